// Long vectors of a JSON text, read at the speed of memory rather than of Python.
#pragma once

#include <cstring>

#include "decimals.hpp"

namespace terratool::definition {

INLINE bool is_json_space(u8 c) { return c == ' ' || c == '\n' || c == '\r' || c == '\t'; }

// Lists of at least `least` items behind a key "x" or "y" that may be numbers alone: begin, end and
// count of each, one after the other.
inline std::vector<i64> find_vectors(Span<const u8> text, i64 least) {
    std::vector<i64> found;
    i64 end = count_of(text);
    auto is_of_vector = [](u8 c) {
        return (c >= '0' && c <= '9') || c == ',' || c == '.' || c == '-' || c == '+' || c == 'e'
            || c == 'E' || is_json_space(c);
    };
    // whether a bracket stands behind the key; within a text its quotes would have backslashes
    auto is_behind_key = [&](i64 at) {
        auto before = [&] { return at > 0 ? text[at - 1] : u8(0); };
        auto pass_space = [&] {
            while (is_json_space(before())) --at;
        };
        pass_space();
        if (before() != ':') return false;
        --at;
        pass_space();
        if (at < 3 || text[at - 1] != '"' || text[at - 3] != '"') return false;
        return (text[at - 2] == 'x' || text[at - 2] == 'y') && (at == 3 || text[at - 4] != '\\');
    };
    for (i64 at = 0; at < end; ++at) {
        const void* next = std::memchr(text.data() + at, '[', std::size_t(end - at));
        if (!next) break;
        i64 first = static_cast<const u8*>(next) - text.data(), count = 1;
        at = first;
        if (!is_behind_key(first)) continue;
        for (++at; at < end && is_of_vector(text[at]); ++at) count += text[at] == ',';
        if (at < end && text[at] == ']' && count >= least)
            found.insert(found.end(), {first, at + 1, count});
        else --at;  // it may be a bracket itself
    }
    return found;
}

// Read the numbers of a vector, brackets included, into `numbers`; whether all are numbers of JSON
// of at most `most` in size whose rounding is certain.
inline bool read_vector(
    Span<const u8> text, Matrix<const double> powers, double most, Out numbers
) {
    constexpr i64 MOST_DIGITS = 18;  // more may not fit into a mantissa
    i64 end = count_of(text), at = 1, count = count_of(numbers);
    // the last bracket ends every number, so that nothing beyond is read
    if (end < 2 || text[0] != '[' || text[end - 1] != ']') return false;
    auto digit = [&] { return u8(text[at] - '0'); };
    auto pass_space = [&] {
        while (is_json_space(text[at])) ++at;
    };
    for (i64 n = 0; n < count; ++n) {
        pass_space();
        bool negative = text[at] == '-';
        at += negative;
        u64 mantissa = 0;
        i64 exponent = 0, first = at;
        for (; digit() <= 9; ++at) mantissa = mantissa * 10 + digit();
        i64 digits = at - first;
        if (digits == 0 || (text[first] == '0' && digits > 1)) return false;
        bool whole = true;
        if (text[at] == '.') {
            i64 point = ++at;
            for (; digit() <= 9; ++at) mantissa = mantissa * 10 + digit();
            if (at == point) return false;
            exponent = point - at, digits += at - point, whole = false;
        }
        if (text[at] == 'e' || text[at] == 'E') {
            bool below = text[++at] == '-';
            at += below || text[at] == '+';
            i64 written = 0, begin = at;
            for (; digit() <= 9; ++at) written = min(written * 10 + digit(), i64(1000));
            if (at == begin) return false;
            exponent += below ? -written : written, whole = false;
        }
        if (digits > MOST_DIGITS)
            for (i64 k = first; text[k] == '0' || text[k] == '.'; ++k) digits -= text[k] == '0';
        if (digits > MOST_DIGITS) return false;
        double number = double(mantissa);
        if (exponent) {
            if (abs(exponent) > MAX_EXPONENT) return false;
            auto [scaled, sure] = scale(mantissa, exponent, {powers});
            if (!sure) return false;
            number = scaled;
        }
        if (number > most) return false;
        // a whole -0 is 0, as for Python
        numbers[n] = negative && (mantissa || !whole) ? -number : number;
        if (is_json_space(text[at])) pass_space();
        if (text[at] != (n + 1 < count ? ',' : ']')) return false;
        ++at;
    }
    return at == end;
}

}  // namespace terratool::definition
