// Rays on terrains with storeys: where a straight line first meets the boundary of what is solid.
//
// That boundary lies on the ground, on tops and other faces of storeys, and on walls beside them.
// Each of these is a plain field, which a ray meets as it meets any. So what a ray meets of them
// one after the other are all places where it may come into something solid, or out of it; whether
// it does is read off the columns between these places. What is no boundary is passed: ground
// within a bore, a face within another solid, a wall beside what fills the place behind it.
#pragma once

#include "columns.hpp"
#include "rays.hpp"

namespace terratool::rays {

// Storeys, with the index of the ground and those of the tops and the other faces of each sheet.
struct StoreyIndex {
    const Storeys& storeys;
    const Index& ground;
    std::vector<const Index*> tops, faces;
};

// Columns one at a time, of the ground as well.
class ColumnReader {
public:
    explicit ColumnReader(const StoreyIndex& all)
        : field_(all.ground.field), storeys_(all.storeys), maker_(all.storeys),
          stack_(field_.pending), sheet_stack_(most_pending(all.storeys)) {}

    bool has_storeys(double x, double y) const { return storeys_.near(x, y) != 0; }

    // What is solid at a point, with ruts and reliefs.
    const std::vector<Solid>& at(double x, double y) {
        begin(x, y);
        maker_.settle(column_, field_, x, y, first_track());
        return column_.solids;
    }

    // Slopes of the other face of a storey at a point, by the number of the storey's own element.
    Gradient face_slopes(double x, double y, i64 element) {
        const auto& numbers = storeys_.table.numbers;
        for (const Sheet& sheet : storeys_.sheets) {
            Found found = found_at<true>(*sheet.faces, x, y, sheet_stack_);
            i32 storey = found.top < 0 ? -1 : sheet.faced[found.top];
            if (storey >= 0 && numbers[storey] == element) return {found.slope_x, found.slope_y};
        }
        return {0.0, 0.0};
    }

    i64 first_track() const { return count_of(field_.elements); }
    // The ground that the last column began with.
    const Face& ground() const { return ground_; }

private:
    const Field& field_;
    const Storeys& storeys_;
    ColumnMaker<Face> maker_;
    SolidColumn<Face> column_;
    Stack stack_, sheet_stack_;
    Face ground_{};

    static i64 most_pending(const Storeys& storeys) {
        i64 most = 1;
        for (const Sheet& sheet : storeys.sheets) most = max(most, sheet.faces->pending);
        return most;
    }

    void begin(double x, double y) {
        ground_ = {NaN};
        if (is_inside(field_.bounds, x, y)) {
            Found found = found_at<true>(field_, x, y, stack_);
            Worn worn = worn_of(field_, found);
            double z = worn.is_void ? NaN : found.z;
            ground_ = {z, found.top, i32(worn.surface), -1, found.slope_x, found.slope_y};
        }
        column_.begin(ground_);
        maker_.put_storeys(column_, x, y, storeys_.near(x, y));
    }
};

// Of the ground under storeys, or of the tops or the other faces of a sheet. A deck is below its
// top and above its underside; a bore is above its floor and below its ceiling. Where it is not
// there its faces are endlessly far.
struct StoreyRules {
    const Sheet* sheet = nullptr;  // none for the ground
    bool faces = false;
    // which tracks count: those whose paths have no heights, and those whose paths have some
    bool low = true, high = true;
    // whether there is nothing beside a bore, whose rough floor may be above the ground there
    bool bare = false;

    bool sees_voids() const { return sheet; }
    Side side_in_void(i64 top) const {
        if (!sheet) return NOWHERE;
        if (faces) return sheet->is_bore ? ABOVE : BELOW;
        bool is_own = top >= 0 && sheet->storeys[top] >= 0;  // a hole
        return sheet->is_bore && !is_own && !bare ? BELOW : ABOVE;
    }
    Rut rut(const Field& field, double x, double y, i64 surface) const {
        i64 cell = cell_near(field.tracks, x, y);
        if (cell < 0) return {0.0, -1, -1, 0.0, 0.0};
        return chosen_rut_in(field.tracks, cell, x, y, surface, [&](const Segment& segment) {
            return isnan(segment.z) ? low : high;
        });
    }
};

// What is at a place: nothing, over ground or over a void; the ground, or what else is solid.
enum Matter : u8 { AIR, OVER_VOID, GROUND, SOLID };

INLINE bool is_solid(Matter matter) { return matter >= GROUND; }

// Whether there is a boundary between two kinds of matter. The rim of the ground at a void is none.
INLINE bool is_boundary(Matter a, Matter b) {
    bool rim = (a == GROUND && b == OVER_VOID) || (a == OVER_VOID && b == GROUND);
    return is_solid(a) != is_solid(b) && !rim;
}

// A place that may be a boundary.
struct Candidate {
    Hit hit;
    i64 element;  // number of the element that it is of, or `UNKNOWN`
    i32 surface;
    bool is_face;   // rather than a top
    bool is_plain;  // of the ground with all tracks
};

// What a ray meets of one field, from place to place.
class Stream {
public:
    const Index& index;
    std::size_t sheet;  // which has the field, but for the ground
    StoreyRules rules;
    Hit hit;             // what is met next, if it is `found`
    double found = INF;  // its distance

    Stream(const Index& of, std::size_t k, StoreyRules r)
        : index(of), sheet(k), rules(r), caster_(of, r) {}

    // Begin with the part of a ray in which there may be something.
    void start(const Ray& ray, double begin, double end) {
        ray_ = &ray, searched_ = begin, end_ = begin <= end ? end : -INF;
        found = INF, stuck_ = 1.0;
    }

    // Look for what comes next, up to a distance.
    void look(double to) {
        if (found < INF || searched_ > to || searched_ > end_) return;
        hit = caster_.cast(*ray_, searched_, min(to, end_));
        found = hit.distance;
        // along a face a ray meets it everywhere
        stuck_ = found <= searched_ ? 2.0 * stuck_ : 1.0;
        searched_ = to;
    }

    // Go on behind what was met, by one `step` or, along a face, ever more.
    void pass(double step) { searched_ = found + stuck_ * step, found = INF; }

private:
    Caster<StoreyRules> caster_;
    const Ray* ray_ = nullptr;
    double searched_ = 0.0;  // no more is met up to there
    double end_ = -INF;
    double stuck_ = 1.0;
};

// Casts rays on a terrain with storeys; each thread needs its own.
class StoreyCaster {
public:
    explicit StoreyCaster(const StoreyIndex& all) : all_(all), columns_(all) {
        const Field& field = all.ground.field;
        In bounds = field.bounds;
        extent_ = bounds[2] - bounds[0] + bounds[3] - bounds[1];
        bool low = false, high = false;  // whether there are tracks on the ground, and on tops
        for (const Segment& segment : field.tracks.segments) (isnan(segment.z) ? low : high) = true;
        // with all tracks first; which ones lie on a top is not the same all over it
        std::vector<StoreyRules> counts(1);
        if (low || high) counts.push_back({.low = false, .high = false});
        if (low && high) counts.push_back({.high = false}), counts.push_back({.low = false});
        for (StoreyRules rules : counts) put(all.ground, 0, rules);
        for (std::size_t k = 0; k < all.storeys.sheets.size(); ++k) {
            const Sheet* sheet = &all.storeys.sheets[k];
            heights_.push_back(heights_of(*sheet, k));
            put(*all.faces[k], k, {.sheet = sheet, .faces = true});
            for (StoreyRules rules : counts) {
                rules.sheet = sheet;
                put(*all.tops[k], k, rules);
                rules.bare = true;
                if (sheet->is_bore && has_reliefs(field)) put(*all.tops[k], k, rules);
            }
        }
    }

    Hit cast(const Ray& ray, double most, i32& surface) {
        ray_ = &ray;
        if (ray.dx == 0.0 && ray.dy == 0.0 && columns_.has_storeys(ray.x, ray.y))
            return cast_upright(most, surface);
        Stream& ground = *streams_[0];
        ground.start(ray, 0.0, most);
        ground.look(most);
        end_ = most;
        bool slants = ray.dx != 0.0 || ray.dy != 0.0;
        if (slants && find_spans(min(ground.found, most))) {
            if (ground.found < most) find_spans(most);
            return cast_slanted(surface);
        }
        if (ground.found < INF) surface = surface_of(all_.ground, ground.hit);
        return ground.hit;
    }

private:
    const StoreyIndex& all_;
    ColumnReader columns_;
    std::vector<std::unique_ptr<Stream>> streams_;  // the ground first
    std::vector<Range> heights_;                    // of the storeys of each sheet
    std::vector<Candidate> near_;  // that rounding may tell apart, or a little more
    std::array<Range, 64> spans_;  // of the ray, by the bits of the lattice
    const Ray* ray_ = nullptr;
    double extent_, end_, width_ = 0.0;  // width of what is looked at together

    void put(const Index& index, std::size_t sheet, StoreyRules rules) {
        streams_.push_back(std::make_unique<Stream>(index, sheet, rules));
    }

    // Between which heights the storeys of a sheet lie.
    Range heights_of(const Sheet& sheet, std::size_t k) const {
        Range tops = all_.tops[k]->height, faces = all_.faces[k]->height;
        if (!sheet.is_bore) return {faces.low, tops.high};
        const Field& field = all_.tops[k]->field;
        for (std::size_t n = 0; n < sheet.storeys.size(); ++n) {
            const Kind& kind = field.kinds[field.elements[n].kind];
            bool may_be_void = kind.is_void || has_classes(kind) || kind.combine == GRID;
            if (sheet.storeys[n] >= 0 && may_be_void) tops.low = -INF;
        }
        // what is rough may be above the ceiling
        return {tops.low, has_reliefs(field) ? max(tops.high, faces.high) : faces.high};
    }

    double x_at(double r) const { return ray_->x + ray_->dx * r; }
    double y_at(double r) const { return ray_->y + ray_->dy * r; }
    double z_at(double r) const { return ray_->z + ray_->dz * r; }

    // Straight up or down: the next end of an interval of the column.
    Hit cast_upright(double most, i32& surface) {
        Hit hit;
        const Face* met = nullptr;
        bool is_top = false;
        const auto& solids = columns_.at(ray_->x, ray_->y);
        for (const Solid& solid : solids)
            for (const Face* face : {&solid.bottom, &solid.top}) {
                double distance = (face->z - ray_->z) / ray_->dz;
                if (!(0.0 <= distance && distance <= most && distance < hit.distance)) continue;
                hit.distance = distance, met = face, is_top = face == &solid.top;
            }
        if (!met) return hit;
        put_face(hit, *met, is_top, {ray_->x, ray_->y}, surface);
        hit.z = met->z;
        return hit;
    }

    // A hit on a top or a bottom of a column.
    void put_face(Hit& hit, Face face, bool is_top, UV at, i32& surface) {
        Gradient slopes{face.slope_x, face.slope_y};
        if (!is_top) slopes = columns_.face_slopes(at.u, at.v, face.element);
        hit.top = face.element, surface = face.surface, hit.wall = false;
        hit.x = at.u, hit.y = at.v, hit.z = z_at(hit.distance);
        put_slanted_normal(*ray_, slopes, hit);
    }

    // Find which part of the ray up to a distance may meet which sheet; whether any does.
    bool find_spans(double most) {
        const StoreyLattice& lattice = all_.storeys.lattice;
        const Ray& ray = *ray_;
        In frame = lattice.frame;
        const std::array<double, 2> from{
            (ray.x - frame[0]) * frame[2], (ray.y - frame[1]) * frame[3]
        };
        const std::array<double, 2> way{ray.dx * frame[2], ray.dy * frame[3]};
        const std::array<i64, 2> count{lattice.cells.columns(), lattice.cells.rows()};
        double begin = 0.0, end = most;
        for (int axis : {X, Y}) {
            if (way[axis] == 0.0) {
                if (!(0.0 <= from[axis] && from[axis] < double(count[axis]))) return false;
                continue;
            }
            double one = -from[axis] / way[axis];
            double other = (double(count[axis]) - from[axis]) / way[axis];
            begin = max(begin, min(one, other)), end = min(end, max(one, other));
        }
        if (!(begin <= end)) return false;
        spans_.fill({INF, -INF});
        std::array<i64, 2> cell;
        for (int axis : {X, Y})
            cell[axis] = i64(clamp(from[axis] + way[axis] * begin, 0.0, double(count[axis]) - 1.0));
        u64 all = 0;
        double at = begin;
        while (true) {
            std::array<double, 2> leaves{INF, INF};
            for (int axis : {X, Y})
                if (way[axis] != 0.0)
                    leaves[axis] =
                        (double(cell[axis] + (way[axis] > 0.0)) - from[axis]) / way[axis];
            int axis = leaves[0] <= leaves[1] ? X : Y;
            double until = max(at, min(leaves[axis], end));
            u64 mask = lattice.cells(cell[1], cell[0]);
            all |= mask;
            for (u64 rest = mask; rest; rest &= rest - 1) {
                Range& span = spans_[std::size_t(std::countr_zero(rest))];
                span.low = min(span.low, at), span.high = max(span.high, until);
            }
            cell[axis] += way[axis] > 0.0 ? 1 : -1;
            if (until >= end || cell[axis] < 0 || cell[axis] >= count[axis]) break;
            at = until;
        }
        return all != 0;
    }

    // Begin with the part of the ray that may meet each field.
    void start_streams() {
        const Ray& ray = *ray_;
        for (auto& stream : streams_) {
            double begin = 0.0, end = end_;
            if (stream->rules.sheet) {
                Range span = spans_[min(stream->sheet, std::size_t(63))];
                Range height = heights_[stream->sheet];
                double more = 1e-9 * (extent_ + abs(ray.z)) + 2.0 * width_;
                begin = max(0.0, span.low - more), end = min(end_, span.high + more);
                if (ray.dz != 0.0) {
                    double one = (height.low - more - ray.z) / ray.dz;
                    double other = (height.high + more - ray.z) / ray.dz;
                    begin = max(begin, min(one, other)), end = min(end, max(one, other));
                } else if (ray.z < height.low - more || ray.z > height.high + more) {
                    end = -INF;
                }
            } else if (stream == streams_[0]) {
                continue;
            }
            stream->start(ray, begin, end);
        }
    }

    // What was met in a field.
    Candidate candidate(const Stream& stream) const {
        const auto& [sheet, is_face, low, high, bare] = stream.rules;
        const Hit& hit = stream.hit;
        Candidate made{hit, UNKNOWN, -1, is_face, !sheet && low && high};
        if (hit.top < 0 && sheet) return made;
        if (is_face) {
            i32 storey = sheet->faced[hit.top];
            if (storey < 0) return made;
            made.element = all_.storeys.table.numbers[storey];
            made.surface = all_.storeys.table.surface[storey];
            return made;
        }
        i64 track = hit.top - count_of(stream.index.field.elements);
        made.element = track >= 0 ? columns_.first_track() + track
            : sheet               ? sheet->numbers[hit.top]
                                  : hit.top;
        made.surface = surface_of(stream.index, hit);
        if (sheet && made.surface == sheet->bare) made.surface = -1;
        return made;
    }

    // What is at a distance.
    Matter matter(double r) {
        double z = z_at(r);
        const auto& solids = columns_.at(x_at(r), y_at(r));
        double ground = columns_.ground().z;
        for (const Solid& solid : solids) {
            if (!(solid.bottom.z <= z && z <= solid.top.z)) continue;
            return solid.top.element < FIRST_STOREY || z <= ground ? GROUND : SOLID;
        }
        return isnan(ground) ? OVER_VOID : AIR;
    }

    // From boundary to boundary that may be, until one is.
    Hit cast_slanted(i32& surface) {
        const Ray& ray = *ray_;
        In bounds = all_.ground.field.bounds;
        double enters = 0.0;
        for (int axis : {X, Y}) {
            double from = axis == X ? ray.x : ray.y, way = axis == X ? ray.dx : ray.dy;
            if (way == 0.0) continue;
            double one = (bounds[axis] - from) / way, other = (bounds[2 + axis] - from) / way;
            enters = max(enters, min(one, other)), end_ = min(end_, max(one, other));
        }
        double scale = abs(ray.x) + abs(ray.y) + abs(ray.z) + min(end_, 1e12);
        width_ = 1e-8 * extent_ + 1e-11 * scale;
        const double step = 1e-3 * width_;
        start_streams();
        // boundaries that no field has: where the relief or the rut of a top ends at another top
        const Field& field = all_.ground.field;
        const bool leaps = has_reliefs(field) || has_tracks(field);
        double last = enters;  // what is there is known
        bool is_known = leaps && !begins_on_boundary();
        Matter known = is_known ? matter(enters) : AIR;
        while (true) {
            double nearest = end_;
            bool some = false;
            for (auto& stream : streams_) {
                stream->look(nearest);
                if (stream->found <= nearest) nearest = stream->found, some = true;
            }
            if (!some) {
                bool differs = is_known && leaps && is_boundary(known, matter(end_));
                return differs ? halve(last, end_, known, surface) : Hit{};
            }
            collect(nearest + width_, step);
            const Candidate& first = near_.front();
            if (near_.size() == 1 && first.is_plain
                && !columns_.has_storeys(first.hit.x, first.hit.y)) {
                surface = first.surface;
                return first.hit;
            }
            if (first.hit.distance == 0.0 && begins_on_boundary()) return chosen(1, 0.0, surface);
            double before = max(nearest - 0.5 * width_, 0.5 * (last + nearest));
            Matter from = matter(before);
            if (is_known && is_boundary(known, from)) {
                Hit hit = halve(last, before, known, surface);
                if (hit.distance < INF) return hit;
            }
            for (std::size_t n = 0; n < near_.size();) {
                std::size_t count = 1;
                double at = near_[n].hit.distance;
                auto distance = [&](std::size_t k) { return near_[k].hit.distance; };
                while (n + count < near_.size() && distance(n + count) - at <= step)
                    at = distance(n + count++);
                double next = n + count < near_.size() ? distance(n + count) : at + width_;
                last = min(0.5 * (at + next), end_);
                Matter to = matter(last);
                if (is_boundary(from, to)) {
                    std::rotate(near_.begin(), near_.begin() + std::ptrdiff_t(n), near_.end());
                    return chosen(count, is_solid(to) ? last : before, surface);
                }
                from = known = to, is_known = true, before = last;
                n += count;
            }
        }
    }

    // Put all that is met up to a distance in order.
    void collect(double to, double step) {
        near_.clear();
        to = min(to, end_);
        for (auto& stream : streams_)
            for (stream->look(to); stream->found <= to; stream->look(to)) {
                near_.push_back(candidate(*stream));
                stream->pass(step);
            }
        std::stable_sort(near_.begin(), near_.end(), [](const Candidate& a, const Candidate& b) {
            return a.hit.distance < b.hit.distance;
        });
    }

    // Whether the ray begins on a face of its column.
    bool begins_on_boundary() {
        double close = 1e-12 * (abs(ray_->z) + extent_);
        for (const Solid& solid : columns_.at(ray_->x, ray_->y))
            for (double z : {solid.bottom.z, solid.top.z})
                if (abs(z - ray_->z) <= close) return true;
        return false;
    }

    // Of the first candidates, which lie at one place, the hit. `inside` is a place in what is
    // solid there.
    Hit chosen(std::size_t count, double inside, i32& surface) {
        Candidate* made = &near_[0];
        Hit hit = made->hit;
        const Face* named = nullptr;
        bool own = count == 1 && made->element != UNKNOWN;
        const Candidate& ground = *made;
        if (hit.wall && !own) {
            double z = z_at(inside);
            for (const Solid& solid : columns_.at(x_at(inside), y_at(inside)))
                if (solid.bottom.z <= z && z <= solid.top.z) named = &solid.top;
        } else if (!own) {
            double off = INF;
            for (const Solid& solid : columns_.at(hit.x, hit.y)) {
                const Face& face = made->is_face ? solid.bottom : solid.top;
                if (abs(face.z - hit.z) < off) off = abs(face.z - hit.z), named = &face;
            }
            // the normal is that of the face that has the name
            for (std::size_t n = 0; named && n < count; ++n)
                if (near_[n].element == named->element && near_[n].is_face == made->is_face)
                    hit = near_[n].hit;
        }
        surface = named ? named->surface : ground.surface;
        hit.top = named ? named->element : ground.element;
        return hit;
    }

    // Look for the boundary between two places by halving.
    Hit halve(double from, double to, Matter known, i32& surface) {
        double begin = from, end = to;
        Matter before = known, behind = matter(to);
        while (true) {
            double middle = 0.5 * (begin + end);
            if (middle <= begin || middle >= end) break;
            Matter there = matter(middle);
            if (is_solid(there) == is_solid(before)) begin = middle, before = there;
            else end = middle, behind = there;
        }
        Hit hit;
        if (!is_boundary(before, behind)) return hit;
        hit.distance = end;
        UV at{x_at(end), y_at(end)};
        double z = z_at(end), close = 1e-6 * width_ + 1e-12 * abs(z);
        double inside = is_solid(behind) ? end : begin;
        const auto solids = columns_.at(x_at(inside), y_at(inside));
        const Solid* own = nullptr;
        for (const Solid& solid : solids)
            if (solid.bottom.z - close <= z && z <= solid.top.z + close) own = &solid;
        if (!own) return {};
        if (abs(own->top.z - z) <= close) put_face(hit, own->top, true, at, surface);
        else if (abs(own->bottom.z - z) <= close) put_face(hit, own->bottom, false, at, surface);
        else {
            hit.x = at.u, hit.y = at.v, hit.z = z;
            hit.top = own->top.element, surface = own->top.surface, hit.wall = true;
            double flat = sqrt(square(ray_->dx) + square(ray_->dy));
            hit.normal[0] = -ray_->dx / flat + 0.0, hit.normal[1] = -ray_->dy / flat + 0.0;
            hit.normal[2] = 0.0;
        }
        return hit;
    }
};

inline i64 cast_storeys(const StoreyIndex& index, const Rays& rays, const RayHits& out) {
    StoreyCaster caster(index);
    return cast_all(rays, out, [&](const Ray& ray, double most, i32& surface) {
        return caster.cast(ray, most, surface);
    });
}

}  // namespace terratool::rays
