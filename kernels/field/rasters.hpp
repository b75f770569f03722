// How high a grid of heights is at a point of the unit square.
//
// Numbers stand on lines of the square (gridline) or in the middle of pixels (pixel). Between four
// of them the height is bilinear. A cell with a void corner is void in the first case, the pixel
// around a void number in the second; there a void number counts, for what lies beside its pixel,
// as the mean of its neighbours.
#pragma once

#include "primitives.hpp"

namespace terratool {

// Two neighbouring numbers along an axis, and how far between them a place is; `per` is the numbers
// to a side of the square, 0 where the nearest number goes on.
struct Between {
    i64 low, high;
    double part, per;
};

// The numbers at `t`, in [0, 1], of so many along an axis.
INLINE Between between(double t, i64 count, bool pixel) {
    double last = double(count - 1), s = pixel ? t * double(count) - 0.5 : t * last;
    bool goes_on = count == 1 || (pixel && (s < 0.0 || s >= last));
    s = clamp(s, 0.0, last);
    i64 low = min(i64(s), max(count - 2, i64(0)));
    return {
        low, min(low + 1, count - 1), s - double(low),
        goes_on ? 0.0 : (pixel ? double(count) : last)
    };
}

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

// Four neighbouring numbers; between them the height is bilinear, `a` to the east of the south-west
// one and `b` to the north of it.
struct FourNumbers {
    double z00, z10, z01, z11;

    double value(double a, double b) const {
        double south = (1.0 - a) * z00 + a * z10, north = (1.0 - a) * z01 + a * z11;
        return (1.0 - b) * south + b * north;
    }
    // Its slopes in a and in b.
    double east(double b) const { return (1.0 - b) * (z10 - z00) + b * (z11 - z01); }
    double up(double a) const { return (1.0 - a) * (z01 - z00) + a * (z11 - z10); }
};

// A grid of heights.
class RasterAt {
public:
    RasterAt(const Curves& curves, const Kind& kind)
        : raster_(curves.rasters[kind.raster]), heights_(curves.heights) {}

    const Raster& raster() const { return raster_; }

    // Value and slopes at (u, v), in [0, 1], which lies in a cell.
    INLINE ShapePoint at(UV at, i64 cell_x, i64 cell_y) const {
        if (raster_.voids && is_void(cell_x, cell_y)) return {NAN, NAN, NAN};
        return between_numbers(
            between(at.u, raster_.count[X], raster_.pixel),
            between(at.v, raster_.count[Y], raster_.pixel)
        );
    }

    // Value and slopes between numbers, whether or not that is void.
    INLINE ShapePoint between_numbers(Between x, Between y) const {
        FourNumbers p = patch(x.low, y.low);
        double a = x.part, b = y.part;
        return {p.value(a, b), p.east(b) * x.per, p.up(a) * y.per};
    }

    // The same of a turned element, in whose square nothing has an exact place.
    INLINE ShapePoint at(UV at) const {
        double u = clamp(at.u, 0.0, 1.0), v = clamp(at.v, 0.0, 1.0);
        i64 i = cell_at(u + STEP, raster_cells(raster_, X));
        i64 j = cell_at(v + STEP, raster_cells(raster_, Y));
        return this->at({u, v}, i, j);
    }

    // The numbers around what lies to the north-east of one; a void one counts as its neighbours
    // do.
    INLINE FourNumbers patch(i64 i, i64 j) const {
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

private:
    const Raster& raster_;
    In heights_;

    // The number at column `i` from the west and row `j` from the south.
    INLINE double number(i64 i, i64 j) const {
        return heights_[raster_.first + (raster_.count[Y] - 1 - j) * raster_.count[X] + i];
    }
    // The number, or where it is void the mean of its neighbours, from the north-west on.
    INLINE double counting(i64 i, i64 j) const {
        double z = number(i, j);
        return raster_.voids && isnan(z) ? mean_around(i, j) : z;
    }
    double mean_around(i64 i, i64 j) const {
        double sum = 0.0, count = 0.0;
        for (i64 row = min(j + 1, raster_.count[Y] - 1); row >= max(j - 1, i64(0)); --row)
            for (i64 c = max(i - 1, i64(0)); c <= min(i + 1, raster_.count[X] - 1); ++c)
                if (double z = number(c, row); !isnan(z)) sum += z, count += 1.0;
        return sum / count;
    }
};

// Value of an unturned grid, and its slopes in u and v, at (x, y) in the world.
inline ShapePoint placed_raster(
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
