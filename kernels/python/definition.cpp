// What Python sees of kernels/definition.
#include "../definition/curves.hpp"
#include "../definition/decimals.hpp"
#include "../definition/keys.hpp"
#include "../definition/scattering.hpp"
#include "../definition/vectors.hpp"

#include "bind.hpp"
#include "modules.hpp"

namespace terratool::python {

void bind_definition(nb::module_ m) {
    m.attr("MAX_EXPONENT") = MAX_EXPONENT;
    def<&definition::decimal_rests>(
        m, "decimal_rests",
        "What doubles lack to their shortest decimals, which stand in a JSON array of numbers.",
        {"text[_]", "powers[121,2]", "numbers[n]", "rests[n]"}
    );
    def<&definition::survey_keys>(
        m, "survey_keys",
        "Whether a key of a JSON text may stand twice in an object; marks lines that may be keys.",
        {"text[_]", "names[_]", "present[n]"}
    );
    def<&definition::find_vectors>(
        m, "find_vectors",
        "Begin, end and count of each list behind a key x or y that may be numbers alone.",
        {"text[_]", "least"}
    );
    def<&definition::read_vector>(
        m, "read_vector",
        "Read a vector's numbers; whether all are numbers of JSON, not too large, surely rounded.",
        {"text[_]", "powers[121,2]", "most", "numbers[n]"}
    );
    m.attr("TRIES") = definition::TRIES;
    def<&definition::scatter>(
        m, "scatter",
        "Sides, middles and turns of scattered copies; how many were looked at, and tries left.",
        {"asked", "tries", "sides[n]", "x[n]", "y[n]", "turns[n]"}
    );
    def<&definition::share>(
        m, "share", "A number from 0 to below 1 that follows from three.",
        {"seed", "number", "draw"}
    );
    def<&definition::least_side>(
        m, "least_side", "The side of the smallest of so many scattered copies.", {"asked", "count"}
    );
    def<&definition::survey>(
        m, "survey",
        "How well pieces can keep to a formula: how many, how far off, where, and places to check.",
        {"operations[n]", "operands[n]", "limits[7]", "places[_]"}
    );
}

}  // namespace terratool::python
