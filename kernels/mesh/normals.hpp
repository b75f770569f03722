// Normals at the corners of faces: one for all faces around a vertex that no crease parts.
#pragma once

#include <tuple>

#include "../core.hpp"

namespace terratool::mesh {

using Vector = std::array<double, 3>;

INLINE double length(const Vector& v) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

// Different directions, in the order of their first use.
class DirectionTable {
public:
    // The number of a vector's direction, to three decimals; of one without a length straight up.
    i32 index_of(const Vector& vector) {
        double size = length(vector);
        std::array<i64, 3> parts{0, 0, PER_UNIT};
        u64 key = 0;
        for (int k = 0; k < 3; ++k) {
            if (size > 0.0 && size < INF)
                parts[k] = i64(floor(vector[k] / size * double(PER_UNIT) + 0.5));
            key = key << 16 | u64(parts[k] + PER_UNIT);
        }
        if (2 * directions_.size() >= slots_.size()) grow();
        Slot& slot = find(key);
        if (slot.key == FREE) {
            slot = {key, i32(directions_.size())};
            auto part = [&](int k) { return float(double(parts[k]) / double(PER_UNIT)); };
            directions_.push_back({part(0), part(1), part(2)});
        }
        return slot.index;
    }

    Rows<float, 3> take() { return std::move(directions_); }

private:
    struct Slot {
        u64 key;
        i32 index;
    };
    static constexpr i64 PER_UNIT = 1'000;
    static constexpr u64 FREE = ~u64(0);

    Rows<float, 3> directions_;
    std::vector<Slot> slots_ = std::vector<Slot>(1 << 10, {FREE, 0});

    Slot& find(u64 key) {
        for (u64 at = hash64(key);; ++at) {
            Slot& slot = slots_[at & (slots_.size() - 1)];
            if (slot.key == key || slot.key == FREE) return slot;
        }
    }
    void grow() {
        std::vector<Slot> old(2 * slots_.size(), {FREE, 0});
        old.swap(slots_);
        for (const Slot& slot : old)
            if (slot.key != FREE) find(slot.key) = slot;
    }
};

// The faces around a vertex, in groups that no crease parts.
class FacesAround {
public:
    explicit FacesAround(double error) : error_(error) {}

    void clear() { faces_.clear(), edges_.clear(); }

    // A face from the vertex to others, `a` and `b`; walls stay by themselves.
    void add(i64 corner, i32 a, i32 b, const Vector& to_a, const Vector& to_b, bool wall) {
        Face face{corner, i32(faces_.size()), {}, {}};
        for (int k = 0; k < 3; ++k) {
            int i = (k + 1) % 3, j = (k + 2) % 3;
            face.area[k] = to_a[i] * to_b[j] - to_a[j] * to_b[i];
        }
        double size = length(face.area), inverse = size > 0.0 ? 1.0 / size : 0.0;
        for (int k = 0; k < 3; ++k) face.normal[k] = face.area[k] * inverse;
        if (!wall && size > 0.0) {
            edges_.push_back({a, face.group, size / length(to_a)});
            edges_.push_back({b, face.group, size / length(to_b)});
        }
        faces_.push_back(face);
    }

    // visit(corner, sum of the areas of its group) for each face.
    template <class Visit> void visit_groups(Visit visit) {
        std::sort(edges_.begin(), edges_.end(), [](const Edge& a, const Edge& b) {
            return std::pair(a.end, a.face) < std::pair(b.end, b.face);
        });
        for (i64 n = 1; n < count_of(edges_); ++n) {
            const Edge &a = edges_[n - 1], &b = edges_[n];
            if (a.end == b.end && !is_crease(a, b)) join(a.face, b.face);
        }
        // the first of a group stands for it
        for (i32 n = 0; n < i32(faces_.size()); ++n) {
            i32 first = first_of(n);
            for (int k = 0; n != first && k < 3; ++k) faces_[first].area[k] += faces_[n].area[k];
        }
        for (i32 n = 0; n < i32(faces_.size()); ++n)
            visit(faces_[n].corner, faces_[first_of(n)].area);
    }

private:
    struct Face {
        i64 corner;
        i32 group;  // a face before it in its group, or itself
        Vector area, normal;
    };
    struct Edge {
        i32 end, face;
        double height;  // of the face over the edge
    };
    double error_;
    std::vector<Face> faces_;
    std::vector<Edge> edges_;

    // Whether no smooth surface that both faces show within the error runs across their edge.
    //
    // If it turns evenly by an angle θ from the middle of one face to that of the other, it lies
    // θ/8 of a face's height above that face.
    bool is_crease(const Edge& a, const Edge& b) const {
        constexpr double most = 0.7653668647301796;  // chord of 45°
        const Vector &m = faces_[a.face].normal, &n = faces_[b.face].normal;
        double turn = length({m[0] - n[0], m[1] - n[1], m[2] - n[2]});
        return turn > most || turn * max(a.height, b.height) > 8.0 * error_;
    }

    i32 first_of(i32 face) const {
        while (faces_[face].group != face) face = faces_[face].group;
        return face;
    }
    void join(i32 a, i32 b) {
        a = first_of(a), b = first_of(b);
        faces_[max(a, b)].group = min(a, b);
    }
};

// Different normals, and the number of that at each corner of faces.
//
// `error` says how far the faces may be from what they show.
inline std::tuple<Rows<float, 3>, Rows<i32, 3>> corner_normals(
    Matrix<const double> points, Matrix<const i32> faces, Span<const bool> walls, double error
) {
    std::vector<i64> offsets(points.rows() + 1), corners(faces.size());
    auto visit = [&](auto put) {
        for (i64 n = 0; n < faces.size(); ++n) put(faces.flat()[n], n);
    };
    index_bins(Span<i64>(offsets), i64(0), visit);
    fill_bins(Span<i64>(offsets), Span<i64>(corners), visit);
    Rows<i32, 3> indices(faces.rows());
    DirectionTable table;
    FacesAround around(error);
    for (i32 p = 0; p < points.rows(); ++p) {
        auto way_to = [&](i32 other) {
            return Vector{
                points(other, 0) - points(p, 0), points(other, 1) - points(p, 1),
                points(other, 2) - points(p, 2)
            };
        };
        around.clear();
        for (i64 n = offsets[p]; n < offsets[p + 1]; ++n) {
            i64 face = corners[n] / 3, c = corners[n] % 3;
            i32 a = faces(face, (c + 1) % 3), b = faces(face, (c + 2) % 3);
            around.add(corners[n], a, b, way_to(a), way_to(b), walls[face]);
        }
        around.visit_groups([&](i64 corner, const Vector& area) {
            indices[corner / 3][corner % 3] = table.index_of(area);
        });
    }
    return {table.take(), std::move(indices)};
}

}  // namespace terratool::mesh
