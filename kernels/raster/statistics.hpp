// Loops over pixels: what a raster holds, column by column.
#pragma once

#include <variant>

#include "../core.hpp"

namespace terratool::raster {

using Pixels = std::variant<Matrix<const float>, Matrix<const double>>;

// The first of `pixels` that is not NaN; 0 if there is none.
inline double first_number(Pixels pixels) {
    return std::visit(
        [](auto all) {
            for (auto value : all.flat())
                if (value == value) return double(value);
            return 0.0;
        },
        pixels
    );
}

// Statistics by column of `pixels` into `sums`, modulo its width: vector instructions without
// reordering sums. `sums` has rows: number, least, greatest, and the sums of what is above `shift`
// and of its squares.
inline void gather(Pixels pixels, double shift, Matrix<double> sums) {
    auto add = [&]<class T>(Matrix<const T> all) {
        i64 width = sums.columns();
        for (i64 column = 0; column < all.columns(); column += width) {
            i64 count = min(width, all.columns() - column);
            double *number = sums[0].data(), *low = sums[1].data(), *high = sums[2].data();
            double *total = sums[3].data(), *squares = sums[4].data();
            for (i64 r = 0; r < all.rows(); ++r) {
                const T* values = &all(r, column);
                for (i64 n = 0; n < count; ++n) {
                    double value = double(values[n]);
                    bool valid = value == value;
                    double above = valid ? value - shift : 0.0;
                    number[n] += valid ? 1.0 : 0.0;
                    low[n] = value < low[n] ? value : low[n];
                    high[n] = value > high[n] ? value : high[n];
                    total[n] += above;
                    squares[n] += above * above;
                }
            }
        }
    };
    std::visit(add, pixels);
}

}  // namespace terratool::raster
