// What Python sees of kernels/traversability.
#include "bind.hpp"
#include "modules.hpp"

namespace terratool::python {

void bind_traversability(nb::module_) {}

}  // namespace terratool::python
