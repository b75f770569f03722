// Triangles are refined until they are near enough to the heights of their regions.
#pragma once

#include "editing.hpp"
#include "error_bounds.hpp"

namespace terratool::mesh {

class Refinement : public EditableTriangulation {
public:
    Refinement(const Plan& plan, const Regions& regions, EditableTriangulation triangles)
        : EditableTriangulation(std::move(triangles)), plan_(plan), regions_(regions) {}

    // Refine triangles to an error, at most so many; whether there are more to look at.
    bool refine(double allowed, i64 most) {
        constexpr double least = 0.25;  // so much is left where polygons for discs take up the rest
        for (i64 n = 0; n < most && !queue_.empty(); ++n) {
            i64 t = queue_.front();  // the oldest first: what is coarse before what is fine
            queue_.pop_front();
            queued_[t] = 0;
            i64 region = of_[t];
            if (regions_.plane[region] || regions_.voids[region]) continue;
            double aside = regions_.asides[region];
            double enough = max(allowed - aside, least * allowed);
            auto [error, place] = error_of(t, enough);
            if (error <= enough || !improve(t, place))
                largest_error_ = max(largest_error_, error + aside);
        }
        return !queue_.empty();
    }

    // Split edges where the higher side changes, with one height for both sides.
    // Returns whether there are triangles to look at again.
    bool part_crossings(double tolerance) {
        for (i64 t = 0; t < count(); ++t) {
            if (regions_.voids[of_[t]]) continue;
            for (i64 e = 0; e < 3; ++e) {
                if (!part_crossing(t, e, tolerance)) continue;
                --t;  // once more
                break;
            }
        }
        return !queue_.empty();
    }

    // The largest error that triangles may have, those in plane regions apart.
    double largest_error() const { return largest_error_; }

private:
    const Plan& plan_;
    const Regions& regions_;
    std::vector<Corners> corners_;  // where corners are in each of the covers of a region
    double largest_error_ = 0.0;

    double height(i64 t, double x, double y) const {
        return height_in(plan_, regions_, of_[t], x, y);
    }

    // How far a triangle is from its region, and where; see mesh::largest_error.
    ErrorAt error_of(i64 t, double enough) {
        i64 region = of_[t];
        auto covers = regions_.covers_of(region);
        corners_.resize(max(corners_.size(), covers.size()));
        for (int c = 0; c < 3; ++c) {
            auto [x, y] = point(triangles_[t][c]);
            for (std::size_t k = 0; k < covers.size(); ++k)
                corners_[k][c] = place_in_shape(plan_, covers[k].element, double(x), double(y));
        }
        return mesh::largest_error(
            {plan_, covers, regions_.drops[region], heights_[t], {corners_.data(), covers.size()}},
            enough
        );
    }

    struct Longest {
        i64 edge;
        double length;
    };

    // The longest edge of a triangle; if `unlocked`, of those not on a seam.
    Longest longest_of(i64 t, bool unlocked = false) const {
        Longest found{0, 0.0};
        for (i64 e = 0; e < 3; ++e) {
            double own = length_of(t, e);
            if (own > found.length && !(unlocked && is_locked(t, e))) found = {e, own};
        }
        return found;
    }

    // Whether a triangle is better split across its longest edge than inside.
    bool is_thin(i64 t) const {
        constexpr double thin = 0.01;  // twice the area, in squares of the longest side
        auto [a, b, c] = corners(t);
        return double(area(a, b, c)) < thin * square(longest_of(t).length);
    }

    // Split an edge at a share of it.
    bool split_at(i64 t, i64 e, double share, double least = LOWEST) {
        constexpr double shortest = 64.0;  // in points of the lattice; what is shorter stays whole
        if (length_of(t, e) < shortest) return false;
        Point a = point(triangles_[t][e]), b = point(triangles_[t][next_corner(e)]);
        i64 x = a.x + i64(std::nearbyint(share * double(b.x - a.x)));
        i64 y = a.y + i64(std::nearbyint(share * double(b.y - a.y)));
        double z = height(t, double(x), double(y));
        i64 beyond = neighbours_[t][e];
        bool differs = beyond >= 0 && of_[beyond] != of_[t];
        double z_beyond = differs ? height(beyond, double(x), double(y)) : z;
        return split_edge(t, e, {x, y}, z, z_beyond, least);
    }

    // Split the longest edge of a triangle, or first that of the neighbours that are longer.
    //
    // To split an edge beside a triangle whose longest edge is another makes it ever thinner
    // (Rivara, 1997: the longest edge propagation path ends at an edge that is the longest of both
    // its sides).
    bool bisect(i64 start) {
        constexpr int path = 1000;  // so many triangles further on at most
        i64 t = start;
        for (int n = 0; n < path; ++n) {
            auto [e, own] = longest_of(t);
            i64 beyond = neighbours_[t][e];
            if (beyond < 0) break;
            auto [k, other] = longest_of(beyond);
            if (other <= own || neighbours_[beyond][k] == t) break;
            if (is_locked(beyond, k)) {  // what lies beside a seam would become ever flatter
                t = start;
                break;
            }
            t = beyond;
        }
        auto split = [&](i64 at) { return split_at(at, longest_of(at, true).edge, 0.5); };
        bool done = split(t) || (t != start && split(start));  // something too low may lie there
        if (done) enqueue(start);
        return done;
    }

    // Insert a point in a triangle, at or near a place.
    bool improve(i64 t, Shares place) {
        constexpr double near_side = 0.05;  // in heights of the triangle: the side is split instead
        auto [s, r] = place;
        double q = 1.0 - s - r;
        i64 e = r <= min(q, s) ? 0 : q <= min(s, r) ? 1 : 2;
        const std::array<double, 3> shares{q, s, r};
        double first = shares[e], second = shares[next_corner(e)];
        double share = first + second > 0.0 ? second / (first + second) : 0.5;
        share = clamp(share, 0.25, 0.75);
        if (!is_thin(t)) {
            if (min3(q, s, r) > near_side) {
                auto [a, b, c] = corners(t);
                double x = std::nearbyint(q * double(a.x) + s * double(b.x) + r * double(c.x));
                double y = std::nearbyint(q * double(a.y) + s * double(b.y) + r * double(c.y));
                if (split_inside(t, {i64(x), i64(y)}, height(t, x, y))) return true;
            }
            i64 beyond = neighbours_[t][e];
            bool blunt = beyond < 0 || !is_thin(beyond);
            if (blunt && split_at(t, e, share)) return true;
        }
        if (bisect(t)) return true;
        // something beside it is too low to be split, but the error counts for more
        return split_at(t, e, share, ANY);
    }

    // Split an edge if the higher side changes along it; whether it was.
    bool part_crossing(i64 t, i64 e, double tolerance) {
        i64 other = neighbours_[t][e];
        if (other < t || regions_.voids[of_[other]]) return false;
        const Side side(*this, t, e);
        i64 k = edge_to(other, t);
        double rise_a = side.za - heights_[other][next_corner(k)];
        double rise_b = side.zb - heights_[other][k];
        if (min(rise_a, rise_b) >= -tolerance || max(rise_a, rise_b) <= tolerance) return false;
        Point a = point(side.a), b = point(side.b);
        double x0 = double(a.x), y0 = double(a.y), dx = double(b.x) - x0, dy = double(b.y) - y0;
        double low = 0.0, high = 1.0;
        for (int n = 0; n < 40; ++n) {
            double share = 0.5 * (low + high), x = x0 + share * dx, y = y0 + share * dy;
            double rise = height(t, x, y);
            rise -= height(other, x, y);
            ((rise > 0.0) == (rise_a > 0.0) ? low : high) = share;
        }
        double x = std::nearbyint(x0 + low * dx), y = std::nearbyint(y0 + low * dy);
        double z = height(t, x, y);
        z = 0.5 * (z + height(other, x, y));
        return split_edge(t, e, {i64(x), i64(y)}, z, z);
    }
};

}  // namespace terratool::mesh
