// Long vectors of a JSON text, read at the speed of memory rather than of Python.
#pragma once

#include "decimals.hpp"

namespace terratool::definition {

INLINE bool is_json_space(u8 c) { return c == ' ' || c == '\n' || c == '\r' || c == '\t'; }

// Lists of at least `least` items behind a key "x" or "y" that may be numbers alone: begin, end and
// count of each, one after the other.
inline std::vector<i64> find_vectors(Span<const u8> text, i64 least) {
    std::vector<i64> found;
    i64 end = count_of(text), at = 0;
    auto pass_space = [&] {
        while (at < end && is_json_space(text[at])) ++at;
    };
    auto is_of_vector = [](u8 c) {
        return (c >= '0' && c <= '9') || c == ',' || c == '.' || c == '-' || c == '+' || c == 'e'
            || c == 'E' || is_json_space(c);
    };
    while (at < end) {
        if (text[at++] != '"') continue;
        i64 begin = at;
        for (; at < end && text[at] != '"'; ++at) at += text[at] == '\\';
        bool is_curve = at - begin == 1 && (text[begin] == 'x' || text[begin] == 'y');
        ++at;
        if (!is_curve) continue;
        pass_space();
        if (at >= end || text[at] != ':') continue;
        ++at;
        pass_space();
        if (at >= end || text[at] != '[') continue;
        i64 first = at++, count = 1;
        for (; at < end && is_of_vector(text[at]); ++at) count += text[at] == ',';
        if (at >= end || text[at] != ']') continue;
        ++at;
        if (count >= least) found.insert(found.end(), {first, at, count});
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
