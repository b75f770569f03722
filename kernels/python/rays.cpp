// What Python sees of kernels/field/rays.hpp.
#include "../field/rays.hpp"

#include "modules.hpp"
#include "rays.hpp"

namespace terratool::python {

void bind_rays(nb::module_ m) {
    nb::class_<KeptIndex>(m, "RayIndex", "Bounds of heights over quarters of the plan, for rays.")
        .def(nb::init<nb::handle, nb::handle>(), "field"_a, "cells"_a)
        .def_prop_ro("nbytes", &KeptIndex::nbytes)
        .def_prop_ro("nodes", &KeptIndex::nodes);
    def<&rays::cast>(
        m, "cast", "What rays meet first; the first that is no ray, or -1.",
        {"index", "rays", "hits"}
    );
}

}  // namespace terratool::python
