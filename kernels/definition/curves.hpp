// How well a formula can be kept by cubic pieces, as its derivatives say.
//
// On an interval of t the Taylor coefficients of every operation are enclosed up to the fourth, by
// the recurrences of automatic differentiation (Moore, Kearfott, Cloud, Introduction to Interval
// Analysis, 2009, 9.3). A cubic through four evenly spaced points of a length h is off by no more
// than |c4| h⁴ / 81. Intervals are halved until that tells how many pieces they need.
#pragma once

#include <tuple>

#include "../core.hpp"

namespace terratool::definition {

constexpr i64 ORDER = 5;  // coefficients: the value and four derivatives

// as terratool/definition/accuracy.py has them
// clang-format off
enum Operation : u8 {
    NUMBER, VARIABLE, ADD, SUB, MUL, DIV, POW, NEG, SIN, COS, TAN, ASIN, ACOS, ATAN, SINH, COSH,
    TANH, EXP, LOG, SQRT, ABS, MIN, MAX
};
// clang-format on

// Everything between two numbers, and these; infinities mean that nothing is known.
struct Interval {
    double low, high;

    bool is_point() const { return low == high; }
    bool holds(double number) const { return low <= number && number <= high; }
    double size() const { return max(abs(low), abs(high)); }
    double width() const { return high - low; }
};

constexpr Interval UNKNOWN{-INF, INF};

// What rounding may have taken away: an ulp to each side, or all if it is no number.
inline Interval widened(double low, double high, double ulps = 1.0) {
    if (isnan(low) || isnan(high)) return UNKNOWN;
    auto slack = [&](double x) { return abs(x) * 0x1p-52 * ulps; };
    return {
        low == INF || low == -INF ? low : low - slack(low),
        high == INF || high == -INF ? high : high + slack(high)
    };
}
inline Interval hull(Interval a, Interval b) { return {min(a.low, b.low), max(a.high, b.high)}; }
inline Interval operator-(Interval a) { return {-a.high, -a.low}; }
inline Interval operator+(Interval a, Interval b) {
    if (a.is_point() && a.low == 0.0) return b;
    if (b.is_point() && b.low == 0.0) return a;
    return widened(a.low + b.low, a.high + b.high);
}
inline Interval operator-(Interval a, Interval b) { return a + -b; }
// 0 times anything is 0: what is unknown is some number all the same.
inline double times(double a, double b) { return a == 0.0 || b == 0.0 ? 0.0 : a * b; }
inline Interval operator*(Interval a, Interval b) {
    if ((a.is_point() && a.low == 0.0) || (b.is_point() && b.low == 0.0)) return {0.0, 0.0};
    double p = times(a.low, b.low), q = times(a.low, b.high);
    double r = times(a.high, b.low), s = times(a.high, b.high);
    return widened(min(min(p, q), min(r, s)), max(max(p, q), max(r, s)));
}
inline Interval operator*(double a, Interval b) { return Interval{a, a} * b; }
inline Interval operator/(Interval a, Interval b) {
    if (a.is_point() && a.low == 0.0) return a;
    if (b.low < 0.0 && b.high > 0.0) return UNKNOWN;
    double low = b.high == 0.0 ? -INF : 1.0 / b.high, high = b.low == 0.0 ? INF : 1.0 / b.low;
    return a * widened(low, high);
}

// Values of a function that rises, between bounds that it has everywhere.
template <class F> Interval rising(F function, Interval x, double least = -INF, double most = INF) {
    Interval y = widened(function(x.low), function(x.high), 4.0);
    return {max(y.low, least), min(y.high, most)};
}

// The cosine, or the sine, which is the cosine a quarter of a turn later.
template <class F> Interval wave(F function, Interval x, double moved) {
    if (!(x.width() < 2.0 * PI) || x.size() > 1e15) return {-1.0, 1.0};
    double first = function(x.low), last = function(x.high);
    Interval y = widened(min(first, last), max(first, last), 4.0);
    y = {max(-1.0, y.low), min(1.0, y.high)};
    double slack = 0x1p-51 * (1.0 + x.size());
    double from = (x.low - moved - slack) / PI, to = (x.high - moved + slack) / PI;
    for (double turn = ceil(from); turn <= to; turn += 1.0)
        (std::fmod(turn, 2.0) == 0.0 ? y.high : y.low) = std::fmod(turn, 2.0) == 0.0 ? 1.0 : -1.0;
    return y;
}

// Enclosures of the coefficients of a Taylor series at any point of an interval.
struct Series {
    std::array<Interval, ORDER> c{};

    Interval& operator[](i64 k) { return c[k]; }
    const Interval& operator[](i64 k) const { return c[k]; }

    static Series constant(Interval value) {
        Series y;
        y[0] = value;
        return y;
    }
    // What has a value and no derivatives that are known.
    static Series rough(Interval value, Interval slope = UNKNOWN) {
        Series y;
        y.c.fill(UNKNOWN);
        y[0] = value, y[1] = slope;
        return y;
    }
    bool is_constant() const {
        for (i64 k = 1; k < ORDER; ++k)
            if (c[k].low != 0.0 || c[k].high != 0.0) return false;
        return true;
    }
    bool is_number() const { return is_constant() && c[0].is_point(); }
};

inline Series operator-(const Series& a) {
    Series y;
    for (i64 k = 0; k < ORDER; ++k) y[k] = -a[k];
    return y;
}
inline Series operator+(const Series& a, const Series& b) {
    Series y;
    for (i64 k = 0; k < ORDER; ++k) y[k] = a[k] + b[k];
    return y;
}
inline Series operator*(const Series& a, const Series& b) {
    Series y;
    for (i64 k = 0; k < ORDER; ++k) {
        Interval sum{0.0, 0.0};
        for (i64 j = 0; j <= k; ++j) sum = sum + a[j] * b[k - j];
        y[k] = sum;
    }
    return y;
}
inline Series operator/(const Series& a, const Series& b) {
    Series y;
    for (i64 k = 0; k < ORDER; ++k) {
        Interval sum = a[k];
        for (i64 j = 1; j <= k; ++j) sum = sum - b[j] * y[k - j];
        y[k] = sum / b[0];
    }
    return y;
}

// Coefficient k of the y whose slope is that of x times `factor`: of it k coefficients are known.
inline Interval driven(const Series& x, const Series& factor, i64 k) {
    Interval sum{0.0, 0.0};
    for (i64 j = 1; j <= k; ++j) sum = sum + double(j) * (x[j] * factor[k - j]);
    return (1.0 / double(k)) * sum;
}

// The y with a value and a slope that is that of x divided by `divisor`.
inline Series undriven(Interval value, const Series& x, const Series& divisor) {
    Series y;
    y[0] = value;
    for (i64 k = 1; k < ORDER; ++k) {
        Interval sum{0.0, 0.0};
        for (i64 j = 1; j < k; ++j) sum = sum + double(j) * (y[j] * divisor[k - j]);
        y[k] = (x[k] - (1.0 / double(k)) * sum) / divisor[0];
    }
    return y;
}

inline Series root(const Series& x) {
    Series y;
    if (x[0].high < 0.0) return Series::rough(UNKNOWN);
    y[0] = rising([](double v) { return sqrt(max(v, 0.0)); }, x[0], 0.0);
    for (i64 k = 1; k < ORDER; ++k) {
        Interval sum = x[k];
        for (i64 j = 1; j < k; ++j) sum = sum - y[j] * y[k - j];
        y[k] = sum / (2.0 * y[0]);
    }
    return y;
}
inline Series exponential(const Series& x) {
    Series y;
    y[0] = rising([](double v) { return std::exp(v); }, x[0], 0.0);
    for (i64 k = 1; k < ORDER; ++k) y[k] = driven(x, y, k);
    return y;
}
inline Series logarithm(const Series& x) {
    if (x[0].high <= 0.0) return Series::rough(UNKNOWN);
    Interval value = rising([](double v) { return v > 0.0 ? std::log(v) : -INF; }, x[0]);
    return undriven(value, x, x);
}

// Sine and cosine; hyperbolic ones, if so `sign` is 1 and not -1.
inline std::pair<Series, Series> waves(const Series& x, double sign) {
    Series sine, cosine;
    if (sign < 0.0) {
        sine[0] = wave([](double v) { return std::sin(v); }, x[0], PI / 2.0);
        cosine[0] = wave([](double v) { return std::cos(v); }, x[0], 0.0);
    } else {
        sine[0] = rising([](double v) { return std::sinh(v); }, x[0]);
        double least = x[0].holds(0.0) ? 0.0 : min(abs(x[0].low), abs(x[0].high));
        cosine[0] = rising([](double v) { return std::cosh(v); }, {least, x[0].size()}, 1.0);
    }
    for (i64 k = 1; k < ORDER; ++k) {
        sine[k] = driven(x, cosine, k);
        cosine[k] = sign * driven(x, sine, k);
    }
    return {sine, cosine};
}

// The tangent; the hyperbolic one, if so `sign` is -1 and not 1: its slope is 1 + sign y².
inline Series tangent(const Series& x, double sign) {
    Series y, factor;
    if (sign < 0.0) {
        y[0] = rising([](double v) { return std::tanh(v); }, x[0], -1.0, 1.0);
    } else {
        double slack = 0x1p-51 * (1.0 + x[0].size());
        bool has_pole = !(x[0].width() < PI) || x[0].size() > 1e15
            || floor((x[0].low - slack) / PI - 0.5) != floor((x[0].high + slack) / PI - 0.5);
        if (has_pole) return Series::rough(UNKNOWN);
        y[0] = rising([](double v) { return std::tan(v); }, {x[0].low - slack, x[0].high + slack});
        if (y[0].low > y[0].high) return Series::rough(UNKNOWN);
    }
    for (i64 k = 1; k < ORDER; ++k) {
        Interval sum{0.0, 0.0};
        for (i64 j = 0; j < k; ++j) sum = sum + y[j] * y[k - 1 - j];
        factor[k - 1] = Interval{k == 1 ? 1.0 : 0.0, k == 1 ? 1.0 : 0.0} + sign * sum;
        y[k] = driven(x, factor, k);
    }
    return y;
}
inline Series arctangent(const Series& x) {
    Interval value = rising([](double v) { return std::atan(v); }, x[0], -PI / 2, PI / 2);
    Series one = Series::constant({1.0, 1.0}), square = x * x;
    square[0] = {max(0.0, square[0].low), square[0].high};
    return undriven(value, x, one + square);
}
inline Series arcsine(const Series& x) {
    if (x[0].low > 1.0 || x[0].high < -1.0) return Series::rough(UNKNOWN);
    auto value = [](double v) { return std::asin(max(-1.0, min(1.0, v))); };
    Series one = Series::constant({1.0, 1.0});
    return undriven(rising(value, x[0], -PI / 2, PI / 2), x, root(one + -(x * x)));
}
inline Series absolute(const Series& x) {
    if (x[0].low >= 0.0) return x;
    if (x[0].high <= 0.0) return -x;
    return Series::rough({0.0, x[0].size()}, hull(x[1], -x[1]));
}
inline Series smaller(const Series& a, const Series& b) {
    if (a[0].high <= b[0].low) return a;
    if (b[0].high <= a[0].low) return b;
    return Series::rough({min(a[0].low, b[0].low), min(a[0].high, b[0].high)}, hull(a[1], b[1]));
}

// A power with a whole exponent from 0 on.
inline Series whole_power(const Series& x, i64 exponent) {
    Series y = Series::constant({1.0, 1.0}), square = x;
    for (i64 rest = exponent; rest; rest >>= 1) {
        if (rest & 1) y = y * square;
        if (rest > 1) square = square * square;
    }
    double p = double(exponent);
    double least = x[0].holds(0.0) ? 0.0 : min(abs(x[0].low), abs(x[0].high));
    auto value = [p](double v) { return std::pow(v, p); };
    y[0] = exponent % 2 ? rising(value, x[0]) : rising(value, {least, x[0].size()}, 0.0);
    return y;
}
inline Series power(const Series& x, const Series& y) {
    constexpr double MOST = 1 << 20;
    Series one = Series::constant({1.0, 1.0});
    // whatever the other is (IEEE 754, 9.2.1)
    if ((y.is_number() && y[0].low == 0.0) || (x.is_number() && x[0].low == 1.0)) return one;
    if (y.is_number()) {
        double p = y[0].low;
        if (p == floor(p) && abs(p) <= MOST)
            return p > 0.0 ? whole_power(x, i64(p)) : one / whole_power(x, i64(-p));
        if (x[0].high < 0.0) return Series::rough(UNKNOWN);
        Series z;
        auto value = [p](double v) { return std::pow(max(v, 0.0), p); };
        z[0] =
            p > 0.0 ? rising(value, x[0], 0.0) : -rising([&](double v) { return -value(v); }, x[0]);
        for (i64 k = 1; k < ORDER; ++k) {
            Interval sum{0.0, 0.0};
            for (i64 j = 1; j <= k; ++j)
                sum = sum + (p * double(j) - double(k - j)) * (x[j] * z[k - j]);
            z[k] = (1.0 / double(k)) * (sum / x[0]);
        }
        return z;
    }
    if (x.is_number() && x[0].low == 0.0)
        return y[0].low > 0.0 ? Series::constant({0.0, 0.0})
            : y[0].low == 0.0 ? Series::rough({0.0, 1.0})
                              : Series::rough(UNKNOWN);
    if (x[0].high < 0.0) return Series::rough(UNKNOWN);
    if (x[0].low <= 0.0 && y[0].low >= 0.0) {
        Interval most = rising([&](double v) { return std::pow(x[0].high, v); }, y[0]);
        return Series::rough({0.0, max(1.0, max(most.low, most.high))});
    }
    return exponential(y * logarithm(x));
}

// A program of operations over a stack; `operands` are numbers, and counts of arguments.
class Formula {
public:
    Formula(Span<const u8> operations, In operands)
        : operations_(operations), operands_(operands) {}

    i64 size() const { return count_of(operations_); }

    Series over(Interval t) {
        stack_.clear();
        for (i64 k = 0; k < size(); ++k) take(Operation(operations_[k]), operands_[k], t);
        return stack_.back();
    }

private:
    Span<const u8> operations_;
    In operands_;
    std::vector<Series> stack_;

    Series pop() {
        Series top = stack_.back();
        stack_.pop_back();
        return top;
    }
    void take(Operation operation, double operand, Interval t) {
        if (operation == NUMBER) return stack_.push_back(Series::constant({operand, operand}));
        if (operation == VARIABLE) {
            Series x = Series::constant(t);
            x[1] = {1.0, 1.0};
            return stack_.push_back(x);
        }
        if (operation == MIN || operation == MAX) {
            Series least = pop();
            bool turned = operation == MAX;
            if (turned) least = -least;
            for (i64 count = 1; count < i64(operand); ++count) {
                Series other = pop();
                least = smaller(turned ? -other : other, least);
            }
            return stack_.push_back(turned ? -least : least);
        }
        Series b = pop();
        if (operation >= ADD && operation <= POW) b = of_two(operation, pop(), b);
        else b = of_one(operation, b);
        // the derivatives of what is not known are not, either
        if (!(b[0].size() < INF))
            for (i64 k = 1; k < ORDER; ++k) b[k] = UNKNOWN;
        stack_.push_back(b);
    }
    static Series of_two(Operation operation, const Series& a, const Series& b) {
        switch (operation) {
            case ADD: return a + b;
            case SUB: return a + -b;
            case MUL: return a * b;
            case DIV: return a / b;
            default: return power(a, b);
        }
    }
    static Series of_one(Operation operation, const Series& x) {
        switch (operation) {
            case NEG: return -x;
            case SIN: return waves(x, -1.0).first;
            case COS: return waves(x, -1.0).second;
            case TAN: return tangent(x, 1.0);
            case ASIN: return arcsine(x);
            case ACOS: {
                Series y = -arcsine(x);
                y[0] = y[0] + widened(PI / 2, PI / 2);
                return y;
            }
            case ATAN: return arctangent(x);
            case SINH: return waves(x, 1.0).first;
            case COSH: return waves(x, 1.0).second;
            case TANH: return tangent(x, -1.0);
            case EXP: return exponential(x);
            case LOG: return logarithm(x);
            case SQRT: return root(x);
            default: return absolute(x);
        }
    }
};

// What pieces are allowed to be, and how long one may look for what they need.
struct Effort {
    double tolerance;  // of the pieces
    double enough;     // an error that is small enough where there are no derivatives
    double most;       // pieces that there may be
    double finest;     // the length that all of them may have
    double narrowest;  // intervals of this length are too narrow to matter
    double checked;    // places at this distance are looked at in any case
    double steps;      // operations on intervals
};

// How well pieces can keep to a formula on t from 0 to 1.
// Returns how much of its values rounding may take away, the most of some places; how far off
// pieces of the finest length may be, at most, infinity where the formula grows without limit; the
// t where that is; and how many `places` were found at which it does what evenly spaced ones may
// not see.
inline std::tuple<double, double, double, i64> survey(
    Span<const u8> operations, In operands, In limits, Out places
) {
    Effort effort{limits[0], limits[1], limits[2], limits[3], limits[4], limits[5], limits[6]};
    constexpr double OVERSHOOT = 1.32;  // half of 1 and the Lebesgue constant of thirds
    constexpr double FEW = 4.0;         // pieces that an interval may need without being halved
    constexpr double NARROW = 64.0;     // pieces around a place where a formula bends
    Formula formula(operations, operands);
    struct Miss {
        double error = 0.0, where = 0.0;
        void note(double other, double middle) {
            if (other > error) error = other, where = middle;
        }
    };
    double pieces = 0.0;
    Miss worst, coarse;  // of what cannot be kept, and of all if there are too many pieces
    i64 found = 0;
    auto settle = [&](double middle, double length, double needed) {
        pieces += needed;
        if (length < effort.checked && found < count_of(places)) places[found++] = middle;
    };
    // over a single t the interval is what rounding leaves open; aside of ends and halves, where
    // a formula may have steps
    constexpr i64 LOOKS = 64;
    Miss rounded;
    for (i64 k = 0; k < LOOKS; ++k) {
        double t = (double(k) + 0.3819660112501051) / LOOKS,
               width = formula.over({t, t})[0].width();
        if (width < INF) rounded.note(width, t);
    }
    if (rounded.error > effort.enough) {  // there is nothing to be kept to below that
        effort.tolerance = rounded.error;
        worst = rounded;
    }
    std::vector<Interval> intervals{{0.0, 1.0}}, next;
    while (!intervals.empty()) {
        next.clear();
        for (Interval t : intervals) {
            Series y = formula.over(t);
            effort.steps -= double(formula.size());
            double length = t.width(), middle = t.low + length / 2.0;
            double fourth = y[4].size(), width = OVERSHOOT * y[0].width();
            auto off = [&](double h) { return fourth < INF ? fourth * h * h * h * h / 81.0 : INF; };
            if (off(length) <= effort.tolerance || width <= effort.enough) {
                settle(middle, length, 1.0);
                continue;
            }
            double h = min(length, effort.finest);
            double error = min(min(off(h), width), OVERSHOOT * times(y[1].size(), h));
            if (isnan(error)) error = INF;
            double needed =
                fourth < INF ? length * sqrt(sqrt(fourth / (81.0 * effort.tolerance))) : INF;
            if (needed <= FEW && length <= effort.checked * 64.0) {
                settle(middle, length, needed);
                coarse.note(error, middle);
                continue;
            }
            bool is_narrow = length <= effort.narrowest;
            if (!is_narrow && effort.steps > 0.0) {
                next.push_back({t.low, middle});
                next.push_back({middle, t.high});
                continue;
            }
            // a place that no position hits, where the formula bends, or jumps
            if (!is_narrow || error == INF) worst.note(error, middle);
            settle(middle, length, is_narrow ? NARROW : length / h);
        }
        std::swap(intervals, next);
    }
    if (pieces > effort.most && coarse.error > worst.error) worst = coarse;
    return {rounded.error, worst.error, worst.where, found};
}

}  // namespace terratool::definition
