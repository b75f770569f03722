// The elements of a field as rays need them: where each stands, the lines along which it begins,
// ends and steps, and bounds of what it adds over a rectangle of the plan.
#pragma once

#include "raster_bounds.hpp"

namespace terratool::rays {

// A rectangle of the plan, by the doubles at which its sides stand.
struct Cell {
    double west, south, east, north;

    double wide() const { return east - west; }
    double tall() const { return north - south; }
    double low(int axis) const { return axis == X ? west : south; }
    double high(int axis) const { return axis == X ? east : north; }
    double middle(int axis) const { return 0.5 * (low(axis) + high(axis)); }
    bool crosses(int axis, double line) const { return line > low(axis) && line < high(axis); }
};

// (u, v) of an element's primitive at (x, y): u = u_0 + u_x x + u_y y, and v likewise.
struct Frame {
    double u_0, u_x, u_y, v_0, v_x, v_y;

    UV at(double x, double y) const { return {u_0 + u_x * x + u_y * y, v_0 + v_x * x + v_y * y}; }
};

// Where an element stands. Where its sides lie along the axes, as those of turns by 90 degrees do,
// the cell is no larger than the footprint; else it is skew, and its cell may trim it.
struct Placed {
    Cell cell;
    Frame frame;
    bool skew, trims;
};

// Whether it is not turned at all.
INLINE bool is_unturned(const Placed& placed) {
    return !placed.skew && placed.frame.u_x > 0.0 && placed.frame.v_y > 0.0;
}

// How far before its t a step of its curves stands.
INLINE double step_ahead(const Placed& placed) { return is_unturned(placed) ? 0.0 : STEP; }

// A line of the plan across an axis. What is on it is on its far side.
struct Line {
    int axis;
    double at;
};

// Call put(line) for the sides of a rectangle.
template <class Put> void for_sides(const Cell& cell, Put put) {
    put(Line{X, cell.west}), put(Line{X, cell.east});
    put(Line{Y, cell.south}), put(Line{Y, cell.north});
}

// What an element does in a rectangle.
struct Part {
    bool meets = false;
    bool cuts = false;       // whether edges or steps lie in it, or along its sides
    i64 lines = 0;           // edges and steps that cut the rectangle
    i64 straight = 0;        // those of `lines` that lie along an axis
    i64 patches = 0;         // of a grid of heights, that meet it
    bool voids = false;      // whether some of those may be void
    Range height{0.0, 0.0};  // what it adds
};

constexpr double ROUNDING = 4.5e-16;  // of a number, by a few operations

// All elements of a field, and their curves.
class Elements {
public:
    const Field& field;
    std::vector<Placed> places;

    Elements(const Field& f, In west, In south, In east, In north) : field(f) {
        for (std::size_t n = 0; n < west.size(); ++n)
            places.push_back(placed(f.elements[n], {west[n], south[n], east[n], north[n]}));
        find_curves();
    }

    INLINE const Curve& curve(u32 kind, int axis) const {
        return curves_[curve_of_kind_[kind][axis]];
    }

    RasterAt raster(u32 kind) const { return {field.curves, field.kinds[kind]}; }

    // Where a step of a curve of an element that is not skew stands.
    INLINE Line step_line(const Placed& placed, int curve, double t) const {
        const auto& [cell, f, skew, trims] = placed;
        if (is_unturned(placed))
            return curve == X ? Line{X, cell.west + t * cell.wide()}
                              : Line{Y, cell.south + t * cell.tall()};
        double by_x = curve == X ? f.u_x : f.v_x, by_y = curve == X ? f.u_y : f.v_y;
        double per = by_x + by_y,
               at = (t - step_ahead(placed) - (curve == X ? f.u_0 : f.v_0)) / per;
        // on the line it is what begins at the step: to the west of it, where t grows that way
        return {by_x != 0.0 ? X : Y, per > 0.0 ? at : std::nextafter(at, INF)};
    }

    // Call put(line) for the edges and steps along the axes that may cut a rectangle, and for the
    // sides of the rectangle around a skew element.
    template <class Put> void for_lines(u32 index, const Cell& plan, Put put) const {
        const auto& [cell, f, skew, trims] = places[index];
        if (trims) for_sides(cell, put);
        if (skew) {
            double area = abs(f.u_x * f.v_y - f.u_y * f.v_x);
            double half_x = 0.5 * (abs(f.v_y) + abs(f.u_y)) / area, x = cell.middle(X);
            double half_y = 0.5 * (abs(f.v_x) + abs(f.u_x)) / area, y = cell.middle(Y);
            for_sides({x - half_x, y - half_y, x + half_x, y + half_y}, put);
            return;
        }
        u32 kind = field.elements[index].kind;
        if (field.kinds[kind].combine == RADIAL) return;
        auto [u, v] = uv_of(index, plan);
        for (double t : curve(kind, X).steps_in(in_surface(u))) put(step_line(places[index], X, t));
        for (double t : curve(kind, Y).steps_in(in_surface(v))) put(step_line(places[index], Y, t));
    }

    Part part_of(u32 index, const Cell& plan) const {
        const Element& element = field.elements[index];
        const Kind& kind = field.kinds[element.kind];
        const auto& [cell, f, skew, trims] = places[index];
        if (!(cell.east > cell.west && cell.north > cell.south)) return {};  // finer than doubles
        Part part;
        if (trims) {
            if (cell.west >= plan.east || cell.east <= plan.west) return {};
            if (cell.south >= plan.north || cell.north <= plan.south) return {};
            for_sides(cell, [&](Line line) { part.straight += plan.crosses(line.axis, line.at); });
            part.lines = part.straight;
        }
        auto [u, v] = uv_of(index, plan);
        bool fills,
            meets = kind.combine == RADIAL ? add_disc(element, u, v, part, fills)
                                           : add_surface(index, u, v, plan, part, fills);
        if (!meets) return {};
        part.meets = true, part.cuts |= part.lines > 0;
        part.height = part.height * element.scale + Range{element.offset, element.offset};
        if (!fills) part.height = around(part.height, {0.0, 0.0});
        return part;
    }

    // Bounds of the slopes of an element in x and y over a rectangle that nothing of it cuts.
    std::array<Range, 2> slopes_of(u32 index, const Cell& plan) const {
        const Element& element = field.elements[index];
        const Frame& f = places[index].frame;
        auto [by_u, by_v] = slopes_by_uv(index, plan);
        return {
            (by_u * f.u_x + by_v * f.v_x) * element.scale,
            (by_u * f.u_y + by_v * f.v_y) * element.scale
        };
    }

    // What an element adds at a point in its footprint, where there is no step.
    double value_at(u32 index, double x, double y) const {
        const Element& element = field.elements[index];
        const u8 how = field.kinds[element.kind].combine;
        const Curve &a = curve(element.kind, X), &b = curve(element.kind, Y);
        auto [u, v] = places[index].frame.at(x, y);
        double shape;
        if (how == RADIAL) shape = a.at(min(0.5 + 0.5 * radius({u, v}), 1.0), a.all()).value;
        else if (how == GRID) {
            RasterAt heights = raster(element.kind);
            const Raster& r = heights.raster();
            shape = heights
                        .between_numbers(
                            between_in(r, X, u, NumberAxis(r, X).patches()),
                            between_in(r, Y, v, NumberAxis(r, Y).patches())
                        )
                        .value;
        } else {
            CurvePoint by_u = a.at(clamp(u, 0.0, 1.0), a.all());
            shape = combine(how, by_u, b.at(clamp(v, 0.0, 1.0), b.all())).value;
        }
        return element.scale * shape + element.offset;
    }

private:
    static constexpr double SLACK = 1e-9;  // of u and v, for rounding and closed edges

    std::vector<Curve> curves_;
    std::vector<std::array<u32, 2>> curve_of_kind_;

    Placed placed(const Element& element, const Cell& cell) const {
        double per_x = 1.0 / cell.wide(), per_y = 1.0 / cell.tall();
        if (!field.poses[element.pose].turned) {
            Frame frame{-cell.west * per_x, per_x, 0.0, -cell.south * per_y, 0.0, per_y};
            return {cell, frame, false, true};
        }
        Pose pose = pose_of(field, element);
        // far from zero the edges of a thin cell say little of its shorter side: that follows from
        // the longer one, or it would be skewed
        if (pose.sin_u != 0.0) {
            double aspect = sqrt(pose.sin_u / pose.sin_v);  // width by height
            if (aspect > 1.0) per_y = per_x * aspect;
            else per_x = per_y / aspect;
        }
        // from the middle of the cell, so that nothing is lost far from zero
        double x = cell.middle(X), y = cell.middle(Y);
        Frame f{0.5, pose.cos * per_x,   -pose.sin_v * per_y,
                0.5, pose.sin_u * per_x, pose.cos * per_y};
        f.u_0 -= f.u_x * x + f.u_y * y, f.v_0 -= f.v_x * x + f.v_y * y;
        if (pose.cos != 0.0 && pose.sin_u != 0.0) return {cell, f, true, !pose.free};
        double half_x = (0.5 + EDGE) / abs(f.u_x + f.v_x);
        double half_y = (0.5 + EDGE) / abs(f.u_y + f.v_y);
        // closed on all sides
        Cell own{
            x - half_x, y - half_y, std::nextafter(x + half_x, INF), std::nextafter(y + half_y, INF)
        };
        if (!pose.free)
            own = {
                max(own.west, cell.west), max(own.south, cell.south), min(own.east, cell.east),
                min(own.north, cell.north)
            };
        return {own, f, false, true};
    }

    void find_curves() {
        std::vector<std::pair<u64, u32>> known;
        for (const Kind& kind : field.kinds) {
            std::array<u32, 2> own{0, 0};
            for (int axis : {X, Y}) {
                if (axis == Y && kind.combine == RADIAL) continue;
                CurveAt at = curve_of(kind, axis);
                u64 key = u64(at.first) << 8 | at.knotted;
                auto found = std::find_if(known.begin(), known.end(), [&](auto k) {
                    return k.first == key;
                });
                if (found == known.end()) {
                    known.push_back({key, u32(curves_.size())});
                    curves_.emplace_back(field.curves, at);
                    found = known.end() - 1;
                }
                own[axis] = found->second;
            }
            curve_of_kind_.push_back(own);
        }
    }

    // Bounds of u and v over a rectangle, however they are rounded.
    std::array<Range, 2> uv_of(u32 index, const Cell& plan) const {
        const Frame& f = places[index].frame;
        return {over(f.u_0, f.u_x, f.u_y, plan), over(f.v_0, f.v_x, f.v_y, plan)};
    }
    static Range over(double zero, double by_x, double by_y, const Cell& plan) {
        Range x = Range{plan.west, plan.east} * by_x, y = Range{plan.south, plan.north} * by_y;
        double size = abs(zero) + max(abs(x.low), abs(x.high)) + max(abs(y.low), abs(y.high));
        double rounding = 2.0 * ROUNDING * size;
        return x + y + Range{zero - rounding, zero + rounding};
    }
    static Range in_surface(Range u) { return clamped(u + Range{-SLACK, SLACK}, 0.0, 1.0); }

    // A rectangle of (u, v) about a disc: how far it is from the middle, in parts of the radius,
    // the parameter of the curve, and the direction from the middle.
    struct Disc {
        Range rho, t, along_u, along_v;
    };

    static Disc disc_of(Range u, Range v) {
        Range q = u * 2.0 + Range{-1.0, -1.0}, p = v * 2.0 + Range{-1.0, -1.0};
        auto nearest = [](Range a) { return a.low > 0.0 ? a.low : a.high < 0.0 ? -a.high : 0.0; };
        Range rho{
            sqrt(square(nearest(q)) + square(nearest(p))),
            sqrt(square(max(-q.low, q.high)) + square(max(-p.low, p.high)))
        };
        Range t{max(0.5 + 0.5 * rho.low - SLACK, 0.5), min(0.5 + 0.5 * rho.high + SLACK, 1.0)};
        return {rho, t, direction(q, p), direction(p, q)};
    }

    // Bounds of a / sqrt(a² + b²): at corners, or where b is 0.
    static Range direction(Range a, Range b) {
        bool beside = b.low <= 0.0 && b.high >= 0.0;
        if (beside && a.low <= 0.0 && a.high >= 0.0) return {-1.0, 1.0};
        Range found{INF, -INF};
        for (double one : {a.low, a.high})
            for (double other : {b.low, b.high}) {
                double way = one / sqrt(one * one + other * other);
                found = around(found, {way, way});
            }
        if (beside && a.low > 0.0) found.high = 1.0;
        if (beside && a.high < 0.0) found.low = -1.0;
        return found + Range{-1e-12, 1e-12};
    }

    // What a disc does in a rectangle of (u, v), but for its scale and offset; false for nothing.
    bool add_disc(const Element& element, Range u, Range v, Part& part, bool& fills) const {
        Disc disc = disc_of(u, v);
        if (disc.rho.low > 1.0 + SLACK) return false;
        const Curve& x = curve(element.kind, X);
        part.lines += disc.rho.high > 1.0;
        fills = part.lines == 0;
        part.lines += count_of(x.steps_in(disc.t));
        part.height = x.over(disc.t, x.all()).value;
        return true;
    }

    // The same of an element of two curves, or of a grid of heights.
    bool add_surface(u32 index, Range u, Range v, const Cell& plan, Part& part, bool& fills) const {
        const u32 kind = field.elements[index].kind;
        const bool skew = places[index].skew;
        if (skew) {
            for (Range one : {u, v}) {
                if (one.high < -SLACK || one.low > 1.0 + SLACK) return false;
                part.lines += (one.low < 0.0) + (one.high > 1.0);
            }
        }
        fills = part.lines == 0;
        if (field.kinds[kind].combine == GRID) {
            RasterAt heights = raster(kind);
            PatchBlock block(heights, in_surface(u), in_surface(v));
            part.height = block.values();
            part.patches = block.patches(), part.voids = block.has_voids();
            part.cuts = part.voids;
            return true;
        }
        CurveRange both[2];
        for (int axis : {X, Y}) {
            const Curve& own = curve(kind, axis);
            const Range whole = axis == X ? u : v, t = in_surface(whole);
            PieceRange pieces = own.all();
            auto steps = own.steps_in(t);
            i64 across = count_of(steps);
            if (across && !skew) {
                across = 0;
                for (double step : steps) {
                    Line line = step_line(places[index], axis, step);
                    across += plan.crosses(line.axis, line.at);
                }
                part.straight += across;
                if (!across) {  // but along its sides
                    double middle = 0.5 * (whole.low + whole.high) + step_ahead(places[index]);
                    pieces = own.stretch(clamp(middle, 0.0, 1.0));
                }
            }
            part.lines += across, part.cuts |= !steps.empty();
            both[axis] = own.over(t, pieces);
        }
        part.height = combined(field.kinds[kind].combine, both[X].value, both[Y].value);
        return true;
    }

    // Bounds of the slopes of an element's primitive in u and v.
    std::array<Range, 2> slopes_by_uv(u32 index, const Cell& plan) const {
        const u32 kind = field.elements[index].kind;
        const u8 how = field.kinds[kind].combine;
        auto [u, v] = uv_of(index, plan);
        if (how == GRID) {
            RasterAt heights = raster(kind);
            return PatchBlock(heights, in_surface(u), in_surface(v)).slopes();
        }
        const Curve& x = curve(kind, X);
        if (how == RADIAL) {
            Disc disc = disc_of(u, v);
            Range slope = x.over(disc.t, x.all()).slope;
            return {slope * disc.along_u, slope * disc.along_v};
        }
        const Curve& y = curve(kind, Y);
        CurveRange a = x.over(in_surface(u), x.all()), b = y.over(in_surface(v), y.all());
        if (how == PRODUCT) return {a.slope * b.value, b.slope * a.value};
        if (how == SUM) return {a.slope, b.slope};
        // where the other curve may decide, it does not matter how steep this one is
        constexpr Range level{0.0, 0.0};
        if (!may_decide(how, a.value, b.value)) return {level, b.slope};
        if (!may_decide(how, b.value, a.value)) return {a.slope, level};
        return {around(a.slope, level), around(b.slope, level)};
    }
};

}  // namespace terratool::rays
