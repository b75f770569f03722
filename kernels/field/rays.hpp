// Rays against the exact field: where a straight line first meets the ground or a wall.
//
// The ground is a sheet: heights over the plan, and upright walls where they jump. A ray that
// passes the void, or comes from outside, may get below it, and meets it from there. An index, a
// tree of quarters of the plan, has bounds of the heights in each node and lists the elements that
// vary in each leaf. In a leaf a ray is cut where it crosses edges of footprints and steps of
// curves, and lines beside holes of grids of heights. Between two cuts it is over the same
// elements, all of them smooth but for kinks, and how its height above the ground changes is
// enclosed by intervals: where it cannot reach 0 there is nothing, where it only rises or falls the
// one root is found, elsewhere the stretch is halved. Leaves that nothing cuts have those intervals
// beforehand.
#pragma once

#include "ray_ground.hpp"

namespace terratool::rays {

struct Hit {
    double distance = INF;
    i64 top = -1;  // the element, or the number of all and the track
    double x = NaN, y = NaN, z = NaN;
    double normal[3] = {NaN, NaN, NaN};
    bool wall = false;
    ClassPixel pixel{};  // of the element, where it is known and has classes
};

// The normal of what has slopes; it points to where the ray comes from.
INLINE void put_slanted_normal(const Ray& ray, Gradient slopes, Hit& hit) {
    double length = sqrt(square(slopes.x) + square(slopes.y) + 1.0);
    double facing = slopes.x * ray.dx + slopes.y * ray.dy - ray.dz >= 0.0 ? 1.0 : -1.0;
    hit.normal[0] = -slopes.x / length * facing + 0.0;
    hit.normal[1] = -slopes.y / length * facing + 0.0;
    hit.normal[2] = facing / length;
}

// Of an element: that it is not known, nor, in the second, whether there is a void instead; and
// that there is a void that counts as endless.
constexpr i64 UNKNOWN = -3, UNSURE = -4, ENDLESS = -5;

// What the ground is where nothing stands over it: a ray in the void is on no side of it, and all
// tracks lie on it.
struct PlainRules {
    // Whether rays are on a side of voids, and on which, by the top element there.
    static constexpr bool sees_voids() { return false; }
    static constexpr Side side_in_void(i64) { return NOWHERE; }

    INLINE Rut rut(const Field& field, double x, double y, i64 surface) const {
        return rut_at(field.tracks, x, y, surface);
    }
};

// Where a stretch of the ray begins or ends.
struct Cut {
    double at, slack;
};

// Casts rays; each thread needs its own.
template <class Rules> class Caster : RayGround {
public:
    explicit Caster(const Index& index, Rules rules = {})
        : RayGround(index), rules_(rules), stack_(field_.pending) {}

    // What a ray meets first from one distance to another.
    Hit cast(const Ray& ray, double from, double most) {
        ray_ = &ray;
        start();
        if (ray.dx == 0.0 && ray.dy == 0.0) return cast_upright(most);
        const double reach = most * (1.0 + 1e-15);  // what lies at the end is met
        double begin = from, end = reach;
        In bounds = field_.bounds;
        // a little more, or rays would pass a level plane in a stretch of no length
        double more = 1e-6 * (bounds[2] - bounds[0] + bounds[3] - bounds[1]) + 1e-12 * abs(ray.z);
        double low = index_.height.low - more, high = index_.height.high + more;
        per_x_ = 1.0 / ray.dx, per_y_ = 1.0 / ray.dy;
        if (!clip(ray.x, per_x_, bounds[0], bounds[2], begin, end)) return hit_;
        if (!clip(ray.y, per_y_, bounds[1], bounds[3], begin, end)) return hit_;
        // walls beside endless voids have no end
        if (!rules_.sees_voids() && !clip(ray.z, 1.0 / ray.dz, low, high, begin, end)) return hit_;
        leaves_ = end < reach;
        scale_ = abs(ray.x) + abs(ray.y) + abs(ray.z) + end;
        bool parallel = ray.dx == 0.0 || ray.dy == 0.0;
        if (parallel) walk<true, true>(begin, end);
        else if (rules_.sees_voids()) walk<false, true>(begin, end);
        else walk<false, false>(begin, end);
        if (hit_.distance == AGAIN) {
            start();
            walk<false, true>(begin, end);
        }
        if (hit_.distance < INF) hit_.distance = min(hit_.distance, most);
        return hit_;
    }

private:
    static constexpr double AGAIN = -1.0;  // of a distance, where voids decide that were passed
    static constexpr int PATIENCE = 4000;

    // Where the part of a ray in a node begins and ends: on a line across an axis, where the ray
    // itself does, or where it comes into the terrain or leaves it.
    enum End : u8 { ACROSS_X = X, ACROSS_Y = Y, ITSELF, RIM };

    Rules rules_;
    Stack stack_;
    std::vector<Cut> cuts_;
    Hit hit_;
    Side side_;                 // of the ground at the end of what was looked at
    double above_;              // so far above it, NaN where that is not known
    i64 top_;                   // the element there, or UNKNOWN or UNSURE
    double past_;               // the end of the last stretch
    bool leaves_;               // whether it ends where it leaves the terrain
    End begins_;                // what the stretch begins on; itself for a cut
    bool skipped_;              // whether a sliver was passed since
    Span<const u32> segments_;  // of the leaf

    void start() {
        hit_ = {};
        along_.clear();
        segments_ = {};
        side_ = NOWHERE, above_ = NaN, top_ = -1, past_ = NaN;
        skipped_ = false;
    }

    // The part of a ray between two bounds along an axis; `per` is 1 by its direction.
    static bool clip(double from, double per, double low, double high, double& begin, double& end) {
        if (abs(per) == INF) return low <= from && from <= high;
        double one = (low - from) * per, other = (high - from) * per;
        begin = max(begin, min(one, other)), end = min(end, max(one, other));
        return begin <= end;
    }

    // Straight up or down; the height is that of any query.
    Hit cast_upright(double most) {
        if (!is_inside(field_.bounds, ray_->x, ray_->y)) return hit_;
        Found found = found_at<true>(field_, ray_->x, ray_->y, stack_);
        Worn worn = worn_of(field_, found);
        if (worn.is_void) return hit_;
        Ground<true> ground(field_, found.z, worn.surface, ray_->x, ray_->y);
        double distance = (ground.z - ray_->z) / ray_->dz;
        if (!(0.0 <= distance && distance <= most)) return hit_;
        hit_.distance = distance;
        hit_.top = found.top, hit_.pixel = found.pixel;
        if (ground.surface_track >= 0) hit_.top = count_of(field_.elements) + ground.surface_track;
        hit_.x = ray_->x, hit_.y = ray_->y, hit_.z = ground.z;
        put_normal({found.slope_x + ground.slope_x, found.slope_y + ground.slope_y});
        return hit_;
    }

    void put_normal(Gradient slopes) { put_slanted_normal(*ray_, slopes, hit_); }

    struct Visit {
        double begin, end;
        u32 quarter;  // of which node, times 4, and which of the four
        End from, to;
    };

    // Through the tree from front to back, until something is hit. `parallel` where the ray may be
    // parallel to an axis, `looks` where all voids are looked for.
    template <bool parallel, bool looks> void walk(double begin, double end) {
        constexpr std::size_t most = 2 * DEEPEST + 2;  // two are left to wait at each level
        std::array<Visit, most> waiting;
        std::size_t pending = 0;
        const Ray ray = *ray_;
        const double per_x = per_x_, per_y = per_y_;
        const bool rises = ray.dz > 0.0;
        Side side = NOWHERE;  // as `side_`, without what was passed
        u32 passed = 0;       // last line passed since a leaf was looked at
        const u32 nearest =
            u32(ray.dx < 0.0) + 2 * u32(ray.dy < 0.0);  // the quarter it meets first
        const Quarters* all = index_.quarters.data();
        auto at = [](double line, double from, double per) {
            // on a line it is east or north of it
            if (parallel && abs(per) == INF) return line <= from ? -INF : INF;
            return (line - from) * per;
        };
        u32 quarter = 0;
        End from = begin > 0.0 ? RIM : ITSELF, to = leaves_ ? RIM : ITSELF;
        while (true) {
            const Quarters& own = all[quarter / 4];
            const double lowest = ray.z + ray.dz * (rises ? begin : end);
            const double highest = ray.z + ray.dz * (rises ? end : begin);
            const u32 next = own.next[quarter % 4];
            const bool bounded = !(looks && next & VOIDS);
            const bool over = bounded && lowest > double(own.high[quarter % 4]);
            const bool under = bounded && highest < double(own.low[quarter % 4]);
            // down to the leaf where the ray gets from one side to the other
            if (over && side != BELOW) {
                side = ABOVE, passed = next;
            } else if (under && side != ABOVE) {
                side = BELOW, passed = next;
            } else if (next & LEAF) {
                if (passed) pass(side, passed), passed = 0;
                const Leaf& leaf = index_.leaves[next & PLACE];
                const Visit visit{begin, end, quarter, from, to};
                if (leaf.slab == VOID && !rules_.sees_voids()) side_ = NOWHERE;
                else if (leaf.slab == LEVEL && meets_level(leaf, visit)) return;
                else if (leaf.slab < MIXED ? cross_slab(leaf, visit) : cross_leaf(leaf, visit))
                    return;
                side = side_;
            } else {
                const Quarters& parts = all[next & PLACE];
                const double at_x = at(parts.x, ray.x, per_x);
                const double at_y = at(parts.y, ray.y, per_y);
                quarter =
                    4 * (next & PLACE) + (nearest ^ (u32(at_x <= begin) + 2 * u32(at_y <= begin)));
                const bool turns_x = at_x > begin && at_x < end;
                const bool turns_y = at_y > begin && at_y < end;
                if (turns_x & turns_y) {
                    // through three quarters, or two where it crosses both middles at once
                    double first = min(at_x, at_y), second = max(at_x, at_y);
                    End before = at_x < at_y ? ACROSS_X : ACROSS_Y;
                    End after = at_x < at_y ? ACROSS_Y : ACROSS_X;
                    waiting[pending++] = {second, end, quarter ^ 3, after, to};
                    if (first < second)
                        waiting[pending++] = {
                            first, second, quarter ^ (at_x < at_y ? 1 : 2), before, after
                        };
                    end = first, to = before;
                } else if (turns_x) {
                    waiting[pending++] = {at_x, end, quarter ^ 1, ACROSS_X, to};
                    end = at_x, to = ACROSS_X;
                } else if (turns_y) {
                    waiting[pending++] = {at_y, end, quarter ^ 2, ACROSS_Y, to};
                    end = at_y, to = ACROSS_Y;
                }
                continue;
            }
            if (!pending) return;
            --pending;
            begin = waiting[pending].begin, end = waiting[pending].end;
            quarter = waiting[pending].quarter;
            from = waiting[pending].from, to = waiting[pending].to;
        }
    }

    // The ray stays on one side of all in a node.
    INLINE void pass(Side side, u32 next) {
        side_ = side, above_ = NaN, top_ = next & VOIDS ? UNSURE : UNKNOWN;
        skipped_ = false;
    }

    // Whether the ray meets the ground of a level leaf, or its side; false, too, where that is not
    // plain.
    INLINE bool meets_level(const Leaf& leaf, const Visit& visit) {
        double z0 = z_at(visit.begin), z1 = z_at(visit.end);
        Side here = side_of(z0 - leaf.base), there = side_of(z1 - leaf.base);
        if (here == NOWHERE || there == NOWHERE) return false;
        if (side_ == NOWHERE || side_ == here) {
            if (here == there) return false;
            put_point(clamp((leaf.base - ray_->z) / ray_->dz, visit.begin, visit.end));
            hit_.top = leaf.top;
            put_normal({0.0, 0.0});
            return true;
        }
        double deep = min(leaf.base - z0, leaf.base - z1);
        if (here == ABOVE || !(deep > wall_from(visit.begin))) return false;
        if (top_ == UNSURE || visit.from > ACROSS_Y || is_sliver(visit)) return false;
        put_point(visit.begin);
        along_.clear(), segments_ = {}, begins_ = visit.from;
        put_wall(leaf.top);
        return true;
    }

    // There may be a void where the ray comes from: look for all of them.
    bool look() {
        hit_.distance = AGAIN;
        return true;
    }

    // Whether it is rounding alone that tells the two ends of a visit apart, at a corner of the
    // node.
    bool is_sliver(const Visit& visit) const {
        if (visit.from == RIM || visit.to == RIM || visit.to == ITSELF) return false;
        Cut begin{visit.begin, slack_of(visit.from, visit.begin)};
        Cut end{visit.end, slack_of(visit.to, visit.end)};
        return are_one(begin, end);
    }

    // A level normal, of any length, towards where the ray comes from.
    void put_level_normal(Gradient normal) {
        auto [x, y] = normal;
        double length = sqrt(x * x + y * y);
        double facing = x * ray_->dx + y * ray_->dy > 0.0 ? -1.0 : 1.0;
        hit_.normal[0] = x / length * facing + 0.0, hit_.normal[1] = y / length * facing + 0.0;
        hit_.normal[2] = 0.0;
    }

    // The slack of where the part of the ray in a node begins or ends.
    double slack_of(End end, double at) const {
        if (end == ITSELF) return ROUNDING * scale_;
        if (end == RIM) return INF;  // on a line that is not known: that of the other cut decides
        if (end == ACROSS_X) return line_slack({X, ray_->x + ray_->dx * at});
        return line_slack({Y, ray_->y + ray_->dy * at});
    }

    // The ray through a leaf that nothing cuts. Its heights are between two planes: below and above
    // them it is known where the ray is, and if it only falls or rises to the ground between them
    // there is one root at most.
    bool cross_slab(const Leaf& leaf, const Visit& visit) {
        const Slab& slab = index_.slabs[leaf.slab];
        const double rounding =
            1e-15 * scale_ * (1.0 + abs(double(slab.slope_x)) + abs(double(slab.slope_y)));
        const double low = slab.low - rounding, high = slab.high + rounding;
        double zero = ray_->z - slab.z - slab.slope_x * ray_->x - slab.slope_y * ray_->y;
        double rate = ray_->dz - slab.slope_x * ray_->dx - slab.slope_y * ray_->dy;
        double here = zero + rate * visit.begin, there = zero + rate * visit.end;
        const bool over = min(here, there) > high, under = max(here, there) < low;
        if ((over && side_ != BELOW) || (under && side_ != ABOVE)) {
            pass(over ? ABOVE : BELOW, LEAF);
            return false;
        }
        double off = slab.off_x * abs(ray_->dx) + slab.off_y * abs(ray_->dy) + 1e-12;
        if (over || under || abs(rate) <= off || is_sliver(visit)) return cross_leaf(leaf, visit);
        Stretch ground = smooth_ground(leaf);
        // INF and -INF beyond the planes
        auto above_at = [&](double r, double off) {
            return off > high ? INF : off < low ? -INF : height_above(ground, r);
        };
        Side side = side_of(above_at(visit.begin, here));
        if (side == NOWHERE || (side_ != NOWHERE && side != side_)) return cross_leaf(leaf, visit);
        bool leaves = (rate > 0.0) == (side == ABOVE);  // the ground, for good
        double beyond = leaves ? double(side) * INF : above_at(visit.end, there);
        if (side_of(beyond) == side) {
            side_ = side, above_ = abs(beyond) < INF ? beyond : NaN, top_ = ground.top;
            past_ = visit.end, skipped_ = false;
            return false;
        }
        double first = (low - zero) / rate, last = (high - zero) / rate;
        double from = max(min(first, last), visit.begin), to = min(max(first, last), visit.end);
        Root root = the_root(ground, from, to, 0.5 * (from + to), side);
        return meet_ground(ground, root.at, root.slopes);
    }

    // Of a leaf that nothing cuts.
    Stretch smooth_ground(const Leaf& leaf) {
        along_.clear();
        Stretch ground{leaf.base, i64(leaf.top)};
        for (u32 entry : entries_of(leaf)) {
            along_.push_back(along_of(entry));
            ground.top = max(ground.top, i64(entry));
        }
        return ground;
    }

    // The ray through any leaf, cut where it crosses edges and steps.
    bool cross_leaf(const Leaf& leaf, const Visit& visit) {
        if (is_sliver(visit)) {
            skipped_ = true;
            return false;
        }
        Cut begin{visit.begin, slack_of(visit.from, visit.begin)};
        Cut end{visit.end, slack_of(visit.to, visit.end)};
        along_.clear(), cuts_.clear();
        auto cut = [&](const Crossing& c) {
            if (c.at > visit.begin && c.at < visit.end) cuts_.push_back({c.at, c.slack});
        };
        for (u32 entry : entries_of(leaf)) {
            along_.push_back(along_of(entry));
            if (!along_.back().cuts) continue;
            find_crossings(along_.back(), {visit.begin, visit.end}, cut);
            find_class_crossings(along_.back(), {visit.begin, visit.end}, cut);
        }
        segments_ = segments_of(leaf);
        for (u32 s : segments_) find_crossings(field_.tracks.segments[s], cut);
        if (cuts_.size() > 1)
            std::sort(cuts_.begin(), cuts_.end(), [](Cut a, Cut b) { return a.at < b.at; });
        drop_slivers(begin, end, visit.to != ITSELF);
        cuts_.push_back(end);
        double from = visit.begin;
        begins_ = visit.from;
        for (Cut c : cuts_) {
            if (cross_stretch(leaf, from, c.at)) return true;
            from = c.at, begins_ = ITSELF;
        }
        return false;
    }

    // Whether it is rounding that tells two cuts apart. A line along which the ray goes says little
    // of where it crosses another one.
    static bool are_one(Cut a, Cut b) {
        return b.at - a.at <= min(a.slack + b.slack, 8.0 * min(a.slack, b.slack));
    }

    // Leave out cuts of edges that are one, or meet, with others: no stretch is shorter than
    // rounding. The one before it is longer for that, or the one behind.
    void drop_slivers(Cut begin, Cut end, bool at_end) {
        std::size_t kept = 0;
        Cut last = begin;
        for (Cut c : cuts_) {
            if (!are_one(last, c)) cuts_[kept++] = c;
            last = c;
        }
        while (at_end && kept && are_one(cuts_[kept - 1], end)) --kept;
        cuts_.resize(kept);
    }

    Span<const u32> entries_of(const Leaf& leaf) const {
        return {index_.entries.data() + leaf.first, leaf.count};
    }
    Span<const u32> segments_of(const Leaf& leaf) const {
        return {index_.entries.data() + leaf.first + leaf.count, leaf.segments};
    }

    // Between two cuts; whether something is hit.
    bool cross_stretch(const Leaf& leaf, double from, double to) {
        double middle = 0.5 * (from + to);
        Stretch ground{leaf.base, i64(leaf.top)};
        bool voids = false;
        for (Along& a : along_) {
            if (a.cuts) a.active = holds_middle(a, middle);
            if (!a.active) continue;
            ground.top = max(ground.top, i64(a.index));
            voids |= a.is_void;
        }
        double x = ray_->x + ray_->dx * middle, y = ray_->y + ray_->dy * middle;
        Worn worn = worn_near(index_.elements, ground.top, x, y);
        if (voids || worn.is_void) return enter_void(ground, from);
        if (leaf.segments || has_reliefs(field_)) {
            i64 surface = worn.surface;
            if (leaf.segments) {
                Rut rut = rules_.rut(field_, x, y, surface);
                ground.depth = rut.depth;
                if (rut.surface_track >= 0) {
                    surface = field_.tracks.surface[rut.surface_track];
                    ground.top = count_of(field_.elements) + rut.surface_track;
                }
            }
            if (has_reliefs(field_)) {
                const Relief& relief = relief_of(field_, surface);
                if (relief.scale != 0.0) ground.relief = &relief;
            }
        }
        double above = height_above(ground, from);
        Side here = side_of(above);
        if (here == NOWHERE || (side_ != NOWHERE && here != side_)) {
            if (side_ != NOWHERE && top_ == UNSURE) return look();
            // not where rounding alone tells the two apart, or what slivers were passed
            double rounding = wall_from(from);
            if (past_ < from) {
                Range rate = change(ground, past_, from);
                rounding += (from - past_) * max(abs(rate.low), abs(rate.high));
            }
            bool is_jump = side_ != NOWHERE && !(abs(above - above_) <= rounding);
            if (here == NOWHERE && skipped_) is_jump = false;  // it may have been in the sliver
            return is_jump ? meet_wall(ground, from) : meet_ground(ground, from);
        }
        past_ = to, skipped_ = false;
        Range rate = change(ground, from, to);
        double width = to - from;
        double least = here == ABOVE ? above + rate.low * width : -above - rate.high * width;
        if (least > wall_from(to)) {  // it stays on its side
            side_ = here, above_ = NaN, top_ = ground.top;
            return false;
        }
        double beyond = height_above(ground, to);
        patience_ = PATIENCE;
        double root = first_root(ground, {from, above, to, beyond}, rate);
        if (root < INF) return meet_ground(ground, root);
        side_ = side_of(beyond), above_ = beyond, top_ = ground.top;
        return false;
    }

    // Into a void; whether the ray meets a wall there, as it does where it counts as endless.
    INLINE bool enter_void(const Stretch& ground, double r) {
        Side side = rules_.side_in_void(ground.top);
        if (side != NOWHERE && side_ != NOWHERE && side_ != side) {
            put_point(r);
            put_wall(ENDLESS);
            return true;
        }
        side_ = side;
        if (rules_.sees_voids()) above_ = NaN, top_ = ENDLESS, past_ = NaN;
        return false;
    }

    void put_point(double r) {
        hit_.distance = r;
        hit_.x = ray_->x + ray_->dx * r, hit_.y = ray_->y + ray_->dy * r, hit_.z = z_at(r);
    }

    bool meet_ground(const Stretch& ground, double r, Gradient slopes) {
        put_point(r);
        hit_.top = ground.top;
        put_normal(slopes);
        return true;
    }
    bool meet_ground(const Stretch& ground, double r) {
        return meet_ground(ground, r, above<true>(ground, r).slopes);
    }

    // A jump that is no larger is rounding.
    INLINE double wall_from(double r) const { return 1e-9 * (1.0 + abs(z_at(r))) + 1e-14 * scale_; }

    // The ground jumps across the ray where a stretch begins: a wall, of the higher side.
    bool meet_wall(const Stretch& ground, double r) {
        put_point(r);
        put_wall(side_ == BELOW ? top_before() : ground.top);
        if (hit_.top < count_of(field_.elements) && is_classed(field_, hit_.top)) {
            auto [x, y] = beside(side_ == BELOW ? -1.0 : 1.0);
            hit_.pixel = pixel_near(index_.elements, hit_.top, x, y);
        }
        return true;
    }

    // A place a little before the hit, or behind it.
    UV beside(double way) const {
        In bounds = field_.bounds;
        double flat = sqrt(square(ray_->dx) + square(ray_->dy));
        double aside = 1e-9 * (bounds[2] - bounds[0] + bounds[3] - bounds[1])
            + 1e-15 * (abs(hit_.x) + abs(hit_.y));
        return {
            clamp(hit_.x + way * aside * ray_->dx / flat, bounds[0], bounds[2]),
            clamp(hit_.y + way * aside * ray_->dy / flat, bounds[1], bounds[3])
        };
    }

    // The element on the side from which the ray comes to a wall.
    i64 top_before() {
        if (top_ != UNKNOWN) return top_;
        auto [x, y] = beside(-1.0);
        Found found = found_at<false>(field_, x, y, stack_);
        if (!has_tracks(field_)) return found.top;
        i64 track = rut_at(field_.tracks, x, y, worn_of(field_, found).surface).surface_track;
        return track < 0 ? found.top : count_of(field_.elements) + track;
    }

    // A wall at the point of the hit, of an element. Its normal is that of the nearest edge, and of
    // that which may jump most; or else of the side of the node through which the ray comes.
    void put_wall(i64 top) {
        hit_.wall = true, hit_.top = top;
        double best = 0.0, nearest = INF;
        Gradient normal{ray_->dx, ray_->dy};
        if (begins_ == ACROSS_X) normal = {1.0, 0.0};
        if (begins_ == ACROSS_Y) normal = {0.0, 1.0};
        auto take = [&](const Crossing& c) {
            double off = abs(c.at - hit_.distance);
            if (off > 16.0 * c.slack || off > nearest) return;  // slivers are shorter than half
            if (off == nearest && c.weight <= best) return;
            nearest = off, best = c.weight, normal = c.normal;
        };
        for (const Along& a : along_) {
            find_crossings(a, EVERYWHERE, take);
            find_class_crossings(a, {hit_.distance, hit_.distance}, take);
        }
        for (u32 s : segments_) find_crossings(field_.tracks.segments[s], take);
        // behind a sliver that side may be no edge
        if (skipped_ && 0 <= top && top < count_of(field_.elements))
            find_crossings(along_of(u32(top)), EVERYWHERE, take);
        put_level_normal(normal);
    }
};

// A ray of a direction of any length, made without that overflows or vanishes on the way. False
// where it is no ray: where a number is not finite, or the direction is 0.
INLINE bool make_ray(const double* origin, const double* direction, Ray& ray) {
    double x = direction[0], y = direction[1], z = direction[2];
    double square = x * x + y * y + z * z;
    if (!(square > 1e-200 && square < 1e200)) {
        double largest = max3(abs(x), abs(y), abs(z));
        x /= largest, y /= largest, z /= largest;
        square = x * x + y * y + z * z;
    }
    double per = 1.0 / sqrt(square);
    ray = {origin[0], origin[1], origin[2], x * per, y * per, z * per};
    double zero = 0.0;  // or NaN, which 0 times what is not finite is
    for (double number : {ray.x, ray.y, ray.z, ray.dx, ray.dy, ray.dz}) zero += 0.0 * number;
    // what moves no coordinate, and has no inverse
    constexpr double nothing = 1e-300;
    if (abs(ray.dx) < nothing) ray.dx = 0.0;
    if (abs(ray.dy) < nothing) ray.dy = 0.0;
    return zero == 0.0;
}

// The surface of what is hit.
inline i32 surface_of(const Index& index, const Hit& hit) {
    const Field& field = index.field;
    i64 track = hit.top - count_of(field.elements);
    if (track >= 0) return field.tracks.surface[track];
    if (hit.pixel.element >= 0) return i32(worn_of(field, hit.top, hit.pixel).surface);
    return i32(worn_near(index.elements, hit.top, hit.x, hit.y).surface);
}

struct Rays {
    Matrix<const double> origins, directions;
    In most;
};

template <class Visit> void visit_arguments(Rays& r, Visit visit) {
    visit("origins[n,3]", r.origins), visit("directions[n,3]", r.directions);
    visit("most[n]", r.most);
}

// What rays meet: the distance, INF for none; the point, the normal towards the ray, the element as
// in `samples`, -2 for none, its surface, -1 for none, and whether it is a wall.
struct RayHits {
    Out distance;
    Matrix<double> point, normal;
    Span<i64> top;
    Span<i32> surface;
    Span<bool> wall;
};

template <class Visit> void visit_arguments(RayHits& h, Visit visit) {
    visit("distance[n]", h.distance), visit("point[n,3]", h.point), visit("normal[n,3]", h.normal);
    visit("element[n]", h.top), visit("surface[n]", h.surface), visit("wall[n]", h.wall);
}

// The first thing that each ray meets: cast(ray, most, surface) gives it, with its surface. The
// number of the first ray that is none, where it ends, or -1.
template <class Cast> i64 cast_all(const Rays& rays, const RayHits& out, Cast cast) {
    for (i64 n = 0; n < rays.origins.rows(); ++n) {
        Ray ray;
        bool is_ray = make_ray(&rays.origins(n, 0), &rays.directions(n, 0), ray);
        if (!is_ray || !(rays.most[n] >= 0.0)) return n;
        out.surface[n] = -1;
        Hit hit = cast(ray, rays.most[n], out.surface[n]);
        out.distance[n] = hit.distance;
        out.point(n, 0) = hit.x, out.point(n, 1) = hit.y, out.point(n, 2) = hit.z;
        for (int axis = 0; axis < 3; ++axis) out.normal(n, axis) = hit.normal[axis];
        out.top[n] = hit.distance < INF ? hit.top : -2;
        out.wall[n] = hit.wall;
    }
    return -1;
}

inline i64 cast(const Index& index, const Rays& rays, const RayHits& out) {
    Caster<PlainRules> caster(index);
    return cast_all(rays, out, [&](const Ray& ray, double most, i32& surface) {
        Hit hit = caster.cast(ray, 0.0, most);
        if (hit.distance < INF) surface = surface_of(index, hit);
        return hit;
    });
}

}  // namespace terratool::rays
