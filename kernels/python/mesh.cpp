// What Python sees of kernels/mesh.
#include "bind.hpp"
#include "modules.hpp"

namespace terratool::python {

void bind_mesh(nb::module_) {}

}  // namespace terratool::python
