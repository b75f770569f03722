// A tile of pixels that stays in the cache, and three planes of it: surfaces, slopes and region
// labels.
#pragma once

#include "rows.hpp"
#include "sharing.hpp"

namespace terratool {

// The most pixels of a tile: a little over 1024 and 128, for windows with margins.
// Heights and surfaces of a tile take 1.2 MB, slopes 2.2 MB, labels 0.5 MB, tracks 3.8 MB.
constexpr i64 TILE_WIDTH = 1040, TILE_HEIGHT = 132;

struct Rectangle {  // columns and rows of a tile; rows run from the south
    i64 west, east, south, north;
    bool is_empty() const { return west >= east || south >= north; }
};

// Pixels of a block of cells: positions in it, in the world, and columns and rows of the tile.
struct BlockPixels {
    In u, v, x, y;
    Rectangle part;
};

struct GridPart {  // a grid that waits with the pixels over it
    i64 grid;
    Rectangle part;
};

struct FramePart {  // the same of a shared field
    Frame frame;
    Rectangle part;
};

struct BinRun {  // columns or rows from `begin` on that lie in the same bin
    i64 begin, bin;
};

// Where a column of pixels lies in a grid of heights.
struct RasterColumn {
    Between at;
    i64 cell;
};

// Numbers of a tile's pixels; none where they are not wanted.
template <class T> class TileOf {
public:
    explicit TileOf(bool wanted) : values_(wanted ? TILE_WIDTH * TILE_HEIGHT : 0) {}
    i64 nbytes() const { return i64(sizeof(T)) * count_of(values_); }
    INLINE bool exists() const { return !values_.empty(); }
    INLINE T& operator()(i64 row, i64 column) { return values_[row * TILE_WIDTH + column]; }
    // Columns `begin` to `end` of a row.
    INLINE Span<T> row(i64 row, i64 begin, i64 end) {
        return {values_.data() + row * TILE_WIDTH + begin, std::size_t(end - begin)};
    }
    void fill(const Rectangle& part, T value) {
        for (i64 r = part.south; r < part.north; ++r) {
            auto cells = row(r, part.west, part.east);
            std::fill(cells.begin(), cells.end(), value);
        }
    }

private:
    std::vector<T> values_;
};

// What tracks leave on a pixel.
struct TrackedPixel {
    double first, passes;  // depth of the deepest first pass, and all passes
    u32 deepest,
        surface_track;  // the track with that pass; the last with a surface and one, 0 for none
};

// A tile, and what is needed to paint it. Surfaces are their indices and one, 0 for none; where it
// is `numbered`, they are the top elements and one instead.
template <class Id> struct Canvas {
    bool numbered = false;
    TileOf<double> heights{true};
    TileOf<Id> surfaces{true};
    TileOf<double> slope_x, slope_y;
    TileOf<u32> labels;  // of regions
    TileOf<u32> stamps;  // the last track over a pixel and one, 0 for none
    TileOf<TrackedPixel> tracked;
    std::vector<u64> near_segments;  // a bit for each, all 0 but while they are looked for
    Span<const u8> nonzero_edges;    // by kinds: whether a footprint's edge may be a wall
    std::vector<GridPart> queue;
    std::vector<u32> found;  // free elements, while a grid of them is painted
    Stack stack;
    // of shared fields: the frames of a level and of the next, copies of one element along x and
    // y, and what waits in a descent
    std::vector<FramePart> frames, frames_below;
    std::vector<i64> copies_x, copies_y;
    SharedStack shared_stack;
    // by column and by row: cells of a grid and positions in them, positions in a block of cells,
    // values of curves, and scratch
    std::array<double, TILE_WIDTH> cell_x, in_x, u, fx, work_0, work_1, work_2;
    // of a grid of heights: how far between two of its numbers columns are, and all of that
    std::array<double, TILE_WIDTH> parts;
    std::array<RasterColumn, TILE_WIDTH> columns;
    std::array<double, TILE_HEIGHT> cell_y, in_y, v, fy;
    std::array<u32, TILE_WIDTH> marks;  // what an element adds to the labels
    std::array<BinRun, TILE_WIDTH + 1> runs_x;
    std::array<BinRun, TILE_HEIGHT + 1> runs_y;

    Canvas(const Field& field, bool slopes, bool labelled, Span<const u8> nonzero)
        : slope_x(slopes), slope_y(slopes), labels(labelled), stamps(has_tracks(field)),
          tracked(has_tracks(field)), near_segments(field.tracks.segments.size() / 64 + 1),
          nonzero_edges(nonzero), stack(field.pending) {}

    i64 nbytes() const {
        return i64(sizeof(*this)) + heights.nbytes() + surfaces.nbytes() + slope_x.nbytes()
            + slope_y.nbytes() + labels.nbytes() + stamps.nbytes() + tracked.nbytes()
            + i64(sizeof(GridPart)) * i64(queue.capacity())
            + i64(sizeof(FramePart)) * i64(frames.capacity() + frames_below.capacity());
    }
};

template <std::size_t n> INLINE Out part_of(std::array<double, n>& all, i64 begin, i64 end) {
    return {all.data() + begin, std::size_t(end - begin)};
}

// Surfaces, as the descent finds them

// Surfaces of an unturned element with classes over its block of cells.
template <class Id>
NEVER_INLINE void wear_classes(
    const Field& field, Canvas<Id>& canvas, const Painted& p, const BlockPixels& pixels
) {
    const auto& [u, v, x, y, part] = pixels;
    ClassesAt classes(field, p.kind);
    auto pixel = [&](int axis, double t, double place) {
        return exact_pixel(classes, p.element, p.pose, p.grid, axis, t, place);
    };
    for (std::size_t n = 0; n < u.size(); ++n) canvas.columns[n].cell = pixel(X, u[n], x[n]);
    i64 before = -1;
    for (i64 line = part.south; line < part.north; ++line) {
        i64 j = pixel(Y, v[line - part.south], y[line - part.south]);
        auto row = canvas.surfaces.row(line, part.west, part.east);
        if (j == before) {
            std::ranges::copy(canvas.surfaces.row(line - 1, part.west, part.east), row.begin());
            continue;
        }
        before = j;
        for (std::size_t n = 0; n < row.size(); ++n)
            row[n] = Id(classes.at(canvas.columns[n].cell, j).surface + 1);
    }
}

// What an element without classes leaves on its pixels.
template <class Id> INLINE Id worn_id(const Canvas<Id>& canvas, const Painted& p) {
    return Id((canvas.numbered ? p.index : i64(p.kind.surface)) + 1);
}

// Surfaces of an unturned element that fills its block of cells.
template <class Id>
INLINE void wear_block(
    const Field& field, Canvas<Id>& canvas, const Painted& p, const BlockPixels& pixels
) {
    if (has_classes(p.kind) && !canvas.numbered) return wear_classes(field, canvas, p, pixels);
    const Rectangle& part = pixels.part;
    Id id = worn_id(canvas, p);
    for (i64 line = part.south; line < part.north; ++line)
        fill(canvas.surfaces.row(line, part.west, part.east), id);
}

// Surfaces of a turned or radial element along a run of pixels that it holds.
template <class Id>
INLINE void wear_run(
    const Field& field, Canvas<Id>& canvas, const Painted& p, In u, double v, i64 line, i64 column
) {
    auto row = canvas.surfaces.row(line, column, column + count_of(u));
    if (!has_classes(p.kind) || canvas.numbered) return fill(row, worn_id(canvas, p));
    ClassesAt classes(field, p.kind);
    for (std::size_t n = 0; n < u.size(); ++n) {
        UV at = p.pose.turned ? turned(p.pose, u[n], v) : UV{u[n], v};
        Worn worn = classes.at(classes.cell(X, at.u, STEP), classes.cell(Y, at.v, STEP));
        row[n] = Id(worn.surface + 1);
    }
}

// Slopes: dz/dx and dz/dy of each element, added as its heights are
//
// On every edge, kink and step they are those of the side that the descent takes: positions come
// from the same operations, curves from the same functions.

// Values and slopes of a curve of an unturned element at each `t`, at `x` in the world.
inline void placed_slopes(
    const Curves& curves, const Painted& p, int axis, In t, In x, Out values, Out slopes
) {
    CurveAt at = curve_of(p.kind, axis);
    GridAxis edges = axis_of(p.grid, axis);
    Block block = block_of(p.element, p.pose, axis);
    bool leaves = p.grid.leaves;
    for (std::size_t n = 0; n < t.size(); ++n) {
        CurvePoint f;
        if (at.knotted == STEPPED) {
            f = placed_curve(curves, at, t[n], x[n], edges, block);
        } else if (at.knotted) {
            f = knotted_curve(curves, at, t[n]);
        } else {
            // in a grid of leaves the descent turns all elements, these by nothing, which rounds
            f = even_curve(curves, at, leaves ? 0.5 + (t[n] - 0.5) : t[n]);
        }
        values[n] = f.value, slopes[n] = f.slope;
    }
}

// Rows of the first element: slopes of a product, in which the other curve is in the factors.
inline void lay_product_slopes(
    Out east, Out north, In fx, In fx_slope, double east_factor, double north_factor
) {
    for (std::size_t n = 0; n < east.size(); ++n) {
        east[n] = fx_slope[n] * east_factor;
        north[n] = fx[n] * north_factor;
    }
}

// Add the slopes of a product along a row.
inline void add_product_slopes(
    Out east, Out north, In fx, In fx_slope, double east_factor, double north_factor
) {
    for (std::size_t n = 0; n < east.size(); ++n) {
        east[n] += fx_slope[n] * east_factor;
        north[n] += fx[n] * north_factor;
    }
}

// Add the slopes of the lesser or the greater of two curves, `amount` where it is `fy`.
inline void add_chosen_slopes(
    bool lesser, Out east, Out north, In fx, In fx_slope, double fy, double factor, double amount
) {
    for (std::size_t n = 0; n < east.size(); ++n) {
        bool chosen = (fx[n] <= fy) == lesser;
        double slope = fx_slope[n] * factor;
        east[n] += chosen ? slope : 0.0;
        north[n] += chosen ? 0.0 : amount;
    }
}

// How an element's slopes in u and v become slopes in the world.
struct Rates {
    double x, y;
    explicit Rates(const Painted& p)
        : x(p.element.scale * (p.grid.per[X] / p.pose.size[X])),
          y(p.element.scale * (p.grid.per[Y] / p.pose.size[Y])) {}
};

// Add, or lay as the first, the slopes of an unturned element that fills its block of cells.
template <class Id>
void slope_block(
    const Field& field, Canvas<Id>& canvas, const Painted& p, const BlockPixels& pixels, bool lay
) {
    const auto& [u, v, x, y, part] = pixels;
    const Kind& kind = p.kind;
    Out fx = part_of(canvas.fx, 0, count_of(u)), fx_slope = part_of(canvas.work_0, 0, count_of(u));
    Out fy = part_of(canvas.fy, 0, count_of(v)), fy_slope = part_of(canvas.work_1, 0, count_of(v));
    placed_slopes(field.curves, p, X, u, x, fx, fx_slope);
    placed_slopes(field.curves, p, Y, v, y, fy, fy_slope);
    Rates rates(p);
    for (i64 j = 0; j < count_of(v); ++j) {
        Out east = canvas.slope_x.row(part.south + j, part.west, part.east);
        Out north = canvas.slope_y.row(part.south + j, part.west, part.east);
        double by_fy = rates.x * fy[j], by_slope = rates.y * fy_slope[j];
        if (lay) lay_product_slopes(east, north, fx, fx_slope, by_fy, by_slope);
        else if (kind.combine == PRODUCT)
            add_product_slopes(east, north, fx, fx_slope, by_fy, by_slope);
        else if (kind.combine == SUM) {
            add_products(east, fx_slope, rates.x, 0.0);
            add_constant(north, by_slope);
        } else {
            add_chosen_slopes(
                kind.combine == MIN, east, north, fx, fx_slope, fy[j], rates.x, by_slope
            );
        }
    }
}

// Add the slopes of a turned or radial element to a run of pixels that it holds.
template <class Id>
void slope_run(
    const Field& field, Canvas<Id>& canvas, const Painted& p, In u, double v, i64 row, i64 column
) {
    const auto& [index, element, kind, pose, grid] = p;
    const Curves& curves = field.curves;
    Out east = canvas.slope_x.row(row, column, column + count_of(u));
    Out north = canvas.slope_y.row(row, column, column + count_of(u));
    Rates rates(p);
    for (std::size_t n = 0; n < u.size(); ++n) {
        double du, dv;
        if (kind.special) {
            UV at = pose.turned ? turned(pose, u[n], v) : UV{u[n], v};
            // the place in the world decides about unturned elements only
            auto shape = special_shape(curves, kind, element, pose, grid, at, 0.0, 0.0).shape;
            du = shape.du, dv = shape.dv;
        } else {
            UV at = turned(pose, u[n], v);
            CurvePoint fx = even_curve(curves.pieces, kind, X, at.u);
            CurvePoint fy = even_curve(curves.pieces, kind, Y, at.v);
            du = fx.slope * fy.value, dv = fx.value * fy.slope;
        }
        auto [slope_u, slope_v] = turned_slopes(pose, du, dv);
        east[n] += rates.x * slope_u;
        north[n] += rates.y * slope_v;
    }
}

// Region labels: numbers of pixels that differ wherever a wall may stand between two neighbours
//
// Each element whose edges may be walls adds a number of its own to the labels of its pixels; each
// with vertical steps one for the piece of the curve that a pixel lies in. So two neighbours of one
// label lie on the same side of every such edge and step, but for sums that happen to be equal: one
// in 2³² where an edge and another change within one pixel. Sums wrap around.

// What tells numbers apart that are drawn for different things.
constexpr u64 ALONG = u64(1) << 62, ACROSS = u64(1) << 63, LEFT_TO_DESCENT = u64(3) << 62,
              CLASSED = u64(1) << 61;

// The same in 32 bits, and never 0.
INLINE u32 hash32(u64 key) { return u32(hash64(key)) | 1; }

// In the place of a truth value: the edge may be a wall even where the element adds no height.
constexpr u8 WHATEVER_SCALE = 2;

// What an element adds to all of its pixels: 0 where none of its edges can be a wall.
INLINE u32 mark_of(const Painted& p, Span<const u8> nonzero) {
    const auto& [index, element, kind, pose, grid] = p;
    // trimmed by its cell a turned element ends anywhere; whole is what has no cell to trim it,
    // what a half turn leaves, or a quarter or a disc in a square
    bool squared = abs(pose.sin_u) == abs(pose.sin_v);
    bool whole = !pose.turned || pose.free || abs(pose.cos) == 1.0
        || (squared && (pose.cos == 0.0 || kind.combine == RADIAL));
    bool shaped = element.scale != 0.0 && (nonzero[element.kind] || !whole);
    bool rough = nonzero[element.kind] == WHATEVER_SCALE;
    return shaped || rough || element.offset != 0.0 ? hash32(u64(index)) : 0;
}

// Whether a curve of the kind has vertical steps.
INLINE bool has_steps(const Kind& kind) {
    return kind.knotted[X] == STEPPED || (kind.knotted[Y] == STEPPED && kind.combine != RADIAL);
}

// What an element adds where a curve is in a piece.
INLINE u32 mark_of_piece(i64 index, u64 along, i64 piece) {
    return hash32((u64(index) << 20) + u64(piece) + along);
}

// Add what tells the classes of an element apart, whose surfaces were painted, where a wall may
// stand between these.
template <class Id>
INLINE void label_classes(Canvas<Id>& canvas, const Painted& p, i64 line, i64 begin, i64 end) {
    if (!has_classes(p.kind) || canvas.nonzero_edges[p.element.kind] != WHATEVER_SCALE) return;
    for (i64 c = begin; c < end; ++c)
        canvas.labels(line, c) += mark_of_piece(p.index, CLASSED, canvas.surfaces(line, c));
}

// The label of a pixel that is left to the descent: its own, whatever lies beside it.
INLINE u32 label_left(i64 row, i64 column) {
    return hash32(LEFT_TO_DESCENT + (u64(row) << 31) + u64(column));
}

// Add an unturned element that fills its block of cells.
template <class Id>
void label_block(
    const Field& field, Canvas<Id>& canvas, const Painted& p, const BlockPixels& pixels
) {
    const auto& [u, v, x, y, part] = pixels;
    const auto& [index, element, kind, pose, grid] = p;
    for (i64 line = part.south; line < part.north; ++line)
        label_classes(canvas, p, line, part.west, part.east);
    u32 common = mark_of(p, canvas.nonzero_edges);
    bool steps = has_steps(kind) && element.scale != 0.0;
    if (!steps && common == 0) return;
    Span<u32> marks(canvas.marks.data(), u.size());
    if (steps) {
        fill(marks, u32(0));
        GridAxis axis = axis_of(grid, X);
        for (std::size_t n = 0; kind.knotted[X] == STEPPED && n < u.size(); ++n) {
            i64 piece = placed_piece(
                field.curves, curve_of(kind, X), u[n], x[n], axis, block_of(element, pose, X)
            );
            marks[n] = mark_of_piece(index, ACROSS, piece);
        }
    }
    for (i64 j = 0; j < count_of(v); ++j) {
        Span<u32> row = canvas.labels.row(part.south + j, part.west, part.east);
        u32 value = common;
        if (kind.knotted[Y] == STEPPED && steps) {
            i64 piece = placed_piece(
                field.curves, curve_of(kind, Y), v[j], y[j], axis_of(grid, Y),
                block_of(element, pose, Y)
            );
            value += mark_of_piece(index, ALONG, piece);
        }
        if (steps)
            for (std::size_t n = 0; n < row.size(); ++n) row[n] += marks[n] + value;
        else add_constant(row, value);
    }
}

// Add a turned or radial element to a run of pixels that it holds.
template <class Id>
void label_run(
    const Field& field, Canvas<Id>& canvas, const Painted& p, In u, double v, i64 line, i64 column
) {
    const auto& [index, element, kind, pose, grid] = p;
    label_classes(canvas, p, line, column, column + count_of(u));
    Span<u32> row = canvas.labels.row(line, column, column + count_of(u));
    if (u32 common = mark_of(p, canvas.nonzero_edges)) add_constant(row, common);
    if (!has_steps(kind) || element.scale == 0.0) return;
    auto piece_of = [&](const CurveAt& curve, double t) {
        return find_piece(field.curves, curve, min(clamp(t, 0.0, 1.0) + STEP, 1.0));
    };
    for (std::size_t n = 0; n < u.size(); ++n) {
        UV at = pose.turned ? turned(pose, u[n], v) : UV{u[n], v};
        if (kind.combine == RADIAL) at.u = 0.5 + 0.5 * radius(at);
        if (kind.knotted[X] == STEPPED)
            row[n] += mark_of_piece(index, ACROSS, piece_of(curve_of(kind, X), at.u));
        if (kind.knotted[Y] == STEPPED && kind.combine != RADIAL)
            row[n] += mark_of_piece(index, ALONG, piece_of(curve_of(kind, Y), at.v));
    }
}

}  // namespace terratool
