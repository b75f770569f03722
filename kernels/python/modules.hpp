// The parts of the module. Those of the field and of traversability are bound in four files and in
// two, which build side by side.
#pragma once

#include <nanobind/nanobind.h>

namespace terratool::python {

void bind_definition(nanobind::module_ m);
void bind_field(nanobind::module_ m);
void bind_importing(nanobind::module_ m);
void bind_mesh(nanobind::module_ m);
void bind_painting(nanobind::module_ m);
void bind_raster(nanobind::module_ m);
void bind_rays(nanobind::module_ m);
void bind_routing(nanobind::module_ m);
void bind_traversability(nanobind::module_ m);
void bind_walls(nanobind::module_ m);

}  // namespace terratool::python
