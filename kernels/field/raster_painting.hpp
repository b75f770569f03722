// Painting of grids of heights: where a column of pixels lies is found once, and the numbers around
// the pixels of a row once for all rows between the same numbers.
#pragma once

#include "planes.hpp"

namespace terratool {

// Numbers around each pixel of a row, south-west, south-east, north-west and north-east of it.
struct CornerRows {
    Out z00, z10, z01, z11;
    INLINE Corners operator[](std::size_t n) const { return {z00[n], z10[n], z01[n], z11[n]}; }
    INLINE void put(std::size_t n, const Corners& z) const {
        z00[n] = z.z00, z10[n] = z.z10, z01[n] = z.z01, z11[n] = z.z11;
    }
};

// What grids are painted into: planes of a canvas, and scratch of it for the pixels of a row.
struct RasterCanvas {
    TileOf<double>&heights, &slope_x, &slope_y;
    Span<RasterColumn> columns;
    Out parts;
    CornerRows around;
};

// Add heights and slopes of a grid of heights that fills its block of cells.
NEVER_INLINE inline void add_raster(
    const Field& field, const RasterCanvas& canvas, const Painted& p, const BlockPixels& pixels
) {
    const auto& [u, v, x, y, part] = pixels;
    RasterAt raster(field.curves, p.kind);
    const Raster& r = raster.raster();
    auto cell = [&](int axis, double t, double place) {
        if (!r.voids) return i64(0);
        Block block = block_of(p.element, p.pose, axis);
        return placed_cell(t, raster_cells(r, axis), place, axis_of(p.grid, axis), block);
    };
    std::size_t width = u.size();
    const auto& [heights, slope_x, slope_y, columns, a, around] = canvas;
    for (std::size_t n = 0; n < width; ++n) {
        i64 cell_x = cell(X, u[n], x[n]);
        columns[n] = {raster.along(X, u[n], cell_x), cell_x};
        a[n] = columns[n].at.part;
    }
    Rates rates(p);
    double scale = p.element.scale, offset = p.element.offset;
    i64 low = -1, row_of_cells = -1;
    for (i64 j = 0; j < count_of(v); ++j) {
        i64 line = part.south + j, cell_y = cell(Y, v[j], y[j]);
        Between along = raster.along(Y, v[j], cell_y);
        if (along.low != low || cell_y != row_of_cells) {
            low = along.low, row_of_cells = cell_y;
            for (std::size_t n = 0; n < width; ++n)
                around.put(n, raster.corners(columns[n].at, along, columns[n].cell, cell_y));
        }
        Out row = heights.row(line, part.west, part.east);
        double b = along.part;
        for (std::size_t n = 0; n < width; ++n) row[n] += scale * around[n].value(a[n], b) + offset;
        if (!slope_x.exists()) continue;
        Out east = slope_x.row(line, part.west, part.east);
        Out north = slope_y.row(line, part.west, part.east);
        for (std::size_t n = 0; n < width; ++n) {
            east[n] += rates.x * (around[n].east(b) * columns[n].at.per);
            north[n] += rates.y * (around[n].north(a[n]) * along.per);
        }
    }
}

// Add a grid of heights that fills its block of cells.
template <class Id>
void paint_raster(
    const Field& field, Canvas<Id>& canvas, const Painted& p, const BlockPixels& pixels
) {
    auto scratch = [&](auto& all) { return part_of(all, 0, count_of(pixels.u)); };
    add_raster(
        field,
        {canvas.heights,
         canvas.slope_x,
         canvas.slope_y,
         {canvas.columns.data(), pixels.u.size()},
         scratch(canvas.parts),
         {scratch(canvas.fx), scratch(canvas.work_0), scratch(canvas.work_1),
          scratch(canvas.work_2)}},
        p, pixels
    );
    wear_block(field, canvas, p, pixels);
    if (canvas.labels.exists()) label_block(field, canvas, p, pixels);
}

}  // namespace terratool
