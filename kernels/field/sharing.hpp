// The descent of a field whose parts are shared.
//
// Such a field is a row of templates: what stands in an element of the text, once for all the
// places where that stands. The grids of a template have tables, but no place: where they lie is
// computed on the way down, by the functions that lay the grids of a field that is written out, and
// so are scales, turned poses and free places that a quarter turn mirrors. What is added, and in
// which order, is what the descent of the field that is written out adds: the bits are the same.
#pragma once

#include "query.hpp"

namespace terratool {

// The number of an element among all, of 128 bits.
struct Number {
    u64 low = 0, high = 0;

    INLINE Number operator+(const Number& other) const {
        u64 sum = low + other.low;
        return {sum, high + other.high + (sum < low)};
    }
    // Times a number of at most 32 bits.
    INLINE Number times(u64 factor) const {
        u64 lower = (low & 0xFFFFFFFF) * factor, upper = (low >> 32) * factor;
        Number shifted{upper << 32, (upper >> 32) + high * factor};
        return shifted + Number{lower, 0};
    }
};

INLINE Number number_of(const u64 (&halves)[2]) { return {halves[0], halves[1]}; }

INLINE bool is_shared(const Field& field) { return !field.shared.elements.empty(); }

// The cell of an element whose grids wait, and what they are laid and scaled by.
struct Frame {
    u64 grid;
    // corner and rest, the pitch of the grid that the cell is in, and how many of its cells it is
    double corner[2], rest[2], pitch[2][2], span[2];
    double length[2];  // its sides
    double from[2];    // the place of the point in it
    double aspect, factor;
    Number number;  // of the first element in it
    i64 depth;
    bool local;
};

// The one cell that the root of the terrain is in.
inline Frame terrain_frame(const Field& field) {
    Frame frame{};
    for (int axis : {X, Y}) {
        GridAxis whole = whole_axis(field.bounds[axis], field.shared.extent[axis]);
        frame.corner[axis] = whole.corner, frame.rest[axis] = whole.rest;
        frame.pitch[axis][0] = whole.pitch, frame.pitch[axis][1] = whole.pitch_rest;
        frame.span[axis] = 1.0, frame.length[axis] = field.shared.extent[axis];
    }
    frame.aspect = field.shared.extent[Y] / field.shared.extent[X];
    frame.factor = 1.0;
    return frame;
}

// A grid of a template where a frame puts it, and what of it does not depend on the corner.
struct LaidGrid {
    u64 index = ~u64(0);
    double pitch[2][2], span[2];  // those of the frame that it was laid for
    double side[2], per[2];       // of its cells
    double share;                 // of a cell in the terrain, the smaller one
    double aspect;                // columns by rows
    Grid grid;
};

// The grids that were laid last: most frames are as large as the one before.
class LaidGrids {
public:
    // A grid of a template in a frame; the reference holds until the next one is laid.
    INLINE LaidGrid& lay(const Field& field, const Frame& frame, u64 index) {
        LaidGrid& laid = kept_[index % most];
        bool same = laid.index == index;
        for (int axis : {X, Y})
            same = same && laid.pitch[axis][0] == frame.pitch[axis][0]
                && laid.pitch[axis][1] == frame.pitch[axis][1]
                && laid.span[axis] == frame.span[axis];
        if (!same) size(field, frame, index, laid);
        Grid& grid = laid.grid;
        grid.local = frame.local;
        for (int axis : {X, Y})
            grid.local |= put_axis(
                grid, axis, frame.corner[axis], frame.rest[axis], laid.side[axis], laid.per[axis]
            );
        if (grid.local) [[unlikely]]
            grid.clear[X] = grid.clear[Y] = -1.0;
        return laid;
    }

private:
    static constexpr u64 most = 64;
    std::array<LaidGrid, most> kept_;

    NEVER_INLINE static void size(
        const Field& field, const Frame& frame, u64 index, LaidGrid& laid
    ) {
        laid.index = index;
        Grid& grid = laid.grid = field.grids[index];
        double shares[2];
        for (int axis : {X, Y}) {
            laid.pitch[axis][0] = frame.pitch[axis][0], laid.pitch[axis][1] = frame.pitch[axis][1];
            laid.span[axis] = frame.span[axis];
            auto [pitch, rest] = divide(
                frame.pitch[axis][0], frame.pitch[axis][1], frame.span[axis], grid.count[axis]
            );
            grid.pitch[axis][0] = pitch, grid.pitch[axis][1] = rest;
            laid.side[axis] = pitch + rest, laid.per[axis] = 1.0 / laid.side[axis];
            shares[axis] = laid.side[axis] / field.shared.extent[axis];
        }
        laid.share = min(shares[X], shares[Y]);
        laid.aspect = grid.count[X] / grid.count[Y];
    }
};

// An element where it stands, without the pose.
struct Instance {
    u64 index;
    Element element;  // its cell, scale and offset are those of this place
    double factor;    // on what is in it
    Number number;
};

// Scale and offset of an element; share(): that of its sides in those of the terrain.
template <class Share>
INLINE void scale_element(const Field& field, const Frame& frame, Instance& one, Share share) {
    one.factor = frame.factor * field.shared.elements[one.index].factor;
    double own = one.element.scale;
    if (isnan(own)) own = share();
    one.element.scale = one.factor * own;
    one.element.offset = frame.factor * one.element.offset;
}

// The same of one in cells.
INLINE void scale_in_cells(
    const Field& field, const Frame& frame, const LaidGrid& laid, const Pose& pose, Instance& one
) {
    scale_element(field, frame, one, [&] {
        if (pose.cells[X] == 1 && pose.cells[Y] == 1) return laid.share;
        const double* extent = &field.shared.extent[0];
        return min(
            laid.side[X] * pose.size[X] / extent[X], laid.side[Y] * pose.size[Y] / extent[Y]
        );
    });
}

// The same of a free one.
INLINE void scale_at_place(
    const Field& field, const Frame& frame, const Place& place, Instance& one
) {
    const double* extent = &field.shared.extent[0];
    scale_element(field, frame, one, [&] {
        return min(place.extent[X] / extent[X], place.extent[Y] / extent[Y]);
    });
}

// The frame of what is in an element in cells, but for the place of a point in it.
inline Frame frame_within(
    const Frame& above, const LaidGrid& laid, double aspect, const Pose& pose, const Instance& one
) {
    const Grid& grid = laid.grid;
    Frame frame;
    frame.grid = one.element.grid;
    for (int axis : {X, Y}) {
        auto [corner, rest] = edge_position(axis_of(grid, axis), double(one.element.cell[axis]));
        frame.corner[axis] = corner, frame.rest[axis] = rest;
        frame.pitch[axis][0] = grid.pitch[axis][0], frame.pitch[axis][1] = grid.pitch[axis][1];
        frame.span[axis] = pose.size[axis];
        frame.length[axis] = laid.side[axis] * pose.size[axis];
    }
    bool square = pose.cells[X] == pose.cells[Y];
    frame.aspect = square ? aspect : aspect * (pose.size[Y] / pose.size[X]);
    frame.factor = one.factor;
    frame.number = one.number + Number{1, 0};
    frame.depth = above.depth + 1;
    frame.local = grid.local;
    return frame;
}

// The same of a free element.
inline Frame frame_at(
    const Frame& above, const Grid& grid, const Place& place, const Instance& one
) {
    Grid own = free_frame(grid, place);
    Frame frame;
    frame.grid = one.element.grid;
    for (int axis : {X, Y}) {
        auto [corner, rest] = edge_position(axis_of(own, axis), 0.0);
        frame.corner[axis] = corner, frame.rest[axis] = rest;
        frame.pitch[axis][0] = own.pitch[axis][0], frame.pitch[axis][1] = own.pitch[axis][1];
        frame.span[axis] = 1.0;
        frame.length[axis] = place.extent[axis];
    }
    frame.aspect = place.extent[Y] / place.extent[X];
    frame.factor = one.factor;
    frame.number = one.number + Number{1, 0};
    frame.depth = above.depth + 1;
    frame.local = own.local;
    return frame;
}

// The pose of a turned element in cells: kept is that of a square one.
INLINE Pose cell_pose(const Pose& square, double aspect) {
    Pose pose = square;
    if (pose.turned) {
        double own = aspect * (pose.size[Y] / pose.size[X]);
        pose.sin_v = square.sin_v * own, pose.sin_u = square.sin_u / own;
    }
    return pose;
}

// First and last of the copies of an element along an axis; none where the last is the lesser one.
struct CopyRange {
    i64 first, last;
};

// The copies that hold the cell which is so many cells right of the first cell of copy 0.
INLINE CopyRange copies_over(i64 right, i64 width, double step_size, u32 count) {
    i64 step = i64(step_size), most = i64(count) - 1;
    if (step == 1) return {max(right - width + 1, i64(0)), min(right, most)};
    auto divided = [](i64 a, i64 b) { return i64(u32(a) / u32(b)); };
    if (step > 0) {
        i64 last = right < 0 ? -1 : divided(right, step);
        return {right < width ? 0 : divided(right - width, step) + 1, min(last, most)};
    }
    if (step < 0) {
        i64 before = width - 1 - right, last = before < 0 ? -1 : divided(before, -step);
        return {right >= 0 ? 0 : divided(-right - step - 1, -step), min(last, most)};
    }
    return {0, 0 <= right && right < width ? most : -1};
}

// The copies of a free element that may reach a coordinate `from` the corner of its parent's cell,
// before mirroring, and perhaps a few more.
INLINE CopyRange copies_near(double from, double at, double reach, double step, u32 count) {
    double most = double(count) - 1.0;
    if (most == 0.0 || step == 0.0)
        return {0, abs(from - at) <= reach * (1.0 + 1e-9) ? i64(most) : -1};
    double middle = (from - at) / step, half = reach / abs(step);
    double doubt = 1e-9 * (abs(middle) + half + 1.0);
    double first = ceil(middle - half - doubt), last = floor(middle + half + doubt);
    return {i64(clamp(first, 0.0, most + 1.0)), i64(clamp(last, -1.0, most))};
}

// Half the sides of the rectangle around the cell and the footprint of a free element.
INLINE std::array<double, 2> free_span(const Pose& pose, const Place& place) {
    auto reach = free_reach(pose, place);
    return {max(reach[X], 0.5 * place.extent[X]), max(reach[Y], 0.5 * place.extent[Y])};
}

// How the copies of an element are counted: `outer` is the axis of the rows.
struct CopyOrder {
    int inner, outer;
    i64 in_row;
    explicit CopyOrder(const Copies& copies)
        : inner(copies.across ? Y : X), outer(copies.across ? X : Y), in_row(copies.count[inner]) {}
};

// Call visit(k along x, k along y, which of all) for the copies in two ranges, in their order.
template <class Visit>
INLINE void visit_copies(const Copies& copies, CopyRange across, CopyRange along, Visit visit) {
    CopyOrder order(copies);
    CopyRange inner = order.inner == X ? across : along, outer = order.inner == X ? along : across;
    for (i64 j = outer.first; j <= outer.last; ++j)
        for (i64 i = inner.first; i <= inner.last; ++i)
            visit(order.inner == X ? i : j, order.inner == X ? j : i, j * order.in_row + i);
}

// One copy of an element; `which` is counted among all its copies. Most ask for no number.
template <bool numbered = true>
INLINE Instance copy_of(const Field& field, const Frame& frame, u64 index, i64 which) {
    Instance one{index, field.elements[index], 0.0, {}};
    if constexpr (numbered) {
        const Member& member = field.shared.elements[index];
        Number before = frame.number + number_of(member.first);
        one.number = before + number_of(member.each).times(u64(which));
    }
    return one;
}

// The place of a copy of a free element, mirrored where a quarter turn mirrors what is around it.
INLINE Place place_of_copy(
    const Frame& frame, u8 mirror, const Place& first, const Copies& copies, i64 k_x, i64 k_y
) {
    Place place = first;
    for (int axis : {X, Y}) {
        i64 k = axis == X ? k_x : k_y;
        if (k) place.at[axis] = first.at[axis] + double(k) * copies.step[axis];
        if (mirror >> axis & 1) place.at[axis] = frame.length[axis] - place.at[axis];
    }
    return place;
}

// The element that decides the surface at a point.
struct SharedTop {
    i64 element = NO_ELEMENT;
    Number number;
    i64 depth = -1, family = -1;
};

// What waits in a descent, and the grids of before; each thread needs its own.
struct SharedStack {
    std::vector<Frame> frames;
    LaidGrids laid;
};

// Elements at a point, and what they add up to; the number of the top one only where `sloped`.
template <bool sloped> class SharedDescent {
public:
    double z = 0.0, slope_x = 0.0, slope_y = 0.0;
    SharedTop top;

    SharedDescent(const Field& field, double x, double y, SharedStack& stack)
        : field_(field), stack_(stack), x_(x), y_(y) {
        stack.frames.assign(1, terrain_frame(field));
        while (!stack.frames.empty()) {
            Frame frame = stack.frames.back();
            stack.frames.pop_back();
            ++family_;
            for (u64 g = frame.grid;; ++g) {
                const LaidGrid& laid = stack.laid.lay(field, frame, g);
                if (laid.grid.standing == IN_CELLS) add_cells(frame, laid);
                else add_free(frame, laid.grid, field.shared.mirrors[g]);
                if (!laid.grid.more) break;
            }
        }
    }

private:
    const Field& field_;
    SharedStack& stack_;
    double x_, y_;
    i64 family_ = 0;

    // Of two elements of one level the later one counts, and what stands in it; as that is visited
    // first, an element of another family does not replace one of its own level.
    INLINE void see(const Frame& frame, const Instance& one) {
        bool deeper = frame.depth > top.depth;
        if (deeper || (frame.depth == top.depth && family_ == top.family))
            top = {i64(one.index), one.number, frame.depth, family_};
    }

    void add_cells(const Frame& frame, const LaidGrid& laid) {
        const Grid& grid = laid.grid;
        double sx = cells_from_corner(grid, X, x_), sy = cells_from_corner(grid, Y, y_);
        i64 i = i64(sx), j = i64(sy);
        double in_x = sx - double(i), in_y = sy - double(j);
        if (!is_clear_of_edges(grid, in_x, in_y)) {
            auto at_x = locate_cell(x_, axis_of(grid, X), grid.local, frame.from[X]);
            auto at_y = locate_cell(y_, axis_of(grid, Y), grid.local, frame.from[Y]);
            i = at_x.cell, in_x = at_x.in, j = at_y.cell, in_y = at_y.in;
        }
        double aspect = frame.aspect * laid.aspect, leaf_x = 0.0, leaf_y = 0.0;
        u64 bin = u64(bin_of(grid, i, j));
        auto add = [&](u64 index, i64 cell_x, i64 cell_y, i64 which) {
            Instance one = copy_of<sloped>(field_, frame, index, which);
            one.element.cell[X] = u16(cell_x), one.element.cell[Y] = u16(cell_y);
            const Pose& square = field_.poses[one.element.pose];
            scale_in_cells(field_, frame, laid, square, one);
            Pose turned_pose;
            if (square.turned) turned_pose = cell_pose(square, aspect);
            const Pose& pose = square.turned ? turned_pose : square;
            const Element& element = one.element;
            const Kind& kind = field_.kinds[element.kind];
            UV at{in_x, in_y};
            if (pose.cells[X] > 1) at.u = min((double(i - cell_x) + in_x) / pose.size[X], 1.0);
            if (pose.cells[Y] > 1) at.v = min((double(j - cell_y) + in_y) / pose.size[Y], 1.0);
            if (element.grid) {
                stack_.frames.push_back(frame_within(frame, laid, aspect, pose, one));
                stack_.frames.back().from[X] = at.u, stack_.frames.back().from[Y] = at.v;
            }
            if (grid.leaves) at = turned(pose, in_x, in_y);
            else if (pose.turned) at = turned(pose, at.u, at.v);
            ShapePoint f;
            if (kind.special) {
                auto [holds, shape] =
                    special_shape(field_.curves, kind, element, pose, grid, at, x_, y_);
                if (!holds) return;
                f = shape;
            } else {
                if (is_beyond(at)) return;
                CurvePoint fx = even_curve(field_.curves.pieces, kind, X, at.u);
                CurvePoint fy = even_curve(field_.curves.pieces, kind, Y, at.v);
                f = {fx.value * fy.value, fx.slope * fy.value, fx.value * fy.slope};
            }
            z += element.scale * f.value + element.offset;
            see(frame, one);
            if constexpr (sloped) {
                auto [du, dv] = turned_slopes(pose, f.du, f.dv);
                if (grid.leaves) {
                    leaf_x += element.scale * du;
                    leaf_y += element.scale * dv;
                } else {
                    slope_x += element.scale * du * (grid.per[X] / pose.size[X]);
                    slope_y += element.scale * dv * (grid.per[Y] / pose.size[Y]);
                }
            }
        };
        for (u64 k = field_.offsets[bin], end = field_.offsets[bin + 1]; k < end; ++k) {
            u64 index = listed_element(field_, grid, k);
            const Element& element = field_.elements[index];
            i64 right = i - element.cell[X], above = j - element.cell[Y];
            const Pose& pose = field_.poses[element.pose];
            if (u32 copied = field_.shared.elements[index].copies) {
                const Copies& copies = field_.shared.copies[copied];
                auto over = [&](int axis, i64 offset) {
                    return copies_over(
                        offset, i64(pose.cells[axis]), copies.step[axis], copies.count[axis]
                    );
                };
                visit_copies(copies, over(X, right), over(Y, above), [&](i64 a, i64 b, i64 which) {
                    add(index, element.cell[X] + a * i64(copies.step[X]),
                        element.cell[Y] + b * i64(copies.step[Y]), which);
                });
            } else if (
                !grid.listed
                || (0 <= right && right < i64(pose.cells[X]) && 0 <= above
                    && above < i64(pose.cells[Y]))
            ) {
                add(index, element.cell[X], element.cell[Y], 0);
            }
        }
        if constexpr (sloped) {
            if (grid.leaves) {
                slope_x += leaf_x * grid.per[X];
                slope_y += leaf_y * grid.per[Y];
            }
        }
    }

    void add_free(const Frame& frame, const Grid& grid, u8 mirror) {
        const FreeBins& bins = field_.free_bins[grid.free];
        double from_x = from_parent(grid, X, x_, frame.from[X]);
        double from_y = from_parent(grid, Y, y_, frame.from[Y]);
        // bins are laid before mirroring
        double bin_x = mirror & 1 ? frame.length[X] - from_x : from_x;
        double bin_y = mirror & 2 ? frame.length[Y] - from_y : from_y;
        u64 bin =
            u64(grid.table + free_bin(bins, Y, bin_y) * i64(grid.row) + free_bin(bins, X, bin_x));
        for (u64 k = field_.offsets[bin], end = field_.offsets[bin + 1]; k < end; ++k) {
            u64 index = field_.entries[k];
            const Place& first = field_.places[i64(index) + bins.places];
            const Copies& copies = field_.shared.copies[field_.shared.elements[index].copies];
            auto [wide, tall] = free_span(field_.poses[field_.elements[index].pose], first);
            CopyRange across =
                copies_near(bin_x, first.at[X], wide + bins.slack, copies.step[X], copies.count[X]);
            CopyRange along =
                copies_near(bin_y, first.at[Y], tall + bins.slack, copies.step[Y], copies.count[Y]);
            visit_copies(copies, across, along, [&](i64 a, i64 b, i64 which) {
                Place place = place_of_copy(frame, mirror, first, copies, a, b);
                add_free_copy(frame, grid, bins.slack, place, {from_x, from_y}, index, which);
            });
        }
    }

    // As add_free of a field that is written out, of one element.
    INLINE void add_free_copy(
        const Frame& frame, const Grid& grid, double slack, const Place& place, UV from, u64 index,
        i64 which
    ) {
        const Pose& square = field_.poses[field_.elements[index].pose];
        u32 own_grid = field_.elements[index].grid;
        DescentPoint p{x_, y_, frame.from[X], frame.from[Y]};
        bool held = false;
        if (!square.turned || own_grid) {
            double depth = free_depth<false>(place, square, from);
            held = abs(depth) > slack ? depth > 0.0 : free_cell_holds(field_, grid, place, p);
            if (!held && !square.turned) return;
        }
        Instance one = copy_of<sloped>(field_, frame, index, which);
        scale_at_place(field_, frame, place, one);
        const Element& element = one.element;
        if (held && own_grid) {
            stack_.frames.push_back(frame_at(frame, grid, place, one));
            stack_.frames.back().from[X] = clamp(free_position(place, X, from.u), 0.0, 1.0);
            stack_.frames.back().from[Y] = clamp(free_position(place, Y, from.v), 0.0, 1.0);
        }
        if (square.turned && free_depth<true>(place, square, from) < -slack) return;
        const Kind& kind = field_.kinds[element.kind];
        UV at = free_place_in_shape(place, square, from);
        Pose pose = square.turned ? free_pose(square, place) : square;
        ShapePoint f;
        if (!kind.special) {
            if (square.turned && !free_leaf_holds(field_, grid, place, square, from, p)) return;
            CurvePoint fx = even_curve(field_.curves.pieces, kind, X, at.u);
            CurvePoint fy = even_curve(field_.curves.pieces, kind, Y, at.v);
            f = {fx.value * fy.value, fx.slope * fy.value, fx.value * fy.slope};
        } else {
            Grid own{};
            if (square.turned)
                at = turned(pose, free_position(place, X, from.u), free_position(place, Y, from.v));
            else if (kind.knotted[X] == STEPPED || kind.knotted[Y] == STEPPED)
                own = free_frame(grid, place);
            auto [holds, shape] =
                special_shape(field_.curves, kind, element, pose, own, at, p.x, p.y);
            if (!holds) return;
            f = shape;
        }
        z += element.scale * f.value + element.offset;
        see(frame, one);
        if constexpr (sloped) {
            UV slopes{f.du, f.dv};
            if (square.turned) slopes = turned_slopes(pose, f.du, f.dv);
            slope_x += element.scale * slopes.u * (1.0 / place.extent[X]);
            slope_y += element.scale * slopes.v * (1.0 / place.extent[Y]);
        }
    }
};

// Heights at points, of any field.
inline void any_heights(const Field& field, In x, In y, Out out) {
    if (!is_shared(field)) {
        heights(field, x, y, out);
        return;
    }
    SharedStack stack;
    for (std::size_t n = 0; n < x.size(); ++n) {
        out[n] = NaN;
        if (!is_inside(field.bounds, x[n], y[n])) continue;
        SharedDescent<false> found(field, x[n], y[n], stack);
        out[n] = settled(field, found.z, found.top.element, x[n], y[n]);
    }
}

// Everything at points of a shared field: as `samples` has it, and the `number` (n, 2) of the top
// element among all, the lower half first.
inline void shared_samples(
    const Field& field, In x, In y, Out height, Span<i64> top, Matrix<u64> number,
    Matrix<double> gradient
) {
    SharedStack stack;
    std::ranges::fill(height, NaN);
    std::ranges::fill(top, -2);
    gradient.fill(NaN), number.fill(0);
    for (std::size_t n = 0; n < x.size(); ++n) {
        if (!is_inside(field.bounds, x[n], y[n])) continue;
        SharedDescent<true> found(field, x[n], y[n], stack);
        i64 element = found.top.element;
        top[n] = element;
        number(n, 0) = found.top.number.low, number(n, 1) = found.top.number.high;
        if (is_void(field, element)) continue;
        Ground<true> ground(field, found.z, element, x[n], y[n]);
        height[n] = ground.z;
        if (ground.surface_track >= 0) top[n] = count_of(field.elements) + ground.surface_track;
        gradient(n, 0) = found.slope_x + ground.slope_x;
        gradient(n, 1) = found.slope_y + ground.slope_y;
    }
}

}  // namespace terratool
