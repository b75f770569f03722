// Crests: the highest ground of a pixel where its centre does not show it.
//
// Ground that is cut into pixels has its kinks between their centres: crests, roofs, lips of
// trenches, the tops of walls and posts. They lie where curves of elements have theirs, on straight
// lines and circles in the primitive, so these are walked along and the field is asked there. What
// a pixel gets is a point of the terrain, with its place: no more than the ground itself.
#pragma once

#include "query.hpp"

namespace terratool {

// Where the curves of each kind have kinks, steps and peaks: those of curve x, or y, of kind k are
// from first[2 k], or first[2 k + 1], on to the next.
struct CrestLines {
    Span<const i64> first;
    In t;     // where
    In drop;  // by how much the slope along t falls there; below 0 where it rises
    In bend;  // of a peak: how fast the slope falls; likewise
    In wall;  // how high a step is there, without sign; the end of a curve is one
};

template <class Visit> void visit_arguments(CrestLines& c, Visit visit) {
    visit("first", c.first), visit("t[l]", c.t), visit("drop[l]", c.drop);
    visit("bend[l]", c.bend), visit("wall[l]", c.wall);
}

// What the pixels of a window have for their highest ground, rows from the north: how high it is,
// and how far to the east and the north of their centres.
struct CrestPlanes {
    Matrix<float> heights, east, north;
};

template <class Visit> void visit_arguments(CrestPlanes& p, Visit visit) {
    visit("heights[h,w]", p.heights), visit("east[h,w]", p.east), visit("north[h,w]", p.north);
}

// Looks for crests in the pixels of a window whose centres are `x` and, from the north, `y`.
class CrestFinder {
public:
    // Left out is what no crest could raise by `least`. `weights` say how much an element's height
    // changes at most where its curve x, or y, changes by 1. `heights` are those of the centres.
    CrestFinder(
        const Field& field, const CrestLines& lines, Matrix<const double> weights, In x, In y,
        double resolution, double least, Matrix<const float> heights, const CrestPlanes& out
    )
        : field_(field), lines_(lines), weights_(weights), x_(x), y_(y), side_(resolution),
          least_(least), heights_(heights), out_(out), stack_(field.pending),
          west_(x.front() - 0.5 * resolution), east_(x.back() + 0.5 * resolution),
          south_(y.back() - 0.5 * resolution), north_(y.front() + 0.5 * resolution) {}

    // Raise the pixels; how many points were asked for that raised one.
    i64 raise() {
        std::vector<u64> waiting{0};
        while (!waiting.empty()) {
            const Grid& grid = field_.grids[waiting.back()];
            waiting.pop_back();
            if (grid.local) continue;  // finer than doubles: smaller than any pixel
            Range across = cells_met(grid, X, west_, east_);
            Range along = cells_met(grid, Y, south_, north_);
            for (i64 j = along.first >> grid.shift[Y]; j <= along.last >> grid.shift[Y]; ++j) {
                for (i64 i = across.first >> grid.shift[X]; i <= across.last >> grid.shift[X]; ++i)
                    visit_bin(grid, i, j, across, along, waiting);
            }
        }
        return raised_;
    }

private:
    struct Range {
        i64 first, last;
    };

    // An element's primitive in the world: a place at (u, v) of it, from its middle, lies at
    // (x + a u_x + b v_x, y + a u_y + b v_y), a and b from -1/2 to 1/2.
    struct Frame {
        const Element& element;
        const Kind& kind;
        double x, y, u_x, u_y, v_x, v_y;
        double length[2];   // of the sides
        double wide, tall;  // of the cell, which trims it
        const double* weights;
    };

    const Field& field_;
    const CrestLines& lines_;
    Matrix<const double> weights_;
    In x_, y_;
    double side_, least_;
    Matrix<const float> heights_;
    const CrestPlanes& out_;
    Stack stack_;
    double west_, east_, south_, north_;
    i64 raised_ = 0;

    static Range cells_met(const Grid& grid, int axis, double low, double high) {
        double most = grid.count[axis] - 1.0;
        auto cell = [&](double at) { return floor(cells_from_corner(grid, axis, at)); };
        return {i64(clamp(cell(low) - 1.0, 0.0, most)), i64(clamp(cell(high) + 1.0, 0.0, most))};
    }

    void visit_bin(
        const Grid& grid, i64 i, i64 j, Range across, Range along, std::vector<u64>& waiting
    ) {
        u64 bin = u64(grid.table + j * i64(grid.row) + i);
        for (u64 k = field_.offsets[bin]; k < field_.offsets[bin + 1]; ++k) {
            u64 index = listed_element(field_, grid, k);
            const Element& element = field_.elements[index];
            // an element in several bins is taken at the first of them
            bool first = max(i64(element.cell[X]), across.first) >> grid.shift[X] == i
                && max(i64(element.cell[Y]), along.first) >> grid.shift[Y] == j;
            if (grid.listed && !first) continue;
            if (visit_element(grid, index) && element.grid) waiting.push_back(element.grid);
        }
    }

    // Whether an element's cell meets the window; its crests are walked along.
    bool visit_element(const Grid& grid, u64 index) {
        const Element& element = field_.elements[index];
        const Pose& pose = field_.poses[element.pose];
        double low[2], wide[2];
        for (int axis : {X, Y}) {
            GridAxis a = axis_of(grid, axis);
            low[axis] = edge_position(a, double(element.cell[axis])).high;
            wide[axis] = pose.size[axis] * (a.pitch + a.pitch_rest);
        }
        if (low[X] > east_ || low[X] + wide[X] < west_ || low[Y] > north_
            || low[Y] + wide[Y] < south_)
            return false;
        Frame frame{
            element,
            field_.kinds[element.kind],
            low[X] + 0.5 * wide[X],
            low[Y] + 0.5 * wide[Y],
            wide[X],
            0.0,
            0.0,
            wide[Y],
            {wide[X], wide[Y]},
            wide[X],
            wide[Y],
            &weights_(i64(index), 0)
        };
        if (pose.turned) {
            frame.u_x = pose.cos * wide[X], frame.u_y = -pose.sin_u * wide[Y];
            frame.v_x = pose.sin_v * wide[X], frame.v_y = pose.cos * wide[Y];
            frame.length[X] = hypot(frame.u_x, frame.u_y);
            frame.length[Y] = hypot(frame.v_x, frame.v_y);
        }
        if (frame.kind.combine == RADIAL) {
            walk_circles(frame);
        } else {
            walk_lines(frame, X), walk_lines(frame, Y);
            bool roofed = (frame.kind.combine == MIN && element.scale > 0.0)
                || (frame.kind.combine == MAX && element.scale < 0.0);
            if (roofed) walk_roof(frame, X), walk_roof(frame, Y);
        }
        return true;
    }

    // How much a line of a curve may raise a pixel, for each unit that the element weighs it with.
    double rise_of(i64 line, double length) const {
        double share = side_ / length;
        return 0.5 * abs(lines_.drop[line]) * share + 0.125 * abs(lines_.bend[line]) * share * share
            + lines_.wall[line];
    }

    // Whether a line may be the foot of a wall, as the end of a curve is with an offset.
    bool is_wall(const Frame& f, i64 line) const {
        double t = lines_.t[line];
        return lines_.wall[line] > 0.0 || (f.element.offset != 0.0 && (t == 0.0 || t == 1.0));
    }

    CurvePoint curve(const Frame& f, int axis, double t) const {
        return any_curve(field_.curves, curve_of(f.kind, axis), clamp(t, 0.0, 1.0));
    }

    // Ask about a place of the primitive, beside a wall on both sides of it along u or v.
    void ask(const Frame& f, double u, double v, bool beside, int axis) {
        double a = u - 0.5, b = v - 0.5;
        auto at = [&](double p, double q) {
            double east = p * f.u_x + q * f.v_x, north = p * f.u_y + q * f.v_y;
            // beyond its cell an element is trimmed; its edge is one, too
            if (abs(east) <= 0.5 * f.wide + side_ && abs(north) <= 0.5 * f.tall + side_)
                raise_at(f.x + east, f.y + north);
        };
        if (!beside) return at(a, b);
        constexpr double apart = 1e-6;  // in pixels
        double shift = apart * side_ / f.length[axis];
        for (double s : {-shift, shift}) at(axis == X ? a + s : a, axis == X ? b : b + s);
    }

    // Which of the steps of 1 / `count` along a line from one end to the other meet the window.
    Range steps_met(double x, double y, double dx, double dy, i64 count) const {
        double begin = 0.0, end = 1.0;
        auto clip = [&](double at, double d, double low, double high) {
            low -= side_, high += side_;
            if (d == 0.0) {
                if (at < low || at > high) end = -1.0;
                return;
            }
            double one = (low - at) / d, other = (high - at) / d;
            begin = max(begin, min(one, other)), end = min(end, max(one, other));
        };
        clip(x, dx, west_, east_), clip(y, dy, south_, north_);
        if (begin > end) return {0, -1};
        return {i64(floor(begin * double(count))), i64(ceil(end * double(count)))};
    }

    // Steps of half a pixel along a side.
    i64 steps_of(double length) const {
        constexpr double most = 1e9;
        return max(i64(1), i64(ceil(min(2.0 * length / side_, most))));
    }

    // Walk along the lines where a curve has a crest.
    void walk_lines(const Frame& f, int axis) {
        int other = 1 - axis;
        i64 kind = i64(f.element.kind), begin = lines_.first[2 * kind + axis];
        i64 end = lines_.first[2 * kind + axis + 1];
        i64 count = steps_of(f.length[other]);
        for (i64 n = begin; n < end; ++n) {
            double rise = f.weights[axis] * rise_of(n, f.length[axis]);
            if (is_wall(f, n)) rise += abs(f.element.offset);
            if (rise < least_) continue;
            double a = lines_.t[n] - 0.5;
            double x = f.x + a * (axis == X ? f.u_x : f.v_x) - 0.5 * (axis == X ? f.v_x : f.u_x);
            double y = f.y + a * (axis == X ? f.u_y : f.v_y) - 0.5 * (axis == X ? f.v_y : f.u_y);
            auto [low, high] =
                steps_met(x, y, axis == X ? f.v_x : f.u_x, axis == X ? f.v_y : f.u_y, count);
            for (i64 s = low; s <= high; ++s) ask_crossing(f, axis, n, double(s) / double(count));
            // where two lines cross stands the top of a pyramid
            for (i64 m = lines_.first[2 * kind + other];
                 high >= low && axis == X && m < lines_.first[2 * kind + other + 1]; ++m) {
                double at = lines_.t[m] * double(count);
                if (double(low) - 1.0 <= at && at <= double(high) + 1.0)
                    ask_crossing(f, axis, n, lines_.t[m]);
            }
        }
    }

    // Ask about a place on a line, if the element has a crest and not a trough there.
    void ask_crossing(const Frame& f, int axis, i64 line, double at) {
        bool wall = is_wall(f, line);
        if (!wall) {
            double factor = f.element.scale;
            if (f.kind.combine == PRODUCT) factor *= curve(f, 1 - axis, at).value;
            double share = side_ / f.length[axis];
            double rise =
                0.5 * lines_.drop[line] * share + 0.125 * lines_.bend[line] * share * share;
            if (factor * rise < least_) return;
        }
        double t = lines_.t[line];
        ask(f, axis == X ? t : at, axis == X ? at : t, wall, axis);
    }

    // Walk along the curve where the lesser of two slopes changes.
    void walk_roof(const Frame& f, int axis) {
        int other = 1 - axis;
        i64 count = steps_of(f.length[other]), across = steps_of(f.length[axis]);
        for (i64 s = 0; s <= count; ++s) {
            double at = double(s) / double(count), level = curve(f, other, at).value;
            double a = at - 0.5;
            double x = f.x + a * (axis == X ? f.v_x : f.u_x) - 0.5 * (axis == X ? f.u_x : f.v_x);
            double y = f.y + a * (axis == X ? f.v_y : f.u_y) - 0.5 * (axis == X ? f.u_y : f.v_y);
            auto [low, high] =
                steps_met(x, y, axis == X ? f.u_x : f.v_x, axis == X ? f.u_y : f.v_y, across);
            for (i64 n = low; n < high; ++n) {
                double one = double(n) / double(across), two = double(n + 1) / double(across);
                bool above = curve(f, axis, one).value > level;
                if ((curve(f, axis, two).value > level) == above) continue;
                for (int halving = 0; halving < 30; ++halving) {
                    double middle = 0.5 * (one + two);
                    ((curve(f, axis, middle).value > level) == above ? one : two) = middle;
                }
                ask(f, axis == X ? one : at, axis == X ? at : one, false, axis);
            }
        }
    }

    // Walk along the circles where the curve of a disc has a crest; its middle may be one.
    void walk_circles(const Frame& f) {
        i64 kind = i64(f.element.kind);
        double length = 0.5 * max(f.length[X], f.length[Y]);
        if (length > 0.0) ask(f, 0.5, 0.5, false, X);
        for (i64 n = lines_.first[2 * kind]; n < lines_.first[2 * kind + 1]; ++n) {
            double rho = 2.0 * lines_.t[n] - 1.0;
            if (rho <= 0.0) continue;
            bool wall = is_wall(f, n);
            double share = side_ / min(f.length[X], f.length[Y]);
            double rise = 0.5 * lines_.drop[n] * share + 0.125 * lines_.bend[n] * share * share;
            if (!wall && f.element.scale * rise < least_) continue;
            i64 count = max(i64(8), i64(ceil(2.0 * PI * rho * length * 2.0 / side_)));
            for (i64 s = 0; s < count; ++s) {
                double angle = 2.0 * PI * double(s) / double(count);
                double c = 0.5 * cos(angle), d = 0.5 * sin(angle);
                constexpr double apart = 1e-6;  // in pixels
                double shift = wall ? apart * side_ / length : 0.0;
                ask(f, 0.5 + (rho - shift) * c, 0.5 + (rho - shift) * d, false, X);
                if (wall) ask(f, 0.5 + (rho + shift) * c, 0.5 + (rho + shift) * d, false, X);
            }
        }
    }

    // Index of the nearest of even centres; -1 for none.
    i64 nearest(In centres, double at, double first, double direction) const {
        i64 last = count_of(centres) - 1;
        i64 n = i64(floor((at - first) * direction / side_ + 0.5));
        if (n < -1 || n > last + 1) return -1;
        n = clamp(n, i64(0), last);
        while (n < last && abs(centres[n + 1] - at) < abs(centres[n] - at)) ++n;
        while (n > 0 && abs(centres[n - 1] - at) <= abs(centres[n] - at)) --n;
        return abs(centres[n] - at) <= 0.5000001 * side_ ? n : -1;
    }

    // How fast the ground rises from the pixel before to that behind, along an axis.
    double trend(i64 row, i64 column, int axis) const {
        auto z = [&](i64 shift) {
            i64 r = axis == Y ? row - shift : row, c = axis == X ? column + shift : column;
            bool inside = 0 <= r && r < heights_.rows() && 0 <= c && c < heights_.columns();
            return inside ? double(heights_(r, c)) : NaN;
        };
        double rise = (z(1) - z(-1)) / (2.0 * side_);
        return isnan(rise) ? 0.0 : rise;
    }

    // Give a place to its pixel if it stands out most, as seen along the slope of the ground there.
    void raise_at(double x, double y) {
        i64 c = nearest(x_, x, x_.front(), 1.0), r = nearest(y_, y, y_.front(), -1.0);
        if (c < 0 || r < 0) return;
        double z = height_at(field_, x, y, stack_);
        if (isnan(z)) return;
        float &best = out_.heights(r, c), &east = out_.east(r, c), &north = out_.north(r, c);
        float to_east = float(x - x_[c]), to_north = float(y - y_[r]);
        double by_x = trend(r, c, X), by_y = trend(r, c, Y);
        double now = isnan(best) ? -INF : double(best) - by_x * double(east) - by_y * double(north);
        double score = z - by_x * double(to_east) - by_y * double(to_north);
        if (score < now) return;
        if (score == now && std::tie(to_east, to_north) >= std::tie(east, north)) return;
        best = float(z), east = to_east, north = to_north;
        ++raised_;
    }
};

inline i64 raise_crests(
    const Field& field, const CrestLines& lines, Matrix<const double> weights, In x, In y,
    double resolution, double least, Matrix<const float> heights, const CrestPlanes& out
) {
    if (x.empty() || y.empty()) return 0;
    return CrestFinder(field, lines, weights, x, y, resolution, least, heights, out).raise();
}

}  // namespace terratool
