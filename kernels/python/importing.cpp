// What Python sees of kernels/importing.
#include "bind.hpp"
#include "modules.hpp"

namespace terratool::python {

void bind_importing(nb::module_) {}

}  // namespace terratool::python
