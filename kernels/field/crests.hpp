// Crests: the highest ground of a pixel where its centre does not show it.
//
// Ground that is cut into pixels has its kinks between their centres: crests, roofs, lips of
// trenches, the tops of walls and posts. They lie where curves of elements have theirs, on straight
// lines and circles in the primitive, so these are walked along and the field is asked there. What
// a pixel gets are points of the terrain, with their places: no more than the ground itself.
#pragma once

#include <tuple>

#include "query.hpp"

namespace terratool {

// Where the curves of each kind have kinks, steps and peaks: those of curve x, or y, of kind k are
// from first[2 k], or first[2 k + 1], on to the next.
struct CrestLines {
    Span<const i64> first;
    In t;     // where
    In drop;  // by how much the slope along t falls there; below 0 where it rises; of a grid of
              // heights, whose slopes differ along a line, the most it changes
    In bend;  // of a peak: how fast the slope falls; likewise
    In wall;  // how high a step is there, without sign; the end of a curve is one
};

template <class Visit> void visit_arguments(CrestLines& c, Visit visit) {
    visit("first", c.first), visit("t[l]", c.t), visit("drop[l]", c.drop);
    visit("bend[l]", c.bend), visit("wall[l]", c.wall);
}

// Places where the ground of pixels stands out: row, from the north, and column of each pixel, how
// high the ground is, and how far to the east and the north of the pixel's centre.
using CrestPlaces = std::tuple<
    std::vector<i64>, std::vector<i64>, std::vector<float>, std::vector<float>, std::vector<float>>;

// Looks for crests in the pixels of a window whose centres are `x` and, from the north, `y`.
class CrestFinder {
public:
    // Left out is what stands out by less than `least`. `weights` say how much an element's height
    // changes at most where its curve x, or y, changes by 1. `heights` are those of the centres.
    CrestFinder(
        const Field& field, const CrestLines& lines, Matrix<const double> weights, In x, In y,
        double resolution, double least, Matrix<const float> heights
    )
        : field_(field), lines_(lines), weights_(weights), x_(x), y_(y), side_(resolution),
          least_(least), heights_(heights), stack_(field.pending),
          west_(x.front() - 0.5 * resolution), east_(x.back() + 0.5 * resolution),
          south_(y.back() - 0.5 * resolution), north_(y.front() + 0.5 * resolution) {}

    // For each pixel the highest place of its crests, and of its tops: where crests cross, or the
    // middle of a disc. On a slope these are not the highest, but what stands out most.
    CrestPlaces find() {
        std::vector<u64> waiting{0};
        std::vector<u32> found;  // in a free grid
        while (!waiting.empty()) {
            u64 g = waiting.back();
            const Grid& grid = field_.grids[g];
            waiting.pop_back();
            if (grid.more) waiting.push_back(g + 1);
            if (grid.local) continue;  // finer than doubles: smaller than any pixel
            if (grid.standing != IN_CELLS) {
                find_free_met(grid, found);
                for (u32 index : found) visit_element(grid, index, waiting);
                continue;
            }
            Range across = cells_met(grid, X, west_, east_);
            Range along = cells_met(grid, Y, south_, north_);
            for (i64 j = along.first >> grid.shift[Y]; j <= along.last >> grid.shift[Y]; ++j) {
                for (i64 i = across.first >> grid.shift[X]; i <= across.last >> grid.shift[X]; ++i)
                    visit_bin(grid, i, j, across, along, waiting);
            }
        }
        return best();
    }

private:
    // So far from a wall the ground on either side of it is asked for, in pixels.
    static constexpr double APART = 1e-6;

    struct Range {
        i64 first, last;
    };

    // A place in a pixel: which, row by row.
    struct Place {
        i64 pixel;
        bool top;
        float height, east, north;
    };

    // An element's primitive in the world: a place at (u, v) of it, from its middle, lies at
    // (x + a u_x + b v_x, y + a u_y + b v_y), a and b from -1/2 to 1/2.
    struct Frame {
        const Element& element;
        const Kind& kind;
        double x, y, u_x, u_y, v_x, v_y;
        double length[2];   // of the sides
        double wide, tall;  // of the cell, which trims it; infinite where none does
        bool trimmed;
        const double* weights;
    };

    const Field& field_;
    const CrestLines& lines_;
    Matrix<const double> weights_;
    In x_, y_;
    double side_, least_;
    Matrix<const float> heights_;
    Stack stack_;
    double west_, east_, south_, north_;
    std::vector<Place> found_;

    static Range cells_met(const Grid& grid, int axis, double low, double high) {
        double most = grid.count[axis] - 1.0;
        auto cell = [&](double at) { return floor(cells_from_corner(grid, axis, at)); };
        return {i64(clamp(cell(low) - 1.0, 0.0, most)), i64(clamp(cell(high) + 1.0, 0.0, most))};
    }

    // The elements of a free grid whose bins meet the window.
    void find_free_met(const Grid& grid, std::vector<u32>& found) const {
        const FreeBins& bins = field_.free_bins[grid.free];
        auto met = [&](int axis, double low, double high) {
            return free_bins_met(
                bins, axis, from_parent(grid, axis, low, 0.0), from_parent(grid, axis, high, 0.0)
            );
        };
        find_free(field_, grid, met(X, west_, east_), met(Y, south_, north_), found);
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
            visit_element(grid, index, waiting);
        }
    }

    // Walk along the crests of an element that meets the window; the grids that it has are left to
    // wait.
    void visit_element(const Grid& grid, u64 index, std::vector<u64>& waiting) {
        const Element& element = field_.elements[index];
        const Pose pose = pose_of(field_, element);
        double low[2], wide[2], beyond[2] = {0.0, 0.0};  // how far it reaches beyond its cell
        for (int axis : {X, Y}) {
            if (pose.free) {
                const terratool::Place& place = field_.places[place_of(element)];
                auto reach = free_reach(field_.poses[element.pose], place);
                wide[axis] = place.extent[axis];
                low[axis] = grid.corner[axis][0] + (place.at[axis] - 0.5 * wide[axis]);
                beyond[axis] = max(reach[axis] - 0.5 * wide[axis], 0.0);
                continue;
            }
            GridAxis a = axis_of(grid, axis);
            low[axis] = edge_position(a, double(element.cell[axis])).high;
            wide[axis] = pose.size[axis] * (a.pitch + a.pitch_rest);
        }
        if (low[X] - beyond[X] > east_ || low[X] + wide[X] + beyond[X] < west_
            || low[Y] - beyond[Y] > north_ || low[Y] + wide[Y] + beyond[Y] < south_)
            return;
        if (element.grid) waiting.push_back(element.grid);
        bool whole = pose.turned && pose.free;
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
            whole ? INF : wide[X],
            whole ? INF : wide[Y],
            pose.turned && !pose.free && pose.cos != 0.0,
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
        if (frame.trimmed) walk_edges(frame);
    }

    // How far a kink and a peak stand above the chord of a pixel across them.
    double above_chord(double drop, double bend, double length) const {
        double share = side_ / length;
        return 0.5 * drop * share + 0.125 * bend * share * share;
    }

    // How much a line of a curve may raise a pixel, for each unit that the element weighs it with.
    double rise_of(i64 line, double length) const {
        return above_chord(abs(lines_.drop[line]), abs(lines_.bend[line]), length)
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

    // A place of the primitive.
    struct Point {
        double at[2];                   // u and v
        bool wall[2] = {false, false};  // whether it is on a wall across u, or v
        bool top = false;
    };

    // Ask about a place of the primitive, on a wall on both sides of it, where two meet on all
    // four.
    void ask(const Frame& f, const Point& point) {
        auto shift = [&](int axis) {
            return point.wall[axis] ? APART * side_ / f.length[axis] : 0.0;
        };
        double shift_u = shift(X), shift_v = shift(Y);
        for (double s : {-1.0, 1.0}) {
            for (double t : {-1.0, 1.0}) {
                double a = point.at[X] - 0.5 + s * shift_u, b = point.at[Y] - 0.5 + t * shift_v;
                double east = a * f.u_x + b * f.v_x, north = a * f.u_y + b * f.v_y;
                // beyond its cell an element is trimmed; its edge is one, too
                if (abs(east) <= 0.5 * f.wide + side_ && abs(north) <= 0.5 * f.tall + side_)
                    look_at(f.x + east, f.y + north, point.top);
                if (shift_v == 0.0) break;
            }
            if (shift_u == 0.0) break;
        }
    }

    // Which part of a line from one end to the other lies in a rectangle; the end before the
    // beginning for none.
    static std::pair<double, double> clipped(
        double x, double y, double dx, double dy, const std::array<double, 4>& bounds
    ) {
        double begin = 0.0, end = 1.0;
        auto clip = [&](double at, double d, double low, double high) {
            if (d == 0.0) {
                if (at < low || at > high) end = -1.0;
                return;
            }
            double one = (low - at) / d, other = (high - at) / d;
            begin = max(begin, min(one, other)), end = min(end, max(one, other));
        };
        clip(x, dx, bounds[0], bounds[1]), clip(y, dy, bounds[2], bounds[3]);
        return {begin, end};
    }

    // Which of the steps of 1 / `count` along a line from one end to the other meet the window.
    Range steps_met(double x, double y, double dx, double dy, i64 count) const {
        auto [begin, end] =
            clipped(x, y, dx, dy, {west_ - side_, east_ + side_, south_ - side_, north_ + side_});
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
            double dx = axis == X ? f.v_x : f.u_x, dy = axis == X ? f.v_y : f.u_y;
            auto [low, high] = steps_met(x, y, dx, dy, count);
            for (i64 s = low; s <= high; ++s) ask_line(f, axis, n, double(s) / double(count));
            if (f.trimmed && high >= low) {
                // where the cell cuts it off, as far inside as on both sides of a wall
                double half_wide = 0.5 * f.wide - 2.0 * APART * side_;
                double half_tall = 0.5 * f.tall - 2.0 * APART * side_;
                auto [one, two] = clipped(
                    x, y, dx, dy,
                    {f.x - half_wide, f.x + half_wide, f.y - half_tall, f.y + half_tall}
                );
                if (one <= two) ask_line(f, axis, n, one, true), ask_line(f, axis, n, two, true);
            }
            // where two lines cross stands the top of a pyramid
            for (i64 m = lines_.first[2 * kind + other];
                 high >= low && axis == X && m < lines_.first[2 * kind + other + 1]; ++m) {
                double at = lines_.t[m] * double(count);
                if (double(low) - 1.0 <= at && at <= double(high) + 1.0)
                    ask_line(f, axis, n, lines_.t[m], true, is_wall(f, m));
            }
        }
    }

    // Ask about a place on a line, if the element has a crest and not a trough there: `top` where
    // it ends or another crosses it, which may be a wall.
    void ask_line(
        const Frame& f, int axis, i64 line, double at, bool top = false, bool crosses_wall = false
    ) {
        int other = 1 - axis;
        Point point;
        point.at[axis] = lines_.t[line], point.wall[axis] = is_wall(f, line);
        point.at[other] = at, point.wall[other] = crosses_wall;
        point.top = top;
        if (!point.wall[X] && !point.wall[Y]) {
            double factor = f.element.scale, drop = lines_.drop[line];
            if (f.kind.combine == PRODUCT) factor *= curve(f, other, at).value;
            if (f.kind.combine == GRID) drop = drop_of_grid(f, axis, point);
            if (factor * above_chord(drop, lines_.bend[line], f.length[axis]) < least_) return;
            point.wall[axis] = isnan(drop);  // ground on one side of it
        }
        ask(f, point);
    }

    // By how much the slope of a grid falls across a line of numbers; NaN at the edge of a void.
    // Between lines it does not change, and beyond the rim it is 0.
    double drop_of_grid(const Frame& f, int axis, const Point& point) const {
        RasterAt raster(field_.curves, f.kind);
        double aside = 0.25 / double(raster.raster().count[axis]);
        auto slope = [&](double t) {
            if (t < 0.0 || t > 1.0) return 0.0;
            ShapePoint z = raster.at(axis == X ? UV{t, point.at[Y]} : UV{point.at[X], t});
            return axis == X ? z.du : z.dv;
        };
        return slope(point.at[axis] - aside) - slope(point.at[axis] + aside);
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
                ask(f, {{axis == X ? one : at, axis == X ? at : one}});
            }
        }
    }

    // Walk along the edges of the cell where these trim a turned element.
    void walk_edges(const Frame& f) {
        double area = f.u_x * f.v_y - f.u_y * f.v_x;
        auto ask_edge = [&](double east, double north) {
            bool outside = abs(east * f.v_y - north * f.v_x) > 0.5 * abs(area)
                || abs(north * f.u_x - east * f.u_y) > 0.5 * abs(area);
            if (!outside) look_at(f.x + east, f.y + north, false);
        };
        double half_wide = 0.5 * f.wide - APART * side_, half_tall = 0.5 * f.tall - APART * side_;
        i64 across = steps_of(f.wide), along = steps_of(f.tall);
        for (double sign : {-1.0, 1.0}) {
            auto row = steps_met(f.x - half_wide, f.y + sign * half_tall, f.wide, 0.0, across);
            for (i64 s = row.first; s <= row.last; ++s)
                ask_edge((double(s) / double(across) - 0.5) * 2.0 * half_wide, sign * half_tall);
            auto column = steps_met(f.x + sign * half_wide, f.y - half_tall, 0.0, f.tall, along);
            for (i64 s = column.first; s <= column.last; ++s)
                ask_edge(sign * half_wide, (double(s) / double(along) - 0.5) * 2.0 * half_tall);
        }
    }

    // Walk along the circles where the curve of a disc has a crest; its middle may be one.
    void walk_circles(const Frame& f) {
        i64 kind = i64(f.element.kind);
        double length = 0.5 * max(f.length[X], f.length[Y]);
        if (length > 0.0) ask(f, {{0.5, 0.5}, {false, false}, true});
        for (i64 n = lines_.first[2 * kind]; n < lines_.first[2 * kind + 1]; ++n) {
            double rho = 2.0 * lines_.t[n] - 1.0;
            if (rho <= 0.0) continue;
            bool wall = is_wall(f, n);
            double rise =
                above_chord(lines_.drop[n], lines_.bend[n], min(f.length[X], f.length[Y]));
            if (!wall && f.element.scale * rise < least_) continue;
            i64 count = max(i64(8), i64(ceil(2.0 * PI * rho * length * 2.0 / side_)));
            for (i64 s = 0; s < count; ++s) {
                double angle = 2.0 * PI * double(s) / double(count);
                double c = 0.5 * cos(angle), d = 0.5 * sin(angle);
                double shift = wall ? APART * side_ / length : 0.0;
                ask(f, {{0.5 + (rho - shift) * c, 0.5 + (rho - shift) * d}});
                if (wall) ask(f, {{0.5 + (rho + shift) * c, 0.5 + (rho + shift) * d}});
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

    // How high a place would be between the four centres around it; NaN if not all have ground.
    double between(double east, double north, i64 row, i64 column) const {
        i64 right = column + (east > 0.0 ? 1 : -1), up = row + (north > 0.0 ? -1 : 1);
        if (min(right, up) < 0 || right >= heights_.columns() || up >= heights_.rows()) return NaN;
        double p = abs(east) / side_, q = abs(north) / side_;
        return (1.0 - q)
            * ((1.0 - p) * double(heights_(row, column)) + p * double(heights_(row, right)))
            + q * ((1.0 - p) * double(heights_(up, column)) + p * double(heights_(up, right)));
    }

    // Keep a place that stands out. What does not stand above the centres around it, in the middle
    // of them, is as high as one of these above any plane.
    void look_at(double x, double y, bool top) {
        i64 c = nearest(x_, x, x_.front(), 1.0), r = nearest(y_, y, y_.front(), -1.0);
        if (c < 0 || r < 0) return;
        double z = height_at(field_, x, y, stack_);
        double east = x - x_[c], north = y - y_[r];
        if (isnan(z) || z - between(east, north, r, c) < least_) return;
        found_.push_back({r * count_of(x_) + c, top, float(z), float(east), float(north)});
    }

    // The highest places, tops for themselves; of those of one height always the same.
    CrestPlaces best() {
        auto order = [](const Place& p) {
            return std::tuple(p.pixel, p.top, -p.height, p.east, p.north);
        };
        std::sort(found_.begin(), found_.end(), [&](const Place& one, const Place& two) {
            return order(one) < order(two);
        });
        CrestPlaces places;
        auto& [row, column, height, east, north] = places;
        const Place* last = nullptr;
        for (const Place& p : found_) {
            bool again = last && last->pixel == p.pixel && last->top == p.top;
            last = &p;
            if (again) continue;
            row.push_back(p.pixel / count_of(x_)), column.push_back(p.pixel % count_of(x_));
            height.push_back(p.height), east.push_back(p.east), north.push_back(p.north);
        }
        return places;
    }
};

inline CrestPlaces find_crests(
    const Field& field, const CrestLines& lines, Matrix<const double> weights, In x, In y,
    double resolution, double least, Matrix<const float> heights
) {
    if (x.empty() || y.empty()) return {};
    return CrestFinder(field, lines, weights, x, y, resolution, least, heights).find();
}

}  // namespace terratool
