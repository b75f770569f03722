// Decimal numbers m × 10ᵉ to twice the precision of doubles.
#pragma once

#include "../exact.hpp"

namespace terratool {

constexpr i64 MAX_EXPONENT = 60;  // of the powers of ten that are known

// Powers of ten from -MAX_EXPONENT to MAX_EXPONENT, as sums of two doubles.
struct Powers {
    Matrix<const double> sums;
    INLINE double high(i64 exponent) const { return sums(exponent + MAX_EXPONENT, 0); }
    INLINE double rest(i64 exponent) const { return sums(exponent + MAX_EXPONENT, 1); }
};

// m × 10ᵉ of |e| ≤ MAX_EXPONENT, to some 2^-103 of its size.
INLINE DoubleSum decimal_number(u64 mantissa, i64 exponent, Powers powers) {
    double high = double(mantissa), power = powers.high(exponent);
    double low = double(i64(mantissa - u64(high)));
    auto [product, rest] = exact_product(high, power);
    rest += high * powers.rest(exponent) + low * power;
    double number = product + rest;
    return {number, rest - (number - product)};
}

constexpr u64 WHOLE = u64(1) << 53;  // up to it doubles hold all whole numbers
constexpr double DOUBT = 0x1p-100;

struct Scaled {
    double number;
    bool certain;  // whether its rounding is
};

// A number m × 10ᵉ of |e| ≤ MAX_EXPONENT.
INLINE Scaled scale(u64 mantissa, i64 exponent, Powers powers) {
    double high = double(mantissa);
    if (mantissa <= WHOLE && -22 <= exponent && exponent <= 22) {
        double power = powers.high(abs(exponent));
        return {exponent < 0 ? high / power : high * power, true};
    }
    auto [number, rest] = decimal_number(mantissa, exponent, powers);
    double doubt = number * DOUBT;
    return {number, number + (rest - doubt) == number && number + (rest + doubt) == number};
}

namespace definition {

// What doubles lack to their shortest decimals, which stand in a JSON array of numbers alone.
// A number that is larger than 10^60 or smaller than 10^-43 lacks nothing that matters.
inline void decimal_rests(Span<const u8> text, Matrix<const double> powers, In numbers, Out rests) {
    std::size_t at = 0;
    auto next = [&] { return at < text.size() ? text[at] : u8(']'); };
    auto digits = [&](auto take) {
        for (; next() >= '0' && next() <= '9'; ++at) take(i64(next() - '0'));
    };
    for (std::size_t n = 0; n < numbers.size(); ++n) {
        u64 mantissa = 0;
        i64 exponent = 0, written = 0;
        while (next() == '[' || next() == ',' || next() == '-') ++at;
        digits([&](i64 digit) { mantissa = mantissa * 10 + u64(digit); });
        if (next() == '.') {
            ++at;
            digits([&](i64 digit) { mantissa = mantissa * 10 + u64(digit), --exponent; });
        }
        if (next() == 'e') {
            ++at;
            bool below = next() == '-';
            at += below || next() == '+';
            digits([&](i64 digit) { written = min(written * 10 + digit, i64(1000)); });
            exponent += below ? -written : written;
        }
        rests[n] = 0.0;
        if (exponent < -MAX_EXPONENT || exponent > MAX_EXPONENT) continue;
        auto [high, low] = decimal_number(mantissa, exponent, {powers});
        double rest = (high - abs(numbers[n])) + low;
        rests[n] = std::signbit(numbers[n]) ? -rest : rest;
    }
}

}  // namespace definition

}  // namespace terratool
