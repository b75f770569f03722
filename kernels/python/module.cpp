// The module of all kernels.
#include "modules.hpp"

namespace nb = nanobind;
using namespace terratool::python;

NB_MODULE(_kernels, m) {
    nb::set_leak_warnings(false);  // a terrain may live until the end
    bind_definition(m.def_submodule("definition"));
    nb::module_ field = m.def_submodule("field");
    bind_field(field);
    bind_painting(field);
    bind_walls(field);
    bind_rays(field);
    bind_importing(m.def_submodule("importing"));
    bind_mesh(m.def_submodule("mesh"));
    bind_raster(m.def_submodule("raster"));
    nb::module_ traversability = m.def_submodule("traversability");
    bind_traversability(traversability);
    bind_routing(traversability);
}
