// Whole DEMs: heights become counts of steps and text, classes become rectangles, and what was
// written is compared with what was wanted.
#pragma once

#include <charconv>
#include <string>
#include <tuple>

#include "../core.hpp"

namespace terratool::importing {

constexpr i64 SWATH = 64;  // columns worked on at once, so that a band's columns stay in the cache

// Round one row to whole steps above `base`.
// Unknown heights take the nearest known one's to the west, else to the east; where none is known
// they keep what `counts` holds.
inline void round_row(In heights, double step, double base, Span<i64> counts) {
    i64 known = -1;
    for (i64 i = 0; i < count_of(heights); ++i) {
        if (!isnan(heights[i])) {
            counts[i] = i64(std::rint((heights[i] - base) / step));
            if (known < 0) std::fill_n(counts.begin(), i, counts[i]);
            known = i;
        } else if (known >= 0) {
            counts[i] = counts[known];
        }
    }
}

// The heights that counts stand for.
inline void lay_levels(double step, double base, Span<const i64> counts, Out levels) {
    for (i64 i = 0; i < count_of(counts); ++i) levels[i] = base + double(counts[i]) * step;
}

// Round a block of rows: every `size`-th by itself, the others against two that came before.
// `heights` has a multiple of `size` rows, a power of two, and one more; NaN for unknown. `above`,
// if given, are the counts of the last row. `counts` gets how many steps a row lies above the base,
// or above the mean of the two rows that it is midway between, where unknown heights add nothing;
// `levels` the heights that come of it.
inline void round_rows(
    Matrix<const double> heights, i64 size, double step, double base, Span<const i64> above,
    Matrix<i64> counts, Matrix<double> levels
) {
    i64 last = heights.rows() - 1, width = heights.columns();
    for (i64 row = last; row >= 0; row -= size) {
        Span<i64> own = counts[row];
        if (row < last) {
            std::ranges::copy(counts[row + size], own.begin());  // for a row without any height
        } else if (above.empty()) {
            std::ranges::fill(own, 0);
        } else {
            std::ranges::copy(above, own.begin());
            lay_levels(step, base, own, levels[row]);
            continue;
        }
        round_row(heights[row], step, base, own);
        lay_levels(step, base, own, levels[row]);
    }
    std::array<double, SWATH> whole;
    for (i64 west = 0; west < width; west += SWATH) {
        i64 east = min(width, west + SWATH);
        for (i64 distance = size; distance >= 2; distance /= 2) {
            i64 half = distance / 2;
            for (i64 row = half; row < last; row += distance) {
                In before = levels[row - half], behind = levels[row + half], own = heights[row];
                Out level = levels[row];
                for (i64 i = west; i < east; ++i) {
                    double mean = (before[i] + behind[i]) / 2.0;
                    double height = isnan(own[i]) ? mean : own[i];  // adds nothing
                    double count = std::rint((height - mean) / step);
                    whole[i - west] = count;
                    level[i] = mean + count * step;
                }
                for (i64 i = west; i < east; ++i) counts(row, i) = i64(whole[i - west]);
            }
        }
    }
}

// Whole numbers as an array of JSON.
inline std::string write_integers(Span<const i64> numbers) {
    constexpr std::size_t LONGEST = 21;  // with a comma
    if (numbers.empty()) return "[]";
    std::string text(numbers.size() * LONGEST + 1, '[');
    char *at = text.data() + 1, *end = text.data() + text.size();
    for (i64 number : numbers) {
        at = std::to_chars(at, end, number).ptr;
        *at++ = ',';
    }
    at[-1] = ']';
    text.resize(at - text.data());
    return text;
}

// Cut a raster of classes into rectangles: runs of rows, joined where they repeat below.
// Negative classes are left out. A rectangle is column, row, width, height and class.
inline Rows<i64, 5> cut_rectangles(Matrix<const i64> classes) {
    Rows<i64, 5> found;
    // by its first column, the rectangle that ended in the row before
    std::vector<i64> known(classes.columns(), -1);
    for (i64 row = 0; row < classes.rows(); ++row) {
        Span<const i64> line = classes[row];
        for (i64 column = 0, end; column < classes.columns(); column = end) {
            i64 value = line[column];
            end = column + 1;
            while (end < classes.columns() && line[end] == value) ++end;
            if (value < 0) continue;
            i64 old = known[column];
            if (old >= 0) {
                auto& [west, south, width, height, number] = found[old];
                if (south + height == row && width == end - column && number == value) {
                    ++height;
                    continue;
                }
            }
            known[column] = count_of(found);
            found.push_back({column, row, end - column, 1, value});
        }
    }
    return found;
}

// Compare heights with those of the field; where `heights` are NaN they do not count.
// `sums` holds a sum of squares, which is added to, and the largest difference, which becomes NaN
// where a height is missing in the field. Returns the pixel of the largest difference, -1 if none
// is larger than `sums` had, and how many were compared.
inline std::tuple<i64, i64> compare(In heights, In ours, Out sums) {
    i64 at = -1, count = 0;
    auto [squares, largest] = std::array{sums[0], sums[1]};
    for (i64 n = 0; n < count_of(heights); ++n) {
        double apart = abs(heights[n] - ours[n]);
        if (!(apart <= largest)) {
            if (isnan(heights[n])) continue;
            largest = apart;
            at = n;
            if (isnan(apart)) break;
        }
        squares += apart * apart;
        ++count;
    }
    sums[0] = squares, sums[1] = largest;
    return {at, count};
}

}  // namespace terratool::importing
