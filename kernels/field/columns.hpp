// Columns: what stands over a point, as intervals of heights, from the ground and from storeys.
//
// Storeys are decks, which stand over other ground, and bores, which are cut through it. They lie
// in sheets: plain fields of storeys that share no point, with the elements in whose cells these
// are, which are void there. A sheet has the tops of its storeys, and in another field their other
// faces: the undersides of decks, the ceilings of bores.
#pragma once

#include "query.hpp"

namespace terratool {

// Storeys that share no point. Numbers of storeys are -1 for elements that belong to none.
struct Sheet {
    const Field* tops;
    const Field* faces;
    Span<const i32> storeys;  // of each element of `tops`
    Span<const i64> numbers;  // of each element of `tops`, among all of the terrain
    Span<const i32> faced;    // storey of each element of `faces`
    i64 bare;                 // surface in `tops` that stands for none
    bool is_bore;
};

// Decks and bores by their numbers.
struct StoreyTable {
    In gaps;                  // between the faces of each; NaN where a primitive gives the other
    Span<const i64> numbers;  // of its own element, among all of the terrain
    Span<const i32> surface;  // that its other face wears; -1 for none
};

template <class Visit> void visit_arguments(StoreyTable& t, Visit visit) {
    visit("gaps[s]", t.gaps), visit("numbers[s]", t.numbers), visit("surface[s]", t.surface);
}

// An even lattice over storeys; each cell has a bit for each sheet that may have one there. The
// last bit stands for all further sheets.
struct StoreyLattice {
    In frame;  // west, south, and cells per unit along x and y
    Matrix<const u64> cells;
};

template <class Visit> void visit_arguments(StoreyLattice& l, Visit visit) {
    visit("frame[4]", l.frame), visit("cells[_,_]", l.cells);
}

struct Storeys {
    std::vector<Sheet> sheets;  // in the order in which columns take them
    StoreyTable table;
    StoreyLattice lattice;

    // The bits of the sheets that may have a storey at a point.
    INLINE u64 near(double x, double y) const {
        double u = (x - lattice.frame[0]) * lattice.frame[2];
        double v = (y - lattice.frame[1]) * lattice.frame[3];
        bool within = 0.0 <= u && u < double(lattice.cells.columns()) && 0.0 <= v
            && v < double(lattice.cells.rows());
        return within ? lattice.cells(i64(v), i64(u)) : 0;
    }
};

// Whether storeys may be at points.
inline void near_storeys(const Storeys& storeys, In x, In y, Span<bool> out) {
    for (std::size_t n = 0; n < x.size(); ++n) out[n] = storeys.near(x[n], y[n]) != 0;
}

// The top or the bottom of what is solid: its height, and what decides it. Slopes are those of a
// top.
struct Face {
    double z;
    i64 element;
    i32 surface;
    double slope_x = 0.0, slope_y = 0.0;
};

struct Solid {
    Face bottom, top;
};

// The column at a point: what is solid, from below; the ground begins at -INF.
class Column {
public:
    std::vector<Solid> solids;

    void begin(const Face& ground) {
        solids.clear();
        if (!isnan(ground.z)) solids.push_back({{-INF, NO_ELEMENT, -1}, ground});
    }

    // A deck: what it touches becomes one with it; of equal ends the deck's count.
    void add(Solid deck) {
        if (!(deck.top.z > deck.bottom.z)) return;
        auto first = solids.begin();
        while (first != solids.end() && first->top.z < deck.bottom.z) ++first;
        auto last = first;
        for (; last != solids.end() && last->bottom.z <= deck.top.z; ++last) {
            if (last->bottom.z < deck.bottom.z) deck.bottom = last->bottom;
            if (last->top.z > deck.top.z) deck.top = last->top;
        }
        solids.insert(solids.erase(first, last), deck);
    }

    // A bore: what is above its floor and not above its ceiling goes.
    void take(const Face& floor, const Face& ceiling) {
        if (!(ceiling.z > floor.z)) return;
        kept_.clear();
        for (const Solid& one : solids) {
            if (one.top.z <= floor.z || one.bottom.z >= ceiling.z) {
                kept_.push_back(one);
                continue;
            }
            if (one.bottom.z < floor.z) kept_.push_back({one.bottom, floor});
            if (one.top.z > ceiling.z) kept_.push_back({ceiling, one.top});
        }
        std::swap(solids, kept_);
    }

private:
    std::vector<Solid> kept_;
};

// Which top a point of a path lies on: the nearest to z, of equally near ones the lower. A path
// without heights lies on the interval from below all.
INLINE i64 top_under(const std::vector<Solid>& solids, double z) {
    if (isnan(z)) return !solids.empty() && solids[0].bottom.z == -INF ? 0 : -1;
    i64 nearest = -1;
    for (i64 k = 0; k < count_of(solids); ++k)
        if (nearest < 0 || abs(solids[k].top.z - z) < abs(solids[nearest].top.z - z)) nearest = k;
    return nearest;
}

// What columns begin with: the ground without ruts and relief.
struct ColumnGround {
    In height;
    Span<const i64> element;
    Span<const i32> surface;
    Matrix<const double> gradient;
};

template <class Visit> void visit_arguments(ColumnGround& g, Visit visit) {
    visit("height[n]", g.height), visit("element[n]", g.element), visit("surface[n]", g.surface);
    visit("gradient[n,2]", g.gradient);
}

// Columns at points, so many intervals each at most; what is left of a row stays as it was.
struct ColumnRows {
    Span<i32> held;
    Matrix<double> bottom, top, slope_x, slope_y;
    Matrix<i32> surface;
    Matrix<i64> element, under;
};

template <class Visit> void visit_arguments(ColumnRows& c, Visit visit) {
    visit("held[n]", c.held), visit("bottom[n,m]", c.bottom), visit("top[n,m]", c.top);
    visit("slope_x[n,m]", c.slope_x), visit("slope_y[n,m]", c.slope_y);
    visit("surface[n,m]", c.surface), visit("element[n,m]", c.element);
    visit("under[n,m]", c.under);
}

// Maker of columns; each thread needs its own.
class ColumnMaker {
public:
    Column column;

    explicit ColumnMaker(const Storeys& storeys) : storeys_(storeys) {
        i64 most = 1;
        for (const Sheet& sheet : storeys.sheets)
            most = max(most, max(sheet.tops->pending, sheet.faces->pending));
        stack_.resize(most);
    }

    // Put the storeys at a point into a column that has the ground.
    void put_storeys(double x, double y) {
        u64 near = storeys_.near(x, y);
        constexpr i64 last = 63;
        i64 count = count_of(storeys_.sheets);
        for (i64 k = 0; near && k < count; ++k)
            if (near >> min(k, last) & 1) put_sheet(storeys_.sheets[k], x, y);
    }

private:
    const Storeys& storeys_;
    Stack stack_;

    void put_sheet(const Sheet& sheet, double x, double y) {
        const StoreyTable& table = storeys_.table;
        if (!is_inside(sheet.tops->bounds, x, y)) return;
        Found found = descend<true>(*sheet.tops, x, y, stack_);
        i32 storey = found.top < 0 ? -1 : sheet.storeys[found.top];
        if (storey < 0) return;
        i64 element = sheet.numbers[found.top];
        double gap = table.gaps[storey], own = found.z;
        // where the storey's own element is the top one, no other is added to it
        if (isnan(gap) || element != table.numbers[storey]) {
            Found face = descend<false>(*sheet.faces, x, y, stack_);
            if (face.top < 0 || sheet.faced[face.top] != storey) return;  // beside its footprint
            own = face.z;
        }
        if (isnan(own)) return;
        double other = isnan(gap) ? own : sheet.is_bore ? own + gap : own - gap;
        Worn worn = worn_of(*sheet.tops, found);
        bool is_void = worn.is_void || isnan(found.z);
        i32 surface = worn.surface == sheet.bare ? -1 : i32(worn.surface);
        Face top{is_void ? -INF : found.z, element, surface, found.slope_x, found.slope_y};
        Face face{other, table.numbers[storey], table.surface[storey]};
        if (sheet.is_bore) column.take(top, face);
        else if (!is_void) column.add({face, top});
    }
};

// Let tracks and reliefs change the tops of a column, as they do on plain ground. An element
// becomes `first_track` and the number of the track that decides the surface.
inline void settle_column(
    const Field& field, double x, double y, i64 first_track, std::vector<Solid>& solids
) {
    i64 cell = has_tracks(field) ? cell_near(field.tracks, x, y) : -1;
    std::vector<Solid> before;
    if (cell >= 0) before = solids;
    for (i64 k = 0; k < count_of(solids); ++k) {
        Face& top = solids[k].top;
        if (cell >= 0) {
            auto chosen = [&](const Segment& segment) {
                return top_under(before, height_of_path(segment, x, y)) == k;
            };
            Rut rut = chosen_rut_in(field.tracks, cell, x, y, top.surface, chosen);
            top.z -= rut.depth;
            if (rut.surface_track >= 0) {
                top.surface = field.tracks.surface[rut.surface_track];
                top.element = first_track + rut.surface_track;
            }
        }
        if (has_reliefs(field)) {
            ReliefPoint relief = relief_at<true>(relief_of(field, top.surface), x, y);
            top.z += relief.z, top.slope_x += relief.slope_x, top.slope_y += relief.slope_y;
        }
    }
}

// Columns at points, by their ground. `field` has the tracks and the reliefs.
inline void columns(
    const Storeys& storeys, const Field& field, In x, In y, const ColumnGround& ground,
    i64 first_track, const ColumnRows& out
) {
    ColumnMaker maker(storeys);
    auto& solids = maker.column.solids;
    for (std::size_t n = 0; n < x.size(); ++n) {
        maker.column.begin(
            {ground.height[n], ground.element[n], ground.surface[n], ground.gradient(n, 0),
             ground.gradient(n, 1)}
        );
        maker.put_storeys(x[n], y[n]);
        settle_column(field, x[n], y[n], first_track, solids);
        out.held[n] = i32(solids.size());
        for (i64 k = 0; k < count_of(solids); ++k) {
            const auto& [bottom, top] = solids[k];
            out.bottom(n, k) = bottom.z, out.under(n, k) = bottom.element;
            out.top(n, k) = top.z, out.element(n, k) = top.element;
            out.surface(n, k) = top.surface;
            out.slope_x(n, k) = top.slope_x, out.slope_y(n, k) = top.slope_y;
        }
    }
}

}  // namespace terratool
