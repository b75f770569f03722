// Walls between neighbouring pixels: where they may stand, whether they do, and which way they run.
//
// A pair of neighbours is a candidate if its labels differ. Whether there is a wall is found by
// halving what lies between the two centres: by the heights and slopes of the descent, and if that
// finds nothing, by labels.
#pragma once

#include <optional>
#include <stdexcept>
#include <variant>

#include "column_painting.hpp"

namespace terratool {

// Halvings between two pixels, down to a billionth of one: no slope changes the height much there.
constexpr i64 HALVINGS = 30;
// Rise of the rim of a dome over that billionth, in multiples of what its slope there gives.
constexpr double STEEPER = 4.0;
// Pixels of a row of which the differing labels are counted at once.
constexpr i64 STRETCH = 128;

using Heights = std::variant<Matrix<const float>, Matrix<const double>>;

// Pairs of different labels, their first pixels in the first `height` rows and `width` columns, and
// the differences of their heights, without sign; pairs with NaN are left out.
// A pair is twice the index of its first pixel, and one more if it goes from north to south.
inline std::tuple<std::vector<i64>, std::vector<double>> find_candidates(
    Matrix<const u32> labels, Heights heights, i64 height, i64 width
) {
    std::vector<i64> pairs;
    std::vector<double> rises;
    i64 rows = labels.rows(), columns = labels.columns();
    if (height > rows || width > columns) throw std::out_of_range("There are fewer labels.");
    auto compare = [&]<class T>(Matrix<const T> z) {
        auto along = [&](i64 row, i64 other, i64 shift, i64 count, i64 down) {
            Span<const u32> one = labels[row], two = labels[other].subspan(shift);
            for (i64 start = 0; start < count; start += STRETCH) {
                i64 end = min(start + STRETCH, count);
                u32 differing = 0;  // counted first: most stretches have none
                for (i64 c = start; c < end; ++c) differing += one[c] != two[c];
                for (i64 c = start; differing && c < end; ++c) {
                    T near = z(row, c), far = z(other, c + shift);
                    if (one[c] == two[c] || isnan(near + far)) continue;
                    pairs.push_back(2 * (row * columns + c) + down);
                    rises.push_back(abs(double(far) - double(near)));
                }
            }
        };
        for (i64 r = 0; r < height; ++r) {
            along(r, r, 1, min(width, columns - 1), 0);
            if (r + 1 < rows) along(r, r + 1, 0, width, 1);
        }
    };
    std::visit(compare, heights);
    return {std::move(pairs), std::move(rises)};
}

struct Wall {
    double at, jump;  // where on its line it stands, and how high it is; 0 for none
};

struct Slant {
    double z, slope;
};

// The pair that a wall is looked for in: a line, and two places on it.
struct Line {
    bool along_x;
    double low, high, fixed;
};

// Looks for walls; each thread needs its own.
class WallFinder {
public:
    // With `storeys`, walls are those of the highest tops, else those of the ground.
    WallFinder(const Field& field, Span<const u8> nonzero_edges, const Storeys* storeys)
        : field_(field), canvas_(field, false, true, nonzero_edges) {
        if (storeys) above_ = std::make_unique<ColumnPainting<u32>>(field, *storeys, true, true);
    }

    // For each pair the height of the wall in it, 0 if none, and for how much wall it stands.
    //
    // The `lengths` are in pixels. For each pixel of its length a wall with the normal n crosses
    // |n_x| pairs along x and |n_y| along y; so pairs that count |n_x| and |n_y| add up to it, n²
    // being 1. Walls along the axes, turned and round ones all have their length.
    void measure(
        Span<const i64> pairs, In x, In y, double resolution, double level, Out jumps, Out lengths
    ) {
        // least and greatest distance beside a wall, in pixels, at which it is looked for again, to
        // see which way it runs; walls nearly along the pair leave that reach, and weigh little
        constexpr double offset_pixels = 1.0 / 64.0;
        constexpr double reach_pixels = 0.25;
        constexpr double grazing = 0.5 * offset_pixels / reach_pixels;
        const double blur = 4.0 * std::ldexp(1.0, -(HALVINGS / 2));
        double reach = reach_pixels * resolution, offset = offset_pixels * resolution;
        for (std::size_t n = 0; n < pairs.size(); ++n) {
            Line line = line_of(pairs[n], x, y);
            auto [at, jump] = find_wall(line, resolution, HALVINGS, level);
            jumps[n] = jump;
            lengths[n] = jump == 0.0 ? 0.0 : grazing;
            if (jump == 0.0) continue;
            for (double side : {-offset, offset}) {
                Line parallel{line.along_x, at - reach, at + reach, line.fixed + side};
                auto [near, again] = find_wall(parallel, resolution, HALVINGS / 2, 0.5 * jump);
                if (again > 0.0) {
                    // as exactly as it was found it runs straight across the pair, or not
                    double shift = abs(near - at) > reach * blur ? near - at : 0.0;
                    lengths[n] = offset / sqrt(square(offset) + square(shift));
                    break;
                }
            }
        }
    }

    // Index of the first pair with a wall of at least this height, and the height; -1 for none.
    std::tuple<i64, double> first(
        Span<const i64> pairs, In heights, In x, In y, double resolution, double level
    ) {
        for (std::size_t n = 0; n < pairs.size(); ++n) {
            double jump = find_wall(line_of(pairs[n], x, y), resolution, HALVINGS, level).jump;
            if (jump > 0.0 && jump >= heights[n]) return {i64(n), jump};
        }
        return {-1, 0.0};
    }

    // Walls above `level` between the places of each pair: up to as many as there is room for.
    //
    // `places` and `jumps` are (pairs, most): where along its axis each stands, and by how much the
    // ground rises there to the east or north, below 0 if it falls; 0 for no wall. In no order.
    // More than one is looked for where one does not explain what rises.
    void between(
        Span<const i64> pairs, In x, In y, double resolution, double level, Matrix<double> places,
        Matrix<double> jumps
    ) {
        std::vector<std::pair<double, double>> todo;
        const double least = std::ldexp(1.0, -(HALVINGS - 4));
        for (std::size_t n = 0; n < pairs.size(); ++n) {
            Line line = line_of(pairs[n], x, y);
            auto height = [&](double at) { return slant(line.along_x, at, line.fixed).z; };
            std::ranges::fill(jumps[n], 0.0);
            double margin = (line.high - line.low) * least;
            double left = height(line.high);
            left -= height(line.low);
            i64 count = 0;
            todo.assign(1, {line.low, line.high});
            while (!todo.empty() && count < jumps.columns()) {
                auto [begin, end] = todo.back();
                todo.pop_back();
                Line part{line.along_x, begin, end, line.fixed};
                auto [at, jump] = count == 0 ? find_wall(part, resolution, HALVINGS, level)
                                             : find_jump(part, HALVINGS, level);
                if (jump == 0.0) continue;
                double after = height(at + margin);
                if (after < height(at - margin)) jump = -jump;
                places(n, count) = at, jumps(n, count) = jump;
                ++count;
                left -= jump;
                if (abs(left) > level) {
                    todo.push_back({begin, at - margin});
                    todo.push_back({at + margin, end});
                }
            }
        }
    }

    // A wall higher than `level` between two places on a line, by heights.
    // Kept is always the half whose change its slopes explain less.
    Wall find_jump(const Line& line, i64 halvings, double level) {
        auto [along_x, low, high, fixed] = line;
        Slant at_low = slant(along_x, low, fixed), at_high = slant(along_x, high, fixed);
        for (i64 halving = 0; halving < halvings; ++halving) {
            double half = 0.5 * (high - low), middle = low + half;
            if (!(low < middle && middle < high)) break;
            Slant at = slant(along_x, middle, fixed);
            double left = abs(at.z - at_low.z - 0.5 * half * (at_low.slope + at.slope));
            double right = abs(at_high.z - at.z - 0.5 * half * (at.slope + at_high.slope));
            if (left >= right) high = middle, at_high = at;
            else low = middle, at_low = at;
        }
        return {low + 0.5 * (high - low), wall_between(at_low, at_high, high - low, level)};
    }

    // As find_jump, by labels: slower, but a low wall beside something steep is found, too.
    Wall find_edge(const Line& line, double resolution, i64 halvings, double level) {
        constexpr int most_edges = 8;  // so many between two pixels are looked at for a wall
        auto [along_x, low, end, fixed] = line;
        u32 last = label(along_x, end, fixed, resolution);
        for (int edge = 0; edge < most_edges; ++edge) {
            u32 first = label(along_x, low, fixed, resolution);
            if (first == last) break;
            double high = end;
            for (i64 halving = 0; halving < halvings; ++halving) {
                double middle = low + 0.5 * (high - low);
                if (!(low < middle && middle < high)) break;
                (label(along_x, middle, fixed, resolution) == first ? low : high) = middle;
            }
            Slant at_low = slant(along_x, low, fixed), at_high = slant(along_x, high, fixed);
            double jump = wall_between(at_low, at_high, high - low, level);
            if (jump > 0.0) return {low + 0.5 * (high - low), jump};
            low = high;  // an edge without a wall; on to the next
        }
        return {low, 0.0};
    }

private:
    const Field& field_;
    Canvas<u32> canvas_;
    std::unique_ptr<ColumnPainting<u32>> above_;

    // The highest top at a point; nothing where there is the ground alone.
    std::optional<Face> top_at(double x, double y) {
        u64 near = above_ ? above_->near(x, y) : 0;
        if (!near) return {};
        const auto& column = above_->column_at(canvas_, x, y, near);
        return column.empty() ? Face{NaN, 0, -1} : column.back().top;
    }

    // Where between two places on a line a wall higher than `level` stands.
    Wall find_wall(const Line& line, double resolution, i64 halvings, double level) {
        Wall wall = find_jump(line, halvings, level);
        return wall.jump == 0.0 ? find_edge(line, resolution, halvings, level) : wall;
    }

    static Line line_of(i64 pair, In x, In y) {
        bool down = pair & 1;
        i64 wide = count_of(x), r = wide ? (pair >> 1) / wide : 0,
            c = wide ? (pair >> 1) % wide : 0;
        if (pair < 0 || c + !down >= wide || r + down >= count_of(y))
            throw std::out_of_range("A pair of pixels leads nowhere.");
        if (down) return {false, y[r + 1], y[r], x[c]};
        return {true, x[c], x[c + 1], y[r]};
    }

    // Height and slope along an axis; NaN outside and in the void.
    Slant slant(bool along_x, double at, double fixed) {
        double x = along_x ? at : fixed, y = along_x ? fixed : at;
        if (!is_inside(field_.bounds, x, y)) return {NaN, NaN};
        if (auto top = top_at(x, y)) return {top->z, along_x ? top->slope_x : top->slope_y};
        Found found = found_at<true>(field_, x, y, canvas_.stack);
        Worn worn = worn_of(field_, found);
        if (worn.is_void) return {NaN, NaN};
        double slope = along_x ? found.slope_x : found.slope_y;
        if (!has_tracks(field_) && !has_reliefs(field_)) return {found.z, slope};
        Ground<true> ground(field_, found.z, worn.surface, x, y);
        return {ground.z, slope + (along_x ? ground.slope_x : ground.slope_y)};
    }

    // Height of what two places so near to each other have between them, 0 if it is no wall.
    static double wall_between(Slant low, Slant high, double width, double level) {
        double jump = abs(high.z - low.z);
        double sloping = width * max(abs(low.slope), abs(high.slope));
        return jump > level && jump > STEEPER * sloping ? jump : 0.0;
    }

    // The label of a place, painted as a tile of one pixel.
    u32 label(bool along_x, double at, double fixed, double resolution) {
        double x = along_x ? at : fixed, y = along_x ? fixed : at;
        if (!is_inside(field_.bounds, x, y)) return 0;
        In xs(&x, 1), ys(&y, 1);
        Rectangle pixel{0, 1, 0, 1};
        paint_tile(field_, canvas_, xs, ys, resolution, pixel);
        if (has_tracks(field_)) paint_tracks(field_, canvas_, xs, ys, pixel);
        u32 painted = canvas_.labels(0, 0);
        auto top = top_at(x, y);
        return top && top->storey >= 0 ? above_->label_at(*top, x, y, resolution) : painted;
    }
};

}  // namespace terratool
