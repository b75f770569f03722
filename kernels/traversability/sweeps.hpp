// A vehicle's footprint swept over ground, all columns of a row at a time.
//
// Ground is (rows, phases, columns): of `phases` neighbouring pixels one is a reference point, and
// pixel `phases · q + p` of a row is at [p, q], so that what lies equally far from the reference
// points of a row lies side by side. Where there is no ground it is minus infinity. Offsets are
// (n, 3): rows, phase and columns, as seen from [row, 0, 0] of a reference point; `first` is the
// row of the first reference points. What is made is (height, width).
#pragma once

#include <type_traits>

#include "../core.hpp"

namespace terratool::traversability {

using Heights = Matrix<const float>;
using Ground = Cube<const float>;
using Offsets = Matrix<const i64>;

constexpr float NO_GROUND = -std::numeric_limits<float>::infinity();

INLINE float higher(float a, float b) { return a > b ? a : b; }

// What lies at an offset of the reference points of row `i`.
template <class T>
INLINE const T* swept_row(Cube<const T> ground, i64 first, Span<const i64> offset, i64 i) {
    return &ground(first + ground.rows() * i + offset[0], offset[1], offset[2]);
}

// Columns that are worked on at a time: what is gathered for them stays in registers, or nearly.
constexpr i64 BLOCK = 32;

using Block = std::array<float, BLOCK>;

// Go through `width` columns: visit(first, number). The last block overlaps the one before, so that
// the number is a constant if it can be.
template <class Visit> INLINE void visit_blocks(i64 width, Visit visit) {
    if (width <= 0) return;
    if (width < BLOCK) return visit(0, width);
    for (i64 j = 0; j < width; j += BLOCK)
        visit(min(j, width - BLOCK), std::integral_constant<i64, BLOCK>());
}

// Go through all reference points: visit(row, first column, number of columns).
template <class Visit> INLINE void visit_points(Matrix<float> points, Visit visit) {
    for (i64 i = 0; i < points.rows(); ++i)
        visit_blocks(points.columns(), [&](i64 j, auto count) { visit(i, j, count); });
}

// For each reference point the highest ground under offsets.
inline void highest(Ground ground, i64 first, Offsets offsets, Matrix<float> out) {
    visit_points(out, [&](i64 i, i64 j, auto count) {
        Block best;
        best.fill(NO_GROUND);
        for (i64 n = 0; n < offsets.rows(); ++n) {
            const float* row = swept_row(ground, first, offsets[n], i) + j;
            for (i64 k = 0; k < count; ++k) best[k] = higher(row[k], best[k]);
        }
        std::copy_n(best.data(), i64(count), &out(i, j));
    });
}

// How high a wheel's lowest point stands at every pixel of `heights`, its circle raised by `lift`
// at each offset of its tread, (n, 2) rows and columns.
// Minus infinity where there is no ground, and along the edges, where not all of it is known.
inline void supports(Heights heights, Offsets tread, Span<const float> lift, Matrix<float> out) {
    i64 lost = 0;
    for (i64 offset : tread.flat()) lost = max(lost, abs(offset));
    out.fill(NO_GROUND);
    for (i64 i = lost; i < out.rows() - lost; ++i) {
        visit_blocks(out.columns() - 2 * lost, [&](i64 j, auto count) {
            Block best;
            best.fill(NO_GROUND);
            for (i64 n = 0; n < tread.rows(); ++n) {
                const float* row = &heights(i + tread(n, 0), lost + j + tread(n, 1));
                float raised = lift[n];
                for (i64 k = 0; k < count; ++k) best[k] = higher(row[k] + raised, best[k]);
            }
            std::copy_n(best.data(), i64(count), &out(i, lost + j));
        });
    }
}

// A rectangle that heads along the unit vector `east`, `north`: from `begin` to `end` ahead of the
// reference point and up to `side` to each side of it, m.
struct Body {
    double east, north, begin, end, side;
};

template <class Visit> void visit_arguments(Body& b, Visit visit) {
    visit("east", b.east), visit("north", b.north), visit("begin", b.begin);
    visit("end", b.end), visit("side", b.side);
}

// Where ground between the centres of pixels stands out: its height, and how far to the east and
// the north of its pixel's centre it lies, m. They are few: rows and columns are those of the
// ground before it is laid out for sweeps.
struct Crests {
    Span<const i64> row, column;
    Span<const float> height, east, north;
};

template <class Visit> void visit_arguments(Crests& c, Visit visit) {
    visit("row[n]", c.row), visit("column[n]", c.column), visit("height[n]", c.height);
    visit("east[n]", c.east), visit("north[n]", c.north);
}

// Raise `supports` where a wheel's circle meets crests: `wheel` is what it covers, `shifts` are how
// far east and north each offset of its tread is, m.
inline void raise_supports(
    const Crests& crests, Offsets tread, Matrix<const float> shifts, const Body& wheel,
    Matrix<float> out
) {
    const float e = float(wheel.east), n = float(wheel.north), side = float(wheel.side);
    const float radius = float(wheel.end), square = radius * radius;
    i64 lost = 0;
    for (i64 offset : tread.flat()) lost = max(lost, abs(offset));
    for (std::size_t c = 0; c < crests.row.size(); ++c) {
        for (i64 k = 0; k < tread.rows(); ++k) {
            i64 i = crests.row[c] - tread(k, 0), j = crests.column[c] - tread(k, 1);
            if (min(i, j) < lost || i >= out.rows() - lost || j >= out.columns() - lost) continue;
            float x = shifts(k, 0) + crests.east[c], y = shifts(k, 1) + crests.north[c];
            float along = x * e + y * n, left = square - along * along;
            if (left < 0.0f || abs(y * e - x * n) > side) continue;
            out(i, j) = higher(crests.height[c] + sqrt(left) - radius, out(i, j));
        }
    }
}

// How the wheels of a vehicle stand on the pixels around them, and what plane that makes.
struct Standing {
    Offsets wheels;               // the pixel nearest to each
    Offsets nearest;              // likewise, in the supports of wheels of its size
    Offsets corners;              // there, for each wheel the four pixels around it
    Matrix<const double> shares;  // (wheels, 4), of these at the very middle of the wheel
    Matrix<const double> fit;     // (3, wheels): what each says of the plane's height and slopes
};

template <class Visit> void visit_arguments(Standing& s, Visit visit) {
    visit("wheels[k,3]", s.wheels), visit("nearest[k,3]", s.nearest);
    visit("corners[_,3]", s.corners);
    visit("shares[k,4]", s.shares), visit("fit[3,k]", s.fit);
}

// For each reference point the plane through the supports of the wheels: height, dz/dx and dz/dy.
// It is NaN where a wheel has no ground. Between pixels supports run along straight lines, but not
// beside ground that is not there.
inline void stand(
    Ground supports, Ground ground, i64 first, const Standing& standing, Cube<float> out
) {
    visit_points(out[0], [&](i64 i, i64 j, auto count) {
        std::array<std::array<double, BLOCK>, 3> total{};
        std::array<double, BLOCK> height;
        for (i64 n = 0; n < standing.wheels.rows(); ++n) {
            height.fill(0.0);
            for (i64 c = 0; c < 4; ++c) {
                double share = standing.shares(n, c);
                if (share == 0.0) continue;
                const float* row = swept_row(supports, first, standing.corners[4 * n + c], i) + j;
                for (i64 k = 0; k < count; ++k) height[k] += share * double(row[k]);
            }
            const float* nearest = swept_row(supports, first, standing.nearest[n], i) + j;
            const float* under = swept_row(ground, first, standing.wheels[n], i) + j;
            for (i64 k = 0; k < count; ++k) {
                double z = height[k] > -INF ? height[k] : double(nearest[k]);
                height[k] = under[k] > NO_GROUND ? z : NaN;
            }
            for (i64 p = 0; p < 3; ++p)
                for (i64 k = 0; k < count; ++k) total[p][k] += standing.fit(p, n) * height[k];
        }
        for (i64 p = 0; p < 3; ++p)
            for (i64 k = 0; k < count; ++k) out(p, i, j + k) = float(total[p][k]);
    });
}

// For each reference point the mean over offsets.
inline void mean(Ground ground, i64 first, Offsets offsets, Matrix<float> out) {
    float share = float(1.0 / double(offsets.rows()));
    visit_points(out, [&](i64 i, i64 j, auto count) {
        Block total{};
        for (i64 n = 0; n < offsets.rows(); ++n) {
            const float* row = swept_row(ground, first, offsets[n], i) + j;
            for (i64 k = 0; k < count; ++k) total[k] += row[k];
        }
        for (i64 k = 0; k < count; ++k) out(i, j + k) = total[k] * share;
    });
}

// For each reference point how far the ground under offsets, by rows, stands above its plane at
// most; minus infinity for no offsets.
// `shifts` are (n, 2), how far east and north each is, m; `plane` (3, height, width), its height,
// dz/dx and dz/dy.
inline void bumps(
    Ground ground, i64 first, Offsets offsets, Matrix<const float> shifts, Ground plane,
    Matrix<float> out
) {
    visit_points(out, [&](i64 i, i64 j, auto count) {
        const float *level = &plane(0, i, j), *east = &plane(1, i, j), *north = &plane(2, i, j);
        Block best, line;
        best.fill(NO_GROUND);
        for (i64 n = 0; n < offsets.rows();) {
            i64 line_of = offsets(n, 0);
            float dy = shifts(n, 1);
            line.fill(NO_GROUND);
            for (; n < offsets.rows() && offsets(n, 0) == line_of; ++n) {
                const float* row = swept_row(ground, first, offsets[n], i) + j;
                float dx = shifts(n, 0);
                for (i64 k = 0; k < count; ++k) line[k] = higher(row[k] - east[k] * dx, line[k]);
            }
            for (i64 k = 0; k < count; ++k) best[k] = higher(line[k] - north[k] * dy, best[k]);
        }
        for (i64 k = 0; k < count; ++k) out(i, j + k) = best[k] - level[k];
    });
}

// Raise what `bumps` found to where crests within a body stand above the plane.
// Reference points lie `phases` pixels apart from row and column `first` on; offsets are (n, 2),
// rows and columns.
inline void raise_bumps(
    const Crests& crests, i64 phases, i64 first, Offsets offsets, Matrix<const float> shifts,
    Ground plane, const Body& body, Matrix<float> out
) {
    const float e = float(body.east), n = float(body.north), side = float(body.side);
    const float half = float(0.5 * (body.end - body.begin));
    const float middle = float(0.5 * (body.begin + body.end));
    auto phase = [&](i64 pixels) { return (pixels % phases + phases) % phases; };
    // by their phases: of a crest's pixel only some lead to reference points
    std::vector<std::vector<i64>> alike(std::size_t(phases * phases));
    for (i64 k = 0; k < offsets.rows(); ++k)
        alike[phase(offsets(k, 0)) * phases + phase(offsets(k, 1))].push_back(k);
    for (std::size_t c = 0; c < crests.row.size(); ++c) {
        i64 row = crests.row[c] - first, column = crests.column[c] - first;
        for (i64 k : alike[phase(row) * phases + phase(column)]) {
            i64 i = (row - offsets(k, 0)) / phases, j = (column - offsets(k, 1)) / phases;
            if (row < offsets(k, 0) || column < offsets(k, 1)) continue;
            if (i >= out.rows() || j >= out.columns()) continue;
            float x = shifts(k, 0) + crests.east[c], y = shifts(k, 1) + crests.north[c];
            if (abs(x * e + y * n - middle) > half || abs(y * e - x * n) > side) continue;
            auto of = [&](i64 p) { return plane(p, i, j); };
            float& found = out(i, j);
            found = higher(crests.height[c] - of(1) * x - of(2) * y - of(0), found);
        }
    }
}

// For each reference point the RMS distance of the ground at offsets from its plane.
// The plane is that of least squares; distances are along z. NaN where ground is missing. Offsets
// are symmetric about the reference point; `plane` is as in `bumps` and only keeps numbers small;
// `spread` is the inverse of the offsets' second moments, xx, xy, yy; 0 for none.
inline void roughness(
    Ground ground, i64 first, Offsets offsets, Matrix<const float> shifts, Ground plane,
    Span<const float> spread, Matrix<float> out
) {
    float share = float(1.0 / double(max(i64(1), offsets.rows())));
    visit_points(out, [&](i64 i, i64 j, auto count) {
        const float *level = &plane(0, i, j), *east = &plane(1, i, j), *north = &plane(2, i, j);
        Block total{}, squares{}, by_x{}, by_y{};
        for (i64 n = 0; n < offsets.rows(); ++n) {
            const float* row = swept_row(ground, first, offsets[n], i) + j;
            float dx = shifts(n, 0), dy = shifts(n, 1);
            for (i64 k = 0; k < count; ++k) {
                float z = row[k] - (level[k] + east[k] * dx + north[k] * dy);
                total[k] += z;
                squares[k] += z * z;
                by_x[k] += z * dx;
                by_y[k] += z * dy;
            }
        }
        for (i64 k = 0; k < count; ++k) {
            float x = by_x[k], y = by_y[k];
            float fitted = spread[0] * x * x + 2.0f * spread[1] * x * y + spread[2] * y * y;
            float left = (squares[k] - total[k] * total[k] * share - fitted) * share;
            out(i, j + k) = left == left ? sqrt(max(left, 0.0f)) : left;
        }
    });
}

// Walls of trenches so narrow that a wheel touches both of their edges.
struct Gaps {
    In width;  // for each pair, along its axis, m; infinity for no such trench
    In rise;   // of the one edge above the other, m
    In lean;   // how far the wall shifts along the axis from a line of pixels to the next
    double radius, side;  // of the wheels and of the pixels, m
};

template <class Visit> void visit_arguments(Gaps& g, Visit visit) {
    visit("width[n]", g.width), visit("rise[n]", g.rise), visit("lean[n]", g.lean);
    visit("radius", g.radius), visit("side", g.side);
}

// How deep a wheel sinks in between two edges, the one above the other, so far apart where it
// heads: it touches the upper at γ + β from the downward vertical, tan γ = rise / width and
// sin β = √(width² + rise²) / D.
inline double step_between(double width, double rise, double radius) {
    double chord = hypot(width, rise) / (2.0 * radius);
    double angle = atan2(rise, width) + asin(min(chord, 1.0));
    return chord >= 1.0 || angle >= 0.5 * PI ? radius : radius * (1.0 - cos(angle));
}

// The step that a wheel meets at pair `n`: that of the trench there, or what it is seen to rise.
inline double step_met(
    const Gaps& gaps, std::size_t n, double east, double north, bool down, double seen
) {
    if (!(gaps.width[n] < INF)) return seen;
    double lean = gaps.lean[n];
    double across = abs(down ? north - lean * east : east + lean * north);
    double width = across > 0.0 ? gaps.width[n] / across : INF;
    // pixels show a trench narrower or wider by up to one on each side; what shows much less of
    // one is a hole that the wheel goes over with a part of its width
    double shown = max(0.0, width - 2.0 * gaps.side);
    if (seen < step_between(shown, 0.0, gaps.radius)) return seen;
    return step_between(width, gaps.rise[n], gaps.radius);
}

// Mark pixels beside walls with the step that a wheel with a heading, or its opposite, meets.
// That is the wall, or what the wheel rises or sinks within some strides before and behind it if
// that is less: it bridges narrow gaps, and goes along walls. What it rises by the slope of the
// ground is not counted: the median of its strides.
// `supports` says how high a wheel stands. `pairs` have twice the index of the first pixel, and one
// for a pair from north to south; `jumps` the heights of the walls, infinity for a steep face
// without one; `gaps` are trenches, whose width counts and not what pixels make of it. `east` and
// `north` are the unit vector of the heading, `strides` are of a pixel's side. `out` is 0 at first.
inline void raise_steps(
    Heights supports, Span<const i64> pairs, In jumps, const Gaps& gaps, double east, double north,
    i64 strides, Matrix<float> out
) {
    i64 rows = supports.rows(), columns = supports.columns();
    std::vector<double> taken, sorted;
    auto less = [](double a, double b) { return a < b || (isnan(b) && !isnan(a)); };
    for (std::size_t n = 0; n < pairs.size(); ++n) {
        i64 pixel = pairs[n] >> 1, down = pairs[n] & 1;
        i64 row = pixel / columns, column = pixel % columns;
        double low = 0.5 * double(down), high = 0.5 * double(1 - down);
        float last = NO_GROUND;
        taken.clear();
        for (i64 s = -strides; s <= strides; ++s) {
            i64 r = i64(floor(double(row) + low - double(s) * north + 0.5));
            i64 c = i64(floor(double(column) + high + double(s) * east + 0.5));
            bool inside = 0 <= r && r < rows && 0 <= c && c < columns;
            float z = inside ? supports(r, c) : NO_GROUND;
            if (!(z > NO_GROUND)) continue;
            if (last > NO_GROUND) taken.push_back(double(z) - double(last));
            last = z;
        }
        if (taken.empty()) continue;
        sorted = taken;
        auto median = sorted.begin() + count_of(sorted) / 2;
        std::nth_element(sorted.begin(), median, sorted.end(), less);
        double at = 0.0, least = 0.0, most = 0.0;
        for (double rise : taken) {
            at += rise - *median;
            least = min(least, at), most = max(most, at);
        }
        double met = step_met(gaps, n, east, north, down, most - least);
        float step = float(min(jumps[n], met));
        for (i64 p : {pixel, pixel + (down ? columns : 1)}) {
            float& marked = out.flat()[p];
            marked = max(marked, step);
        }
    }
}

}  // namespace terratool::traversability
