// Runs of numbers in a text, at the speed of memory rather than of Python.
//
// A decimal number m × 10ᵉ is exact in one operation where m < 2⁵³ and |e| ≤ 22 (Clinger, How to
// read floating point numbers accurately, 1990). Others are computed to twice the precision
// (Dekker, A floating-point technique for extending the available precision, 1971), and where that
// leaves a doubt about the rounding, or the number is very long, large or small, Python reads it.
#pragma once

#include <tuple>

#include "../definition/decimals.hpp"

namespace terratool::importing {

constexpr u64 MANY = 1'000'000'000'000'000'000;  // a mantissa from here on takes no further digit

enum ByteClass : u8 { GAP = 1, DIGIT = 2, END = 4, HASH = 8 };  // END: ends a number, too

constexpr std::array<u8, 256> BYTE_CLASSES = [] {
    std::array<u8, 256> classes{};
    for (u8 c : {'\t', '\n', '\v', '\f', '\r', ' ', ','}) classes[c] = GAP;  // a comma is a space
    for (u8 c = '0'; c <= '9'; ++c) classes[c] = DIGIT;
    for (u8 c : {'[', ']', '{', '}', '"'}) classes[c] = END;
    classes['#'] = HASH;
    return classes;
}();

// What is left of a text.
class Reader {
public:
    Reader(Span<const u8> text, i64 at) : text_(text), at_(at) {}

    INLINE i64 at() const { return at_; }
    INLINE bool is_at_end() const { return at_ == count_of(text_); }
    INLINE u8 byte() const { return text_[at_]; }
    INLINE bool is(char c) const { return !is_at_end() && byte() == u8(c); }
    INLINE bool is_letter(char lower) const { return !is_at_end() && (byte() | 32) == u8(lower); }
    INLINE bool is_class(u8 any) const { return !is_at_end() && BYTE_CLASSES[byte()] & any; }
    INLINE void pass() { ++at_; }
    INLINE bool take(char c) {
        bool is_there = is(c);
        at_ += is_there;
        return is_there;
    }
    // The value of the digit that comes next, which it passes over; -1 if there is none.
    INLINE i64 digit() { return is_class(DIGIT) ? text_[at_++] - '0' : -1; }
    INLINE i64 hexadecimal() {
        if (is_class(DIGIT)) return text_[at_++] - '0';
        u8 letter = is_at_end() ? 0 : byte() | 32;
        if (letter < 'a' || letter > 'f') return -1;
        ++at_;
        return letter - 'a' + 10;
    }
    INLINE bool is_hexadecimal() const {
        return is('0') && at_ + 1 < count_of(text_) && (text_[at_ + 1] | 32) == 'x';
    }
    INLINE void pass_gaps() {
        while (true) {
            if (is_class(GAP)) ++at_;
            else if (!is('#')) return;
            else
                while (!is_at_end() && !is('\n') && !is('\r')) ++at_;
        }
    }

private:
    Span<const u8> text_;
    i64 at_;
};

enum Kind { NUMBER, HARD, WRONG };  // HARD: for Python

struct Read {
    Kind kind;
    double value = 0.0;
};

// The number that begins here, behind its sign.
INLINE Read read_number(Reader& reader, Powers powers) {
    u64 mantissa = 0;
    i64 exponent = 0, digits = 0, digit;
    bool certain = true;
    if (reader.is_hexadecimal()) {
        reader.pass(), reader.pass();
        for (; (digit = reader.hexadecimal()) >= 0; ++digits) {
            certain = certain && mantissa < MANY;
            mantissa = mantissa * 16 + u64(digit);
        }
    } else {
        for (; (digit = reader.digit()) >= 0; ++digits) {
            if (mantissa < MANY) mantissa = mantissa * 10 + u64(digit);
            else certain = false;
        }
        if (reader.take('.')) {
            for (; (digit = reader.digit()) >= 0; ++digits) {
                if (mantissa < MANY) mantissa = mantissa * 10 + u64(digit), --exponent;
                else if (digit) certain = false;
            }
        }
        if (digits && reader.is_letter('e')) {
            reader.pass();
            bool below = reader.take('-');
            if (!below) reader.take('+');
            if (!reader.is_class(DIGIT)) return {WRONG};
            i64 written = 0;
            while ((digit = reader.digit()) >= 0)
                if (written < 1000) written = written * 10 + digit;
            exponent += below ? -written : written;
        }
    }
    if (!digits || !(reader.is_at_end() || reader.is_class(GAP | END | HASH))) return {WRONG};
    if (!certain) return {HARD};
    if (!mantissa) return {NUMBER, 0.0};
    if (exponent < -MAX_EXPONENT || exponent > MAX_EXPONENT) return {HARD};
    auto [number, sure] = scale(mantissa, exponent, powers);
    return sure ? Read{NUMBER, number} : Read{HARD};
}

// Read numbers from a byte of a text on, up to what is none.
// `powers` are those of ten from -MAX_EXPONENT to MAX_EXPONENT, as sums of two doubles. Returns the
// numbers; which of them Python must read, and where they begin; and where the next word begins,
// which is no number even if it begins like one.
inline std::tuple<std::vector<double>, std::vector<std::pair<i64, i64>>, i64> read_numbers(
    Span<const u8> text, i64 at, Matrix<const double> powers
) {
    std::vector<double> numbers;
    std::vector<std::pair<i64, i64>> hard;
    Reader reader(text, at);
    while (true) {
        reader.pass_gaps();
        i64 begin = reader.at();
        bool negative = reader.take('-');
        if (!negative && !reader.take('+') && !reader.is('.') && !reader.is_class(DIGIT))
            return {std::move(numbers), std::move(hard), begin};
        auto [kind, value] = read_number(reader, {powers});
        if (kind == WRONG) return {std::move(numbers), std::move(hard), begin};
        if (kind == HARD) hard.emplace_back(count_of(numbers), begin);
        numbers.push_back(negative ? -value : value);
    }
}

}  // namespace terratool::importing
