// The descent: which elements hold a point, and what they add up to.
#pragma once

#include "classes.hpp"
#include "frames.hpp"
#include "roughness.hpp"
#include "tracks.hpp"

namespace terratool {

// Points that a batch takes at a time; their positions stay in the cache.
constexpr i64 BATCH = 512;

constexpr i64 NO_ELEMENT = -1;

struct Waiting {  // a grid that waits in a descent, and the place in the element that it divides
    u64 grid;
    double from_x, from_y;
};

using Stack = std::vector<Waiting>;

// A point of a batch, and a free leaf that holds it.
struct HeldPoint {
    u32 element, point;
};

// Space to work in; each thread needs its own.
struct Scratch {
    Stack stack;
    std::array<std::array<double, BATCH>, 9> work;
    std::array<u32, BATCH> begins, ends;
    std::array<i64, BATCH> top;
    std::array<HeldPoint, 4 * BATCH> held;

    explicit Scratch(const Field& field) : stack(field.pending) {}
};

struct LeafSum {
    double z, slope_x, slope_y;
    i64 top;
};

// Add the elements of a bin that have no grid and nothing special, each as wide as the cell.
// Height, slopes in cells, and the top element go in and come out.
template <bool sloped>
INLINE LeafSum
add_leaves(const Field& field, u64 begin, u64 end, double in_x, double in_y, LeafSum sum) {
    for (u64 k = begin; k < end; ++k) {
        const Element& element = field.elements[k];
        const Kind& kind = field.kinds[element.kind];
        const Pose& pose = field.poses[element.pose];
        // turned by nothing for most; that is quicker than to guess which ones are
        UV at = turned(pose, in_x, in_y);
        if (is_beyond(at)) continue;
        CurvePoint fx = even_curve(field.curves.pieces, kind, X, at.u);
        CurvePoint fy = even_curve(field.curves.pieces, kind, Y, at.v);
        sum.z += element.scale * (fx.value * fy.value) + element.offset;
        sum.top = i64(k);
        if constexpr (sloped) {
            auto [du, dv] = turned_slopes(pose, fx.slope * fy.value, fx.value * fy.slope);
            sum.slope_x += element.scale * du;
            sum.slope_y += element.scale * dv;
        }
    }
    return sum;
}

// A point in the world, and its place in the cell that a grid divides.
struct DescentPoint {
    double x, y, from_x, from_y;
};

struct FreeSum {
    LeafSum sum;
    std::size_t pending;  // grids that wait
};

// Whether a cell of a free grid holds a point, by the doubles that its edges stand at.
inline bool free_cell_holds(
    const Field& field, const Grid& grid, const ExactPlace& place, const DescentPoint& p
) {
    if (grid.local) {  // finer than doubles
        double u = free_position(place.near, X, from_parent(grid, X, p.x, p.from_x));
        double v = free_position(place.near, Y, from_parent(grid, Y, p.y, p.from_y));
        return 0.0 <= u && (u < 1.0 || p.from_x == 1.0) && 0.0 <= v && (v < 1.0 || p.from_y == 1.0);
    }
    Grid frame = free_frame(grid, place);
    return holds_along(axis_of(frame, X), p.x, field.bounds[2])
        && holds_along(axis_of(frame, Y), p.y, field.bounds[3]);
}

// Whether the footprint of a free leaf with nothing special holds a point, as exactly as can be.
inline bool free_leaf_holds(
    const Field& field, const Grid& grid, const ExactPlace& place, const Pose& square, UV from,
    const DescentPoint& p
) {
    if (!square.turned) return free_cell_holds(field, grid, place, p);
    UV at{free_position(place.near, X, from.u), free_position(place.near, Y, from.v)};
    return !is_beyond(turned(free_pose(square, place.near), at.u, at.v));
}

// How far inside the footprint of a free element a point is, from its parent's corner; below 0
// outside. It is off by less than the slack of the bins.
template <bool turned> INLINE double free_depth(const Place& place, const Pose& square, UV from) {
    double dx = from.u - place.at[X], dy = from.v - place.at[Y];
    if constexpr (turned) {
        double across = dx * square.cos - dy * square.sin_u;
        dy = dx * square.sin_u + dy * square.cos, dx = across;
    }
    return min(0.5 * place.extent[X] - abs(dx), 0.5 * place.extent[Y] - abs(dy));
}

// Position in the primitive of a free element of a point that its footprint holds.
template <bool turns = true>
INLINE UV free_place_in_shape(const Place& place, const Pose& square, UV from) {
    UV at{free_position(place, X, from.u), free_position(place, Y, from.v)};
    if (turns && square.turned) at = turned(free_pose(square, place), at.u, at.v);
    return {clamp(at.u, 0.0, 1.0), clamp(at.v, 0.0, 1.0)};
}

// Keep those of some elements of a free grid of leaves whose footprints hold a point, in their
// order, with the index of the point; returns how many. What is near an edge is looked at again;
// there is no branch but for it.
template <bool turned>
INLINE i64 keep_free_leaves(
    const Field& field, const Grid& grid, const FreeBins& bins, Span<const u32> entries, UV from,
    const DescentPoint& p, u32 point, HeldPoint* kept
) {
    i64 count = 0;
    double slack = bins.slack;
    for (u32 index : entries) {
        const Place& place = field.places[i64(index) + bins.places];
        const Pose& pose = field.poses[turned ? field.elements[index].pose : 0];
        double depth = free_depth<turned>(place, pose, from);
        bool holds = depth > 0.0;
        if (abs(depth) <= slack) [[unlikely]] {
            const Pose& own = field.poses[field.elements[index].pose];
            ExactPlace exact = exact_place(field, i64(index) + bins.places);
            holds = free_leaf_holds(field, grid, exact, own, from, p);
        }
        kept[count] = {index, point};
        count += holds;
    }
    return count;
}

// So many entries of a bin are looked at together.
constexpr i64 FREE_CHUNK = 256;

// Add a product of evenly spaced pieces of an element that holds a point; `turns` if it may be
// turned.
template <bool sloped, bool turns = true>
INLINE void add_free_leaf(
    const Field& field, i64 index, const Place& place, UV from, LeafSum& sum
) {
    const Element& element = field.elements[index];
    const Kind& kind = field.kinds[element.kind];
    const Pose& square = field.poses[turns ? element.pose : 0];
    UV at = free_place_in_shape<turns>(place, square, from);
    CurvePoint fx = even_curve(field.curves.pieces, kind, X, at.u);
    CurvePoint fy = even_curve(field.curves.pieces, kind, Y, at.v);
    sum.z += element.scale * (fx.value * fy.value) + element.offset;
    sum.top = max(sum.top, index);
    if constexpr (sloped) {
        UV slopes{fx.slope * fy.value, fx.value * fy.slope};
        if (turns && square.turned)
            slopes = turned_slopes(free_pose(square, place), slopes.u, slopes.v);
        sum.slope_x += element.scale * slopes.u * (1.0 / place.extent[X]);
        sum.slope_y += element.scale * slopes.v * (1.0 / place.extent[Y]);
    }
}

// Add those leaves among the entries of a bin that hold a point.
template <bool sloped>
LeafSum add_free_leaves(
    const Field& field, const Grid& grid, Span<const u32> entries, UV from, const DescentPoint& p,
    LeafSum sum
) {
    const FreeBins& bins = field.free_bins[grid.free];
    std::array<HeldPoint, FREE_CHUNK> kept;
    for (std::size_t begin = 0; begin < entries.size(); begin += FREE_CHUNK) {
        auto some = entries.subspan(begin, min(std::size_t(FREE_CHUNK), entries.size() - begin));
        i64 count = grid.standing == FREE_PLAIN
            ? keep_free_leaves<false>(field, grid, bins, some, from, p, 0, kept.data())
            : keep_free_leaves<true>(field, grid, bins, some, from, p, 0, kept.data());
        for (i64 n = 0; n < count; ++n) {
            u32 index = kept[n].element;
            const Place& place = field.places[i64(index) + bins.places];
            add_free_leaf<sloped>(field, index, place, from, sum);
        }
    }
    return sum;
}

// Whether the cell of a free element holds a point; `slack` is that of its bins.
INLINE bool free_cell_is_met(
    const Field& field, const Grid& grid, const ExactPlace& place, UV from, const DescentPoint& p,
    double slack
) {
    double depth = free_depth<false>(place.near, field.poses[0], from);
    return abs(depth) > slack ? depth > 0.0 : free_cell_holds(field, grid, place, p);
}

// Whether the footprint of a free element of any kind holds a point, in its cell unless it is
// turned, and value and slopes there, these along the sides of the cell.
INLINE Footprint free_shape(
    const Field& field, const Grid& grid, const Element& element, const ExactPlace& exact, UV from,
    const DescentPoint& p, double slack
) {
    constexpr Footprint none{false, {0.0, 0.0, 0.0}};
    const Place& place = exact.near;
    const Pose& square = field.poses[element.pose];
    const Kind& kind = field.kinds[element.kind];
    if (square.turned && free_depth<true>(place, square, from) < -slack) return none;
    UV at = free_place_in_shape(place, square, from);
    Pose pose = free_pose(square, place);
    ShapePoint f;
    if (kind.special) {
        Grid frame{};
        if (square.turned)
            at = turned(pose, free_position(place, X, from.u), free_position(place, Y, from.v));
        else if (has_edges(kind)) frame = free_frame(grid, exact);
        auto [holds, shape] = special_shape(field.curves, kind, element, pose, frame, at, p.x, p.y);
        if (!holds) return none;
        f = shape;
    } else {
        if (square.turned && !free_leaf_holds(field, grid, exact, square, from, p)) return none;
        CurvePoint fx = even_curve(field.curves.pieces, kind, X, at.u);
        CurvePoint fy = even_curve(field.curves.pieces, kind, Y, at.v);
        f = {fx.value * fy.value, fx.slope * fy.value, fx.value * fy.slope};
    }
    if (square.turned) {
        auto [du, dv] = turned_slopes(pose, f.du, f.dv);
        f.du = du, f.dv = dv;
    }
    return {true, f};
}

// The pixel of a free element with classes that a point of its footprint lies in.
NEVER_INLINE inline ClassPixel free_pixel(
    const Field& field, const Grid& grid, i64 index, const ExactPlace& exact, UV from,
    const DescentPoint& p
) {
    const Element& element = field.elements[index];
    const Pose& square = field.poses[element.pose];
    Pose pose = free_pose(square, exact.near);
    UV at = free_place_in_shape(exact.near, square, from);
    return pixel_of(field, index, element, pose, free_frame(grid, exact), at, p.x, p.y);
}

// Add an element of a free grid of any kind, if it holds a point; its grids are left to wait.
template <bool sloped>
INLINE void add_free_element(
    const Field& field, const Grid& grid, i64 index, UV from, const DescentPoint& p, LeafSum& sum,
    ClassPixel& pixel, Stack& stack, std::size_t& pending
) {
    const Element& element = field.elements[index];
    ExactPlace exact = exact_place(field, place_of(element));
    const Place& place = exact.near;
    bool is_turned = field.poses[element.pose].turned;
    double slack = field.free_bins[grid.free].slack;
    if (!is_turned || element.grid) {
        bool held = free_cell_is_met(field, grid, exact, from, p, slack);
        if (!held && !is_turned) return;
        if (held && element.grid) {
            UV at{free_position(place, X, from.u), free_position(place, Y, from.v)};
            stack[pending++] = {element.grid, clamp(at.u, 0.0, 1.0), clamp(at.v, 0.0, 1.0)};
        }
    }
    auto [holds, f] = free_shape(field, grid, element, exact, from, p, slack);
    if (!holds) return;
    sum.z += element.scale * f.value + element.offset;
    sum.top = max(sum.top, index);
    if (sum.top == index && has_classes(field.kinds[element.kind])) [[unlikely]]
        pixel = free_pixel(field, grid, index, exact, from, p);
    if constexpr (sloped) {
        sum.slope_x += element.scale * f.du * (1.0 / place.extent[X]);
        sum.slope_y += element.scale * f.dv * (1.0 / place.extent[Y]);
    }
}

// The entries of the bin of a free grid that holds a point.
INLINE Span<const u32> free_entries(const Field& field, const Grid& grid, UV from) {
    const FreeBins& bins = field.free_bins[grid.free];
    i64 row = free_bin(bins, Y, from.v) * i64(grid.row);
    u64 bin = u64(grid.table + row + free_bin(bins, X, from.u));
    u32 begin = field.offsets[bin];
    return field.entries.subspan(begin, field.offsets[bin + 1] - begin);
}

// Add the elements of a free grid that hold a point; the grids that they have are left to wait.
template <bool sloped>
FreeSum add_free(
    const Field& field, const Grid& grid, const DescentPoint p, LeafSum sum, ClassPixel& pixel,
    Stack& stack, std::size_t pending
) {
    UV from{from_parent(grid, X, p.x, p.from_x), from_parent(grid, Y, p.y, p.from_y)};
    auto entries = free_entries(field, grid, from);
    if (grid.leaves) {
        sum = add_free_leaves<sloped>(field, grid, entries, from, p, sum);
    } else {
        for (u32 index : entries)
            add_free_element<sloped>(field, grid, index, from, p, sum, pixel, stack, pending);
    }
    return {sum, pending};
}

struct Found {  // of the elements at a point; the top one decides the surface
    double z;
    i64 top;
    double slope_x, slope_y;
    ClassPixel pixel{};  // of the top one, where it has classes
};

INLINE Worn worn_of(const Field& field, const Found& found) {
    return worn_of(field, found.top, found.pixel);
}

INLINE bool has_tracks(const Field& field) { return !field.tracks.masks.empty(); }

// The height of the elements, NaN in the void, where no class decides.
INLINE double height_or_void(const Field& field, double z, i64 top) {
    return field.voids && worn_of(field, top, {}).is_void ? NaN : z;
}

// The ground at a point where the elements have a height and a surface, and no void is: first the
// rut is taken from it, then the relief of the surface that is there then is added.
template <bool sloped> struct Ground {
    double z;
    i64 surface_track = -1;               // the track that decides the surface, -1 for none
    double slope_x = 0.0, slope_y = 0.0;  // of the relief

    i64 surface;  // that is there then

    INLINE Ground(const Field& field, double height, i64 worn, double x, double y)
        : z(height), surface(worn) {
        if (has_tracks(field)) {
            Rut rut = rut_at(field.tracks, x, y, surface);
            z -= rut.depth, surface_track = rut.surface_track;
            if (surface_track >= 0) surface = field.tracks.surface[surface_track];
        }
        if (has_reliefs(field)) {
            ReliefPoint relief = relief_at<sloped>(relief_of(field, surface), x, y);
            z += relief.z, slope_x = relief.slope_x, slope_y = relief.slope_y;
        }
    }
};

// What of the height of the elements is left by tracks, reliefs and the void.
INLINE double settled(const Field& field, double z, const Worn& worn, double x, double y) {
    if (worn.is_void) return NaN;
    bool bare = !has_tracks(field) && !has_reliefs(field);
    return bare ? z : Ground<false>(field, z, worn.surface, x, y).z;
}
INLINE double settled(const Field& field, const Found& found, double x, double y) {
    return surfaces_matter(field) ? settled(field, found.z, worn_of(field, found), x, y) : found.z;
}

struct Begun {  // the root's height and slopes, and the place in the root's grid
    double z, slope_x, slope_y;
    i64 i, j;
    double in_x, in_y;
};

// Height, top element and gradient at a point inside the bounds, tracks apart.
// The gradient is computed only where `sloped` holds; a descent that has `begun` goes on from it.
template <bool sloped, bool begun = false>
INLINE Found descend(const Field& field, double x, double y, Stack& stack, Begun from = {}) {
    auto [z, slope_x, slope_y, i, j, in_x, in_y] = from;
    bool placed = begun;
    double from_x = 0.0, from_y = 0.0;
    i64 top = begun ? 0 : NO_ELEMENT;
    ClassPixel pixel;
    std::size_t pending = 0;
    u64 g = begun ? 1 : 0, descended = 0;
    double below_x = 0.0, below_y = 0.0;
    while (true) {
        const Grid& grid = field.grids[g];
        if (grid.standing != IN_CELLS) [[unlikely]] {
            placed = false;
            if (descended) stack[pending++] = {std::exchange(descended, 0), below_x, below_y};
            FreeSum found = add_free<sloped>(
                field, grid, {x, y, from_x, from_y}, {z, slope_x, slope_y, top}, pixel, stack,
                pending
            );
            z = found.sum.z, top = found.sum.top, pending = found.pending;
            slope_x = found.sum.slope_x, slope_y = found.sum.slope_y;
            if (grid.more) {
                ++g;
            } else if (pending) {
                auto waiting = stack[--pending];
                g = waiting.grid, from_x = waiting.from_x, from_y = waiting.from_y;
            } else {
                return {z, top, slope_x, slope_y, pixel};
            }
            continue;
        }
        if (placed) {
            placed = false;
        } else {
            // the usual case: far enough from any edge of a cell
            double sx = cells_from_corner(grid, X, x), sy = cells_from_corner(grid, Y, y);
            i = i64(sx), j = i64(sy);
            in_x = sx - double(i), in_y = sy - double(j);
        }
        if (!is_clear_of_edges(grid, in_x, in_y)) [[unlikely]] {
            auto at_x = locate_cell(x, axis_of(grid, X), grid.local, from_x);
            auto at_y = locate_cell(y, axis_of(grid, Y), grid.local, from_y);
            i = at_x.cell, in_x = at_x.in, j = at_y.cell, in_y = at_y.in;
        }
        u64 bin = u64(bin_of(grid, i, j));
        u64 begin = field.offsets[bin], end = field.offsets[bin + 1];
        if (grid.leaves) {
            LeafSum sum =
                add_leaves<sloped>(field, begin, end, in_x, in_y, {z, 0.0, 0.0, NO_ELEMENT});
            z = sum.z;
            top = max(top, sum.top);
            if constexpr (sloped) {
                slope_x += sum.slope_x * grid.per[X];
                slope_y += sum.slope_y * grid.per[Y];
            }
            begin = end;
        }
        for (u64 k = begin; k < end; ++k) {
            u64 index = listed_element(field, grid, k);
            const Element& element = field.elements[index];
            const Kind& kind = field.kinds[element.kind];
            const Pose& pose = field.poses[element.pose];
            UV at{in_x, in_y};
            if (grid.listed) {
                i64 right = i - element.cell[X], above = j - element.cell[Y];
                if (right < 0 || above < 0 || right >= pose.cells[X] || above >= pose.cells[Y])
                    continue;
                at.u = min((double(right) + in_x) / pose.size[X], 1.0);
                at.v = min((double(above) + in_y) / pose.size[Y], 1.0);
            }
            if (element.grid) {
                if (descended) stack[pending++] = {descended, below_x, below_y};
                descended = element.grid;
                below_x = at.u, below_y = at.v;
            }
            if (pose.turned) at = turned(pose, at.u, at.v);
            ShapePoint f;
            if (kind.special) {
                auto [holds, shape] =
                    special_shape(field.curves, kind, element, pose, grid, at, x, y);
                if (!holds) continue;
                f = shape;
                if (has_classes(kind) && i64(index) >= top) [[unlikely]]
                    pixel = pixel_of(field, i64(index), element, pose, grid, at, x, y);
            } else {
                if (is_beyond(at)) continue;
                CurvePoint fx = even_curve(field.curves.pieces, kind, X, at.u);
                CurvePoint fy = even_curve(field.curves.pieces, kind, Y, at.v);
                f = {fx.value * fy.value, fx.slope * fy.value, fx.value * fy.slope};
            }
            z += element.scale * f.value + element.offset;
            top = max(top, i64(index));
            if constexpr (sloped) {
                auto [du, dv] = turned_slopes(pose, f.du, f.dv);
                slope_x += element.scale * du * (grid.per[X] / pose.size[X]);
                slope_y += element.scale * dv * (grid.per[Y] / pose.size[Y]);
            }
        }
        if (grid.more) {
            ++g;
        } else if (descended) {
            g = std::exchange(descended, 0), from_x = below_x, from_y = below_y;
        } else if (pending) {
            auto waiting = stack[--pending];
            g = waiting.grid, from_x = waiting.from_x, from_y = waiting.from_y;
        } else {
            return {z, top, slope_x, slope_y, pixel};
        }
    }
}

// The same for where few points are asked: a function of its own is compiled once in each file.
template <bool sloped>
NEVER_INLINE Found found_at(const Field& field, double x, double y, Stack& stack) {
    return descend<sloped>(field, x, y, stack);
}

// Whether a point is on the terrain, its edges included.
INLINE bool is_inside(In bounds, double x, double y) {
    return bounds[0] <= x && x <= bounds[2] && bounds[1] <= y && y <= bounds[3];
}

// Height at a point; NaN outside and in the void.
inline double height_at(const Field& field, double x, double y, Stack& stack) {
    if (!is_inside(field.bounds, x, y)) return NaN;
    return settled(field, descend<false>(field, x, y, stack), x, y);
}

// Positions along one axis of a grid, in whole cells and parts of them; vectorised.
INLINE void positions(In x, const GridAxis& axis, Out whole, Out part) {
    double corner = axis.corner, rest = axis.rest, per = axis.per;
    for (std::size_t n = 0; n < x.size(); ++n) {
        double s = ((x[n] - corner) - rest) * per;
        double below = quick_floor(s);
        whole[n] = below;
        part[n] = s - below;
    }
}

// Values of a curve of evenly spaced pieces at each `t`, in [0, 1] or EDGE beyond; farther out they
// mean nothing. `whole` is scratch.
inline void even_values(In pieces, const Kind& kind, int axis, In t, Out whole, Out out) {
    u32 first = kind.pieces[axis][0];
    double count = kind.count[axis];
    if (is_constant(pieces, first, count)) {
        std::fill(out.begin(), out.end(), stored_piece(pieces, first).c0);
        return;
    }
    for (std::size_t n = 0; n < t.size(); ++n) {  // vectorised
        double s = t[n] * count;
        double below = clamp(quick_floor(s), 0.0, count);
        whole[n] = below;
        out[n] = s - below;
    }
    for (std::size_t n = 0; n < t.size(); ++n)
        out[n] = stored_piece(pieces, first + u64(i64(whole[n]))).value(out[n]);
}

// A batch of points whose root, which they share, is evaluated for all at once.
template <bool sloped> class PointBatch {
public:
    Out z, slope_x, slope_y;  // of the root

    // Whether the root of a field can be evaluated so.
    static bool is_possible(const Field& field) {
        const Element& root = field.elements[0];
        const Kind& kind = field.kinds[root.kind];
        if (!root.grid || root.pose || kind.combine == RADIAL || has_classes(kind)) return false;
        for (u64 g = 1;; ++g) {
            if (field.grids[g].local) return false;  // where the place in the world says nothing
            if (!field.grids[g].more) return true;
        }
    }

    PointBatch(const Field& field, In x, In y, Scratch& scratch)
        : z(row(scratch, 0, x)), slope_x(row(scratch, 1, x)), slope_y(row(scratch, 2, x)),
          cell_x_(row(scratch, 3, x)), cell_y_(row(scratch, 4, x)), in_x_(row(scratch, 5, x)),
          in_y_(row(scratch, 6, x)), u_(row(scratch, 7, x)), v_(row(scratch, 8, x)),
          ground_(field.grids[0]) {
        positions(x, axis_of(ground_, X), cell_x_, u_);
        positions(y, axis_of(ground_, Y), cell_y_, v_);
        for (std::size_t n = 0; n < x.size(); ++n) {  // outside and at its edges, u is made to fail
            bool inside = (cell_x_[n] == 0.0) & (cell_y_[n] == 0.0);  // not where they are NaN
            u_[n] = inside ? u_[n] : 1.0;
            v_[n] = inside ? v_[n] : 1.0;
        }
        const Element& root = field.elements[0];
        const Kind& kind = field.kinds[root.kind];
        const Pose& pose = field.poses[0];
        if (sloped || kind.special) {
            for (std::size_t n = 0; n < x.size(); ++n) {
                if (!is_clear(n)) continue;
                ShapePoint f = placed_shape(
                    field.curves, kind, root, pose, ground_, {u_[n], v_[n]}, x[n], y[n]
                );
                z[n] = root.scale * f.value + root.offset;
                if constexpr (sloped) {
                    auto [du, dv] = turned_slopes(pose, f.du, f.dv);
                    slope_x[n] = root.scale * du * (ground_.per[X] / pose.size[X]);
                    slope_y[n] = root.scale * dv * (ground_.per[Y] / pose.size[Y]);
                }
            }
        } else {
            In pieces = field.curves.pieces;
            even_values(pieces, kind, X, u_, in_y_, z);
            even_values(pieces, kind, Y, v_, in_y_, in_x_);
            for (std::size_t n = 0; n < x.size(); ++n)
                z[n] = root.scale * (z[n] * in_x_[n]) + root.offset;
        }
        const Grid& grid = field.grids[1];
        if (grid.standing == IN_CELLS) {
            positions(x, axis_of(grid, X), cell_x_, in_x_);
            positions(y, axis_of(grid, Y), cell_y_, in_y_);
        } else {
            for (std::size_t n = 0; n < x.size(); ++n) {
                in_x_[n] = from_parent(grid, X, x[n], 0.0);
                in_y_[n] = from_parent(grid, Y, y[n], 0.0);
            }
        }
    }

    // Whether a point is inside, and so far from the edges of the terrain that it can go on.
    INLINE bool is_clear(std::size_t n) const { return is_clear_of_edges(ground_, u_[n], v_[n]); }
    // How far it is from the corner of the root, where the grid is free.
    INLINE UV from_corner(std::size_t n) const { return {in_x_[n], in_y_[n]}; }
    // From where its descent goes on.
    INLINE Begun begun(std::size_t n) const {
        double by_x = sloped ? slope_x[n] : 0.0, by_y = sloped ? slope_y[n] : 0.0;
        return {z[n], by_x, by_y, i64(cell_x_[n]), i64(cell_y_[n]), in_x_[n], in_y_[n]};
    }

private:
    Out cell_x_, cell_y_, in_x_, in_y_, u_, v_;
    const Grid& ground_;

    static Out row(Scratch& scratch, int index, In x) {
        return {scratch.work[index].data(), x.size()};
    }
};

// Sentinel in place of a top element: the height of this point is final.
constexpr i64 COMPLETE = -2;

// Take the ruts from the heights of a batch of points, and add the reliefs.
inline void settle_batch(const Field& field, In x, In y, const Scratch& scratch, Out out) {
    for (std::size_t n = 0; n < x.size(); ++n) {
        if (scratch.top[n] == COMPLETE || isnan(out[n])) continue;
        i64 surface = worn_of(field, scratch.top[n], {}).surface;
        out[n] = Ground<false>(field, out[n], surface, x[n], y[n]).z;
    }
}

// The same where no surface is rough.
inline void lower_batch(const Field& field, In x, In y, Scratch& scratch, Out out) {
    std::size_t count = x.size();
    Out u(scratch.work[0].data(), count), v(scratch.work[1].data(), count);
    Span<u32> near(scratch.ends);
    i64 found = find_near_tracks(field.tracks, x, y, u, v, near);
    for (i64 k = 0; k < found; ++k) {
        u32 n = near[k];
        if (scratch.top[n] == COMPLETE || isnan(out[n])) continue;
        i64 surface = worn_of(field, scratch.top[n], {}).surface;
        out[n] -= rut_at(field.tracks, x[n], y[n], surface).depth;
    }
}

// Heights at a batch of points over a free grid of leaves below the root; complete(n) is called for
// those that are left out here.
// First what holds each point is found, then what it adds up to: neither waits for the other.
template <bool turned, class Complete>
void batch_free_leaves(
    const Field& field, const PointBatch<false>& batch, In x, In y, Scratch& scratch, Out out,
    Complete complete
) {
    const Grid& grid = field.grids[1];
    const FreeBins& bins = field.free_bins[grid.free];
    auto& held = scratch.held;
    i64 count = 0;
    auto add = [&] {
        for (i64 k = 0; k < count; ++k) {
            auto [index, n] = held[k];
            const Place& place = field.places[i64(index) + bins.places];
            LeafSum sum{batch.z[n], 0.0, 0.0, scratch.top[n]};
            add_free_leaf<false, turned>(field, index, place, batch.from_corner(n), sum);
            batch.z[n] = sum.z, scratch.top[n] = sum.top;
        }
        count = 0;
    };
    for (std::size_t n = 0; n < x.size(); ++n) {
        scratch.begins[n] = scratch.ends[n] = 0, scratch.top[n] = 0;
        if (!batch.is_clear(n)) {
            scratch.top[n] = COMPLETE;
            continue;
        }
        UV from = batch.from_corner(n);
        i64 row = free_bin(bins, Y, from.v) * i64(grid.row);
        u64 bin = u64(grid.table + row + free_bin(bins, X, from.u));
        scratch.begins[n] = field.offsets[bin], scratch.ends[n] = field.offsets[bin + 1];
    }
    for (std::size_t n = 0; n < x.size(); ++n) {
        UV from = batch.from_corner(n);
        for (u32 begin = scratch.begins[n], end; begin < scratch.ends[n]; begin = end) {
            end = min(scratch.ends[n], begin + u32(FREE_CHUNK));
            if (count + FREE_CHUNK > count_of(held)) add();
            count += keep_free_leaves<turned>(
                field, grid, bins, field.entries.subspan(begin, end - begin), from,
                {x[n], y[n], 0.0, 0.0}, u32(n), held.data() + count
            );
        }
    }
    add();
    for (std::size_t n = 0; n < x.size(); ++n) {
        if (scratch.top[n] == COMPLETE) complete(n);
        else out[n] = height_or_void(field, batch.z[n], scratch.top[n]);
    }
}

// Heights at a batch of points; those of the elements alone where `scratch.top` gets an element.
inline void batch_heights(const Field& field, In x, In y, Scratch& scratch, Out out) {
    PointBatch<false> batch(field, x, y, scratch);
    auto complete = [&](std::size_t n) {
        out[n] = height_at(field, x[n], y[n], scratch.stack);
        scratch.top[n] = COMPLETE;
    };
    const Grid& grid = field.grids[1];
    bool free = grid.standing != IN_CELLS;
    if (free && grid.leaves && !grid.more) {
        if (grid.standing == FREE_PLAIN)
            batch_free_leaves<false>(field, batch, x, y, scratch, out, complete);
        else batch_free_leaves<true>(field, batch, x, y, scratch, out, complete);
        return;
    }
    if (free || !grid.leaves || grid.more) {
        for (std::size_t n = 0; n < x.size(); ++n) {
            if (!batch.is_clear(n)) {
                complete(n);
                continue;
            }
            Found found = descend<false, true>(field, x[n], y[n], scratch.stack, batch.begun(n));
            bool classed = is_classed(field, found.top);
            out[n] = classed ? settled(field, found, x[n], y[n])
                             : height_or_void(field, found.z, found.top);
            scratch.top[n] = classed ? COMPLETE : found.top;
        }
        return;
    }
    // first where the elements of each point are, then what they are: neither waits for the other
    for (std::size_t n = 0; n < x.size(); ++n) {
        scratch.begins[n] = 1, scratch.ends[n] = 0;
        if (!batch.is_clear(n)) continue;
        Begun at = batch.begun(n);
        if (is_clear_of_edges(grid, at.in_x, at.in_y)) {
            u64 bin = u64(grid.table + at.j * i64(grid.row) + at.i);  // leaves have a bin per cell
            scratch.begins[n] = field.offsets[bin];
            scratch.ends[n] = field.offsets[bin + 1];
        }
    }
    for (std::size_t n = 0; n < x.size(); ++n) {
        u64 begin = scratch.begins[n], end = scratch.ends[n];
        if (begin > end) {  // near an edge
            complete(n);
            continue;
        }
        Begun at = batch.begun(n);
        LeafSum sum = add_leaves<false>(field, begin, end, at.in_x, at.in_y, {at.z, 0.0, 0.0, 0});
        out[n] = height_or_void(field, sum.z, sum.top);
        scratch.top[n] = sum.top;
    }
}

// Call visit(begin, count) for batches of points.
template <class Visit> INLINE void visit_batches(std::size_t points, Visit visit) {
    for (std::size_t begin = 0; begin < points; begin += BATCH)
        visit(begin, min(std::size_t(BATCH), points - begin));
}

// Whether all ground is one grid of heights in memory, none of which is void.
inline bool is_grid_alone(const Field& field) {
    const Element& root = field.elements[0];
    const Kind& kind = field.kinds[root.kind];
    if (root.grid || root.pose || kind.combine != GRID || kind.is_void || has_classes(kind))
        return false;
    if (has_tracks(field) || has_reliefs(field) || field.grids[0].local) return false;
    RasterAt raster(field.curves, kind);
    return !raster.raster().voids && raster.is_in_memory();
}

// Heights at a batch of points of a grid that is alone: first where the numbers around each point
// are, then what they are, so that the memory is asked for many at a time.
inline void batch_grid(const Field& field, In x, In y, Scratch& scratch, Out out) {
    const Element& root = field.elements[0];
    const Grid& ground = field.grids[0];
    RasterAt raster(field.curves, field.kinds[root.kind]);
    const Raster& r = raster.raster();
    auto row = [&](int index) { return Out{scratch.work[index].data(), x.size()}; };
    Out cell_x = row(0), cell_y = row(1), u = row(2), v = row(3);
    positions(x, axis_of(ground, X), cell_x, u);
    positions(y, axis_of(ground, Y), cell_y, v);
    Span<i64> first(scratch.top.data(), x.size());  // of the numbers, -1 for where it is not clear
    for (std::size_t n = 0; n < x.size(); ++n) {
        bool inside = (cell_x[n] == 0.0) & (cell_y[n] == 0.0);  // not where they are NaN
        bool clear = inside && is_clear_of_edges(ground, u[n], v[n]);
        Between along = between(clear ? u[n] : 0.0, r.count[X], r.pixel);
        Between across = between(clear ? v[n] : 0.0, r.count[Y], r.pixel);
        first[n] = clear ? raster.place_of(along.low, across.low) : -1;
        u[n] = along.part, v[n] = across.part;
    }
    i64 east = r.count[X] > 1, north = r.count[Y] > 1 ? -r.count[X] : 0;
    double scale = root.scale, offset = root.offset;
    raster.visit_numbers([&](const auto* numbers) {
        for (std::size_t n = 0; n < x.size(); ++n) {
            const auto* z = numbers + max(first[n], -north);
            Corners around{
                double(z[0]), double(z[east]), double(z[north]), double(z[east + north])
            };
            out[n] = scale * around.value(u[n], v[n]) + offset;
        }
    });
    for (std::size_t n = 0; n < x.size(); ++n)
        if (first[n] < 0) out[n] = height_at(field, x[n], y[n], scratch.stack);
}

// Heights at points, on one thread.
inline void heights(const Field& field, In x, In y, Out out) {
    Scratch scratch(field);
    if (is_grid_alone(field)) {
        visit_batches(x.size(), [&](std::size_t begin, std::size_t count) {
            In xs = x.subspan(begin, count), ys = y.subspan(begin, count);
            batch_grid(field, xs, ys, scratch, out.subspan(begin, count));
        });
    } else if (PointBatch<false>::is_possible(field)) {
        visit_batches(x.size(), [&](std::size_t begin, std::size_t count) {
            In xs = x.subspan(begin, count), ys = y.subspan(begin, count);
            Out zs = out.subspan(begin, count);
            batch_heights(field, xs, ys, scratch, zs);
            if (has_reliefs(field)) settle_batch(field, xs, ys, scratch, zs);
            else if (has_tracks(field)) lower_batch(field, xs, ys, scratch, zs);
        });
    } else {
        for (std::size_t n = 0; n < x.size(); ++n)
            out[n] = height_at(field, x[n], y[n], scratch.stack);
    }
}

// Everything at points: `height` (n,), `top` (n,), `surface` (n,), `gradient` (n, 2).
// The top element decides the surface, or the track does: the number of elements and its index; -1
// where there is none, -2 outside. The surface is -1 for none. Height and gradient are NaN outside
// and in the void.
inline void samples(
    const Field& field, In x, In y, Out height, Span<i64> top, Span<i32> surface,
    Matrix<double> gradient
) {
    Scratch scratch(field);
    auto put = [&](std::size_t n, const Found& found) {
        top[n] = found.top;
        Worn worn = worn_of(field, found);
        surface[n] = i32(worn.surface);
        if (worn.is_void) return;
        height[n] = found.z;
        gradient(n, 0) = found.slope_x;
        gradient(n, 1) = found.slope_y;
        if (!has_tracks(field) && !has_reliefs(field)) return;
        Ground<true> ground(field, found.z, worn.surface, x[n], y[n]);
        height[n] = ground.z, surface[n] = i32(ground.surface);
        if (ground.surface_track >= 0) top[n] = count_of(field.elements) + ground.surface_track;
        gradient(n, 0) += ground.slope_x;
        gradient(n, 1) += ground.slope_y;
    };
    auto descend_from_root = [&](std::size_t n) {
        if (is_inside(field.bounds, x[n], y[n]))
            put(n, descend<true>(field, x[n], y[n], scratch.stack));
    };
    std::ranges::fill(height, NaN);
    std::ranges::fill(top, -2);
    std::ranges::fill(surface, -1);
    gradient.fill(NaN);
    bool in_batches = PointBatch<true>::is_possible(field);
    visit_batches(x.size(), [&](std::size_t begin, std::size_t count) {
        if (!in_batches) {
            for (std::size_t n = begin; n < begin + count; ++n) descend_from_root(n);
            return;
        }
        PointBatch<true> batch(field, x.subspan(begin, count), y.subspan(begin, count), scratch);
        for (std::size_t k = 0; k < count; ++k) {
            std::size_t n = begin + k;
            if (batch.is_clear(k))
                put(n, descend<true, true>(field, x[n], y[n], scratch.stack, batch.begun(k)));
            else descend_from_root(n);
        }
    });
}

// Points of a large batch are sorted into so many strips along each axis.
constexpr i64 STRIPS = 64;

// Which of the strips along an axis; NaN goes to the first.
INLINE i64 strip_of(double coordinate, double start, double per) {
    double s = (coordinate - start) * per;
    return s > 0.0 ? i64(min(s, double(STRIPS) - 1.0)) : 0;
}

// Counting sort of points by place: `order` is where each sorted point came from.
// Points outside go with those at the nearest edge.
inline void sort_by_place(In x, In y, In bounds, Span<i64> order, Out sorted_x, Out sorted_y) {
    double per_x = double(STRIPS) / (bounds[2] - bounds[0]);
    double per_y = double(STRIPS) / (bounds[3] - bounds[1]);
    auto place = [&](std::size_t n) {
        return strip_of(x[n], bounds[0], per_x) + STRIPS * strip_of(y[n], bounds[1], per_y);
    };
    std::array<i64, STRIPS * STRIPS + 1> ends{};
    for (std::size_t n = 0; n < x.size(); ++n) ++ends[place(n) + 1];
    for (std::size_t k = 1; k < ends.size(); ++k) ends[k] += ends[k - 1];
    for (std::size_t n = 0; n < x.size(); ++n) {
        i64 at = ends[place(n)]++;
        order[at] = i64(n);
        sorted_x[at] = x[n];
        sorted_y[at] = y[n];
    }
}

}  // namespace terratool
