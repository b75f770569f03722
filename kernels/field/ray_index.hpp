// What rays look things up in: a tree of quarters of the plan, with bounds of the heights in each
// node; each leaf lists the elements that vary in it. What is level all over a leaf is its base.
#pragma once

#include <numeric>

#include "ray_classes.hpp"

namespace terratool::rays {

constexpr int DEEPEST = 22;  // level of quarters in quarters

// Of what is next in a quarter: no quarters, but a leaf; and that there may be a void in it.
constexpr u32 LEAF = u32(1) << 31, VOIDS = u32(1) << 30, PLACE = VOIDS - 1;

constexpr float BEYOND = std::numeric_limits<float>::infinity();

INLINE float float_above(double x) { return std::nextafter(float(x), BEYOND); }
INLINE float float_below(double x) { return std::nextafter(float(x), -BEYOND); }

// Quarters of a node: south-west, south-east, north-west, north-east; a line of the cache.
struct alignas(64) Quarters {
    std::array<float, 4> low, high;  // heights
    std::array<u32, 4> next;         // where their quarters are, or which leaf each is
    double x, y;                     // where they part

    void put(int quarter, Range height) {
        low[quarter] = float_below(height.low), high[quarter] = float_above(height.high);
    }
};

// What is in a leaf, besides elements: ground at its base, nothing, or anything.
constexpr u32 LEVEL = ~u32(0), VOID = LEVEL - 1, MIXED = LEVEL - 2;

struct Leaf {
    double base;       // what elements add that are level all over it
    u32 first, count;  // the leaf's entries
    u32 segments;      // entries behind `count`, of tracks
    i32 top;           // the last of the elements that are level all over it, -1 for none
    u32 slab;          // where nothing cuts it; or `LEVEL`, `VOID` or `MIXED`
};

// Bounds of the heights in a leaf that nothing cuts, from a plane that leans as they do: they are
// `low` to `high` above z + slope_x x + slope_y y. How far their slopes may differ from those.
struct Slab {
    double z;
    float slope_x, slope_y, low, high, off_x, off_y;
};

constexpr u32 CUT = u32(1) << 31;  // of an entry: edges or steps of the element lie in the leaf

// The tree over all elements of a field.
class Index {
public:
    const Field& field;
    Elements elements;
    Range height;                    // of all
    std::vector<Quarters> quarters;  // of a node; the first quarter of the first one is the root

    std::vector<Leaf> leaves;
    std::vector<Slab> slabs;
    std::vector<u32> entries;  // elements, those that cut with `CUT`; then segments of tracks

    Index(const Field& f, In west, In south, In east, In north)
        : field(f), elements(f, west, south, east, north) {
        find_ruts();
        for (double bound : f.bounds) least_ = max(least_, 1e5 * ROUNDING * abs(bound));
        build();
    }

    i64 nbytes() const {
        return i64(
            quarters.size() * sizeof(Quarters) + leaves.size() * sizeof(Leaf)
            + slabs.size() * sizeof(Slab) + entries.size() * 4
            + elements.places.size() * sizeof(Placed)
        );
    }

private:
    double deepest_ = 0.0, rough_ = 0.0;  // of tracks: the deepest rut, the highest relief
    double least_ = 0.0;  // no narrower side is halved, or rounding would be as wide

    struct Pending {
        Cell plan;
        double base = 0.0;
        i32 top = -1;
        std::vector<u32> entries{};  // elements only, as those of leaves
        std::vector<u32> segments{};
        Range height{0.0, 0.0};  // of all in it
        bool voids = false;      // whether there may be a void in it
        double rough = 0.0;      // the highest relief in it
        i64 straight = 0;        // edges and steps in it along an axis
        i64 cutting = 0;         // edges, steps and segments in the node
        double finest = INF;     // least distance between two of `cutting` of one element
        i64 patches = 0;         // of the grid of heights that has the most in it

        bool is_bare() const { return entries.empty() && segments.empty(); }
    };

    void find_ruts() {
        const Tracks& tracks = field.tracks;
        for (i64 surface : tracks.surface) rough_ = max(rough_, relief_on(surface));
        double first = 0.0, passes = 0.0, power = 0.0;
        for (double depth : tracks.depths.flat())
            if (depth > first) first = depth;
        for (double one : tracks.passes) passes += one;
        for (double one : tracks.power) power = max(power, one);
        deepest_ = deepened(first, passes, power);
    }

    static bool meets(const Segment& s, const Cell& plan) {
        constexpr double more = 1.0 + 1e-9;
        double reach = s.reach * more;
        return min(s.x, s.end_x) - reach <= plan.east && max(s.x, s.end_x) + reach >= plan.west
            && min(s.y, s.end_y) - reach <= plan.north && max(s.y, s.end_y) + reach >= plan.south;
    }

    // Take of what may be in a plan what is; what is level all over it goes into the base.
    void settle(Pending& own, Span<const u32> among, Span<const u32> segments) const {
        double size = 0.0;
        for (u32 entry : among) {
            u32 index = entry & ~CUT;
            Part part = elements.part_of(index, own.plan);
            if (!part.meets) continue;
            const Kind& kind = field.kinds[field.elements[index].kind];
            ClassPart classes = class_part(elements, index, own.plan);
            bool alike = !has_classes(kind) || !surfaces_matter(field);
            bool level = part.height.low == part.height.high;
            if (!part.lines && !part.voids && alike && level) {
                own.base += part.height.low;
                own.top = max(own.top, i32(index));
                continue;
            }
            own.entries.push_back(index | (part.cuts || classes.differs ? CUT : 0));
            own.height = own.height + part.height;
            own.voids |= part.voids || classes.voids;
            own.patches = max3(own.patches, part.patches, classes.pixels);
            own.rough = max(own.rough, relief_on(kind));
            size += max(abs(part.height.low), abs(part.height.high));
            if (!part.lines) continue;
            own.cutting += part.lines, own.straight += part.straight;
            double steps = 1.0;
            for (int axis : {X, Y})
                steps += double(elements.curve(field.elements[index].kind, axis).steps.size());
            const Cell& cell = elements.places[index].cell;
            own.finest = min(own.finest, min(cell.wide(), cell.tall()) / steps);
        }
        for (u32 s : segments)
            if (meets(field.tracks.segments[s], own.plan)) own.segments.push_back(s);
        own.cutting += count_of(own.segments);
        own.voids |= own.top >= 0 && is_void_kind(own.top);
        own.rough = max(own.rough, relief_on(worn_of(field, own.top, {}).surface));
        double deepest = 0.0;
        if (!own.segments.empty()) deepest = deepest_, own.rough = max(own.rough, rough_);
        double rounding = 1e-12 * (size + abs(own.base)) + 1e-300;
        own.height = own.height + Range{own.base, own.base};
        own.height.low -= rounding + own.rough + deepest;
        own.height.high += rounding + own.rough;
    }

    double relief_on(i64 surface) const {
        return has_reliefs(field) ? HIGHEST_RELIEF * abs(relief_of(field, surface).scale) : 0.0;
    }

    // The highest relief that an element of a kind may wear.
    double relief_on(const Kind& kind) const {
        double found = relief_on(i64(kind.surface));
        if (!has_classes(kind)) return found;
        const ClassGrid& grid = field.classes.grids[kind.classes];
        for (i64 surface : field.classes.surfaces.subspan(grid.first, grid.count))
            found = max(found, relief_on(surface));
        return found;
    }

    bool is_void_kind(i32 index) const { return field.kinds[field.elements[index].kind].is_void; }

    // Whether a node is to be quartered: where edges or steps along an axis cut it, at which it can
    // be parted; where too much else does, or more than one thing and it is large beside that;
    // where a grid of heights has many patches; or where heights are far from a plane.
    bool is_crowded(const Pending& pending, int depth) const {
        constexpr i64 few = 4, many_patches = 64;
        constexpr int bent_until = 7;
        constexpr double bent = 0.02;  // heights from a plane beside the shorter side
        // the shorter side of a node that few or more things cut, beside `finest`
        constexpr double large = 1.5, crowded = 0.2;
        if (depth >= DEEPEST) return false;
        if (pending.straight) return true;
        double side = min(pending.plan.wide(), pending.plan.tall());
        if (side < least_) return false;
        double beside = pending.cutting > few ? crowded : large;
        if (side > beside * pending.finest && pending.cutting > 1) return true;
        if (pending.patches > many_patches) return true;
        if (depth >= bent_until || pending.entries.empty()) return false;
        Slab slab = slab_of(pending);
        return slab.high - slab.low > bent * side;
    }

    void build() {
        std::vector<Pending> level(1);
        level[0].plan = {field.bounds[0], field.bounds[1], field.bounds[2], field.bounds[3]};
        std::vector<u32> all(field.elements.size()), segments(field.tracks.segments.size());
        std::iota(all.begin(), all.end(), 0u);
        std::iota(segments.begin(), segments.end(), 0u);
        settle(level[0], all, segments);
        height = level[0].height;
        quarters.emplace_back().put(0, height);
        // so many quarters, and so many entries that wait, keep the tree in the size of the field
        i64 most = (i64(1) << 16) + count_of(field.elements) + count_of(field.curves.heights) / 32;
        i64 most_waiting = 32 * most;
        std::vector<u32> parents{0};  // of the level: where their nodes are, in quarters
        for (int depth = 0; !level.empty(); ++depth) {
            std::vector<Pending> next;
            std::vector<u32> own;
            i64 waiting = 0;
            for (std::size_t n = 0; n < level.size(); ++n) {
                Pending pending = std::move(level[n]);
                bool splits = count_of(quarters) < most && waiting < most_waiting
                    && is_crowded(pending, depth);
                u32 place = splits ? u32(quarters.size()) : u32(leaves.size()) | LEAF;
                quarters[parents[n / 4]].next[n % 4] = place | (pending.voids ? VOIDS : 0);
                if (splits) own.push_back(place), waiting += split(pending, next);
                else add_leaf(pending);
            }
            level = std::move(next), parents = std::move(own);
        }
    }

    // Where the quarters of a node part: at edges or steps that go through most of it, near to its
    // middle; INF, and not at all, where it is too narrow to be halved.
    std::array<double, 2> parting(const Pending& pending) const {
        constexpr double short_lines = 0.3;  // what length counts beside the place
        const Cell& plan = pending.plan;
        const std::array<double, 2> side{plan.wide(), plan.tall()};
        std::array<double, 2> found, best{INF, INF};
        for (int axis : {X, Y}) found[axis] = side[axis] < least_ ? INF : plan.middle(axis);
        for (u32 entry : pending.entries) {
            if (!(entry & CUT)) continue;
            const u32 index = entry & ~CUT;
            const Cell& cell = elements.places[index].cell;
            std::array<double, 2> missing;  // of a line across an axis, in parts of the node
            for (int axis : {X, Y}) {
                int along = 1 - axis;
                double length =
                    min(cell.high(along), plan.high(along)) - max(cell.low(along), plan.low(along));
                missing[axis] = 1.0 - length / side[along];
            }
            elements.for_lines(index, plan, [&](Line line) {
                if (!plan.crosses(line.axis, line.at)) return;
                double off = abs(line.at - plan.middle(line.axis)) / side[line.axis]
                    + short_lines * missing[line.axis];
                if (off < best[line.axis]) best[line.axis] = off, found[line.axis] = line.at;
            });
        }
        return found;
    }

    // A plane in the middle of all heights in a node but for ruts and relief, and how far they may
    // be from it.
    Slab slab_of(const Pending& pending) const {
        const Cell& plan = pending.plan;
        const double x = plan.middle(X), y = plan.middle(Y);
        Range slope_x{0.0, 0.0}, slope_y{0.0, 0.0}, off{0.0, 0.0};
        double z = pending.base, size = abs(pending.base);
        for (u32 entry : pending.entries) {
            const u32 index = entry & ~CUT;
            if (entry & CUT) {
                off = off + elements.part_of(index, plan).height;
                continue;
            }
            double own = elements.value_at(index, x, y);
            z += own, size += abs(own);
            auto [by_x, by_y] = elements.slopes_of(index, plan);
            slope_x = slope_x + by_x, slope_y = slope_y + by_y;
        }
        Slab slab;
        slab.slope_x = float(0.5 * (slope_x.low + slope_x.high));
        slab.slope_y = float(0.5 * (slope_y.low + slope_y.high));
        slab.z = z - slab.slope_x * x - slab.slope_y * y;
        slab.off_x = float_above(max(slope_x.high - slab.slope_x, slab.slope_x - slope_x.low));
        slab.off_y = float_above(max(slope_y.high - slab.slope_y, slab.slope_y - slope_y.low));
        double leaning = 0.5 * (slab.off_x * plan.wide() + slab.off_y * plan.tall());
        double most = leaning + 1e-12 * size
            + 1e-14 * (abs(slab.z) + abs(slab.slope_x * x) + abs(slab.slope_y * y));
        slab.low = float_below(off.low - most);
        slab.high = float_above(off.high + most);
        return slab;
    }

    void add_leaf(const Pending& pending) {
        u32 slab = slab_in(pending);
        if (slab == slabs.size()) slabs.push_back(slab_of(pending));
        leaves.push_back(
            {pending.base, u32(entries.size()), u32(pending.entries.size()),
             u32(pending.segments.size()), pending.top, slab}
        );
        entries.insert(entries.end(), pending.entries.begin(), pending.entries.end());
        entries.insert(entries.end(), pending.segments.begin(), pending.segments.end());
    }

    // What `Leaf::slab` is to be.
    u32 slab_in(const Pending& pending) const {
        if (pending.is_bare() && pending.voids) return VOID;
        bool cut = std::any_of(pending.entries.begin(), pending.entries.end(), [](u32 entry) {
            return (entry & CUT) != 0;
        });
        if (cut || pending.voids || pending.rough > 0.0 || !pending.segments.empty()) return MIXED;
        return pending.is_bare() ? LEVEL : u32(slabs.size());
    }

    // The number of entries that its quarters have.
    i64 split(const Pending& pending, std::vector<Pending>& next) {
        Quarters made;
        i64 count = 0;
        auto [x, y] = parting(pending);
        made.x = x, made.y = y;
        for (int quarter = 0; quarter < 4; ++quarter) {
            Pending own{pending.plan, pending.base, pending.top};
            if (x < INF) (quarter & 1 ? own.plan.west : own.plan.east) = x;
            if (y < INF) (quarter & 2 ? own.plan.south : own.plan.north) = y;
            bool is_there = !(quarter & 1 && x == INF) && !(quarter & 2 && y == INF);
            if (is_there) settle(own, pending.entries, pending.segments);
            made.put(quarter, own.height);
            count += count_of(own.entries) + count_of(own.segments);
            next.push_back(std::move(own));
        }
        quarters.push_back(made);
        return count;
    }
};

}  // namespace terratool::rays
