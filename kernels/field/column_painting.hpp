// Pixels under which there may be storeys: each gets the column that a query finds at its centre.
//
// The ground of a tile is painted first, as if there were no storeys, and is right wherever no bit
// of the lattice is set.
#pragma once

#include "columns.hpp"
#include "painting.hpp"

namespace terratool {

// What of the columns of a window only the highest top is shown of.
struct Hidden {
    Span<const i64> within;  // rows and columns that count: first and last one, exclusive, of each
    Out figures;             // pixels with two tops or more, the most tops, the least gap between
                             // two, and its row and column
    Span<u8> seen;           // whether a top of each storey is the highest at a pixel

    bool exists() const { return !figures.empty(); }

    void count(i64 row, i64 column, Span<const Solid> solids) const {
        bool counts =
            within[0] <= row && row < within[1] && within[2] <= column && column < within[3];
        if (!counts || solids.empty()) return;
        if (i32 storey = solids.back().top.storey; storey >= 0) seen[storey] = 1;
        figures[1] = max(figures[1], double(solids.size()));
        if (solids.size() < 2) return;
        figures[0] += 1.0;
        double gap = INF;
        for (std::size_t k = 1; k < solids.size(); ++k)
            gap = min(gap, solids[k].bottom.z - solids[k - 1].top.z);
        double r = double(row), c = double(column);
        bool earlier = r < figures[3] || (r == figures[3] && c < figures[4]);
        if (gap < figures[2] || (gap == figures[2] && earlier))
            figures[2] = gap, figures[3] = r, figures[4] = c;
    }
};

// Bands of columns: ground, clearance over it, number of tops, then top, bottom, top, bottom …
constexpr i64 GROUND_BAND = 0, CLEARANCE_BAND = 1, COUNT_BAND = 2, FIRST_BAND = 3;

// Labels of the tops of storeys, as `label_block` makes those of the ground.
class TopLabels {
public:
    explicit TopLabels(const Storeys& storeys)
        : storeys_(storeys), edges_(most_kinds(storeys), 1),
          canvas_(*storeys.sheets[0].tops, false, true, edges_) {
        sheets_.resize(storeys.table.gaps.size());
        i64 most = 1;
        for (std::size_t k = 0; k < storeys.sheets.size(); ++k) {
            most = max(most, storeys.sheets[k].tops->pending);
            for (i32 storey : storeys.sheets[k].storeys)
                if (storey >= 0) sheets_[storey] = i64(k);
        }
        canvas_.stack.resize(most);
    }

    u32 of(i32 storey, double x, double y, double resolution) {
        constexpr u64 storey_key = u64(3) << 61;
        In xs(&x, 1), ys(&y, 1);
        const Field& tops = *storeys_.sheets[sheets_[storey]].tops;
        paint_tile(tops, canvas_, xs, ys, resolution, {0, 1, 0, 1});
        return canvas_.labels(0, 0) + hash32(storey_key + u64(storey));
    }

private:
    const Storeys& storeys_;
    std::vector<u8> edges_;  // each may be a wall
    Canvas<u32> canvas_;
    std::vector<i64> sheets_;  // of each storey

    static std::size_t most_kinds(const Storeys& storeys) {
        std::size_t most = 0;
        for (const Sheet& sheet : storeys.sheets) most = max(most, sheet.tops->kinds.size());
        return most;
    }
};

// A pixel under which there may be storeys, and its column among those of a tile.
struct PixelColumn {
    i64 row, column;  // of the tile, rows from the south
    i64 first, last;  // of its solids
};

// Paints what is above the ground of a tile; each thread needs its own.
template <class Id> class ColumnPainting {
public:
    // All pixels of the tile that was painted last under which there may be storeys.
    std::vector<PixelColumn> pixels;
    std::vector<Solid> solids;

    ColumnPainting(const Field& field, const Storeys& storeys, bool labelled)
        : field_(field), storeys_(storeys), maker_(storeys) {
        if (labelled) labels_ = std::make_unique<TopLabels>(storeys);
    }

    // Put the highest tops into a painted part of a tile.
    void paint(Canvas<Id>& canvas, In x, In y, double resolution, const Rectangle& part) {
        pixels.clear(), solids.clear();
        if (part.is_empty()) return;
        find_runs(x, part);
        i64 row = -1;
        for (i64 r = part.south; r < part.north; ++r) {
            i64 j = storeys_.row_near(y[r]);
            if (j < 0) continue;
            if (j != row) list_near(row = j);
            for (const Near& near : near_)
                for (i64 c = near.begin; c < near.end; ++c)
                    paint_pixel(canvas, x[c], y[r], resolution, r, c, near.bits);
        }
    }

    // Count what is hidden in the tile, whose south-west pixel has this row and column.
    void count(const Hidden& hidden, i64 row, i64 column) const {
        if (!hidden.exists()) return;
        for (const PixelColumn& pixel : pixels) {
            Span<const Solid> own{
                solids.data() + pixel.first, std::size_t(pixel.last - pixel.first)
            };
            hidden.count(row - pixel.row, column + pixel.column, own);
        }
    }

    // The bits of the sheets that may have a storey at a point.
    INLINE u64 near(double x, double y) const { return storeys_.near(x, y); }

    // The column at a point within the bounds.
    const std::vector<Solid>& column_at(Canvas<Id>& canvas, double x, double y, u64 near) {
        Found found = find_elements(field_, x, y, canvas);
        Worn worn = worn_of(field_, found);
        double z = worn.is_void ? NaN : found.z;
        maker_.column.begin({z, found.top, i32(worn.surface), -1, found.slope_x, found.slope_y});
        maker_.template put_storeys<true>(x, y, near);
        maker_.template settle<true>(field_, x, y, 0);
        return maker_.column.solids;
    }

    // The label of a top at a point; the ground has that which was painted.
    u32 label_of(const Face& top, u32 painted, double x, double y, double resolution) {
        if (top.storey < 0) return painted;
        u32 tracked = has_tracks(field_) ? hash32(std::bit_cast<u64>(top.z)) : 0;
        return labels_->of(top.storey, x, y, resolution) + tracked;
    }

private:
    struct Run {
        i64 begin, column;  // first column of the tile, and its column of the lattice
    };
    struct Near {
        i64 begin, end;
        u64 bits;
    };
    const Field& field_;
    const Storeys& storeys_;
    ColumnMaker maker_;
    std::unique_ptr<TopLabels> labels_;
    std::vector<Run> runs_;
    std::vector<Near> near_;  // runs of columns of the tile with bits, in a row of the lattice

    void find_runs(In x, const Rectangle& part) {
        runs_.clear();
        i64 last = -2;
        for (i64 c = part.west; c < part.east; ++c) {
            i64 column = storeys_.column_near(x[c]);
            if (column != last) runs_.push_back({c, last = column});
        }
        runs_.push_back({part.east, -1});
    }

    void list_near(i64 row) {
        near_.clear();
        for (std::size_t k = 0; k + 1 < runs_.size(); ++k) {
            i64 column = runs_[k].column;
            u64 bits = column < 0 ? 0 : storeys_.lattice.cells(row, column);
            if (bits) near_.push_back({runs_[k].begin, runs_[k + 1].begin, bits});
        }
    }

    void paint_pixel(
        Canvas<Id>& canvas, double x, double y, double resolution, i64 r, i64 c, u64 near
    ) {
        const auto& own = column_at(canvas, x, y, near);
        bool some = !own.empty();
        const Face top = some ? own.back().top : Face{NaN, 0, -1, -1, NaN, NaN};
        canvas.heights(r, c) = top.z;
        if (some) canvas.surfaces(r, c) = Id(top.surface + 1);
        if (canvas.slope_x.exists())
            canvas.slope_x(r, c) = top.slope_x, canvas.slope_y(r, c) = top.slope_y;
        if (canvas.labels.exists())
            canvas.labels(r, c) = label_of(top, canvas.labels(r, c), x, y, resolution);
        i64 first = count_of(solids);
        solids.insert(solids.end(), own.begin(), own.end());
        pixels.push_back({r, c, first, count_of(solids)});
    }
};

}  // namespace terratool
