// The descent of a field whose parts are shared.
//
// Such a field is a row of templates: what stands in an element of the text, once for all the
// places where that stands. The grids of a template have tables, but no place: where they lie is
// computed on the way down, by the functions that lay the grids of a field that is written out, and
// so are scales, turned poses and free places that a quarter turn mirrors. What is added, and in
// which order, is what the descent of the field that is written out adds: the bits are the same.
#pragma once

#include <memory>

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
        GridAxis whole = axis_of(field.grids[0], axis);
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
    const Frame& above, const Grid& grid, const ExactPlace& place, const Instance& one
) {
    Grid own = free_frame(grid, place);
    Frame frame;
    frame.grid = one.element.grid;
    for (int axis : {X, Y}) {
        auto [corner, rest] = edge_position(axis_of(own, axis), 0.0);
        frame.corner[axis] = corner, frame.rest[axis] = rest;
        frame.pitch[axis][0] = own.pitch[axis][0], frame.pitch[axis][1] = own.pitch[axis][1];
        frame.span[axis] = 1.0;
        frame.length[axis] = place.near.extent[axis];
    }
    frame.aspect = place.near.extent[Y] / place.near.extent[X];
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

// A place that was computed, and what its doubles lack.
struct KeptPlace {
    Place near, rest;

    ExactPlace exact() const { return {near, rest}; }
};

// The place of a copy of a free element, mirrored where a quarter turn mirrors what is around it.
INLINE KeptPlace place_of_copy(
    const Frame& frame, u8 mirror, const ExactPlace& first, const Copies& copies, i64 k_x, i64 k_y
) {
    KeptPlace place{first.near, first.rest};
    for (int axis : {X, Y}) {
        double &at = place.near.at[axis], &rest = place.rest.at[axis];
        auto put = [&](double near, double low) {
            auto [sum, lost] = exact_sum(near, low);
            at = sum, rest = lost;
        };
        double k = double(axis == X ? k_x : k_y);
        if (k != 0.0) {
            auto [sum, lost] = exact_sum(at, k * copies.pitch[axis][0]);
            put(sum, lost + (rest + k * copies.pitch[axis][1]));
        }
        if (mirror >> axis & 1) {
            auto [length, more] = exact_sum(
                frame.span[axis] * frame.pitch[axis][0], frame.span[axis] * frame.pitch[axis][1]
            );
            auto [sum, lost] = exact_sum(length, -at);
            put(sum, lost + (more - rest));
        }
    }
    return place;
}

// The elements of a grid of a template, from the first one on.
inline std::pair<u64, u64> elements_of(const Field& field, const Grid& grid) {
    i64 rows = ((i64(grid.count[Y]) - 1) >> grid.shift[Y]) + 1;
    if (grid.standing != IN_CELLS) rows = field.free_bins[grid.free].shape[Y];
    u64 begin = field.offsets[grid.table], end = field.offsets[grid.table + rows * i64(grid.row)];
    if (!grid.listed) return {begin, end};
    auto entries = field.entries.subspan(begin, end - begin);
    if (entries.empty()) return {0, 0};
    auto [first, last] = std::minmax_element(entries.begin(), entries.end());
    return {*first, u64(*last) + 1};
}

// The element that decides the surface at a point.
struct SharedTop {
    i64 element = NO_ELEMENT;
    Number number;
    i64 depth = -1, family = -1;
    ClassPixel pixel;  // where it has classes
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
    // pixel() is asked where it has classes.
    template <class Pixel> INLINE void see(const Frame& frame, const Instance& one, Pixel pixel) {
        bool deeper = frame.depth > top.depth;
        if (!deeper && (frame.depth < top.depth || family_ != top.family)) return;
        top = {i64(one.index), one.number, frame.depth, family_, {}};
        if (has_classes(field_.kinds[one.element.kind])) [[unlikely]]
            top.pixel = pixel();
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
            see(frame, one,
                [&] { return pixel_of(field_, i64(index), element, pose, grid, at, x_, y_); });
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
                KeptPlace place = place_of_copy(
                    frame, mirror, exact_place(field_, i64(index) + bins.places), copies, a, b
                );
                add_free_copy(
                    frame, grid, bins.slack, place.exact(), {from_x, from_y}, index, which
                );
            });
        }
    }

    // As add_free of a field that is written out, of one element.
    INLINE void add_free_copy(
        const Frame& frame, const Grid& grid, double slack, const ExactPlace& exact, UV from,
        u64 index, i64 which
    ) {
        const Place& place = exact.near;
        bool is_turned = field_.poses[field_.elements[index].pose].turned;
        u32 own_grid = field_.elements[index].grid;
        DescentPoint p{x_, y_, frame.from[X], frame.from[Y]};
        bool held = false;
        if (!is_turned || own_grid) {
            held = free_cell_is_met(field_, grid, exact, from, p, slack);
            if (!held && !is_turned) return;
        }
        Instance one = copy_of<sloped>(field_, frame, index, which);
        scale_at_place(field_, frame, place, one);
        const Element& element = one.element;
        if (held && own_grid) {
            stack_.frames.push_back(frame_at(frame, grid, exact, one));
            stack_.frames.back().from[X] = clamp(free_position(place, X, from.u), 0.0, 1.0);
            stack_.frames.back().from[Y] = clamp(free_position(place, Y, from.v), 0.0, 1.0);
        }
        auto [holds, f] = free_shape(field_, grid, element, exact, from, p, slack);
        if (!holds) return;
        z += element.scale * f.value + element.offset;
        see(frame, one, [&] { return free_pixel(field_, grid, i64(index), exact, from, p); });
        if constexpr (sloped) {
            slope_x += element.scale * f.du * (1.0 / place.extent[X]);
            slope_y += element.scale * f.dv * (1.0 / place.extent[Y]);
        }
    }
};

// World rectangles of the cells of all elements of a shared field into `out`, (4, n): west, south,
// east, north. They come in no order that means anything.
inline void shared_rectangles(const Field& field, Matrix<double> out) {
    LaidGrids grids;
    std::vector<Frame> waiting{terrain_frame(field)};
    i64 next = 0;
    auto put = [&](const Grid& grid, const std::array<Block, 2>& block) {
        HARD_CHECK(next < out.columns());
        for (int axis : {X, Y}) {
            auto [cell, width] = block[axis];
            out(axis, next) = edge_double(axis_of(grid, axis), cell);
            out(axis + 2, next) = edge_double(axis_of(grid, axis), cell + width);
        }
        ++next;
    };
    while (!waiting.empty() && next < out.columns()) {
        Frame frame = waiting.back();
        waiting.pop_back();
        for (u64 g = frame.grid;; ++g) {
            LaidGrid laid = grids.lay(field, frame, g);
            const Grid& grid = laid.grid;
            auto [first, last] = elements_of(field, grid);
            for (u64 index = first; index < last; ++index) {
                const Pose& square = field.poses[field.elements[index].pose];
                const Copies& copies = field.shared.copies[field.shared.elements[index].copies];
                CopyRange across{0, i64(copies.count[X]) - 1}, along{0, i64(copies.count[Y]) - 1};
                visit_copies(copies, across, along, [&](i64 a, i64 b, i64 which) {
                    if (next == out.columns()) return;
                    Instance one = copy_of(field, frame, index, which);
                    if (square.free) {
                        KeptPlace place = place_of_copy(
                            frame, field.shared.mirrors[g],
                            exact_place(field, place_of(one.element)), copies, a, b
                        );
                        put(free_frame(grid, place.exact()), ONE_CELL);
                        if (one.element.grid)
                            waiting.push_back(frame_at(frame, grid, place.exact(), one));
                        return;
                    }
                    one.element.cell[X] = u16(one.element.cell[X] + a * i64(copies.step[X]));
                    one.element.cell[Y] = u16(one.element.cell[Y] + b * i64(copies.step[Y]));
                    put(grid, {block_of(one.element, square, X), block_of(one.element, square, Y)});
                    double aspect = frame.aspect * laid.aspect;
                    if (one.element.grid)
                        waiting.push_back(frame_within(frame, laid, aspect, square, one));
                });
            }
            if (!grid.more) break;
        }
    }
}

// Low and high ends of what an element and all its copies take along an axis, in its grid.
inline std::array<double, 2> taken_along(const Field& field, u64 index, int axis) {
    const Element& element = field.elements[index];
    const Pose& pose = field.poses[element.pose];
    const Copies& copies = field.shared.copies[field.shared.elements[index].copies];
    double far = (double(copies.count[axis]) - 1.0) * copies.step[axis];
    double low = double(element.cell[axis]), high = low + pose.size[axis];
    if (pose.free) {
        const Place& place = field.places[place_of(element)];
        double reach = free_span(pose, place)[axis];
        low = place.at[axis] - reach, high = place.at[axis] + reach;
    }
    return {low + min(far, 0.0), high + max(far, 0.0)};
}

// How many copies of an element lie over one point at most.
inline double copies_over_point(const Field& field, u64 index) {
    const Element& element = field.elements[index];
    const Pose& pose = field.poses[element.pose];
    const Copies& copies = field.shared.copies[field.shared.elements[index].copies];
    double over = 1.0;
    for (int axis : {X, Y}) {
        double wide = pose.size[axis];
        if (pose.free) wide = 2.0 * free_span(pose, field.places[place_of(element)])[axis];
        double most = double(copies.count[axis]), step = abs(copies.step[axis]);
        over *= step > 0.0 ? min(ceil(wide / step) + double(pose.free), most) : most;
    }
    return over;
}

// No less than the elements that lie over any one point of a shared field.
inline double most_over_point(const Field& field) {
    constexpr u64 few = 64;  // entries of a bin that are compared with each other
    std::vector<double> inside(field.grids.size() + 1, 0.0);  // of a grid and those that follow it
    for (i64 g = count_of(field.grids) - 1; g >= 0; --g) {
        const Grid& grid = field.grids[g];
        bool free = grid.standing != IN_CELLS;
        i64 rows = ((i64(grid.count[Y]) - 1) >> grid.shift[Y]) + 1;
        if (free) rows = field.free_bins[grid.free].shape[Y];
        double most = 0.0;
        std::vector<double> weights;
        for (i64 bin = grid.table; bin < grid.table + rows * i64(grid.row); ++bin) {
            u64 begin = field.offsets[bin], end = field.offsets[bin + 1];
            weights.clear();
            double all = 0.0;
            for (u64 k = begin; k < end; ++k) {
                u64 index = listed_element(field, grid, k);
                u32 below = field.elements[index].grid;
                double each = 1.0 + (below ? inside[below] : 0.0);
                weights.push_back(copies_over_point(field, index) * each);
                all += weights.back();
            }
            if (grid.listed && end - begin <= few) {
                double met = 0.0;
                for (u64 k = begin; k < end; ++k) {
                    double own = 0.0;
                    for (u64 n = begin; n < end; ++n) {
                        bool meet = true;
                        for (int axis : {X, Y}) {
                            auto [low, high] = taken_along(field, field.entries[k], axis);
                            auto [from, to] = taken_along(field, field.entries[n], axis);
                            meet = meet && low < to && from < high;
                        }
                        if (meet) own += weights[n - begin];
                    }
                    met = max(met, own);
                }
                all = met;
            }
            most = max(most, all);
        }
        inside[g] = most + (grid.more ? inside[g + 1] : 0.0);
    }
    return inside[0];
}

// Finds the elements at a batch of points of a shared field. Points that are in the same element,
// all of them in one size of cell, go down together: what differs between them is in columns, and
// the loops over these are vectors. Points near an edge, those with several elements over them, and
// what is rare go through a descent of their own.
class SharedBatch {
public:
    static constexpr i64 most = 256;  // points

    explicit SharedBatch(const Field& field) : field_(field) {
        for (double bound : field.bounds) farthest_ = max(farthest_, abs(bound));
        farthest_ *= 1.0 + 1e-9;
    }

    // Heights of the elements at points, and the elements that decide the surface; NaN outside.
    void find(In x, In y, Out height, Span<i64> top) {
        height_ = height, found_ = top;
        i64 count = 0;
        for (i64 n = 0; n < count_of(x); ++n) {
            height[n] = NaN, top[n] = NO_ELEMENT;
            if (!is_inside(field_.bounds, x[n], y[n])) continue;
            world_[X][count] = x[n], world_[Y][count] = y[n];
            z_[count] = 0.0, top_[count] = NO_ELEMENT, point_[count] = u32(n);
            ++count;
        }
        Frame frame = terrain_frame(field_);
        for (int axis : {X, Y}) {
            std::fill_n(corner_[axis].begin(), count, frame.corner[axis]);
            std::fill_n(rest_[axis].begin(), count, frame.rest[axis]);
        }
        descend(frame, 0, count);
    }

private:
    using Column = std::array<double, most>;
    static constexpr i64 few = 4;       // points that do not go together
    static constexpr i64 deepest = 64;  // levels that they go together
    const Field& field_;
    SharedStack stack_;
    double farthest_ = 0.0;
    Out height_;
    Span<i64> found_;
    // of each point: its place, the corner of the cell that it is in, cell and place in the grid,
    // and the first cell of the element
    Column world_[2], corner_[2], rest_[2], cell_[2], part_[2], first_[2], z_, value_[2], work_;
    std::array<i64, most> top_;
    std::array<u32, most> point_, element_, order_;

    // By a descent of its own.
    void complete(i64 n) {
        SharedDescent<false> found(field_, world_[X][n], world_[Y][n], stack_);
        height_[point_[n]] = found.z, found_[point_[n]] = found.top.element;
    }

    // All elements of a point are known.
    INLINE void settle(i64 n) { height_[point_[n]] = z_[n], found_[point_[n]] = top_[n]; }

    INLINE void move(i64 from, i64 to) {
        if (from == to) return;
        for (int axis : {X, Y}) {
            world_[axis][to] = world_[axis][from];
            corner_[axis][to] = corner_[axis][from], rest_[axis][to] = rest_[axis][from];
            cell_[axis][to] = cell_[axis][from], part_[axis][to] = part_[axis][from];
            first_[axis][to] = first_[axis][from];
        }
        z_[to] = z_[from], top_[to] = top_[from];
        point_[to] = point_[from], element_[to] = element_[from];
    }

    void descend(Frame frame, i64 begin, i64 end) {
        while (begin < end) {
            for (int axis : {X, Y})
                frame.corner[axis] = corner_[axis][begin], frame.rest[axis] = rest_[axis][begin];
            LaidGrid laid = stack_.laid.lay(field_, frame, frame.grid);
            const Grid& grid = laid.grid;
            double spacing = std::numeric_limits<double>::epsilon() * farthest_;
            // no grid of this size is finer than doubles, wherever it is in the terrain
            bool coarse = min(laid.side[X], laid.side[Y]) > 16.0 * spacing;
            if (!coarse || grid.local || grid.standing != IN_CELLS || grid.more
                || frame.depth > deepest || end - begin < few) {
                for (i64 n = begin; n < end; ++n) complete(n);
                return;
            }
            for (int axis : {X, Y}) locate(laid, axis, begin, end);
            double clear[2];
            for (int axis : {X, Y}) clear[axis] = 0.5 - max(EDGE, spacing * laid.per[axis]);
            auto [kept, same] = keep_together(grid, clear, begin, end);
            if (!same) {
                descend_apart(frame, laid, begin, kept);
                return;
            }
            end = kept;
            if (begin < end && !add(frame, laid, begin, end)) return;
        }
    }

    void locate(const LaidGrid& laid, int axis, i64 begin, i64 end) {
        double per = laid.per[axis];
        const auto &x = world_[axis], &corner = corner_[axis], &rest = rest_[axis];
        auto &cell = cell_[axis], &part = part_[axis];
        for (i64 n = begin; n < end; ++n) {  // vectorised
            double s = ((x[n] - corner[n]) - rest[n]) * per;
            double below = quick_floor(s);
            cell[n] = below, part[n] = s - below;
        }
    }

    struct Kept {
        i64 end;
        bool same;  // all in one element
    };

    // The only element of a grid of which each cell has one copy; -1 if it is none such.
    i64 fills(const Grid& grid) const {
        constexpr i64 few_bins = 128;
        i64 bins = i64(grid.row) * (((i64(grid.count[Y]) - 1) >> grid.shift[Y]) + 1);
        if (bins > few_bins) return -1;
        u64 index = 0;
        for (i64 bin = grid.table; bin < grid.table + bins; ++bin) {
            u32 first = field_.offsets[bin], last = field_.offsets[bin + 1];
            if (last - first != 1) return -1;
            u64 here = listed_element(field_, grid, first);
            if (bin > grid.table && here != index) return -1;
            index = here;
        }
        const Element& element = field_.elements[index];
        const Pose& pose = field_.poses[element.pose];
        const Copies& copies = field_.shared.copies[field_.shared.elements[index].copies];
        for (int axis : {X, Y}) {
            double count = grid.count[axis], step = copies.step[axis];
            bool every = double(copies.count[axis]) == count && pose.cells[axis] == 1;
            bool from_west = element.cell[axis] == 0 && (step == 1.0 || count == 1.0);
            bool from_east = double(element.cell[axis]) == count - 1.0 && step == -1.0;
            if (!every || !(from_west || from_east)) return -1;
        }
        return i64(index);
    }

    // Whether a point is in a cell of a grid, clear of its edges.
    INLINE bool is_good(const Grid& grid, const double (&clear)[2], i64 n) const {
        return (abs(part_[X][n] - 0.5) <= clear[X]) & (abs(part_[Y][n] - 0.5) <= clear[Y])
            & (cell_[X][n] >= 0.0) & (cell_[X][n] < grid.count[X]) & (cell_[Y][n] >= 0.0)
            & (cell_[Y][n] < grid.count[Y]);
    }

    // Keep the points that are in one element; the others are complete then.
    Kept keep_together(const Grid& grid, const double (&clear)[2], i64 begin, i64 end) {
        i64 kept = begin, whole = fills(grid);
        bool same = true;
        if (whole >= 0) {
            i64 good = 0;
            for (i64 n = begin; n < end; ++n) good += is_good(grid, clear, n);  // vectorised
            if (good == end - begin) {
                for (int axis : {X, Y})
                    std::copy_n(&cell_[axis][begin], good, &first_[axis][begin]);
                std::fill_n(&element_[begin], good, u32(whole));
                return {end, true};
            }
        }
        for (i64 n = begin; n < end; ++n) {
            if (!is_good(grid, clear, n)) {
                complete(n);
                continue;
            }
            if (whole >= 0) {
                first_[X][n] = cell_[X][n], first_[Y][n] = cell_[Y][n], element_[n] = u32(whole);
                move(n, kept++);
                continue;
            }
            i64 i = i64(cell_[X][n]), j = i64(cell_[Y][n]);
            u64 bin = u64(bin_of(grid, i, j));
            u32 first = field_.offsets[bin], count = field_.offsets[bin + 1] - first;
            if (count > 1) {
                complete(n);
                continue;
            }
            if (count == 0) {
                settle(n);
                continue;
            }
            u64 index = listed_element(field_, grid, first);
            const Element& element = field_.elements[index];
            const Pose& pose = field_.poses[element.pose];
            i64 at_x = element.cell[X], at_y = element.cell[Y];
            if (u32 copied = field_.shared.elements[index].copies) {
                const Copies& copies = field_.shared.copies[copied];
                auto [low, high] =
                    copies_over(i - at_x, i64(pose.cells[X]), copies.step[X], copies.count[X]);
                auto [down, up] =
                    copies_over(j - at_y, i64(pose.cells[Y]), copies.step[Y], copies.count[Y]);
                if (low > high || down > up) {
                    settle(n);
                    continue;
                }
                if (low < high || down < up) {
                    complete(n);
                    continue;
                }
                at_x += low * i64(copies.step[X]), at_y += down * i64(copies.step[Y]);
            } else if (
                i < at_x || j < at_y || i >= at_x + i64(pose.cells[X])
                || j >= at_y + i64(pose.cells[Y])
            ) {
                settle(n);
                continue;
            }
            first_[X][n] = double(at_x), first_[Y][n] = double(at_y), element_[n] = u32(index);
            move(n, kept);
            same = same && element_[kept] == element_[begin];
            ++kept;
        }
        return {kept, same};
    }

    // Go down with the points of each element.
    void descend_apart(const Frame& frame, const LaidGrid& laid, i64 begin, i64 end) {
        auto order = Span<u32>(order_).subspan(begin, end - begin);
        for (i64 n = begin; n < end; ++n) order[n - begin] = u32(n);
        std::sort(order.begin(), order.end(), [&](u32 a, u32 b) {
            return element_[a] < element_[b] || (element_[a] == element_[b] && a < b);
        });
        auto sort = [&](auto& column) {
            std::array<typename std::decay_t<decltype(column)>::value_type, most> sorted;
            for (i64 n = 0; n < end - begin; ++n) sorted[n] = column[order[n]];
            std::copy_n(sorted.begin(), end - begin, column.begin() + begin);
        };
        for (int axis : {X, Y}) {
            sort(world_[axis]), sort(corner_[axis]), sort(rest_[axis]);
            sort(cell_[axis]), sort(part_[axis]), sort(first_[axis]);
        }
        sort(z_), sort(top_), sort(point_), sort(element_);
        for (i64 last = begin; begin < end; begin = last) {
            while (last < end && element_[last] == element_[begin]) ++last;
            if (last - begin < few) {
                for (i64 n = begin; n < last; ++n) complete(n);
            } else {
                Frame below = frame;
                if (add(below, laid, begin, last)) descend(below, begin, last);
            }
        }
    }

    // Add the element of some points to their heights; whether they go on, in the frame then.
    bool add(Frame& frame, const LaidGrid& laid, i64 begin, i64 end) {
        const Grid& grid = laid.grid;
        Instance one = copy_of<false>(field_, frame, element_[begin], 0);
        const Element& element = one.element;
        const Kind& kind = field_.kinds[element.kind];
        const Pose& square = field_.poses[element.pose];
        if (kind.special) {
            for (i64 n = begin; n < end; ++n) complete(n);
            return false;
        }
        scale_in_cells(field_, frame, laid, square, one);
        double aspect = frame.aspect * laid.aspect;
        Pose pose = cell_pose(square, aspect);
        for (int axis : {X, Y}) {
            if (pose.cells[axis] == 1) continue;
            for (i64 n = begin; n < end; ++n) {
                double within = (cell_[axis][n] - first_[axis][n]) + part_[axis][n];
                part_[axis][n] = min(within / pose.size[axis], 1.0);
            }
        }
        In pieces = field_.curves.pieces;
        double scale = element.scale, offset = element.offset;
        if (pose.turned) {
            for (i64 n = begin; n < end; ++n) {  // vectorised
                UV at = turned(pose, part_[X][n], part_[Y][n]);
                part_[X][n] = at.u, part_[Y][n] = at.v;
            }
        } else if (grid.leaves) {  // they are turned by nothing, which rounds
            for (int axis : {X, Y})
                for (i64 n = begin; n < end; ++n) part_[axis][n] = 0.5 + (part_[axis][n] - 0.5);
        }
        for (int axis : {X, Y}) {
            auto of = [&](Column& column) { return Out(column).subspan(begin, end - begin); };
            even_values(pieces, kind, axis, of(part_[axis]), of(work_), of(value_[axis]));
        }
        for (i64 n = begin; n < end; ++n) {  // vectorised
            bool beyond = is_beyond({part_[X][n], part_[Y][n]});
            double more = scale * (value_[X][n] * value_[Y][n]) + offset;
            z_[n] += beyond ? -0.0 : more;  // what leaves every height as it is, -0 too
            top_[n] = beyond ? top_[n] : i64(one.index);
        }
        if (!element.grid) {
            for (i64 n = begin; n < end; ++n) settle(n);
            return false;
        }
        for (int axis : {X, Y}) {
            auto &corner = corner_[axis], &rest = rest_[axis], &first = first_[axis];
            double pitch = grid.pitch[axis][0], pitch_rest = grid.pitch[axis][1];
            double zero = grid.zero[axis];
            for (i64 n = begin; n < end; ++n) {  // vectorised
                GridAxis above{corner[n], rest[n], 0.0, 0.0, 0.0, pitch, pitch_rest, zero};
                auto [high, low] = edge_position(above, first[n]);
                corner[n] = high, rest[n] = low;
            }
        }
        frame = frame_within(frame, laid, aspect, pose, one);
        return true;
    }
};

// Heights at points, of any field.
inline void any_heights(const Field& field, In x, In y, Out out) {
    if (!is_shared(field)) {
        heights(field, x, y, out);
        return;
    }
    auto batch = std::make_unique<SharedBatch>(field);
    std::array<i64, SharedBatch::most> top;
    SharedStack stack;
    auto worn_at = [&](i64 element, double x, double y) {
        if (!is_classed(field, element)) return worn_of(field, element, {});
        SharedDescent<false> found(field, x, y, stack);
        return worn_of(field, found.top.element, found.top.pixel);
    };
    for (std::size_t begin = 0; begin < x.size(); begin += SharedBatch::most) {
        std::size_t count = min(std::size_t(SharedBatch::most), x.size() - begin);
        In xs = x.subspan(begin, count), ys = y.subspan(begin, count);
        Out zs = out.subspan(begin, count);
        batch->find(xs, ys, zs, top);
        if (!surfaces_matter(field)) continue;
        for (std::size_t n = 0; n < count; ++n) {
            if (isnan(zs[n])) continue;
            zs[n] = settled(field, zs[n], worn_at(top[n], xs[n], ys[n]), xs[n], ys[n]);
        }
    }
}

// Everything at points of a shared field: as `samples` has it, and the `number` (n, 2) of the top
// element among all, the lower half first.
inline void shared_samples(
    const Field& field, In x, In y, Out height, Span<i64> top, Span<i32> surface,
    Matrix<u64> number, Matrix<double> gradient
) {
    SharedStack stack;
    std::ranges::fill(height, NaN);
    std::ranges::fill(top, -2);
    std::ranges::fill(surface, -1);
    gradient.fill(NaN), number.fill(0);
    for (std::size_t n = 0; n < x.size(); ++n) {
        if (!is_inside(field.bounds, x[n], y[n])) continue;
        SharedDescent<true> found(field, x[n], y[n], stack);
        i64 element = found.top.element;
        top[n] = element;
        number(n, 0) = found.top.number.low, number(n, 1) = found.top.number.high;
        Worn worn = worn_of(field, element, found.top.pixel);
        surface[n] = i32(worn.surface);
        if (worn.is_void) continue;
        Ground<true> ground(field, found.z, worn.surface, x[n], y[n]);
        height[n] = ground.z, surface[n] = i32(ground.surface);
        if (ground.surface_track >= 0) top[n] = count_of(field.elements) + ground.surface_track;
        gradient(n, 0) = found.slope_x + ground.slope_x;
        gradient(n, 1) = found.slope_y + ground.slope_y;
    }
}

}  // namespace terratool
