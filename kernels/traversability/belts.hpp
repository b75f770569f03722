// Tracks and feet on ground: the plane that belts rest on, and where feet may be set.
#pragma once

#include "sweeps.hpp"

namespace terratool::traversability {

// Places along two belts, the left one's first: pixels, and how far ahead and to the left, m.
struct Belts {
    Offsets places;
    Matrix<const float> shifts;
    i64 left;        // number of places of the left belt
    double apart;    // distance of the belts' middles, m
    double gravity;  // how far ahead the centre of gravity is, m
    double east, north;
};

template <class Visit> void visit_arguments(Belts& b, Visit visit) {
    visit("places[k,3]", b.places), visit("shifts[k,2]", b.shifts), visit("left", b.left);
    visit("apart", b.apart), visit("gravity", b.gravity);
    visit("east", b.east), visit("north", b.north);
}

// For each reference point the plane that two rigid belts rest on, its height, dz/dx and dz/dy.
// Nothing of the ground under them is above it, and the centre of gravity is as low as that permits
// (the least potential energy; its height above the belts is not counted). For a slope p along them
// that is F(p) = mean of both belts of max(z − p x) + p x_cg, convex and made of lines: between the
// steepest slope and its opposite the least is found line by line. Places without ground do not
// count; without any under a belt it is NaN.
inline void rest_belts(Ground ground, i64 first, const Belts& belts, Cube<float> out) {
    constexpr float steepest = 4.0f, close = 1e-5f;
    constexpr int rounds = 12;
    const float gravity = float(belts.gravity), apart = float(belts.apart);
    const float e = float(belts.east), n = float(belts.north);
    visit_points(out[0], [&](i64 i, i64 j, auto count) {
        // touched: highest intercept of each belt at the slopes, and where ahead
        struct Line {
            Block height, slope;  // of F
        };
        Block roll{}, level;
        auto touch = [&](const Block& slope, Line& line) {
            std::array<Block, 2> best, place;
            best[0].fill(NO_GROUND), best[1].fill(NO_GROUND);
            place[0].fill(0.0f), place[1].fill(0.0f);
            for (i64 k = 0; k < belts.places.rows(); ++k) {
                i64 side = k < belts.left ? 0 : 1;
                const float* row = swept_row(ground, first, belts.places[k], i) + j;
                float x = belts.shifts(k, 0);
                float y = belts.shifts(k, 1) - (side ? -0.5f : 0.5f) * apart;
                Block &high = best[side], &at = place[side];
                for (i64 c = 0; c < count; ++c) {
                    float z = row[c] - slope[c] * x - roll[c] * y;
                    bool more = z > high[c];
                    high[c] = more ? z : high[c];
                    at[c] = more ? x : at[c];
                }
            }
            for (i64 c = 0; c < count; ++c) {
                level[c] = 0.5f * (best[0][c] + best[1][c]);
                roll[c] = (best[0][c] - best[1][c]) / apart;
                if (!(abs(roll[c]) < INF)) roll[c] = 0.0f;
                line.height[c] = level[c] + slope[c] * gravity;
                line.slope[c] = gravity - 0.5f * (place[0][c] + place[1][c]);
            }
        };
        Line low, high, line;
        Block down, up, slope{};
        down.fill(-steepest), up.fill(steepest);
        touch(down, low), touch(up, high);
        roll.fill(0.0f);
        touch(slope, line);  // for the roll, which the ends hardly show
        for (int round = 0; round < rounds; ++round) {
            bool found = true;
            Block next = slope, least{};
            for (i64 c = 0; c < count; ++c) {
                float bend = high.slope[c] - low.slope[c];
                float b = high.height[c] - high.slope[c] * up[c];
                float a = low.height[c] - low.slope[c] * down[c];
                next[c] = bend > 0.0f ? clamp((a - b) / bend, down[c], up[c]) : slope[c];
                least[c] = a + low.slope[c] * next[c];
            }
            slope = next;
            touch(slope, line);
            for (i64 c = 0; c < count; ++c) {
                if (!(line.height[c] > least[c] + close)) continue;
                found = false;
                if (line.slope[c] < 0.0f) {
                    down[c] = slope[c];
                    low.height[c] = line.height[c], low.slope[c] = line.slope[c];
                } else {
                    up[c] = slope[c];
                    high.height[c] = line.height[c], high.slope[c] = line.slope[c];
                }
            }
            if (found) break;
        }
        for (i64 c = 0; c < count; ++c) {
            bool known = level[c] > NO_GROUND;
            out(0, i, j + c) = known ? level[c] : float(NaN);
            out(1, i, j + c) = known ? slope[c] * e - roll[c] * n : float(NaN);
            out(2, i, j + c) = known ? slope[c] * n + roll[c] * e : float(NaN);
        }
    });
}

// What a foot asks of a foothold. Shares are those of the limits: 1 and more is none.
struct FootholdLimits {
    double rough;                // how far ground may be from its plane, m
    In grip;                     // tangent of the slope on which a foot slides, by surface and one
    In depth;                    // share of a step that a foot stands deep in each
    Matrix<const float> shifts;  // of the foot's pixels, to the east and the south, m
    Offsets patch;               // rows and columns of these pixels
};

template <class Visit> void visit_arguments(FootholdLimits& f, Visit visit) {
    visit("rough", f.rough), visit("grip[s]", f.grip), visit("depth[s]", f.depth);
    visit("shifts[k,2]", f.shifts), visit("patch[k,2]", f.patch);
}

// For each pixel of the ground the largest share of a foothold's limits that a foot set there
// takes: slope of the plane that fits its patch best, the largest distance of ground from that, and
// the depth in which the soil bears it. Infinity where ground is missing, and along the edges.
template <class Id>
void rate_footholds(
    Heights heights, Matrix<const Id> surfaces, const FootholdLimits& limits, Matrix<float> out
) {
    i64 lost = 0, pixels = limits.patch.rows();
    for (i64 offset : limits.patch.flat()) lost = max(lost, abs(offset));
    float spread = 0.0f;  // of a symmetric patch, along each axis
    for (i64 k = 0; k < pixels; ++k) spread += limits.shifts(k, 0) * limits.shifts(k, 0);
    float inverse = spread > 0.0f ? 1.0f / spread : 0.0f;
    out.fill(float(INF));
    for (i64 i = lost; i < out.rows() - lost; ++i) {
        visit_blocks(out.columns() - 2 * lost, [&](i64 j, auto count) {
            Block total{}, east{}, south{}, far{};
            const float* middle = &heights(i, lost + j);
            auto row_of = [&](i64 k) {
                return &heights(i + limits.patch(k, 0), lost + j + limits.patch(k, 1));
            };
            for (i64 k = 0; k < pixels; ++k) {
                const float* row = row_of(k);
                float x = limits.shifts(k, 0), y = limits.shifts(k, 1);
                for (i64 c = 0; c < count; ++c) {
                    float z = row[c] - middle[c];
                    total[c] += z, east[c] += x * z, south[c] += y * z;
                }
            }
            for (i64 c = 0; c < count; ++c) {
                total[c] /= float(pixels), east[c] *= inverse, south[c] *= inverse;
            }
            for (i64 k = 0; k < pixels; ++k) {
                const float* row = row_of(k);
                float x = limits.shifts(k, 0), y = limits.shifts(k, 1);
                for (i64 c = 0; c < count; ++c) {
                    float left = row[c] - middle[c] - total[c] - east[c] * x - south[c] * y;
                    far[c] = higher(abs(left), far[c]);
                }
            }
            for (i64 c = 0; c < count; ++c) {
                i64 id = i64(surfaces(i, lost + j + c));
                double slope = hypot(double(east[c]), double(south[c]));
                double share = max(double(far[c]) / limits.rough, limits.depth[id]);
                if (slope > 0.0) share = max(share, slope / limits.grip[id]);
                bool known = middle[c] > NO_GROUND && total[c] - total[c] == 0.0f;
                out(i, lost + j + c) = known ? float(share) : float(INF);
            }
        });
    }
}

// What a foot may be set to from its own place: pixels, nearest first, and heights.
struct FootReach {
    Offsets places;
    Heights level;  // of the ground at its own place, gaps within reach filled, m
    double step;    // how far from that the foothold may be, m
    double enough;  // share of the limits below which the nearest is taken
};

template <class Visit> void visit_arguments(FootReach& f, Visit visit) {
    visit("places[k,2]", f.places), visit("level[h,w]", f.level);
    visit("step", f.step), visit("enough", f.enough);
}

// For each pixel the best foothold within reach. Its height, minus infinity for none, and its
// share.
inline void choose_footholds(
    Heights heights, Heights shares, const FootReach& foot, Matrix<float> height,
    Matrix<float> share
) {
    const Offsets& reach = foot.places;
    i64 lost = 0;
    for (i64 offset : reach.flat()) lost = max(lost, abs(offset));
    height.fill(NO_GROUND), share.fill(float(INF));
    const float least = float(foot.enough), step = float(foot.step);
    for (i64 i = lost; i < height.rows() - lost; ++i) {
        visit_blocks(height.columns() - 2 * lost, [&](i64 j, auto count) {
            const float* level = &foot.level(i, lost + j);
            Block best, at, rated;
            best.fill(float(INF)), at.fill(NO_GROUND), rated.fill(float(INF));
            for (i64 k = 0; k < reach.rows(); ++k) {
                const float* z = &heights(i + reach(k, 0), lost + j + reach(k, 1));
                const float* r = &shares(i + reach(k, 0), lost + j + reach(k, 1));
                for (i64 c = 0; c < count; ++c) {
                    bool far = !(abs(z[c] - level[c]) <= step);
                    float cost = far ? float(INF) : higher(r[c], least);
                    bool better = cost < best[c];
                    best[c] = better ? cost : best[c];
                    at[c] = better ? z[c] : at[c];
                    rated[c] = better ? r[c] : rated[c];
                }
            }
            std::copy_n(at.data(), i64(count), &height(i, lost + j));
            std::copy_n(rated.data(), i64(count), &share(i, lost + j));
        });
    }
}

// For each reference point how far the ground under offsets is from its plane at most, m; `plane`
// and `shifts` are as in `bumps`.
inline void departures(
    Ground ground, i64 first, Offsets offsets, Matrix<const float> shifts, Ground plane,
    Matrix<float> out
) {
    visit_points(out, [&](i64 i, i64 j, auto count) {
        Block most{};
        for (i64 n = 0; n < offsets.rows(); ++n) {
            const float* row = swept_row(ground, first, offsets[n], i) + j;
            float x = shifts(n, 0), y = shifts(n, 1);
            for (i64 c = 0; c < count; ++c) {
                float left =
                    row[c] - plane(0, i, j + c) - plane(1, i, j + c) * x - plane(2, i, j + c) * y;
                most[c] = higher(abs(left), most[c]);
            }
        }
        std::copy_n(most.data(), i64(count), &out(i, j));
    });
}

}  // namespace terratool::traversability
