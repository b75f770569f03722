// Rows of a text, a line each, whose fields are parted by blanks, or by a comma with blanks.
#pragma once

#include "numbers.hpp"

namespace terratool::importing {

// Read the fields of ascending numbers `places` of each line into rows. An empty field, and one
// that is not read here, becomes NaN; of the latter Python is told the place and where it begins.
// Returns the numbers, those, and the first byte of the first line that has too few fields, or -1.
// Lines that are empty, or begin with # or /, are passed over.
inline std::tuple<std::vector<double>, std::vector<std::pair<i64, i64>>, i64> read_rows(
    Span<const u8> text, Span<const i64> places, Matrix<const double> powers
) {
    std::vector<double> numbers;
    std::vector<std::pair<i64, i64>> odd;
    Reader reader(text, 0);
    auto is_blank = [&] { return reader.is(' ') || reader.is('\t'); };
    auto ends = [&] { return reader.is_at_end() || reader.is('\n') || reader.is('\r'); };
    auto pass_blanks = [&] {
        while (is_blank()) reader.pass();
    };
    auto pass_word = [&] {
        while (!ends() && !is_blank() && !reader.is(',')) reader.pass();
    };
    while (!reader.is_at_end()) {
        i64 line = reader.at();
        pass_blanks();
        if (!ends() && !reader.is('#') && !reader.is('/')) {
            std::size_t found = 0;
            for (i64 field = 0; found < places.size() && !ends(); ++field) {
                if (field != places[found]) pass_word();
                else {
                    i64 begin = reader.at();
                    double number = NAN;
                    if (!reader.is(',')) {
                        bool negative = reader.take('-');
                        if (!negative) reader.take('+');
                        auto [kind, value] = read_number(reader, {powers});
                        if (kind == NUMBER) number = negative ? -value : value;
                        else odd.emplace_back(count_of(numbers), begin);
                        pass_word();
                    }
                    numbers.push_back(number);
                    ++found;
                }
                pass_blanks();
                if (reader.take(',')) pass_blanks();
            }
            if (found < places.size()) return {std::move(numbers), std::move(odd), line};
        }
        while (!ends()) reader.pass();
        if (!reader.is_at_end()) reader.pass();
    }
    return {std::move(numbers), std::move(odd), -1};
}

}  // namespace terratool::importing
