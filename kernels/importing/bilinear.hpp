// Sums of products of two piecewise linear curves: values, normal equations, errors.
#pragma once

#include <tuple>

#include "../core.hpp"

namespace terratool::importing {

struct Place {  // on a curve: the node before, and how far it is on the way to the next one
    i64 node;
    double part;
};

// Heights over the unit square: `offset` + Σ xₖ(u) · yₖ(v), or `offset` + x(u) + y(v) if `summed`.
// Rows of x and y are values at the nodes. These ascend from 0 to 1, two equal ones are a step, a
// single one is a constant.
struct Terms {
    In x_nodes, y_nodes;
    Matrix<const double> x, y;
    double offset;
    bool summed;

    INLINE static double value(Matrix<const double> curves, i64 k, Place at) {
        double value = curves(k, at.node);
        return at.part == 0.0 ? value : value + at.part * (curves(k, at.node + 1) - value);
    }
    INLINE double height(Place u, Place v) const {
        double total = offset;
        for (i64 k = 0; k < x.rows(); ++k) {
            double a = value(x, k, u), b = value(y, k, v);
            total += summed ? a + b : a * b;
        }
        return total;
    }
};

template <class Visit> void visit_arguments(Terms& terms, Visit&& visit) {
    visit("x_nodes[p]", terms.x_nodes);
    visit("y_nodes[q]", terms.y_nodes);
    visit("x[k,p]", terms.x);
    visit("y[k,q]", terms.y);
    visit("offset", terms.offset);
    visit("summed", terms.summed);
}

// Heights z of points at i + f along u and at j + g along v.
struct Problem {
    In z;
    Span<const i64> i, j;
    In f, g;

    INLINE Place u(i64 n) const { return {i[n], f[n]}; }
    INLINE Place v(i64 n) const { return {j[n], g[n]}; }
};

template <class Visit> void visit_arguments(Problem& problem, Visit&& visit) {
    visit("z[n]", problem.z);
    visit("i[n]", problem.i);
    visit("f[n]", problem.f);
    visit("j[n]", problem.j);
    visit("g[n]", problem.g);
}

// The place of t among the nodes of a curve; right of a step, as queries are.
INLINE Place locate(In nodes, double t) {
    i64 last = count_of(nodes) - 2;
    if (last < 0) return {0, 0.0};
    i64 behind = std::upper_bound(nodes.begin(), nodes.end(), t) - nodes.begin();
    i64 low = min(max(behind - 1, i64(0)), last);
    return {low, (t - nodes[low]) / (nodes[low + 1] - nodes[low])};
}

// For each t, the node before it and how far it lies on the way to the next.
inline std::tuple<std::vector<i64>, std::vector<double>> locate_all(In nodes, In t) {
    std::vector<i64> index(t.size());
    std::vector<double> fraction(t.size());
    for (std::size_t n = 0; n < t.size(); ++n) {
        auto [node, part] = locate(nodes, t[n]);
        index[n] = node, fraction[n] = part;
    }
    return {std::move(index), std::move(fraction)};
}

// Heights minus those of the terms.
inline std::vector<double> residuals(const Problem& problem, const Terms& terms) {
    std::vector<double> out(problem.z.size());
    for (i64 n = 0; n < count_of(out); ++n)
        out[n] = problem.z[n] - terms.height(problem.u(n), problem.v(n));
    return out;
}

// Add up JᵀWJ and JᵀWr of the points; unknowns are x row by row, y row by row, the offset.
// `matrix` and `right` are as large as these; only the upper triangle is filled.
inline void normal_equations(
    const Problem& problem, const Terms& terms, In weights, Matrix<double> matrix, Out right
) {
    struct Slope {  // of the height, by one of the unknowns
        i64 unknown;
        double value;
    };
    i64 count = terms.x.rows(), p = terms.x.columns(), q = terms.y.columns();
    std::vector<Slope> slopes(4 * count + 1);  // in the order of the unknowns
    slopes.back() = {count * (p + q), 1.0};
    matrix.fill(0.0);
    std::ranges::fill(right, 0.0);
    for (i64 n = 0; n < count_of(problem.z); ++n) {
        if (weights[n] <= 0.0) continue;
        Place u = problem.u(n), v = problem.v(n);
        double total = terms.offset;
        // a single node has no next one, and its slope there is 0
        i64 next_u = min(u.node + 1, p - 1), next_v = min(v.node + 1, q - 1);
        for (i64 k = 0; k < count; ++k) {
            double a = Terms::value(terms.x, k, u), b = Terms::value(terms.y, k, v);
            total += terms.summed ? a + b : a * b;
            double by_x = terms.summed ? 1.0 : b, by_y = terms.summed ? 1.0 : a;
            i64 first_x = k * p, first_y = count * p + k * q;
            Slope *x = &slopes[2 * k], *y = &slopes[2 * (count + k)];
            x[0] = {first_x + u.node, by_x * (1.0 - u.part)};
            x[1] = {first_x + next_u, by_x * u.part};
            y[0] = {first_y + v.node, by_y * (1.0 - v.part)};
            y[1] = {first_y + next_v, by_y * v.part};
        }
        double residual = problem.z[n] - total;
        for (i64 a = 0; a < count_of(slopes); ++a) {
            auto [unknown, slope] = slopes[a];
            double weighted = weights[n] * slope;
            right[unknown] += weighted * residual;
            Span<double> row = matrix[unknown];
            bool twice = a > 0 && slopes[a - 1].unknown == unknown;
            for (i64 b = a - twice; b < count_of(slopes); ++b)
                row[slopes[b].unknown] += weighted * slopes[b].value;
        }
    }
}

// Heights of pixels, NaN for none, and terms; `affine` says how u and v change: u by column, u by
// row, v by column, v by row.
struct Fit {
    Matrix<const double> heights;
    In affine;
    const Terms& terms;

    // Height minus that of the terms at a pixel; NaN without a height or beyond the curves.
    INLINE double error_at(i64 row, i64 column) const {
        double dx = double(column) + 0.5 - 0.5 * double(heights.columns());
        double dy = double(row) + 0.5 - 0.5 * double(heights.rows());
        double u = 0.5 + (affine[0] * dx + affine[1] * dy);
        double v = 0.5 + (affine[2] * dx + affine[3] * dy);
        double height = heights(row, column);
        if (isnan(height) || u < 0.0 || u > 1.0 || v < 0.0 || v > 1.0) return NaN;
        return height - terms.height(locate(terms.x_nodes, u), locate(terms.y_nodes, v));
    }
};

// The pixel with the largest error of each block of `block` × `block` pixels that has any, by its
// index; and the largest of all, -1 if there is none.
inline std::tuple<std::vector<i64>, double> worst_pixels(
    Matrix<const double> heights, In affine, const Terms& terms, i64 block
) {
    Fit fit{heights, affine, terms};
    struct Worst {
        i64 pixel = -1;
        double size = -1.0;
    };
    i64 across = (heights.columns() + block - 1) / block;
    std::vector<Worst> row_of_blocks(across);
    std::vector<i64> found;
    double largest = -1.0;
    for (i64 south = 0; south < heights.rows(); south += block) {
        std::ranges::fill(row_of_blocks, Worst{});
        for (i64 row = south; row < min(south + block, heights.rows()); ++row) {
            for (i64 column = 0; column < heights.columns(); ++column) {
                double size = abs(fit.error_at(row, column));
                Worst& worst = row_of_blocks[column / block];
                if (size > worst.size) worst = {row * heights.columns() + column, size};
            }
        }
        for (auto [pixel, size] : row_of_blocks) {
            if (pixel >= 0) found.push_back(pixel);
            largest = max(largest, size);
        }
    }
    return {std::move(found), largest};
}

// The smallest and largest error of all pixels.
inline std::tuple<double, double> error_range(
    Matrix<const double> heights, In affine, const Terms& terms
) {
    Fit fit{heights, affine, terms};
    double low = INF, high = -INF;
    for (i64 row = 0; row < heights.rows(); ++row) {
        for (i64 column = 0; column < heights.columns(); ++column) {
            double error = fit.error_at(row, column);
            if (isnan(error)) continue;
            low = min(low, error), high = max(high, error);
        }
    }
    return {low, high};
}

// Solve a symmetric system by Cholesky's method; `right` becomes the solution.
// Only the upper triangle of `matrix` is read, and overwritten. By rows, as LAPACK's threads take
// longer for systems of this size when other programs run. Returns whether the matrix is positive
// definite.
inline bool solve(Matrix<double> matrix, Out right) {
    i64 size = count_of(right);
    for (i64 k = 0; k < size; ++k) {
        if (!(matrix(k, k) > 0.0)) return false;
        double root = sqrt(matrix(k, k));
        for (i64 n = k; n < size; ++n) matrix(k, n) /= root;
        right[k] /= root;
        for (i64 i = k + 1; i < size; ++i) {
            double factor = matrix(k, i);
            if (factor == 0.0) continue;
            for (i64 n = i; n < size; ++n) matrix(i, n) -= factor * matrix(k, n);
            right[i] -= factor * right[k];
        }
    }
    for (i64 k = size - 1; k >= 0; --k) {
        for (i64 n = k + 1; n < size; ++n) right[k] -= matrix(k, n) * right[n];
        right[k] /= matrix(k, k);
    }
    return true;
}

}  // namespace terratool::importing
