// How high a grid of heights is at a point of the unit square.
//
// Numbers stand on lines of the square (gridline) or in the middle of pixels (pixel). Between four
// of them the height is bilinear. A cell with a void corner is void in the first case, the pixel
// around a void number in the second; there a void number counts, for what lies beside its pixel,
// as the mean of its neighbours.
#pragma once

#include "primitives.hpp"

namespace terratool {

// The lesser of two neighbouring numbers along an axis, and how far between them a place is; `per`
// is the numbers to a side of the square, 0 where the nearest number goes on.
struct Between {
    i64 low;
    double part, per;
};

// The numbers at `t`, in [0, 1], of so many along an axis.
INLINE Between between(double t, i64 count, bool pixel) {
    double last = double(count - 1), s = pixel ? t * double(count) - 0.5 : t * last;
    bool goes_on = count == 1 || (pixel && (s < 0.0 || s >= last));
    s = clamp(s, 0.0, last);
    i64 low = min(i64(s), max(count - 2, i64(0)));
    return {low, s - double(low), goes_on ? 0.0 : (pixel ? double(count) : last)};
}

// Four numbers, and the height between them at a part of the way east and north.
struct Corners {
    double z00, z10, z01, z11;
    INLINE double value(double a, double b) const {
        return (1.0 - b) * ((1.0 - a) * z00 + a * z10) + b * ((1.0 - a) * z01 + a * z11);
    }
    // Rises over the whole way, to the east and to the north.
    INLINE double east(double b) const { return (1.0 - b) * (z10 - z00) + b * (z11 - z01); }
    INLINE double north(double a) const { return (1.0 - a) * (z01 - z00) + a * (z11 - z10); }
};

// Cells of a grid along an axis: what is void is void by cells.
INLINE i64 raster_cells(const Raster& r, int axis) {
    return r.pixel ? r.count[axis] : max(r.count[axis] - 1, i64(1));
}

// The cell at `t` of so many along an axis.
INLINE i64 cell_at(double t, i64 count) { return clamp(i64(t * double(count)), i64(0), count - 1); }

// The cell at `t` of an unturned element, at `x` in the world, where an edge's double decides.
inline i64 placed_cell(double t, i64 count, double x, const GridAxis& axis, Block block) {
    double n = double(count), k = floor(t * n + 0.5);
    double near = max(axis.near / block.width, EDGE) * n;
    if (abs(t * n - k) > near || k <= 0.0 || k >= n) return cell_at(t, count);
    double edge = k / n, rest = -std::fma(edge, n, -k) / n;
    return i64(k) - !is_past_step(x, axis, block, edge, rest);
}

// Numbers from a column and row to another, both included, from the south-west.
struct NumberBlock {
    i64 west, east, south, north;
};

// Least and greatest of the numbers of a block that are there, and whether some are not.
struct NumberRange {
    double low, high;
    bool voids;
};

// A grid of heights.
class RasterAt {
public:
    RasterAt(const Curves& curves, const Kind& kind)
        : RasterAt(curves, curves.rasters[kind.raster]) {}
    RasterAt(const Curves& curves, const Raster& raster)
        : raster_(raster), numbers_(numbers_of(curves, raster)),
          blocks_(raster.file < 0 ? nullptr : curves.memory->blocks[raster.file].get()) {}

    const Raster& raster() const { return raster_; }
    bool is_in_memory() const { return !blocks_; }

    // The numbers about t along an axis, which lies in a cell; those of another one, which is on
    // the far side of an edge, may be void.
    INLINE Between along(int axis, double t, i64 cell) const {
        Between found = between(t, raster_.count[axis], raster_.pixel);
        if (!raster_.voids || raster_.pixel) return found;
        return {cell, clamp(found.part + double(found.low - cell), 0.0, 1.0), found.per};
    }

    // The four numbers around a place that lies in a cell, NaN in a void one.
    INLINE Corners corners(const Between& x, const Between& y, i64 cell_x, i64 cell_y) const {
        if (raster_.voids && is_void(cell_x, cell_y)) return {NAN, NAN, NAN, NAN};
        return patch(x.low, y.low);
    }

    // Value and slopes at (u, v), in [0, 1], which lies in a cell.
    INLINE ShapePoint at(UV at, i64 cell_x, i64 cell_y) const {
        if (raster_.voids && is_void(cell_x, cell_y)) return {NAN, NAN, NAN};
        return between_numbers(along(X, at.u, cell_x), along(Y, at.v, cell_y));
    }

    // The same where a cell beside it is not void.
    INLINE ShapePoint filled(UV at) const {
        return between_numbers(
            between(at.u, raster_.count[X], raster_.pixel),
            between(at.v, raster_.count[Y], raster_.pixel)
        );
    }

    // Value and slopes between numbers, whether or not that is void.
    INLINE ShapePoint between_numbers(Between x, Between y) const {
        Corners z = patch(x.low, y.low);
        return {z.value(x.part, y.part), z.east(y.part) * x.per, z.north(x.part) * y.per};
    }

    // The same of a turned element, in whose square nothing has an exact place.
    NEVER_INLINE ShapePoint at(UV at) const {
        double u = clamp(at.u, 0.0, 1.0), v = clamp(at.v, 0.0, 1.0);
        i64 i = cell_at(u + STEP, raster_cells(raster_, X));
        i64 j = cell_at(v + STEP, raster_cells(raster_, Y));
        return this->at({u, v}, i, j);
    }

    // The numbers around what lies to the north-east of one; a void one counts as its neighbours
    // do.
    INLINE Corners patch(i64 i, i64 j) const {
        i64 east = min(i + 1, raster_.count[X] - 1), north = min(j + 1, raster_.count[Y] - 1);
        return {counting(i, j), counting(east, j), counting(i, north), counting(east, north)};
    }

    // Whether a cell is void.
    bool is_void(i64 i, i64 j) const {
        if (raster_.pixel) return isnan(number(i, j));
        i64 east = min(i + 1, raster_.count[X] - 1), north = min(j + 1, raster_.count[Y] - 1);
        return isnan(number(i, j)) || isnan(number(east, j)) || isnan(number(i, north))
            || isnan(number(east, north));
    }

    // What the numbers of a block reach. Between them no height is beyond it, void numbers apart.
    NumberRange range(const NumberBlock& block) const {
        NumberRange found{INF, -INF, false};
        for (i64 j = block.south; j <= block.north; ++j)
            for (i64 i = block.west; i <= block.east; ++i) {
                double z = number(i, j);
                found.voids |= isnan(z);
                found.low = min(found.low, isnan(z) ? INF : z);
                found.high = max(found.high, isnan(z) ? -INF : z);
            }
        return found;
    }

    // The number at column `i` from the west and row `j` from the south.
    INLINE double number(i64 i, i64 j) const {
        i64 n = place_of(i, j);
        if (blocks_) blocks_->need(raster_.count[Y] - 1 - j, i, i);
        if (raster_.single) return double(static_cast<const float*>(numbers_)[n]);
        return static_cast<const double*>(numbers_)[n];
    }

    // Where it is among all numbers, row by row from the north.
    INLINE i64 place_of(i64 i, i64 j) const {
        return (raster_.count[Y] - 1 - j) * raster_.count[X] + i;
    }

    // Call visit(all numbers), of float or double, of a grid in memory.
    template <class Visit> INLINE void visit_numbers(Visit visit) const {
        if (raster_.single) visit(static_cast<const float*>(numbers_));
        else visit(static_cast<const double*>(numbers_));
    }

    // Call visit(the numbers from column `first` to `last` of row `j` from the south), of float or
    // double.
    template <class Visit> INLINE void visit_row(i64 j, i64 first, i64 last, Visit visit) const {
        i64 row = raster_.count[Y] - 1 - j, n = row * raster_.count[X] + first;
        if (blocks_) blocks_->need(row, first, last);
        if (raster_.single) visit(static_cast<const float*>(numbers_) + n);
        else visit(static_cast<const double*>(numbers_) + n);
    }

    // The number, or where it is void the mean of its neighbours, from the north-west on.
    INLINE double counting(i64 i, i64 j) const {
        double z = number(i, j);
        return raster_.voids && isnan(z) ? mean_around(i, j) : z;
    }

private:
    const Raster& raster_;
    const void* numbers_;       // float or double, as the raster says
    const GridBlocks* blocks_;  // null where all are in memory

    INLINE static const void* numbers_of(const Curves& curves, const Raster& r) {
        return r.file < 0 ? static_cast<const void*>(curves.heights.data() + r.first)
                          : curves.memory->files[r.file].data();
    }
    NEVER_INLINE double mean_around(i64 i, i64 j) const {
        double sum = 0.0, count = 0.0;
        for (i64 row = min(j + 1, raster_.count[Y] - 1); row >= max(j - 1, i64(0)); --row)
            for (i64 c = max(i - 1, i64(0)); c <= min(i + 1, raster_.count[X] - 1); ++c)
                if (double z = number(c, row); !isnan(z)) sum += z, count += 1.0;
        return sum / count;
    }
};

// Value of an unturned grid, and its slopes in u and v, at (x, y) in the world.
NEVER_INLINE inline ShapePoint placed_raster(
    const Curves& curves, const Kind& kind, const Element& element, const Pose& pose,
    const Grid& grid, UV at, double x, double y
) {
    RasterAt raster(curves, kind);
    const Raster& r = raster.raster();
    if (!r.voids) return raster.at(at, 0, 0);
    auto cell = [&](int axis, double t, double place) {
        Block block = block_of(element, pose, axis);
        return placed_cell(t, raster_cells(r, axis), place, axis_of(grid, axis), block);
    };
    return raster.at(at, cell(X, at.u, x), cell(Y, at.v, y));
}

}  // namespace terratool
