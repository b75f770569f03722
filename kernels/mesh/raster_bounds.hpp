// Bounds of grids of heights over rectangles of numbers.
//
// Between four numbers, in a patch, the height is bilinear: its second derivatives are 0 but for
// the mixed one, the twist. Across a line between two patches its slope jumps by a second
// difference.
#pragma once

#include <memory>
#include <mutex>

#include "../field/rasters.hpp"

namespace terratool::mesh {

// What numbers reach, and without sign their second differences and the twists of patches.
struct PatchBounds {
    double low = INF, high = -INF, bend[2] = {0.0, 0.0}, twist = 0.0;

    void join(const PatchBounds& other) {
        low = min(low, other.low), high = max(high, other.high);
        for (int axis : {X, Y}) bend[axis] = max(bend[axis], other.bend[axis]);
        twist = max(twist, other.twist);
    }
};

// Numbers as bounds count them: those at the rim go on outside, and a void one is NaN where all
// patches beside it are void.
class PatchNumbers {
public:
    explicit PatchNumbers(const RasterAt& raster) : raster_(raster) {}

    const Raster& raster() const { return raster_.raster(); }

    // Bounds of numbers; of the lines that run inside, and of the patches between them.
    PatchBounds over(const NumberBlock& numbers) const {
        PatchBounds found;
        auto [west, east, south, north] = numbers;
        for (i64 j = south; j <= north; ++j)
            for (i64 i = west; i <= east; ++i) {
                double z = number(i, j);
                if (z < found.low) found.low = z;
                if (z > found.high) found.high = z;
                // what has a void number is NaN, which is not greater: nothing lies there
                auto widen = [](double& most, double one) {
                    most = abs(one) > most ? abs(one) : most;
                };
                if (west < i && i < east)
                    widen(found.bend[X], (number(i + 1, j) - z) - (z - number(i - 1, j)));
                if (south < j && j < north)
                    widen(found.bend[Y], (number(i, j + 1) - z) - (z - number(i, j - 1)));
                if (i < east && j < north)
                    widen(
                        found.twist,
                        (number(i + 1, j + 1) - number(i, j + 1)) - (number(i + 1, j) - z)
                    );
            }
        return found;
    }

private:
    RasterAt raster_;

    INLINE double number(i64 i, i64 j) const {
        const Raster& r = raster_.raster();
        i = clamp(i, i64(0), r.count[X] - 1), j = clamp(j, i64(0), r.count[Y] - 1);
        return r.pixel ? raster_.counting(i, j) : raster_.number(i, j);
    }
};

// Bounds of a grid over blocks of 8, 16, 32, … numbers a side.
class PatchPyramid {
public:
    PatchPyramid() = default;

    explicit PatchPyramid(const PatchNumbers& numbers) {
        const Raster& r = numbers.raster();
        constexpr i64 side = i64(1) << BASE;
        if (max(r.count[X], r.count[Y]) <= side) return;
        Level base(r, BASE);
        for (i64 j = 0; j < base.rows; ++j)
            for (i64 i = 0; i < base.columns; ++i) {
                i64 west = i * side, south = j * side;
                // with the lines and patches to both sides of the rim
                base.at(i, j) = numbers.over({west - 1, west + side, south - 1, south + side});
            }
        levels_.push_back(std::move(base));
        while (max(levels_.back().columns, levels_.back().rows) > 1) {
            const Level& below = levels_.back();
            Level level(r, BASE + count_of(levels_));
            for (i64 j = 0; j < below.rows; ++j)
                for (i64 i = 0; i < below.columns; ++i)
                    level.at(i >> 1, j >> 1).join(below.at(i, j));
            levels_.push_back(std::move(level));
        }
    }

    // Bounds over numbers: of no less than what PatchNumbers has.
    PatchBounds over(const PatchNumbers& numbers, const NumberBlock& block) const {
        constexpr i64 direct = 10, most = 4;  // numbers a side, and blocks less one
        auto [west, east, south, north] = block;
        i64 span = max(east - west, north - south);
        if (span < direct || levels_.empty()) return numbers.over(block);
        i64 k = 0;
        while (k + 1 < count_of(levels_) && (span >> (BASE + k)) > most) ++k;
        const Level& level = levels_[k];
        auto index = [&](i64 number, i64 count) {
            return clamp(number >> (BASE + k), i64(0), count - 1);
        };
        PatchBounds found;
        for (i64 j = index(south, level.rows); j <= index(north, level.rows); ++j)
            for (i64 i = index(west, level.columns); i <= index(east, level.columns); ++i)
                found.join(level.at(i, j));
        return found;
    }

private:
    static constexpr i64 BASE = 3;

    struct Level {
        i64 columns, rows;
        std::vector<PatchBounds> blocks;

        Level(const Raster& r, i64 shift)
            : columns(((r.count[X] - 1) >> shift) + 1), rows(((r.count[Y] - 1) >> shift) + 1),
              blocks(columns * rows) {}

        PatchBounds& at(i64 i, i64 j) { return blocks[j * columns + i]; }
        const PatchBounds& at(i64 i, i64 j) const { return blocks[j * columns + i]; }
    };
    std::vector<Level> levels_;
};

// The pyramids of all grids of a field, each made by the first that asks for it.
class PatchPyramids {
public:
    PatchPyramids() = default;
    explicit PatchPyramids(std::size_t rasters) : made_(std::make_unique<Made[]>(rasters)) {}

    const PatchPyramid& of(u32 raster, const PatchNumbers& numbers) const {
        Made& made = made_[raster];
        std::call_once(made.once, [&] { made.pyramid = PatchPyramid(numbers); });
        return made.pyramid;
    }

private:
    struct Made {
        std::once_flag once;
        PatchPyramid pyramid;
    };
    std::unique_ptr<Made[]> made_;
};

// A stretch along an axis of a grid, in numbers, and the first and last patch there.
struct NumberStretch {
    double low, high;
    i64 first, last;

    double width() const { return high - low; }

    // How far a chord over the stretch misses a function whose slope jumps by 1 at each line.
    // For one line, at a and b from the ends, it is a b / (a + b).
    double bends() const {
        if (last <= first) return 0.0;
        double lines = double(last - first), middle = 0.5 * double(first + 1 + last);
        double product = (middle - low) * (high - middle);
        return lines * (product - (lines * lines - 1.0) / 12.0) / width();
    }
};

// The numbers between two t in [0, 1], in parts of the distance of two numbers.
INLINE double number_at(const Raster& r, int axis, double t) {
    return r.pixel ? t * double(r.count[axis]) - 0.5 : t * double(r.count[axis] - 1);
}

// The number nearest to t along an axis, in t; t if all numbers are one.
INLINE double nearest_number(const Raster& r, int axis, double t) {
    if (r.count[axis] < 2) return t;
    double number = clamp(std::nearbyint(number_at(r, axis, t)), 0.0, double(r.count[axis] - 1));
    return r.pixel ? (number + 0.5) / double(r.count[axis]) : number / double(r.count[axis] - 1);
}

// The stretch between two t; what lies beyond a number by less than `near`, in numbers, is on it.
INLINE NumberStretch stretch_of(const Raster& r, int axis, double t0, double t1, double near) {
    double low = number_at(r, axis, clamp(t0, 0.0, 1.0));
    double high = number_at(r, axis, clamp(t1, 0.0, 1.0));
    if (ceil(low) - low <= near) low = ceil(low);
    if (high - floor(high) <= near) high = floor(high);
    high = max(low, high);
    i64 first = i64(floor(low));
    return {low, high, first, max(first, i64(ceil(high)) - 1)};
}

}  // namespace terratool::mesh
