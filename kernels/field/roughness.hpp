// Relief of rough surfaces: bumps on a lattice, computed from the place alone.
//
// Each cell of an even lattice over the world has one bump, whose place in the cell and whose
// height are hashed from the cell; the relief is the sum of those that reach a point. As places are
// uniform and heights have the mean 0, the autocorrelation of all is that of one bump, wherever on
// the lattice and in whichever direction: sparse convolution noise (Lewis, Algorithms for solid
// noise synthesis, SIGGRAPH 1989, 263-270). A bump is a polynomial, so bits are the same
// everywhere.
#pragma once

#include "types.hpp"

namespace terratool {

// A bump reaches so far from its middle, in cells: (2.25 - d²)³ high at the distance d.
constexpr double BUMP_REACH = 1.5, BUMP_SQUARE = 2.25;
// So many cells along an axis may have a bump that reaches a point.
constexpr int BUMP_CELLS = 4;
// Beyond so many cells from the origin doubles tell no places in a cell apart; there is no relief.
constexpr double FARTHEST_CELL = 1125899906842624.0;  // 2^50

// No relief is higher, steeper or more bent than so many times its scale, in cells: the bumps of
// all cells at the worst places for a point. Bounds for all points, found box by box.
constexpr double HIGHEST_RELIEF = 65.0, STEEPEST_RELIEF = 130.0, MOST_BENT_RELIEF = 364.0;

struct Bump {
    double x, y, height;  // its place in its cell, and its height from -1 to 1
};

// The key of a row of cells.
INLINE u64 row_key(const Relief& relief, double row) { return hash64(relief.key ^ u64(i64(row))); }

INLINE Bump bump_in(u64 row, double column) {
    constexpr double fine = 0x1p-21, finer = 0x1p-22;
    u64 bits = hash64(row ^ u64(i64(column)));
    i64 x = i64(bits >> 43), y = i64((bits >> 22) & 0x1FFFFF), height = i64(bits & 0x3FFFFF);
    return {double(x) * fine, double(y) * fine, double(2 * height + 1) * finer - 1.0};
}

struct ReliefPoint {
    double z, slope_x, slope_y;
};

// Height and slopes of a relief whose sums over the bumps are given.
INLINE ReliefPoint scaled(const Relief& relief, double z, double along, double across) {
    double slope = -6.0 * relief.scale * relief.per;
    return {relief.scale * z, slope * along, slope * across};
}

// Whether a relief has bumps at a place, in cells.
INLINE bool is_rough(const Relief& relief, double s, double t) {
    return relief.scale != 0.0 && abs(s) < FARTHEST_CELL && abs(t) < FARTHEST_CELL;
}

// Height and gradient of a relief at a point; cells are summed from the south-west, row by row.
template <bool sloped> INLINE ReliefPoint relief_at(const Relief& relief, double x, double y) {
    double s = x * relief.per, t = y * relief.per;
    if (!is_rough(relief, s, t)) return {0.0, 0.0, 0.0};
    double west = quick_floor(s - BUMP_REACH), south = quick_floor(t - BUMP_REACH);
    double z = 0.0, along = 0.0, across = 0.0;
    for (int j = 0; j < BUMP_CELLS; ++j) {
        double row = south + double(j), v = t - row;
        u64 key = row_key(relief, row);
        for (int i = 0; i < BUMP_CELLS; ++i) {
            double column = west + double(i);
            Bump bump = bump_in(key, column);
            double dx = (s - column) - bump.x, dy = v - bump.y;
            double rest = max(BUMP_SQUARE - (dx * dx + dy * dy), 0.0);
            double part = bump.height * (rest * rest);
            z += part * rest;
            if constexpr (sloped) along += part * dx, across += part * dy;
        }
    }
    return scaled(relief, z, along, across);
}

INLINE bool has_reliefs(const Field& field) { return !field.reliefs.empty(); }

// The relief of a surface by its index, -1 for none; only where has_reliefs.
INLINE const Relief& relief_of(const Field& field, i64 surface) {
    return field.reliefs[surface + 1];
}

}  // namespace terratool
