// Painting: the elements of a field over the pixels of a window, each over all its pixels at once.
//
// A window is painted in tiles that stay in the cache. In a tile, grids are visited breadth first,
// and the elements of a grid are painted in the order of the field; so of the elements over a pixel
// the last one painted is the one that decides the surface, as in the descent.
//
// Which cell of a grid a column or a row of pixels lies in is settled by `locate_cell`, as in the
// descent, once for each column and row of pixels of the grid. Grids finer than doubles are left to
// the descent.
#pragma once

#include "raster_painting.hpp"
#include "relief_painting.hpp"
#include "track_painting.hpp"

namespace terratool {

// Runs of the same bin among `cell[begin:end]` into `runs`; their number.
template <std::size_t n, std::size_t m>
i64 find_runs(
    const std::array<double, n>& cell, i64 begin, i64 end, u8 shift, std::array<BinRun, m>& runs
) {
    i64 count = 0;
    for (i64 k = begin; k < end;) {
        i64 bin = i64(cell[k]) >> shift;
        runs[count++] = {k, bin};
        for (++k; k < end && i64(cell[k]) >> shift == bin;) ++k;
    }
    runs[count].begin = end;
    return count;
}

// Narrow `begin` and `end` of ascending cells to those in a block.
template <std::size_t n>
void narrow_to(const std::array<double, n>& cell, i64& begin, i64& end, Block block) {
    while (begin < end && cell[begin] < block.cell) ++begin;
    while (end > begin && cell[end - 1] >= block.cell + block.width) --end;
}

// Begin and end of the ascending coordinates from `low` to `high`.
inline Run inside_bounds(In x, double low, double high) {
    i64 begin = 0, end = count_of(x);
    while (begin < end && x[begin] < low) ++begin;
    while (end > begin && x[end - 1] > high) --end;
    return {begin, end};
}

// Add an unturned element that fills its block of cells.
template <class Id>
void paint_block(
    const Field& field, Canvas<Id>& canvas, const Painted& p, const BlockPixels& pixels
) {
    if (p.kind.combine == GRID) return paint_raster(field, canvas, p, pixels);
    const Rectangle& part = pixels.part;
    Out fx = part_of(canvas.fx, part.west, part.east),
        fy = part_of(canvas.fy, part.south, part.north);
    placed_values(field.curves, p, X, pixels.u, pixels.x, fx);
    placed_values(field.curves, p, Y, pixels.v, pixels.y, fy);
    bool lay = p.index == 0 && p.kind.combine == PRODUCT;
    double scale = p.element.scale, offset = p.element.offset;
    for (i64 r = part.south; r < part.north; ++r) {
        double factor = fy[r - part.south];
        Out row = canvas.heights.row(r, part.west, part.east);
        if (lay) lay_products(row, fx, scale * factor, offset);
        else add_row(p.kind.combine, row, fx, factor, scale, offset);
    }
    if (canvas.slope_x.exists()) slope_block(field, canvas, p, pixels, lay);
    wear_block(field, canvas, p, pixels);
    if (canvas.labels.exists()) label_block(field, canvas, p, pixels);
}

// Add a turned or radial element of any kind to a run of pixels that it holds.
template <class Id>
void add_special(
    const Field& field, Canvas<Id>& canvas, const Painted& p, In u, double v, Out row
) {
    i64 count = count_of(row);
    Out s = part_of(canvas.work_0, 0, count), t = part_of(canvas.work_1, 0, count);
    Out fx = part_of(canvas.fx, 0, count), fy = part_of(canvas.work_2, 0, count);
    double scale = p.element.scale, offset = p.element.offset;
    if (p.kind.combine == RADIAL) {
        radii(p.pose, u, v, s);
        curve_values(field.curves, curve_of(p.kind, X), s, fx);
        add_products(row, fx, scale, offset);
    } else if (p.kind.combine == GRID) {
        RasterAt raster(field.curves, p.kind);
        for (i64 n = 0; n < count; ++n)
            row[n] += scale * raster.at(turned(p.pose, u[n], v)).value + offset;
    } else {
        turn_row(p.pose, u, v, s, t);
        curve_values(field.curves, curve_of(p.kind, Y), t, fy);
        curve_values(field.curves, curve_of(p.kind, X), s, fx);
        add_both(p.kind.combine, row, fx, fy, scale, offset);
    }
}

// Add a turned or radial element, row by row where its footprint holds the pixels.
template <class Id>
void paint_runs(
    const Field& field, Canvas<Id>& canvas, const Painted& p, In u, In v, double resolution,
    const Rectangle& part
) {
    // turned curves that change their pieces less often than this per pixel are added by pieces
    constexpr double seldom = 1.0 / 12.0;
    const auto& [index, element, kind, pose, grid] = p;
    In pieces = field.curves.pieces;
    double step = resolution * grid.per[X] / pose.size[X];
    double per = step > 0.0 ? 1.0 / step : 0.0;
    Spacing spacing{per, 4.0 * per * (grid.near[X] / pose.size[X])};
    bool flat_x = is_constant(pieces, kind.pieces[X][0], kind.count[X]);
    bool flat_y = is_constant(pieces, kind.pieces[Y][0], kind.count[Y]);
    bool level = flat_x && flat_y && !kind.special;
    double changes = flat_x ? 0.0 : abs(pose.cos) * kind.count[X];
    changes += flat_y ? 0.0 : abs(pose.sin_u) * kind.count[Y];
    double constant = 0.0;
    if (level) {
        auto value = [&](int axis) { return stored_piece(pieces, kind.pieces[axis][0]).c0; };
        constant = element.offset + element.scale * (value(X) * value(Y));
    }
    for (i64 r = part.south; r < part.north; ++r) {
        double at = v[r - part.south];
        auto [begin, end, whole] = kind.combine == RADIAL ? disc_run(pose, u, at, spacing)
                                                          : turned_run(pose, u, at, spacing);
        for (i64 stop; begin < end; begin = stop) {
            stop = whole ? end : begin + 1;
            if (!whole && !is_in_disc(pose, u[begin], at)) continue;
            In run = u.subspan(begin, stop - begin);
            i64 column = part.west + begin;
            Out row = canvas.heights.row(r, column, part.west + stop);
            wear_run(field, canvas, p, run, at, r, column);
            if (kind.special) add_special(field, canvas, p, run, at, row);
            else if (level) add_constant(row, constant);
            else if (changes * step < seldom) add_turned_pieces(row, run, at, step, pieces, p);
            else if (kind.count[X] <= 2.0 && kind.count[Y] <= 2.0)
                add_turned_pairs(row, run, at, pieces, p);
            else add_turned_products(row, run, at, pieces, p);
            if (canvas.slope_x.exists() && !level) slope_run(field, canvas, p, run, at, r, column);
            if (canvas.labels.exists()) label_run(field, canvas, p, run, at, r, column);
        }
    }
}

// Paint one element in cells over pixels that its block holds.
template <class Id>
void paint_held(
    const Field& field, Canvas<Id>& canvas, const Painted& painted, In x, In y, double resolution,
    const Rectangle& part
) {
    const Pose& pose = painted.pose;
    bool spans = painted.grid.listed && (pose.cells[X] > 1 || pose.cells[Y] > 1);
    if (spans) {
        place_in_block(
            part_of(canvas.cell_x, part.west, part.east),
            part_of(canvas.in_x, part.west, part.east), block_of(painted.element, pose, X),
            part_of(canvas.u, part.west, part.east)
        );
        place_in_block(
            part_of(canvas.cell_y, part.south, part.north),
            part_of(canvas.in_y, part.south, part.north), block_of(painted.element, pose, Y),
            part_of(canvas.v, part.south, part.north)
        );
    }
    In u = part_of(spans ? canvas.u : canvas.in_x, part.west, part.east);
    In v = part_of(spans ? canvas.v : canvas.in_y, part.south, part.north);
    if (pose.turned || painted.kind.combine == RADIAL) {
        paint_runs(field, canvas, painted, u, v, resolution, part);
    } else {
        In xs = x.subspan(part.west, u.size()), ys = y.subspan(part.south, v.size());
        paint_block(field, canvas, painted, {u, v, xs, ys, part});
    }
}

// Paint one element where its block of cells meets the given pixels; returns these.
template <class Id>
Rectangle paint_element(
    const Field& field, Canvas<Id>& canvas, i64 index, const Grid& grid, In x, In y,
    double resolution, Rectangle part
) {
    const Element& element = field.elements[index];
    Painted painted{index, element, field.kinds[element.kind], field.poses[element.pose], grid};
    if (grid.listed) {
        narrow_to(canvas.cell_x, part.west, part.east, block_of(element, painted.pose, X));
        narrow_to(canvas.cell_y, part.south, part.north, block_of(element, painted.pose, Y));
        if (part.is_empty()) return {part.west, part.west, part.south, part.south};
    }
    paint_held(field, canvas, painted, x, y, resolution, part);
    return part;
}

// Columns or rows of ascending coordinates that the cell of a free place holds.
inline BinRange held_by_cell(In x, const GridAxis& cell, double terrain_end) {
    double low = edge_double(cell, 0.0), high = edge_double(cell, 1.0);
    auto begin = std::lower_bound(x.begin(), x.end(), low);
    auto end = high >= terrain_end ? std::upper_bound(begin, x.end(), high)
                                   : std::lower_bound(begin, x.end(), high);
    return {begin - x.begin(), end - x.begin()};
}

// A free element where it stands, and the grid that it is in.
struct FreePainted {
    i64 index;
    const Element& element;
    ExactPlace exact;
    const Grid& grid;
};

// Paint one free element; returns the pixels that its cell holds.
template <class Id>
Rectangle paint_free_element(
    const Field& field, Canvas<Id>& canvas, const FreePainted& one, In x, In y, double resolution,
    const Rectangle& part
) {
    const auto& [index, element, exact, grid] = one;
    const Place& place = exact.near;
    const Pose& square = field.poses[element.pose];
    Grid frame = free_frame(grid, exact);
    Pose pose = free_pose(square, place);
    Painted painted{index, element, field.kinds[element.kind], pose, frame};
    In own_x = x.subspan(part.west, part.east - part.west);
    In own_y = y.subspan(part.south, part.north - part.south);
    auto columns = held_by_cell(own_x, axis_of(frame, X), field.bounds[2]);
    auto rows = held_by_cell(own_y, axis_of(frame, Y), field.bounds[3]);
    Rectangle held{
        part.west + columns.first, part.west + columns.last, part.south + rows.first,
        part.south + rows.last
    };
    Rectangle around = held;
    if (pose.turned) {  // it may reach beyond its cell
        auto [wide, tall] = free_reach(square, place);
        auto near = [](In at, double middle, double reach) {
            auto begin = std::lower_bound(at.begin(), at.end(), middle - reach);
            return BinRange{
                begin - at.begin(), std::upper_bound(begin, at.end(), middle + reach) - at.begin()
            };
        };
        double slack = field.free_bins[grid.free].slack;
        columns = near(own_x, grid.corner[X][0] + place.at[X], wide + slack);
        rows = near(own_y, grid.corner[Y][0] + place.at[Y], tall + slack);
        around = {
            part.west + columns.first, part.west + columns.last, part.south + rows.first,
            part.south + rows.last
        };
    }
    if (around.is_empty()) return held;
    auto position = [&](In at, int axis, Out out) {
        for (std::size_t n = 0; n < at.size(); ++n) {
            double u = free_position(place, axis, from_parent(grid, axis, at[n], 0.0));
            out[n] = pose.turned ? u : clamp(u, 0.0, 1.0);
        }
    };
    In xs = x.subspan(around.west, around.east - around.west);
    In ys = y.subspan(around.south, around.north - around.south);
    Out u = part_of(canvas.u, around.west, around.east);
    Out v = part_of(canvas.v, around.south, around.north);
    position(xs, X, u), position(ys, Y, v);
    if (pose.turned || painted.kind.combine == RADIAL)
        paint_runs(field, canvas, painted, u, v, resolution, around);
    else paint_block(field, canvas, painted, {u, v, xs, ys, around});
    return held;
}

// Paint the elements of a free grid, in their order; below(index, pixels) is called with the pixels
// that the cell of each holds.
template <class Id, class Below>
void paint_free(
    const Field& field, Canvas<Id>& canvas, const Grid& grid, In x, In y, double resolution,
    const Rectangle& part, Below below
) {
    const FreeBins& bins = field.free_bins[grid.free];
    auto met = [&](In at, int axis, i64 begin, i64 end) {
        return free_bins_met(
            bins, axis, from_parent(grid, axis, at[begin], 0.0),
            from_parent(grid, axis, at[end - 1], 0.0)
        );
    };
    BinRange across = met(x, X, part.west, part.east), along = met(y, Y, part.south, part.north);
    find_free(field, grid, across, along, canvas.found);
    for (u32 index : canvas.found) {
        const Element& element = field.elements[index];
        FreePainted one{index, element, exact_place(field, place_of(element)), grid};
        below(index, paint_free_element(field, canvas, one, x, y, resolution, part));
    }
}

// Paint the elements of a grid in cells, bin by bin; likewise.
template <class Id, class Below>
void paint_cells(
    const Field& field, Canvas<Id>& canvas, const Grid& grid, In x, In y, double resolution,
    const Rectangle& part, Below below
) {
    auto [west, east, south, north] = part;
    locate_cells(
        x.subspan(west, east - west), axis_of(grid, X), part_of(canvas.cell_x, west, east),
        part_of(canvas.in_x, west, east)
    );
    locate_cells(
        y.subspan(south, north - south), axis_of(grid, Y), part_of(canvas.cell_y, south, north),
        part_of(canvas.in_y, south, north)
    );
    i64 across = find_runs(canvas.cell_x, west, east, grid.shift[X], canvas.runs_x);
    i64 along = find_runs(canvas.cell_y, south, north, grid.shift[Y], canvas.runs_y);
    for (i64 j = 0; j < along; ++j) {
        for (i64 i = 0; i < across; ++i) {
            i64 slot = grid.table + canvas.runs_y[j].bin * i64(grid.row) + canvas.runs_x[i].bin;
            Rectangle in_bin{
                canvas.runs_x[i].begin, canvas.runs_x[i + 1].begin, canvas.runs_y[j].begin,
                canvas.runs_y[j + 1].begin
            };
            for (u32 k = field.offsets[slot]; k < field.offsets[slot + 1]; ++k) {
                i64 index = i64(listed_element(field, grid, k));
                below(index, paint_element(field, canvas, index, grid, x, y, resolution, in_bin));
            }
        }
    }
}

// Whether one of the grids of an element, of which this is the first, is finer than doubles.
inline bool is_any_local(const Field& field, i64 g) {
    while (!field.grids[g].local && field.grids[g].more) ++g;
    return field.grids[g].local;
}

// Paint a part of a tile that is inside the bounds; whether pixels, NaN, are left to the descent.
template <class Id>
bool paint_tile(
    const Field& field, Canvas<Id>& canvas, In x, In y, double resolution, const Rectangle& whole
) {
    auto& queue = canvas.queue;  // read from `head` on; what is before is done
    queue.assign(1, {0, whole});
    bool left = false;
    const Element& root = field.elements[0];
    if (field.poses[root.pose].turned || field.kinds[root.kind].combine != PRODUCT) {
        canvas.heights.fill(whole, 0.0);
        canvas.surfaces.fill(whole, 0);
        if (canvas.slope_x.exists()) {
            canvas.slope_x.fill(whole, 0.0);
            canvas.slope_y.fill(whole, 0.0);
        }
    }
    if (canvas.labels.exists()) canvas.labels.fill(whole, 0);
    for (std::size_t head = 0; head < queue.size(); ++head) {
        auto [g, part] = queue[head];
        auto below = [&](i64 index, const Rectangle& held) {
            i64 first = field.elements[index].grid;
            if (!first || held.is_empty()) return;
            if (is_any_local(field, first)) {
                left = true;
                canvas.heights.fill(held, NaN);  // stays NaN, whatever is added to it
            } else {
                queue.push_back({first, held});
            }
        };
        for (;; ++g) {  // all grids of an element
            const Grid& grid = field.grids[g];
            if (grid.standing == IN_CELLS)
                paint_cells(field, canvas, grid, x, y, resolution, part, below);
            else paint_free(field, canvas, grid, x, y, resolution, part, below);
            if (!grid.more) break;
        }
    }
    return left;
}

// Which copies of an element lie over pixels along an axis, ascending.
// near(pixel) are those that may lie over a pixel; where `down` is set, later pixels have lesser
// ones.
template <class Near>
void list_copies(std::vector<i64>& found, i64 begin, i64 end, bool down, Near near) {
    found.clear();
    i64 after = 0;  // the first that is not listed yet
    for (i64 n = 0; n < end - begin; ++n) {
        auto [first, last] = near(down ? end - 1 - n : begin + n);
        for (i64 k = max(first, after); k <= last; ++k) found.push_back(k);
        after = max(after, last + 1);
    }
}

// Paints tiles of a shared field: as paint_tile does it, but that grids are laid on the way.
template <class Id> class SharedPainting {
public:
    SharedPainting(const Field& field, Canvas<Id>& canvas, In x, In y, double resolution)
        : field_(field), canvas_(canvas), x_(x), y_(y), resolution_(resolution) {}

    // Paint a part of a tile that is inside the bounds; whether pixels are left to the descent.
    // Where too many grids wait at a time, smaller parts of it are painted one after the other.
    bool paint(const Rectangle& whole) {
        constexpr i64 side = 64;
        if (try_paint(whole)) return left_;
        std::vector<Rectangle> pending;
        for (i64 south = whole.south; south < whole.north; south += side)
            for (i64 west = whole.west; west < whole.east; west += side)
                pending.push_back(
                    {west, min(west + side, whole.east), south, min(south + side, whole.north)}
                );
        while (!pending.empty()) {
            Rectangle part = pending.back();
            pending.pop_back();
            if (try_paint(part)) continue;
            Rectangle rest = part;
            if (part.east - part.west > 1) rest.west = part.east = (part.west + part.east) / 2;
            else rest.south = part.north = (part.south + part.north) / 2;
            pending.push_back(rest), pending.push_back(part);
        }
        return left_;
    }

private:
    static constexpr std::size_t most_waiting = 16384;  // grids, but where one pixel has more
    const Field& field_;
    Canvas<Id>& canvas_;
    In x_, y_;
    double resolution_;
    bool left_ = false;

    bool try_paint(const Rectangle& whole) {
        const Element& root = field_.elements[0];
        if (field_.poses[root.pose].turned || field_.kinds[root.kind].combine != PRODUCT) {
            canvas_.heights.fill(whole, 0.0);
            canvas_.surfaces.fill(whole, 0);
            if (canvas_.slope_x.exists()) {
                canvas_.slope_x.fill(whole, 0.0);
                canvas_.slope_y.fill(whole, 0.0);
            }
        }
        bool single = whole.east - whole.west == 1 && whole.north - whole.south == 1;
        auto &now = canvas_.frames, &below = canvas_.frames_below;
        now.assign(1, {terrain_frame(field_), whole});
        while (!now.empty()) {
            below.clear();
            for (const FramePart& waiting : now) {
                paint_frame(waiting.frame, waiting.part);
                if (below.size() > most_waiting && !single) return false;
            }
            std::swap(now, below);
        }
        return true;
    }

    void paint_frame(const Frame& frame, const Rectangle& part) {
        auto& grids = canvas_.shared_stack.laid;
        bool local = false;
        u64 end = frame.grid;
        do local |= grids.lay(field_, frame, end).grid.local;
        while (field_.grids[end++].more);
        if (local) {
            left_ = true;
            canvas_.heights.fill(part, NaN);  // stays NaN, whatever is added to it
            return;
        }
        for (u64 g = frame.grid; g < end; ++g) {
            const LaidGrid& laid = grids.lay(field_, frame, g);
            if (laid.grid.standing == IN_CELLS) paint_cells(frame, laid, part);
            else paint_free(frame, laid.grid, field_.shared.mirrors[g], part);
        }
    }

    void paint_cells(const Frame& frame, const LaidGrid& laid, const Rectangle& part) {
        const Grid& grid = laid.grid;
        auto [west, east, south, north] = part;
        locate_cells(
            x_.subspan(west, east - west), axis_of(grid, X), part_of(canvas_.cell_x, west, east),
            part_of(canvas_.in_x, west, east)
        );
        locate_cells(
            y_.subspan(south, north - south), axis_of(grid, Y),
            part_of(canvas_.cell_y, south, north), part_of(canvas_.in_y, south, north)
        );
        i64 across = find_runs(canvas_.cell_x, west, east, grid.shift[X], canvas_.runs_x);
        i64 along = find_runs(canvas_.cell_y, south, north, grid.shift[Y], canvas_.runs_y);
        for (i64 j = 0; j < along; ++j) {
            for (i64 i = 0; i < across; ++i) {
                i64 slot =
                    grid.table + canvas_.runs_y[j].bin * i64(grid.row) + canvas_.runs_x[i].bin;
                Rectangle in_bin{
                    canvas_.runs_x[i].begin, canvas_.runs_x[i + 1].begin, canvas_.runs_y[j].begin,
                    canvas_.runs_y[j + 1].begin
                };
                for (u32 k = field_.offsets[slot]; k < field_.offsets[slot + 1]; ++k)
                    paint_copies(frame, laid, listed_element(field_, grid, k), in_bin);
            }
        }
    }

    // Paint an element in cells, and its copies, where they meet pixels.
    void paint_copies(
        const Frame& frame, const LaidGrid& laid, u64 index, const Rectangle& in_bin
    ) {
        const Element& element = field_.elements[index];
        u32 copied = field_.shared.elements[index].copies;
        if (!copied) {
            paint_one(frame, laid, index, 0, 0, in_bin);
            return;
        }
        const Copies& copies = field_.shared.copies[copied];
        const Pose& pose = field_.poses[element.pose];
        auto list = [&](std::vector<i64>& found, int axis, i64 begin, i64 end, const auto& cells) {
            list_copies(found, begin, end, copies.step[axis] < 0.0, [&](i64 n) {
                return copies_over(
                    i64(cells[n]) - element.cell[axis], pose.cells[axis], copies.step[axis],
                    copies.count[axis]
                );
            });
        };
        list(canvas_.copies_x, X, in_bin.west, in_bin.east, canvas_.cell_x);
        list(canvas_.copies_y, Y, in_bin.south, in_bin.north, canvas_.cell_y);
        visit_listed(copies, [&](i64 a, i64 b) {
            i64 right = a * i64(copies.step[X]), above = b * i64(copies.step[Y]);
            paint_one(frame, laid, index, right, above, in_bin);
        });
    }

    // Call visit(k along x, k along y) for the copies that are listed, in their order.
    template <class Visit> void visit_listed(const Copies& copies, Visit visit) {
        CopyOrder order(copies);
        bool rows_along_x = order.inner == X;
        auto& inner = rows_along_x ? canvas_.copies_x : canvas_.copies_y;
        auto& outer = rows_along_x ? canvas_.copies_y : canvas_.copies_x;
        for (i64 j : outer)
            for (i64 i : inner) visit(rows_along_x ? i : j, rows_along_x ? j : i);
    }

    // Paint a copy of an element that is so many cells from the first one.
    void paint_one(
        const Frame& frame, const LaidGrid& laid, u64 index, i64 right, i64 above, Rectangle part
    ) {
        const Grid& grid = laid.grid;
        Instance one = copy_of<false>(field_, frame, index, 0);
        one.element.cell[X] = u16(one.element.cell[X] + right);
        one.element.cell[Y] = u16(one.element.cell[Y] + above);
        const Pose& square = field_.poses[one.element.pose];
        if (grid.listed) {
            search(canvas_.cell_x, part.west, part.east, block_of(one.element, square, X));
            search(canvas_.cell_y, part.south, part.north, block_of(one.element, square, Y));
            if (part.is_empty()) return;
        }
        scale_in_cells(field_, frame, laid, square, one);
        double aspect = frame.aspect * laid.aspect;
        Pose pose = cell_pose(square, aspect);
        Painted painted{i64(index), one.element, field_.kinds[one.element.kind], pose, grid};
        paint_held(field_, canvas_, painted, x_, y_, resolution_, part);
        if (one.element.grid)
            canvas_.frames_below.push_back({frame_within(frame, laid, aspect, pose, one), part});
    }

    // Narrow `begin` and `end` of ascending cells to those in a block.
    template <std::size_t n>
    static void search(const std::array<double, n>& cells, i64& begin, i64& end, Block block) {
        auto first = cells.begin() + begin, last = cells.begin() + end;
        first = std::lower_bound(first, last, block.cell);
        last = std::lower_bound(first, last, block.cell + block.width);
        begin = first - cells.begin(), end = last - cells.begin();
    }

    void paint_free(const Frame& frame, const Grid& grid, u8 mirror, const Rectangle& part) {
        const FreeBins& bins = field_.free_bins[grid.free];
        // bins and copies are laid before mirroring
        auto from = [&](In at, int axis, i64 n) {
            double from_corner = from_parent(grid, axis, at[n], 0.0);
            return mirror >> axis & 1 ? frame.length[axis] - from_corner : from_corner;
        };
        auto met = [&](In at, int axis, i64 begin, i64 end) {
            double one = from(at, axis, begin), other = from(at, axis, end - 1);
            return free_bins_met(bins, axis, min(one, other), max(one, other));
        };
        BinRange across = met(x_, X, part.west, part.east);
        BinRange along = met(y_, Y, part.south, part.north);
        find_free(field_, grid, across, along, canvas_.found);
        for (u32 index : canvas_.found) {
            const Element& element = field_.elements[index];
            const Place& first = field_.places[place_of(element)];
            const Copies& copies = field_.shared.copies[field_.shared.elements[index].copies];
            auto reach = free_span(field_.poses[element.pose], first);
            auto list = [&](std::vector<i64>& found, In at, int axis, i64 begin, i64 end) {
                double step = copies.step[axis];
                if (copies.count[axis] == 1) {
                    found.assign(1, 0);
                    return;
                }
                bool down = (step < 0.0) != bool(mirror >> axis & 1);
                list_copies(found, begin, end, down, [&](i64 n) {
                    return copies_near(
                        from(at, axis, n), first.at[axis], reach[axis] + bins.slack, step,
                        copies.count[axis]
                    );
                });
            };
            list(canvas_.copies_x, x_, X, part.west, part.east);
            list(canvas_.copies_y, y_, Y, part.south, part.north);
            visit_listed(copies, [&](i64 a, i64 b) {
                KeptPlace place = place_of_copy(
                    frame, mirror, exact_place(field_, place_of(element)), copies, a, b
                );
                Instance one = copy_of<false>(field_, frame, index, 0);
                scale_at_place(field_, frame, place.near, one);
                FreePainted painted{index, one.element, place.exact(), grid};
                Rectangle held =
                    paint_free_element(field_, canvas_, painted, x_, y_, resolution_, part);
                if (one.element.grid && !held.is_empty())
                    canvas_.frames_below.push_back(
                        {frame_at(frame, grid, place.exact(), one), held}
                    );
            });
        }
    }
};

// What a descent finds at a point of any field.
template <class Id>
Found find_elements(const Field& field, double x, double y, Canvas<Id>& canvas) {
    if (!is_shared(field)) return found_at<true>(field, x, y, canvas.stack);
    SharedDescent<true> found(field, x, y, canvas.shared_stack);
    return {found.z, found.top.element, found.slope_x, found.slope_y, found.top.pixel};
}

// Ask the descent about the pixels that were left to it.
// `row`, counted from the north, and `column` are those of the tile's south-west pixel.
template <class Id>
void descend_left(
    const Field& field, Canvas<Id>& canvas, In x, In y, i64 row, i64 column, const Rectangle& part
) {
    bool sloped = canvas.slope_x.exists();
    for (i64 r = part.south; r < part.north; ++r) {
        for (i64 c = part.west; c < part.east; ++c) {
            if (!isnan(canvas.heights(r, c))) continue;
            Found found = find_elements(field, x[c], y[r], canvas);
            canvas.heights(r, c) = found.z;
            canvas.surfaces(r, c) = Id(worn_of(field, found).surface + 1);
            if (sloped) {
                canvas.slope_x(r, c) = found.slope_x;
                canvas.slope_y(r, c) = found.slope_y;
            }
            if (canvas.labels.exists()) canvas.labels(r, c) = label_left(row - r, column + c);
        }
    }
}

}  // namespace terratool
