// Which ruts hold a place on the lattice, by the edges that are drawn, and how deep they are.
#pragma once

#include <tuple>

#include "../field/tracks.hpp"
#include "types.hpp"

namespace terratool::mesh {

// Rows of places from the south on.
struct RowFrame {
    double south, per;
    i64 rows;

    // The row of a place, the first or the last where it lies beyond them.
    INLINE i64 row_of(double y) const {
        return i64(min(max((y - south) * per, 0.0), double(rows) - 1.0));
    }
};

// Visit the rows that each edge passes, a level one none: visit(edge, row).
template <class Visit>
INLINE void visit_rows(Matrix<const i64> edges, const RowFrame& frame, Visit visit) {
    for (i64 e = 0; e < edges.rows(); ++e) {
        i64 y0 = edges(e, 1), y1 = edges(e, 3);
        if (y0 == y1) continue;
        i64 last = frame.row_of(double(max(y0, y1)));
        for (i64 row = frame.row_of(double(min(y0, y1))); row <= last; ++row) visit(e, row);
    }
}

// For each row of places the edges that pass it: where they begin in the entries, and these.
inline std::tuple<std::vector<i64>, std::vector<u32>> index_rows(
    Matrix<const i64> edges, In frame, i64 rows
) {
    RowFrame index{frame[0], frame[1], rows};
    auto visit = [&](auto put) {
        visit_rows(edges, index, [&](i64 e, i64 row) { put(row, u32(e)); });
    };
    std::vector<i64> offsets(rows + 1);
    std::vector<u32> entries(index_bins(Span<i64>(offsets), i64(0), visit));
    fill_bins(Span<i64>(offsets), Span<u32>(entries), visit);
    return {std::move(offsets), std::move(entries)};
}

// The tracks that hold places.
class TracksAt {
public:
    explicit TracksAt(const Plan& plan)
        : outlines_(plan.outlines), tracks_(plan.field->tracks), marks_(tracks_.passes.size()) {}

    // The indices of those that hold a place on the lattice, in any order.
    // A place is inside where a ray to the west passes an odd number of a track's edges.
    const std::vector<i64>& find(double x, double y) {
        constexpr u8 odd = 1, seen = 2;
        found_.clear();
        RowFrame index{outlines_.frame[0], outlines_.frame[1], count_of(outlines_.offsets) - 1};
        if (index.rows < 1) return found_;
        i64 row = index.row_of(y);
        for (i64 k = outlines_.offsets[row]; k < outlines_.offsets[row + 1]; ++k) {
            i64 e = outlines_.entries[k];
            auto edge = outlines_.edges[e];
            double x0 = double(edge[0]), y0 = double(edge[1]);
            double x1 = double(edge[2]), y1 = double(edge[3]);
            if ((y0 <= y) == (y1 <= y)) continue;
            if (min(x0, x1) > x) continue;
            if (max(x0, x1) > x) {
                double across = (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0);
                if ((across > 0.0) == (y1 > y0)) continue;
            }
            u8& mark = marks_[outlines_.owners[e]];
            if (!mark) found_.push_back(outlines_.owners[e]);
            mark = (mark ^ odd) | seen;
        }
        std::erase_if(found_, [&](i64 track) { return !(std::exchange(marks_[track], 0) & odd); });
        return found_;
    }

    // Depth of the rut that the tracks found make together, and which decides the surface.
    // As rut_at of the field; `ground` is the index of the ground's surface, -1 for none.
    Rut rut(i64 ground) const {
        RutOfAll all{tracks_};
        for (i64 track : found_)
            if (!all.add(track, ground)) return {0.0, -1};
        return all.rut();
    }

private:
    const Outlines& outlines_;
    const Tracks& tracks_;
    std::vector<u8> marks_;  // all 0 but while tracks are looked for
    std::vector<i64> found_;
};

}  // namespace terratool::mesh
