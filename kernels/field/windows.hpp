// Windows of pixels: painted tile by tile, and given to the planes that are wanted.
#pragma once

#include <variant>

#include "column_painting.hpp"

namespace terratool {

using Floats = std::variant<Matrix<float>, Matrix<double>>;
using Ids = std::variant<Matrix<u8>, Matrix<u16>, Matrix<u32>>;

// What is painted over a window, rows from the north; all but the heights may be empty.
// `columns` has bands of as many rows: see GROUND_BAND and those that follow.
struct Planes {
    Floats heights;
    Ids surfaces;
    Floats slope_x, slope_y;
    Matrix<u32> labels;
    Floats columns;
    Hidden hidden;
};

template <class Visit> void visit_arguments(Planes& p, Visit visit) {
    visit("heights[h,w]", p.heights), visit("?surfaces[h,w]", p.surfaces);
    visit("?slope_x[h,w]", p.slope_x), visit("?slope_y[h,w]", p.slope_y);
    visit("?labels[h,w]", p.labels), visit("?columns[_,w]", p.columns);
    visit("?within[4]", p.hidden.within), visit("?figures[5]", p.hidden.figures);
    visit("?seen[_]", p.hidden.seen);
}

// Copy the columns from `begin` to `end` of a row of a tile; outside there is `nothing`.
template <class From, class To>
void copy_columns(Span<From> own, Span<To> out, i64 begin, i64 end, To nothing) {
    fill(out.first(begin), nothing);
    for (i64 n = begin; n < end; ++n) out[n] = To(own[n]);
    fill(out.subspan(end), nothing);
}

// A window, and the rows and columns of the grid of pixels that it begins at, from the north-west.
struct Window {
    In x, y;  // of pixel centres, ascending
    double resolution;
    i64 row, column;
};

// Put columns over a tile's pixels, the ground alone where there are no storeys, into a window.
// `north` and `west` are row and column in the window of the north-west pixel of the tile.
template <class Id, class T>
void give_columns(
    const ColumnPainting<Id>& painting, Matrix<const T> heights, Matrix<T> columns, Rectangle tile
) {
    i64 height = heights.rows(), bands = columns.rows() / height;
    i64 north = height - tile.north;
    auto band = [&](i64 k, i64 row) { return columns[k * height + row]; };
    for (i64 row = north; row < height - tile.south; ++row) {
        for (i64 k = 0; k < bands; ++k)
            fill(band(k, row).subspan(tile.west, tile.east - tile.west), T(NaN));
        for (i64 c = tile.west; c < tile.east; ++c) {
            T z = heights(row, c);
            band(GROUND_BAND, row)[c] = z, band(COUNT_BAND, row)[c] = T(!isnan(z));
            if (bands > FIRST_BAND) band(FIRST_BAND, row)[c] = z;
        }
    }
    for (const PixelColumn& pixel : painting.pixels) {
        i64 row = height - 1 - tile.south - pixel.row, c = tile.west + pixel.column;
        i64 count = pixel.last - pixel.first;
        const Solid* solids = painting.solids.data() + pixel.first;
        bool grounded = count && solids[0].bottom.z == -INF;
        band(GROUND_BAND, row)[c] = grounded ? T(solids[0].top.z) : T(NaN);
        if (grounded && count > 1)
            band(CLEARANCE_BAND, row)[c] = T(solids[1].bottom.z - solids[0].top.z);
        band(COUNT_BAND, row)[c] = T(count);
        for (i64 k = 0; k < count && FIRST_BAND + 2 * k < bands; ++k) {
            i64 top = FIRST_BAND + 2 * k;
            band(top, row)[c] = T(solids[k].top.z);
            if (k) band(top - 1, row)[c] = T(solids[k].bottom.z);
        }
    }
}

// Paint a window. `voids` says which ids are void; `above` paints storeys, if it is there.
template <class Id>
void paint_window(
    const Field& field, Canvas<Id>& canvas, ColumnPainting<Id>* above, Span<const bool> voids,
    const Window& window, const Planes& planes
) {
    i64 width = count_of(window.x), height = count_of(window.y);
    i64 across = (width + TILE_WIDTH - 1) / TILE_WIDTH;
    i64 along = (height + TILE_HEIGHT - 1) / TILE_HEIGHT;
    if (!across || !along) return;
    i64 wide = (width + across - 1) / across, tall = (height + along - 1) / along;
    bool exact = std::holds_alternative<Matrix<double>>(planes.heights);
    bool kept = planes.hidden.exists()
        || std::visit([](auto one) { return one.size() > 0; }, planes.columns);
    for (i64 line = 0; line < height; line += tall) {
        for (i64 column = 0; column < width; column += wide) {
            In xs = window.x.subspan(column, min(wide, width - column));
            In ys = window.y.subspan(line, min(tall, height - line));
            auto [west, east, _] = inside_bounds(xs, field.bounds[0], field.bounds[2]);
            auto [south, north, __] = inside_bounds(ys, field.bounds[1], field.bounds[3]);
            Rectangle part{west, east, south, north};
            if (!part.is_empty()) {
                bool left = is_shared(field)
                    ? SharedPainting<Id>(field, canvas, xs, ys, window.resolution).paint(part)
                    : paint_tile(field, canvas, xs, ys, window.resolution, part);
                if (left)
                    descend_left(
                        field, canvas, xs, ys, window.row + height - 1 - line,
                        window.column + column, part
                    );
                if (above) above->find(canvas, voids, xs, ys, window.resolution, part, exact, kept);
                if (has_tracks(field)) paint_tracks(field, canvas, xs, ys, part);
                if (has_reliefs(field)) paint_reliefs(field, canvas, xs, ys, part);
                if (above) {
                    above->put(canvas, voids, xs, ys);
                    above->count(planes.hidden, height - 1 - line, column);
                }
            } else if (above) {
                above->clear();
            }
            for (i64 r = 0; r < count_of(ys); ++r) {
                bool painted = !part.is_empty() && part.south <= r && r < part.north;
                i64 begin = painted ? part.west : 0, end = painted ? part.east : 0;
                i64 at = height - 1 - line - r;
                auto give = [&]<class T>(auto& tile, Matrix<T> plane, T nothing) {
                    if (!plane.size()) return;
                    auto out = plane[at].subspan(column, xs.size());
                    copy_columns(tile.row(r, 0, TILE_WIDTH), out, begin, end, nothing);
                };
                auto give_floats = [&](auto& tile, const Floats& plane) {
                    std::visit(
                        [&]<class T>(Matrix<T> one) {
                            give(tile, one, T(NaN));
                            if (!field.voids || !one.size()) return;
                            auto ids = canvas.surfaces.row(r, begin, end);
                            auto out = one[at].subspan(column + begin, ids.size());
                            for (std::size_t n = 0; n < ids.size(); ++n)
                                if (voids[ids[n]]) out[n] = T(NaN);
                        },
                        plane
                    );
                };
                give_floats(canvas.heights, planes.heights);
                give_floats(canvas.slope_x, planes.slope_x);
                give_floats(canvas.slope_y, planes.slope_y);
                give(canvas.labels, planes.labels, u32(0));
                std::visit(
                    [&]<class T>(Matrix<T> one) { give(canvas.surfaces, one, T(0)); },
                    planes.surfaces
                );
            }
            if (!above) continue;
            Rectangle tile{column, column + count_of(xs), line, line + count_of(ys)};
            std::visit(
                [&]<class T>(Matrix<T> heights) {
                    auto* columns = std::get_if<Matrix<T>>(&planes.columns);
                    if (columns && columns->size())
                        give_columns<Id, T>(*above, heights, *columns, tile);
                },
                planes.heights
            );
        }
    }
}

}  // namespace terratool
