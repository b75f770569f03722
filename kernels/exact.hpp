// Sums and products of doubles without rounding, as unevaluated sums of two (Dekker, A
// floating-point technique for extending the available precision, 1971; Knuth for sums).
#pragma once

#include "core.hpp"

namespace terratool {

struct DoubleSum {  // unevaluated: high + low
    double high, low;
};

// The sum of two doubles, exactly.
INLINE DoubleSum exact_sum(double a, double b) {
    double sum = a + b, back = sum - a;
    return {sum, (a - (sum - back)) + (b - back)};
}

// The product of two doubles, exactly unless it or its parts leave the range of doubles.
INLINE DoubleSum exact_product(double a, double b) {
    constexpr double split = 134217729.0;
    double product = a * b, wide = a * split;
    double a_high = wide - (wide - a), a_low = a - a_high;
    wide = b * split;
    double b_high = wide - (wide - b), b_low = b - b_high;
    return {
        product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low
    };
}

}  // namespace terratool
