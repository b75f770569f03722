// What Python sees of kernels/definition.
#include "../definition/curves.hpp"
#include "../definition/keys.hpp"

#include "bind.hpp"
#include "modules.hpp"

namespace terratool::python {

void bind_definition(nb::module_ m) {
    def<&definition::may_repeat_keys>(
        m, "may_repeat_keys",
        "Whether a key stands twice in an object of a JSON text, or has an escape.", {"text[_]"}
    );
    def<&definition::survey>(
        m, "survey",
        "How well pieces can keep to a formula: how many, how far off, where, and places to check.",
        {"operations[n]", "operands[n]", "limits[7]", "places[_]"}
    );
}

}  // namespace terratool::python
