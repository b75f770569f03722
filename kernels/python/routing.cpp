// What Python sees of routes in kernels/traversability.
#include "../traversability/pulling.hpp"
#include "bind.hpp"
#include "modules.hpp"

namespace terratool::python {

using namespace traversability;

namespace {

// Twins that lead round: each cell is the twin of one.
void check_twins(Matrix<const i64> twins, IndexCheck check_index) {
    std::vector<bool> met(std::size_t(twins.size()), false);
    for (i64 twin : twins.flat()) {
        check_index(0 <= twin && twin < twins.size() && !met[twin], "a twin");
        met[twin] = true;
    }
}

// Costs whose moves and tiles go with their cells.
void check_costs(const Costs& costs, IndexCheck check_index) {
    const Moves& moves = costs.moves;
    check_index(moves.headings() == costs.rate.layers(), "the number of moves");
    for (i64 n : moves.steps) check_index(0 <= n && n <= moves.passed.rows(), "a step");
    check_index(!moves.bends() || moves.arcs.rows() == 2 * moves.headings(), "the number of arcs");
    for (i64 n : moves.counts) check_index(0 < n && n <= moves.within.rows(), "cells of an arc");
    check_index(costs.tile > 0, "the side of tiles");
    check_index(costs.pitch > 0, "the pitch");
    check_twins(costs.twins, check_index);
    check_index(costs.tile * costs.known.rows() >= costs.rate.rows(), "a row of tiles");
    check_index(costs.tile * costs.known.columns() >= costs.rate.columns(), "tiles");
}

// A search over costs, whose arrays are kept; between two calls more of them may become known.
class KeptSearch {
public:
    KeptSearch(nb::handle costs, nb::handle starts, i64 row, i64 column)
        : costs_(costs, where("costs")), starts_(starts, where("starts[n]")),
          search((check(row, column), costs_.get()), starts_.get(), row, column) {}

private:
    Sizes sizes_;
    Bundled<Costs> costs_;
    Argument<Span<const i64>> starts_;

    Where where(const char* name) { return {"Search", name, sizes_}; }

    void check(i64 row, i64 column) {
        constexpr IndexCheck check_index{"Search"};
        const Costs& costs = costs_.get();
        check_costs(costs, check_index);
        check_index(0 <= row && row < costs.rate.rows(), "the row of the goal");
        check_index(0 <= column && column < costs.rate.columns(), "the column of the goal");
        for (i64 state : starts_.get())
            check_index(0 <= state && state < costs.rate.size(), "a start");
    }

public:
    Search search;
};

// The states of a way are those of the costs.
Rows<i64, 4> pull_way(
    const Costs& costs, Matrix<const i64> states, i64 rounds, bool both, i64 near
) {
    constexpr IndexCheck check_index{"pull"};
    check_costs(costs, check_index);
    std::array<i64, 3> sizes{costs.rate.layers(), costs.rate.rows(), costs.rate.columns()};
    for (i64 n = 0; n < states.rows(); ++n)
        for (std::size_t k = 0; k < 3; ++k)
            check_index(0 <= states[n][k] && states[n][k] < sizes[k], "a state");
    return pull(costs, states, rounds, both, near);
}

Rows<double, 7> pull_bent_way(
    const Costs& costs, Matrix<const double> corners, double radius, i64 rounds, bool both, i64 near
) {
    constexpr IndexCheck check_index{"pull_bends"};
    check_costs(costs, check_index);
    for (i64 n = 0; n < corners.rows(); ++n) {
        auto row = corners[n][0], column = corners[n][1];
        check_index(0.0 <= row && row < double(costs.rate.rows()), "a row");
        check_index(0.0 <= column && column < double(costs.rate.columns()), "a column");
    }
    check_index(radius > 0.0, "the radius");
    return pull_bends(costs, corners, radius, rounds, both, near);
}

i64 flood_cells(
    const Moves& moves, i64 direction, const Drivable& can, const FloodPlaces& places,
    const Marked& fresh, const Marked& reached, i64 states
) {
    check_twins(places.twins, IndexCheck{"flood"});
    return flood(moves, direction, can, places, fresh, reached, states);
}

i64 find_parts_of(
    const Moves& moves, const Drivable& can, const FloodPlaces& places, const Marked& fresh,
    const Marked& reached, Matrix<i64> parts, i64 states
) {
    check_twins(places.twins, IndexCheck{"find_parts"});
    return find_parts(moves, can, places, fresh, reached, parts, states);
}

}  // namespace

template <> struct Argument<Search> : KnownArgument<KeptSearch> {
    using KnownArgument::KnownArgument;
    Search& get() { return kept->search; }
};

void bind_routing(nb::module_ m) {
    nb::class_<KeptSearch> search(m, "Search", "A search for the cheapest way to a cell.");
    search.def(
        nb::init<nb::handle, nb::handle, i64, i64>(), "costs"_a, "starts"_a, "row"_a, "column"_a
    );

    visit_enumerators(Direction{}, [&](const char* name, Direction d) { m.attr(name) = int(d); });
    def<&Search::advance>(
        m, "advance", "Search on; the index of a tile that must be known for that, or -1.",
        {"search"}
    );
    def<&Search::cost>(m, "cost", "What the way costs; infinity where there is none.", {"search"});
    def<&Search::way>(m, "way", "The states of the way, the goal first.", {"search"});
    def<&Search::mark>(m, "mark", "Mark the cells that were reached.", {"search", "out[_,_]"});
    def<&pull_way>(
        m, "pull", "Corners of a way pulled straight: row, column, sign of the leg, side of turn.",
        {"costs", "states[n,3]", "rounds", "both", "near"}
    );
    def<&pull_bent_way>(
        m, "pull_bends",
        "Corners of a way with arcs pulled straight: row, column, sign of the leg, and the arc's "
        "begin and end on the legs, its radius, and whether it is the search's.",
        {"costs", "corners[n,7]", "radius", "rounds", "both", "near"}
    );
    def<&flood_cells>(
        m, "flood", "Spread over what can be driven; over how many states, fewer once all is done.",
        {"moves", "direction", "can[h,w]", "places", "fresh[h,w]", "reached[h,w]", "states"}
    );
    def<&find_parts_of>(
        m, "find_parts",
        "Find the largest part that can be driven both ways; over how many states this went.",
        {"moves", "can[h,w]", "places", "fresh[h,w]", "reached[h,w]", "parts[2,3]", "states"}
    );
}

}  // namespace terratool::python
