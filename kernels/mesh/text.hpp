// What files are made of: numbers as text, faces by surface, triangles.
//
// A float32 becomes the shortest decimal number that reads back as the same float32: the first that
// does so of its 6, 7, 8 and 9 significant digits, without the zeros at their end. Whatever has at
// most 6 digits survives float32, so no shorter one is missed, but for subnormal numbers.
//
// A float64 becomes its 15 significant digits without the zeros at their end; whatever has at most
// as many survives float64.
#pragma once

#include <cstring>
#include <numeric>
#include <tuple>
#include <variant>

#include "../core.hpp"

namespace terratool::mesh {

// No number needs more.
constexpr i64 NUMBER_BYTES = 24;

// Powers of ten from 1e-60 to 1e60.
class PowersOfTen {
public:
    INLINE double operator[](i64 n) const { return powers_[n + 60]; }

private:
    static constexpr double powers_[] = {
        1e-60, 1e-59, 1e-58, 1e-57, 1e-56, 1e-55, 1e-54, 1e-53, 1e-52, 1e-51, 1e-50, 1e-49, 1e-48,
        1e-47, 1e-46, 1e-45, 1e-44, 1e-43, 1e-42, 1e-41, 1e-40, 1e-39, 1e-38, 1e-37, 1e-36, 1e-35,
        1e-34, 1e-33, 1e-32, 1e-31, 1e-30, 1e-29, 1e-28, 1e-27, 1e-26, 1e-25, 1e-24, 1e-23, 1e-22,
        1e-21, 1e-20, 1e-19, 1e-18, 1e-17, 1e-16, 1e-15, 1e-14, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9,
        1e-8,  1e-7,  1e-6,  1e-5,  1e-4,  1e-3,  1e-2,  1e-1,  1e0,   1e1,   1e2,   1e3,   1e4,
        1e5,   1e6,   1e7,   1e8,   1e9,   1e10,  1e11,  1e12,  1e13,  1e14,  1e15,  1e16,  1e17,
        1e18,  1e19,  1e20,  1e21,  1e22,  1e23,  1e24,  1e25,  1e26,  1e27,  1e28,  1e29,  1e30,
        1e31,  1e32,  1e33,  1e34,  1e35,  1e36,  1e37,  1e38,  1e39,  1e40,  1e41,  1e42,  1e43,
        1e44,  1e45,  1e46,  1e47,  1e48,  1e49,  1e50,  1e51,  1e52,  1e53,  1e54,  1e55,  1e56,
        1e57,  1e58,  1e59,  1e60,
    };
};

inline constexpr PowersOfTen TEN_TO;

struct Decimal {  // digits / 10 ** decimals; the last digit is not 0
    u64 digits;
    i64 decimals;
};

// As few digits of a positive number as read back as the same float32, but at least `fewest` and at
// most `most`.
inline Decimal decimal_of(double exact, i64 fewest, i64 most) {
    float value = float(exact);
    i64 exponent = 0, decimals = 0;
    while (exact >= TEN_TO[exponent + 1]) ++exponent;
    while (exact < TEN_TO[exponent]) --exponent;
    u64 digits = 0;
    for (i64 count = fewest; count <= most; ++count) {
        decimals = count - 1 - exponent;
        double back;
        // powers up to 22 are exact, so divide by them rather than multiply by their inverse
        if (decimals >= 0) {
            digits = u64(i64(exact * TEN_TO[decimals] + 0.5));
            back = double(i64(digits)) / TEN_TO[decimals];
        } else {
            digits = u64(i64(exact / TEN_TO[-decimals] + 0.5));
            back = double(i64(digits)) * TEN_TO[-decimals];
        }
        if (float(back) == value) break;
    }
    while (digits % 10 == 0) digits /= 10, --decimals;
    return {digits, decimals};
}

// How many digits an unsigned number has.
INLINE i64 count_digits(u64 number) {
    i64 digits = 1;
    for (u64 limit = 10; number >= limit; limit *= 10) ++digits;
    return digits;
}

// Writes text to memory that has room.
class TextWriter {
public:
    explicit TextWriter(Span<u8> out) : begin_(out.data()), at_(out.data()) {}

    i64 count() const { return at_ - begin_; }

    INLINE void put(u8 byte) { *at_++ = byte; }
    INLINE void put_bytes(Span<const u8> text) { at_ = std::copy(text.begin(), text.end(), at_); }

    // An integer that is not negative.
    INLINE void put_integer(u64 number) {
        i64 count = count_digits(number);
        put_digits(number, count);
        at_ += count;
    }

    // A finite number: a float32, or 15 digits of a float64 below 1e45 and not below 1e-45.
    template <class T> void put_number(T value) {
        constexpr bool single = std::is_same_v<T, float>;
        constexpr i64 least_plain = -5, most_plain = 15;  // exponents that are not written
        if (value == 0) return put('0');
        if (value < 0) {
            put('-');
            value = -value;
        }
        auto [digits, decimals] = decimal_of(double(value), single ? 6 : 15, single ? 9 : 15);
        i64 count = count_digits(digits), exponent = count - 1 - decimals;
        if (exponent < least_plain || exponent > most_plain) {
            if (count > 1) {
                digits = put_digits(digits, count + 1, 2);
                at_[1] = '.';
            }
            at_[0] = u8('0' + digits);
            at_ += count > 1 ? count + 1 : 1;
            put('e');
            if (exponent < 0) put('-');
            return put_integer(u64(abs(exponent)));
        }
        if (decimals <= 0) {
            put_digits(digits, count);
            at_ = std::fill_n(at_ + count, -decimals, u8('0'));
            return;
        }
        i64 whole = max(i64(1), count - decimals);
        digits = put_digits(digits, whole + 1 + decimals, whole + 1);
        at_[whole] = '.';
        put_digits(digits, whole);
        at_ += whole + 1 + decimals;
    }

private:
    u8 *begin_, *at_;

    // The last digits of a number, from place `begin` from here to `end`; what is left of it.
    INLINE u64 put_digits(u64 number, i64 end, i64 begin = 0) {
        for (; end > begin; number /= 10) at_[--end] = u8('0' + number % 10);
        return number;
    }
};

using VertexRows = std::variant<Matrix<const float>, Matrix<const double>>;

// Lines of points, (n, 3), each between two texts, into `out`; returns where they end.
inline i64 put_points(
    Span<u8> out, VertexRows points, Span<const u8> before, Span<const u8> after
) {
    TextWriter text(out);
    auto put = [&]<class T>(Matrix<const T> all) {
        for (i64 n = 0; n < all.rows(); ++n) {
            text.put_bytes(before);
            text.put_number(all(n, 0)), text.put(' ');
            text.put_number(all(n, 1)), text.put(' ');
            text.put_number(all(n, 2)), text.put_bytes(after);
        }
    };
    std::visit(put, points);
    return text.count();
}

// Lines of faces, each between two texts, into `out`; returns where they end.
// `first` is the number of the first vertex.
inline i64 put_faces(
    Span<u8> out, Matrix<const i32> faces, i64 first, Span<const u8> before, Span<const u8> after
) {
    TextWriter text(out);
    for (i64 n = 0; n < faces.rows(); ++n) {
        text.put_bytes(before);
        text.put_integer(u64(faces(n, 0) + first)), text.put(' ');
        text.put_integer(u64(faces(n, 1) + first)), text.put(' ');
        text.put_integer(u64(faces(n, 2) + first)), text.put_bytes(after);
    }
    return text.count();
}

// Lines of faces whose corners have normals, vertex//normal; otherwise the same.
inline i64 put_corners(
    Span<u8> out, Matrix<const i32> faces, Matrix<const i32> normals, i64 first,
    Span<const u8> before, Span<const u8> after
) {
    TextWriter text(out);
    auto put = [&](i64 n, i64 k) {
        text.put_integer(u64(faces(n, k) + first)), text.put('/'), text.put('/');
        text.put_integer(u64(normals(n, k) + first));
    };
    for (i64 n = 0; n < faces.rows(); ++n) {
        text.put_bytes(before);
        put(n, 0), text.put(' '), put(n, 1), text.put(' '), put(n, 2);
        text.put_bytes(after);
    }
    return text.count();
}

// Faces in the order of their surfaces, otherwise as they were.
// `places` say of each which of the surfaces it has, `counts` how many faces each of these has.
inline Rows<i32, 3> sort_faces(
    Matrix<const i32> faces, Span<const i32> places, Span<const i64> counts
) {
    std::vector<i64> ends(counts.size());
    std::exclusive_scan(counts.begin(), counts.end(), ends.begin(), i64(0));
    Rows<i32, 3> sorted(faces.rows());
    for (i64 n = 0; n < faces.rows(); ++n)
        sorted[ends[places[n]]++] = {faces(n, 0), faces(n, 1), faces(n, 2)};
    return sorted;
}

// Vertices that faces use, in the order of their use, and the faces of these.
inline std::tuple<Rows<float, 3>, Rows<i32, 3>> take_vertices(
    Matrix<const float> points, Matrix<const i32> faces
) {
    std::vector<i32> places(points.rows(), -1);
    Rows<float, 3> own_points;
    Rows<i32, 3> own_faces;
    own_points.reserve(min(points.rows(), faces.size()));
    own_faces.reserve(faces.rows());
    auto place_of = [&](i32 vertex) {
        if (places[vertex] < 0) {
            places[vertex] = i32(own_points.size());
            own_points.push_back({points(vertex, 0), points(vertex, 1), points(vertex, 2)});
        }
        return places[vertex];
    };
    for (i64 n = 0; n < faces.rows(); ++n) {
        i32 a = place_of(faces(n, 0)), b = place_of(faces(n, 1)), c = place_of(faces(n, 2));
        own_faces.push_back({a, b, c});
    }
    return {std::move(own_points), std::move(own_faces)};
}

// Faces as a binary STL has them: normal and corners as float32, and two bytes of 0.
// A face that has no area has no normal: zeros, as readers expect.
inline Rows<u8, 50> stl_faces(Matrix<const float> points, Matrix<const i32> faces) {
    Rows<u8, 50> rows(faces.rows());
    for (i64 n = 0; n < faces.rows(); ++n) {
        auto a = points[faces(n, 0)], b = points[faces(n, 1)], c = points[faces(n, 2)];
        double ux = double(b[0]) - a[0], uy = double(b[1]) - a[1], uz = double(b[2]) - a[2];
        double vx = double(c[0]) - a[0], vy = double(c[1]) - a[1], vz = double(c[2]) - a[2];
        double x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
        double length = sqrt(x * x + y * y + z * z);
        double inverse = length > 0.0 ? 1.0 / length : 0.0;
        const float numbers[12] = {
            float(x * inverse),
            float(y * inverse),
            float(z * inverse),
            a[0],
            a[1],
            a[2],
            b[0],
            b[1],
            b[2],
            c[0],
            c[1],
            c[2]
        };
        std::memcpy(rows[n].data(), numbers, sizeof numbers);
    }
    return rows;
}

}  // namespace terratool::mesh
