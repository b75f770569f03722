// What every kernel is written with: numbers of fixed size, and views of arrays.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#if defined(_MSC_VER) && !defined(__clang__)
#define INLINE __forceinline
#define NEVER_INLINE __declspec(noinline)
#define HARD_CHECK(condition) (void)0
#else
#define INLINE [[gnu::always_inline]] inline
#define NEVER_INLINE [[gnu::noinline]]
#ifdef _GLIBCXX_ASSERTIONS  // as std::span does it
#define HARD_CHECK(condition) __glibcxx_assert(condition)
#else
#define HARD_CHECK(condition) (void)0
#endif
#endif

namespace terratool {

using i16 = std::int16_t;
using i32 = std::int32_t;
using i64 = std::int64_t;
using u8 = std::uint8_t;
using u16 = std::uint16_t;
using u32 = std::uint32_t;
using u64 = std::uint64_t;

using std::abs;
using std::ceil;
using std::floor;
using std::isnan;
using std::max;
using std::min;
using std::sqrt;

constexpr double PI = std::numbers::pi;
constexpr double NaN = std::numeric_limits<double>::quiet_NaN();
constexpr double INF = std::numeric_limits<double>::infinity();

template <class T> using Span = std::span<T>;

using In = Span<const double>;
using Out = Span<double>;

template <class T> INLINE i64 count_of(const T& array) { return i64(array.size()); }

// A two-dimensional array, row by row.
template <class T> class Matrix {
public:
    Matrix() = default;
    Matrix(T* data, i64 rows, i64 columns) : data_(data), rows_(rows), columns_(columns) {}
    template <class U>
    Matrix(Matrix<U> other) : data_(other.data()), rows_(other.rows()), columns_(other.columns()) {}

    INLINE i64 rows() const { return rows_; }
    INLINE i64 columns() const { return columns_; }
    INLINE i64 size() const { return rows_ * columns_; }
    INLINE T* data() const { return data_; }
    INLINE T& operator()(i64 row, i64 column) const {
        HARD_CHECK(row >= 0 && row < rows_ && column >= 0 && column < columns_);
        return data_[row * columns_ + column];
    }
    INLINE Span<T> operator[](i64 row) const {
        HARD_CHECK(row >= 0 && row < rows_);
        return {data_ + row * columns_, std::size_t(columns_)};
    }
    INLINE Span<T> flat() const { return {data_, std::size_t(size())}; }
    INLINE void fill(T value) const { std::fill_n(data_, size(), value); }

private:
    T* data_ = nullptr;
    i64 rows_ = 0, columns_ = 0;
};

// A three-dimensional array: matrices, one after the other.
template <class T> class Cube {
public:
    Cube() = default;
    Cube(T* data, i64 layers, i64 rows, i64 columns)
        : data_(data), layers_(layers), rows_(rows), columns_(columns) {}

    INLINE i64 layers() const { return layers_; }
    INLINE i64 rows() const { return rows_; }
    INLINE i64 columns() const { return columns_; }
    INLINE i64 size() const { return layers_ * rows_ * columns_; }
    INLINE T* data() const { return data_; }
    INLINE T& operator()(i64 layer, i64 row, i64 column) const {
        return (*this)[layer](row, column);
    }
    INLINE Matrix<T> operator[](i64 layer) const {
        HARD_CHECK(layer >= 0 && layer < layers_);
        return {data_ + layer * rows_ * columns_, rows_, columns_};
    }

private:
    T* data_ = nullptr;
    i64 layers_ = 0, rows_ = 0, columns_ = 0;
};

// Rows of `width` values that a kernel makes: (n, width) in Python.
template <class T, int width> using Rows = std::vector<std::array<T, width>>;

// floor() of what is below 2^51 in size, in instructions that every processor has; else the number.
INLINE double quick_floor(double a) {
#if defined(__SSE4_1__) || defined(__AVX__) || defined(__aarch64__) || defined(_M_ARM64)
    return floor(a);
#else
    constexpr double whole = 6755399441055744.0;  // 1.5 · 2^52: a sum with it has no fraction
    double near = (a + whole) - whole;
    double below = near - (near > a ? 1.0 : 0.0);
    return abs(a) < 2251799813685248.0 ? below : a;
#endif
}

// A number that is as good as drawn from the key: the steps of SplitMix64 (Steele, Lea, Flood, Fast
// splittable pseudorandom number generators, OOPSLA 2014).
INLINE u64 hash64(u64 key) {
    key *= 0x9E3779B97F4A7C15;
    key = (key ^ (key >> 30)) * 0xBF58476D1CE4E5B9;
    key = (key ^ (key >> 27)) * 0x94D049BB133111EB;
    return key ^ (key >> 31);
}

// Begin an index of entries by bins: the place where each bin begins goes into `offsets`, one more
// than there are bins, counted from `start`. Returns where they end.
// visit(put) calls put(bin, entry) for all entries, each time in the same order.
template <class Offset, class Visit>
Offset index_bins(Span<Offset> offsets, Offset start, Visit visit) {
    std::fill(offsets.begin(), offsets.end(), Offset(0));
    visit([&](i64 bin, auto) { ++offsets[bin]; });
    for (Offset& offset : offsets) start += std::exchange(offset, start);
    return start;
}

// Finish an index of entries by bins: the entries of each bin, in their order.
template <class Offset, class Entry, class Visit>
void fill_bins(Span<Offset> offsets, Span<Entry> entries, Visit visit) {
    Offset start = offsets[0];
    visit([&](i64 bin, Entry entry) { entries[offsets[bin]++] = entry; });
    // each offset has moved to its end, which is the next one's beginning
    std::move_backward(offsets.begin(), offsets.end() - 1, offsets.end());
    offsets[0] = start;
}

template <class T> INLINE T min3(T a, T b, T c) { return min(min(a, b), c); }
template <class T> INLINE T max3(T a, T b, T c) { return max(max(a, b), c); }
template <class T> INLINE T square(T a) { return a * a; }
template <class T> INLINE T clamp(T a, T low, T high) { return min(max(a, low), high); }

}  // namespace terratool
