// What Python sees of kernels/field/columns.hpp.
#include "columns.hpp"

#include "modules.hpp"

namespace terratool::python {

void bind_columns(nb::module_ m) {
    nb::class_<KeptStoreys>(m, "Storeys", "Decks and bores of a field, in sheets.")
        .def(nb::init<nb::handle, nb::handle, nb::handle>(), "sheets"_a, "table"_a, "lattice"_a);
    def<&near_storeys>(
        m, "near_storeys", "Whether storeys may be at points.",
        {"storeys", "x[n]", "y[n]", "out[n]"}
    );
    def<&top_heights>(
        m, "top_heights",
        "Put the highest tops, or those not above some heights, in place of the bare ground.",
        {"storeys", "x[n]", "y[n]", "?below[n]", "height[n]"}
    );
    def<&columns>(
        m, "columns", "Intervals of heights at points, from below.",
        {"storeys", "field", "x[n]", "y[n]", "ground", "first_track", "out"}
    );
}

}  // namespace terratool::python
