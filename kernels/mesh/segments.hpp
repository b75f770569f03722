// Segments that the edges of a mesh follow: footprints, vertical steps, creases, where min changes.
//
// They are clipped to the cell of their element and to the part that is meshed, and rounded to the
// lattice. Where triangles of equal sides would be many more, a curve is divided into chords, too:
// where the other curve is constant, and where a tangent is vertical, as at the edge of a dome.
#pragma once

#include "../field/classes.hpp"
#include "heights.hpp"

namespace terratool::mesh {

// How many of some chords end at or before `t`.
INLINE i64 chords_before(In chords, double t) {
    auto is_before = [t](double chord) { return chord <= t; };
    return std::partition_point(chords.begin(), chords.end(), is_before) - chords.begin();
}

// The largest t to which a chord from `t` misses a curve by no more than `allowed`.
inline double chord_end(
    const Plan& plan, const CurveAt& curve, i64 group, double t, double allowed
) {
    constexpr int halvings = 30, tests = 8;
    auto value = [&](double at) { return curve_at(plan, curve, group, at, 0.0); };
    double low = t, high = plan.groups[group].high, end = high, begin_z = value(t);
    for (int n = 0; n < halvings; ++n) {
        double end_z = value(end);
        bool fits = true;
        for (int k = 1; k < tests && fits; ++k) {
            double z = value(t + (end - t) * double(k) / double(tests));
            fits = abs(z - begin_z - (end_z - begin_z) * double(k) / double(tests)) <= allowed;
        }
        (fits ? low : high) = end;
        if (low >= high) break;
        end = 0.5 * (low + high);
    }
    return low;
}

// Append where chords over a grid's numbers along an axis end, where the other has one row.
// No number between their ends is farther from them than `allowed`.
inline void append_raster_chords(
    const Plan& plan, const Kind& kind, int axis, double allowed, std::vector<double>& ends
) {
    RasterAt raster(plan.field->curves, kind);
    const Raster& r = raster.raster();
    i64 count = r.count[axis];
    double last = r.pixel ? double(count) : double(max(count - 1, i64(1)));
    double shift = r.pixel ? 0.5 : 0.0;
    struct End {
        double t, z;
    };
    auto end_at = [&](i64 k) {  // and in a grid of pixels one more on both sides, on the rim
        double t = clamp((double(k) + shift) / last, 0.0, 1.0);
        i64 number = clamp(k, i64(0), count - 1);
        double z = axis == X ? raster.counting(number, 0) : raster.counting(0, number);
        return End{t, isnan(z) ? 0.0 : z};
    };
    i64 k = r.pixel ? -1 : 0, rim = r.pixel ? count : count - 1;
    End begin = end_at(k), before = begin;
    double least = -INF, most = INF;  // slopes of chords that are near enough to what they passed
    while (++k <= rim) {
        End end = end_at(k);
        double slope = (end.z - begin.z) / (end.t - begin.t);
        if (slope < least || slope > most) {
            ends.push_back(before.t);
            begin = before, least = -INF, most = INF;
        }
        double spread = allowed / (end.t - begin.t);
        slope = (end.z - begin.z) / (end.t - begin.t);
        least = max(least, slope - spread), most = min(most, slope + spread);
        before = end;
    }
}

// The chords of all elements.
inline Chords find_chords(const Plan& plan) {
    constexpr double share = 0.95;        // part of the error that chords may miss a curve by
    constexpr double steep_share = 0.25;  // that part where a tangent is vertical
    constexpr double ring_share = 0.45;   // that part in a disc
    constexpr int most = 4096;            // no curve has more chords between two steps
    constexpr double points = 8.0;        // of the lattice; ends that are nearer may become one
    Chords chords;
    auto append = [&](const ElementView& e, int along) {
        const Axis& axis = along == X ? e.x : e.y;
        const CurveAt curve = curve_of(e.kind, along);
        double weight = e.frame.weight[along];
        double shortest = points / (e.frame.high[along] - e.frame.low[along]);
        bool radial = e.kind.combine == RADIAL;
        double part = radial ? ring_share : axis.steep ? steep_share : share;
        double allowed = part * plan.error / weight;
        for (i64 line = -1; line < i64(axis.lines); ++line) {
            i64 group = axis.group;
            if (line >= 0) {
                group = plan.lines[axis.line + line].group;
                if (!std::isinf(plan.lines[axis.line + line].crease)) continue;
            }
            double t = plan.groups[group].low, end = plan.groups[group].high;
            if (radial) t = max(t, 0.5), end = min(end, e.frame.straight_from);
            for (int n = 0; n < most; ++n) {
                double last = t;
                t = min(max(chord_end(plan, curve, group, t, allowed), last + shortest), end);
                if (t <= last || t >= plan.groups[group].high) break;
                if (t <= 1.0 - shortest) chords.ends.push_back(t);
            }
        }
    };
    auto mark = [&] { chords.begins.push_back(u32(chords.ends.size())); };
    chords.begins.reserve(2 * plan.frames.size() + 1);
    for (std::size_t index = 0; index < plan.frames.size(); ++index) {
        const ElementView e(plan, i64(index));
        bool exists = e.frame.drawn && e.element.scale != 0.0;
        bool radial = e.kind.combine == RADIAL;
        // what has children has their edges in it
        bool lone = e.element.grid == 0 && (e.kind.combine == PRODUCT || e.kind.combine == SUM);
        auto wants = [&](const Axis& own, const Axis& other) {
            return exists && (own.steep || (lone && other.constant && !own.linear));
        };
        bool plain = is_raster(e.kind) && exists && e.element.grid == 0;
        auto append_numbers = [&](int axis) {
            const Raster& raster = raster_of(plan, e.kind);
            if (raster.count[axis == X ? Y : X] > 1) return;
            double allowed = share * plan.error / e.frame.weight[X];
            append_raster_chords(plan, e.kind, axis, allowed, chords.ends);
        };
        mark();
        if (plain) append_numbers(X);
        if (radial ? exists && e.x.ringed : wants(e.x, e.y)) append(e, X);
        mark();
        if (plain) append_numbers(Y);
        if (!radial && wants(e.y, e.x)) append(e, Y);
    }
    mark();
    return chords;
}

// Whether most cells of a grid are so twisted, and so large on the lattice, that each is best
// meshed by itself, between drawn lines.
inline bool is_celled(const Plan& plan, const ElementView& e) {
    constexpr double share = 0.5;       // of the cells
    constexpr i64 most = i64(1) << 22;  // numbers; of more, cells are small beside what is seen
    if (!is_raster(e.kind) || !e.frame.drawn || e.element.scale == 0.0) return false;
    RasterAt raster(plan.field->curves, e.kind);
    const Raster& r = raster.raster();
    i64 columns = r.count[X] - 1, rows = r.count[Y] - 1;
    if (r.pixel || r.voids || !raster.is_in_memory() || min(columns, rows) < 1) return false;
    if (columns * rows > most) return false;
    double wide = (e.frame.high[X] - e.frame.low[X]) / double(columns);
    double tall = (e.frame.high[Y] - e.frame.low[Y]) / double(rows);
    if (min(wide, tall) < SMALLEST_CELL) return false;
    i64 twisted = 0;
    for (i64 j = 0; j < rows; ++j)
        for (i64 i = 0; i < columns; ++i) {
            auto [z00, z10, z01, z11] = raster.patch(i, j);
            double missed = 0.25 * abs(e.element.scale * ((z11 - z01) - (z10 - z00)));
            twisted += missed > plan.error;
        }
    return double(twisted) > share * double(columns * rows);
}

inline std::vector<u8> find_celled(const Plan& plan) {
    std::vector<u8> found(plan.frames.size());
    for (std::size_t index = 0; index < found.size(); ++index)
        found[index] = is_celled(plan, ElementView(plan, i64(index)));
    return found;
}

// What lies outside by less, in points of the lattice, is inside.
constexpr double SLACK = 1e-3;

struct Position {  // on the lattice, not rounded
    double x, y;

    INLINE Position towards(Position end, double share) const {
        return {x + share * (end.x - x), y + share * (end.y - y)};
    }
};

INLINE Position on_lattice(const Frame& f, UV in_cell) {
    return {
        f.low[X] + in_cell.u * (f.high[X] - f.low[X]), f.low[Y] + in_cell.v * (f.high[Y] - f.low[Y])
    };
}

// Where (u, v) of an element's primitive is.
INLINE Position shape_on_lattice(const ElementView& e, UV at) {
    const Pose& pose = e.pose;
    if (pose.turned) {  // back to the cell
        double p = at.u - 0.5, q = at.v - 0.5;
        at.u = 0.5 + p * pose.cos + q * pose.sin_v;
        at.v = 0.5 + q * pose.cos - p * pose.sin_u;
    }
    return on_lattice(e.frame, at);
}

// A stretch of a segment, in parts of it; none where it ends before it begins.
struct Interval {
    double low = 0.0, high = 1.0;

    // Narrow it to where a linear function is at most `slack`.
    // `before` and `after` are its values at the two ends of the segment.
    INLINE void cut(double before, double after, double slack) {
        before -= slack;
        after -= slack;
        if (before > 0.0 && after > 0.0) low = 1.0, high = 0.0;
        else if (before > 0.0) low = max(low, before / (before - after));
        else if (after > 0.0) high = min(high, before / (before - after));
    }
    // Narrow a segment to a rectangle.
    INLINE void cut(double west, double south, double east, double north, Position a, Position b) {
        cut(west - a.x, west - b.x, SLACK);
        cut(a.x - east, b.x - east, SLACK);
        cut(south - a.y, south - b.y, SLACK);
        cut(a.y - north, b.y - north, SLACK);
    }
};

// A crease is an edge if the chord over it misses by more than so much of the error.
constexpr double DRAWN = 0.5;

// Whether a line of a curve is drawn, for an element where it weighs so much.
INLINE bool is_drawn(const Plan& plan, const Line& line, double weight) {
    return weight > 0.0 && line.crease * weight > DRAWN * plan.error;
}

INLINE Span<const Line> lines_of(const Plan& plan, const Axis& axis) {
    return plan.lines.subspan(axis.line, axis.lines);
}

struct BetweenLines {
    i64 passed, group;
};

// Between which drawn lines of a curve `t` lies, and in which group.
INLINE BetweenLines between_lines(const Plan& plan, const Axis& axis, double weight, double t) {
    BetweenLines at{0, axis.group};
    for (const Line& line : lines_of(plan, axis)) {
        if (line.t > t) break;
        at.passed += is_drawn(plan, line, weight);
        at.group = line.group;
    }
    return at;
}

// Number of the pieces of a curve, one of no length at the end not counted.
inline i64 count_pieces(const Plan& plan, const CurveAt& curve) {
    if (!curve.knotted) return i64(curve.count);
    i64 i = 0;
    while (plan.field->curves.knots[curve.knot + i] < 1.0) ++i;
    return i;
}

using Segments = Rows<i64, 4>;  // x, y, x, y

// Draws the segments of elements: put(segment) is called with each.
template <class Put> class Drawing {
public:
    Drawing(const Plan& plan, Put put) : plan_(plan), put_(put) {}

    // All segments of an element.
    void draw(i64 index) {
        const ElementView e(plan_, index);
        double along = e.frame.weight[X], across = e.frame.weight[Y];
        if (e.is_trimmed()) draw_trims(e);
        if (e.kind.combine == RADIAL) {
            draw_ring(e, 1.0, 1);
            for (const Line& line : lines_of(plan_, e.x))
                if (is_drawn(plan_, line, along)) draw_ring(e, 2.0 * line.t - 1.0, 1);
            if (is_faceted(e)) draw_spokes(e);
            draw_chords(e, false);
            if (has_classes(e.kind)) draw_classes(e);
            return;
        }
        draw_in_shape(e, {0.0, 0.0}, {1.0, 0.0});
        draw_in_shape(e, {1.0, 0.0}, {1.0, 1.0});
        draw_in_shape(e, {1.0, 1.0}, {0.0, 1.0});
        draw_in_shape(e, {0.0, 1.0}, {0.0, 0.0});
        for (const Line& line : lines_of(plan_, e.x))
            if (is_drawn(plan_, line, along)) draw_in_shape(e, {line.t, 0.0}, {line.t, 1.0});
        for (const Line& line : lines_of(plan_, e.y))
            if (is_drawn(plan_, line, across)) draw_in_shape(e, {0.0, line.t}, {1.0, line.t});
        draw_chords(e, false);
        draw_chords(e, true);
        if (is_raster(e.kind)) draw_gaps(e);
        if (has_classes(e.kind)) draw_classes(e);
        bool straight = e.x.linear && e.y.linear && e.element.scale != 0.0;
        if (straight && (e.kind.combine == MIN || e.kind.combine == MAX)) draw_ties(e);
    }

    // The lines of a grid whose cells are meshed each by itself, from number to number.
    void draw_cells(i64 index) {
        if (!plan_.celled[index]) return;
        const ElementView e(plan_, index);
        const Raster& r = raster_of(plan_, e.kind);
        for (int axis : {X, Y}) {
            i64 lines = r.count[axis] - 1, length = r.count[1 - axis] - 1;
            auto [first_line, last_line] = cells_within(e, axis, lines);
            auto [first, last] = cells_within(e, 1 - axis, length);
            for (i64 line = first_line; line <= last_line; ++line) {
                double t = double(line) / double(lines);
                for (i64 k = first; k < last; ++k) {
                    double from = double(k) / double(length), to = double(k + 1) / double(length);
                    if (axis == X) draw_in_shape(e, {t, from}, {t, to});
                    else draw_in_shape(e, {from, t}, {to, t});
                }
            }
        }
    }

private:
    const Plan& plan_;
    Put put_;

    // A segment on the lattice, clipped to the cell of its element if it is `trimmed`.
    void draw_on_lattice(const ElementView& e, bool trimmed, Position a, Position b) {
        Interval kept;
        In bounds = plan_.bounds;
        const Frame& f = e.frame;
        kept.cut(bounds[0], bounds[1], bounds[2], bounds[3], a, b);
        if (trimmed) kept.cut(f.low[X], f.low[Y], f.high[X], f.high[Y], a, b);
        if (kept.low >= kept.high) return;
        auto rounded = [&](double share) {
            auto [x, y] = a.towards(b, share);
            return Position{std::nearbyint(x), std::nearbyint(y)};
        };
        Position begin = rounded(kept.low), end = rounded(kept.high);
        if (begin.x == end.x && begin.y == end.y) return;
        // one direction, so that the same edge of two elements is the same segment
        if (begin.x > end.x || (begin.x == end.x && begin.y > end.y)) std::swap(begin, end);
        put_({i64(begin.x), i64(begin.y), i64(end.x), i64(end.y)});
    }

    // A segment given in (u, v) of the element's primitive.
    void draw_in_shape(const ElementView& e, UV a, UV b) {
        draw_on_lattice(e, e.is_trimmed(), shape_on_lattice(e, a), shape_on_lattice(e, b));
    }

    // The polygon that stands for a circle of so many radii of the disc.
    // Only each `stride`-th corner of the disc's polygon is used.
    void draw_ring(const ElementView& e, double rho, i64 stride) {
        i64 corners = e.frame.corners;
        double step = 2.0 * PI / double(corners);
        const UV first{0.5 + 0.5 * rho, 0.5};
        UV before = first;
        for (i64 k = stride; k <= corners; k += stride) {
            double angle = double(k) * step;
            UV at{0.5 + 0.5 * rho * std::cos(angle), 0.5 + 0.5 * rho * std::sin(angle)};
            if (k == corners) at = first;
            draw_in_shape(e, before, at);
            before = at;
        }
    }

    // How many corners of a disc's polygon the ring at `t` may go at a time.
    i64 stride_at(const ElementView& e, double t) {
        constexpr double allowed = 0.2;  // the height may change by so much of the error
        constexpr double share = 0.01;   // the slope is that of a secant over so much of the way on
        CurveAt curve = curve_of(e.kind, X);
        i64 group = between_lines(plan_, e.x, 0.0, t).group;
        double ahead = t + share * (1.0 - t);
        double drop = curve_at(plan_, curve, group, t, 0.0);
        drop -= curve_at(plan_, curve, group, ahead, 0.0);
        // the slope there, for a change of the radius, times the radius
        double steep = 0.5 * abs(drop * e.element.scale) / (ahead - t) * (2.0 * t - 1.0);
        i64 corners = e.frame.corners, stride = 1;
        while (corners % (2 * stride) == 0 && corners >= 16 * stride) {
            double angle = 2.0 * double(stride) * PI / double(corners);
            if (steep * (1.0 - std::cos(angle)) > allowed * plan_.error) break;
            stride *= 2;
        }
        return stride;
    }

    // The lines where the chords of a curve meet.
    void draw_chords(const ElementView& e, bool on_y) {
        for (double t : plan_.chords.of(e.index, on_y)) {
            if (e.kind.combine == RADIAL) draw_ring(e, 2.0 * t - 1.0, stride_at(e, t));
            else if (on_y) draw_in_shape(e, {0.0, t}, {1.0, t});
            else draw_in_shape(e, {t, 0.0}, {t, 1.0});
        }
    }

    // The lines from the middle of a disc to the corners of its polygon.
    void draw_spokes(const ElementView& e) {
        i64 corners = e.frame.corners;
        for (i64 k = 0; k < corners; ++k) {
            double angle = double(k) * (2.0 * PI / double(corners));
            draw_in_shape(
                e, {0.5, 0.5}, {0.5 + 0.5 * std::cos(angle), 0.5 + 0.5 * std::sin(angle)}
            );
        }
    }

    // The sides of the cell where they trim what is turned.
    void draw_trims(const ElementView& e) {
        const Frame& f = e.frame;
        const Pose& pose = e.pose;
        double slack = SLACK * max(f.per[X], f.per[Y]);
        constexpr std::array<UV, 4> corners = {{{0.0, 0.0}, {1.0, 0.0}, {1.0, 1.0}, {0.0, 1.0}}};
        for (int side = 0; side < 4; ++side) {
            auto [a0, b0] = corners[side];
            auto [a1, b1] = corners[(side + 1) % 4];
            double p0 = (a0 - 0.5) * pose.cos - (b0 - 0.5) * pose.sin_v;
            double q0 = (a0 - 0.5) * pose.sin_u + (b0 - 0.5) * pose.cos;
            double p1 = (a1 - 0.5) * pose.cos - (b1 - 0.5) * pose.sin_v;
            double q1 = (a1 - 0.5) * pose.sin_u + (b1 - 0.5) * pose.cos;
            Interval kept;
            if (e.kind.combine == RADIAL) {
                double half = PI / double(f.corners), reach = 0.5 * std::cos(half);
                for (i64 k = 0; k < f.corners; ++k) {
                    double angle = double(2 * k + 1) * half;
                    double c = std::cos(angle), s = std::sin(angle);
                    kept.cut(p0 * c + q0 * s - reach, p1 * c + q1 * s - reach, slack);
                }
            } else {
                kept.cut(p0 - 0.5, p1 - 0.5, slack);
                kept.cut(-0.5 - p0, -0.5 - p1, slack);
                kept.cut(q0 - 0.5, q1 - 0.5, slack);
                kept.cut(-0.5 - q0, -0.5 - q1, slack);
            }
            if (kept.low >= kept.high) continue;
            Position a = on_lattice(f, {a0, b0}), b = on_lattice(f, {a1, b1});
            draw_on_lattice(e, true, a.towards(b, kept.low), a.towards(b, kept.high));
        }
    }

    // The sides of the void in a grid, each from corner to corner.
    void draw_gaps(const ElementView& e) {
        RasterAt raster(plan_.field->curves, e.kind);
        const Raster& r = raster.raster();
        if (!r.voids) return;
        draw_borders(e, raster_cells(r, X), raster_cells(r, Y), [&](i64 i, i64 j) {
            return i64(raster.is_void(i, j));
        });
    }

    // The borders between the surfaces that pixels of classes stand for.
    void draw_classes(const ElementView& e) {
        ClassesAt classes(*plan_.field, e.kind);
        draw_borders(e, classes.count(X), classes.count(Y), [&](i64 i, i64 j) {
            return classes.at(i, j).surface;
        });
    }

    // Which of so many cells along an axis of an element may lie in the plan: the first, and one
    // more than the last.
    std::array<i64, 2> cells_within(const ElementView& e, int axis, i64 count) const {
        if (e.pose.turned) return {0, count};
        const Frame& f = e.frame;
        auto cell = [&](double at) {
            double t = (at - f.low[axis]) * f.per[axis] * double(count);
            return i64(clamp(t, 0.0, double(count)));
        };
        i64 first = max(cell(plan_.bounds[axis]) - 1, i64(0));
        return {first, min(cell(plan_.bounds[2 + axis]) + 2, count)};
    }

    // The borders between cells of a grid of which what(column, row) differs, each from corner to
    // corner; in a disc as far as it goes.
    template <class What>
    void draw_borders(const ElementView& e, i64 columns, i64 rows, What what) {
        for (int axis : {X, Y}) {
            i64 lines = axis == X ? columns : rows, length = axis == X ? rows : columns;
            auto [first_line, last_line] = cells_within(e, axis, lines);
            auto [first, last] = cells_within(e, 1 - axis, length);
            auto differ = [&](i64 line, i64 along) {
                if (axis == X) return what(line, along) != what(line - 1, along);
                return what(along, line) != what(along, line - 1);
            };
            for (i64 line = max(first_line, i64(1)); line < last_line; ++line) {
                double t = double(line) / double(lines), low = 0.0, high = 1.0;
                if (e.kind.combine == RADIAL) {
                    double half = 0.5 * sqrt(1.0 - square(2.0 * t - 1.0));
                    low = 0.5 - half, high = 0.5 + half;
                }
                auto place = [&](i64 along) {
                    double s = clamp(double(along) / double(length), low, high);
                    return axis == X ? UV{t, s} : UV{s, t};
                };
                i64 begin = -1;  // of a border; none where it is -1
                for (i64 k = first; k <= last; ++k) {
                    bool is_border = k < last && differ(line, k);
                    if (is_border == (begin >= 0)) continue;
                    if (begin >= 0) draw_in_shape(e, place(begin), place(k));
                    begin = is_border ? k : -1;
                }
            }
        }
    }

    // The lines where the two curves of a minimum or maximum are equal.
    void draw_ties(const ElementView& e) {
        CurveAt curve_x = curve_of(e.kind, X), curve_y = curve_of(e.kind, Y);
        i64 along = count_pieces(plan_, curve_x), across = count_pieces(plan_, curve_y);
        for (i64 i = 0; i < along; ++i) {
            auto [u0, u1, a, slope_a] = straight_piece(plan_, curve_x, i);
            for (i64 j = 0; j < across; ++j) {
                auto [v0, v1, b, slope_b] = straight_piece(plan_, curve_y, j);
                // a + slope_a (u - u0) = b + slope_b (v - v0)
                if (slope_a == 0.0 && slope_b == 0.0) continue;
                UV begin, end;
                if (abs(slope_b) * (v1 - v0) >= abs(slope_a) * (u1 - u0)) {
                    begin = {u0, v0 + (a - b) / slope_b};
                    end = {u1, v0 + (a + slope_a * (u1 - u0) - b) / slope_b};
                } else {
                    begin = {u0 + (b - a) / slope_a, v0};
                    end = {u0 + (b + slope_b * (v1 - v0) - a) / slope_a, v1};
                }
                Interval kept;
                kept.cut(u0 - begin.u, u0 - end.u, 0.0);
                kept.cut(begin.u - u1, end.u - u1, 0.0);
                kept.cut(v0 - begin.v, v0 - end.v, 0.0);
                kept.cut(begin.v - v1, end.v - v1, 0.0);
                if (kept.low >= kept.high) continue;
                auto at = [&](double share) {
                    return UV{
                        begin.u + share * (end.u - begin.u), begin.v + share * (end.v - begin.v)
                    };
                };
                draw_in_shape(e, at(kept.low), at(kept.high));
            }
        }
    }
};

// Segments of the elements with these indices and of all ruts.
inline Segments segments_of(const Plan& plan, Span<const i64> chosen) {
    Segments drawn;
    Drawing drawing(plan, [&](std::array<i64, 4> segment) { drawn.push_back(segment); });
    for (i64 index : chosen) drawing.draw(index), drawing.draw_cells(index);
    for (i64 e = 0; e < plan.outlines.edges.rows(); ++e) {
        auto edge = plan.outlines.edges[e];
        drawn.push_back({edge[0], edge[1], edge[2], edge[3]});
    }
    return drawn;
}

// How many segments elements have, lines between the cells of grids apart.
inline i64 count_segments(const Plan& plan, Span<const i64> chosen) {
    i64 count = 0;
    Drawing drawing(plan, [&](std::array<i64, 4>) { ++count; });
    for (i64 index : chosen) drawing.draw(index);
    return count;
}

}  // namespace terratool::mesh
