// Columns: what stands over a point, as intervals of heights, from the ground and from storeys.
//
// Storeys are decks, which stand over other ground, and bores, which are cut through it. They lie
// in sheets: plain fields of storeys that share no point, with the elements in whose cells these
// are, which are void there. A sheet has the tops of its storeys, and in another field their other
// faces: the undersides of decks, the ceilings of bores.
#pragma once

#include <algorithm>
#include <bit>
#include <functional>

#include "query.hpp"

namespace terratool {

// Numbers of elements of storeys begin here, as in Python.
constexpr i64 FIRST_STOREY = i64(3) << 61;

// Storeys that share no point. Numbers of storeys are -1 for elements that belong to none.
struct Sheet {
    const Field* tops;
    const Field* faces;
    Span<const i32> storeys;  // of each element of `tops`
    Span<const i64> numbers;  // of each element of `tops`, among all of the terrain
    Span<const i32> faced;    // storey of each element of `faces`
    bool is_bore;
    i64 bare;     // index of the surface of what has none
    double most;  // no top is higher

    // The terrain's index of a surface of a top; -1 for none.
    INLINE i32 surface_of(i64 worn) const { return worn == bare ? -1 : i32(worn); }
    // The other face of a storey whose own element has a height, by the gap between both.
    INLINE double beyond(double own, double gap) const { return is_bore ? own + gap : own - gap; }
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
    // Of each cell the height that decks of one level have all over it; NaN where they may not.
    Matrix<const double> levels;
};

template <class Visit> void visit_arguments(StoreyLattice& l, Visit visit) {
    visit("frame[4]", l.frame), visit("cells[r,c]", l.cells), visit("levels[r,c]", l.levels);
}

struct Storeys {
    std::vector<Sheet> sheets;  // in the order in which columns take them
    StoreyTable table;
    StoreyLattice lattice;

    // Row and column of the lattice; -1 beyond it.
    INLINE i64 row_near(double y) const { return cell_at(y, 1, lattice.cells.rows()); }
    INLINE i64 column_near(double x) const { return cell_at(x, 0, lattice.cells.columns()); }

    // The bits of the sheets that may have a storey at a point.
    INLINE u64 near(double x, double y) const {
        i64 i = column_near(x), j = row_near(y);
        return i < 0 || j < 0 ? 0 : lattice.cells(j, i);
    }

private:
    INLINE i64 cell_at(double at, int axis, i64 count) const {
        double u = (at - lattice.frame[axis]) * lattice.frame[2 + axis];
        return 0.0 <= u && u < double(count) ? i64(u) : -1;
    }
};

// The bit of a sheet; all further ones share the last.
INLINE u64 bit_of(i64 sheet) { return u64(1) << min(sheet, i64(63)); }

// Call visit(number of the sheet) for the sheets of some bits, in their order.
template <class Visit> INLINE void visit_sheets(const Storeys& storeys, u64 near, Visit visit) {
    constexpr i64 last = 63;
    for (; near; near &= near - 1) {
        i64 k = std::countr_zero(near);
        visit(k);
        if (k == last)
            for (i64 further = k + 1; further < count_of(storeys.sheets); ++further) visit(further);
    }
}

// Whether storeys may be at points.
inline void near_storeys(const Storeys& storeys, In x, In y, Span<bool> out) {
    for (std::size_t n = 0; n < x.size(); ++n) out[n] = storeys.near(x[n], y[n]) != 0;
}

// The top or the bottom of what is solid: its height, and what decides it. Slopes are those of a
// top.
struct Face {
    double z;
    i64 element = NO_ELEMENT;
    i32 surface = -1;
    i32 storey = -1;  // that it belongs to; -1 for the ground
    double slope_x = 0.0, slope_y = 0.0;
};

// The same where heights are all that is wanted.
struct FaceHeight {
    double z;
};

template <class F> struct SolidOf {
    F bottom, top;
};
using Solid = SolidOf<Face>;

// The column at a point: what is solid, from below; the ground begins at -INF.
template <class F> class SolidColumn {
public:
    std::vector<SolidOf<F>> solids;

    void begin(const F& ground) {
        solids.clear();
        if (isnan(ground.z)) return;
        SolidOf<F>& first = solids.emplace_back();
        first.bottom.z = -INF, first.top = ground;
    }

    // A deck: what it touches becomes one with it; of equal ends the deck's count.
    void add(const F& bottom, const F& top) {
        if (!(top.z > bottom.z)) return;
        if (solids.empty() || solids.back().top.z < bottom.z) {  // mostly it is over all else
            solids.push_back({bottom, top});
            return;
        }
        auto first = solids.begin();
        while (first->top.z < bottom.z) ++first;
        auto last = first;
        SolidOf<F> deck{bottom, top};
        for (; last != solids.end() && last->bottom.z <= deck.top.z; ++last) {
            if (last->bottom.z < deck.bottom.z) deck.bottom = last->bottom;
            if (last->top.z > deck.top.z) deck.top = last->top;
        }
        solids.insert(solids.erase(first, last), deck);
    }

    // A bore: what is above its floor and not above its ceiling goes.
    void take(const F& floor, const F& ceiling) {
        if (!(ceiling.z > floor.z)) return;
        kept_.clear();
        for (const SolidOf<F>& one : solids) {
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
    std::vector<SolidOf<F>> kept_;
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

// What a descent, or a painted pixel, finds of the tops of a sheet.
struct SheetTop {
    double z;
    i64 top;  // the element that decides the surface
    Worn worn;
    double slope_x, slope_y;
};

// Maker of columns; each thread needs its own.
template <class F> class ColumnMaker {
public:
    static constexpr bool sloped = std::is_same_v<F, Face>;
    using Column = SolidColumn<F>;

    explicit ColumnMaker(const Storeys& storeys) : storeys_(storeys) {
        i64 most = 1;
        for (const Sheet& sheet : storeys.sheets)
            most = max(most, max(sheet.tops->pending, sheet.faces->pending));
        stack_.resize(most);
    }

    // Put the storeys at a point into a column that has the ground; `near` are the bits there.
    void put_storeys(Column& column, double x, double y, u64 near) {
        visit_sheets(storeys_, near, [&](i64 k) { put_sheet(column, storeys_.sheets[k], x, y); });
    }

    // Put the storey of a sheet at a point into a column, if there is one.
    void put_sheet(Column& column, const Sheet& sheet, double x, double y) {
        if (!is_inside(sheet.tops->bounds, x, y)) return;
        Found found = found_at<sloped>(*sheet.tops, x, y, stack_);
        if (found.top < 0 || sheet.storeys[found.top] < 0) return;
        Worn worn = worn_of(*sheet.tops, found);
        put_top(column, sheet, x, y, {found.z, found.top, worn, found.slope_x, found.slope_y});
    }

    // Put the storey whose top was found at a point; its element belongs to a storey.
    void put_top(Column& column, const Sheet& sheet, double x, double y, const SheetTop& found) {
        const StoreyTable& table = storeys_.table;
        i32 storey = sheet.storeys[found.top];
        double gap = table.gaps[storey], own = found.z;
        // where the storey's own element is the top one, no other is added to it
        if (isnan(gap) || sheet.numbers[found.top] != table.numbers[storey]) {
            Found face = found_at<false>(*sheet.faces, x, y, stack_);
            if (face.top < 0 || sheet.faced[face.top] != storey) return;  // beside its footprint
            own = face.z;
        }
        if (isnan(own)) return;
        double other = isnan(gap) ? own : sheet.beyond(own, gap);
        bool is_void = found.worn.is_void || isnan(found.z);
        F top{is_void ? -INF : found.z}, face{other};
        if constexpr (sloped) {
            i32 surface = sheet.surface_of(found.worn.surface);
            top = {top.z, sheet.numbers[found.top], surface, storey, found.slope_x, found.slope_y};
            face = {other, table.numbers[storey], table.surface[storey], storey};
        }
        if (sheet.is_bore) column.take(top, face);
        else if (!is_void) column.add(face, top);
    }

    // Let tracks and reliefs change the tops of a column, as they do on plain ground. An element
    // becomes `first_track` and the number of the track that decides the surface.
    void settle(Column& column, const Field& field, double x, double y, i64 first_track) {
        i64 cell = has_tracks(field) ? cell_near(field.tracks, x, y) : -1;
        if (cell < 0 && !has_reliefs(field)) return;
        auto& solids = column.solids;
        if (cell >= 0) before_ = solids;
        for (i64 k = 0; k < count_of(solids); ++k) {
            Face& top = solids[k].top;
            if (cell >= 0) {
                auto chosen = [&](const Segment& segment) {
                    return top_under(before_, height_of_path(segment, x, y)) == k;
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

private:
    const Storeys& storeys_;
    Stack stack_;
    std::vector<SolidOf<F>> before_;
};

// Columns at points, by their ground. `field` has the tracks and the reliefs.
inline void columns(
    const Storeys& storeys, const Field& field, In x, In y, const ColumnGround& ground,
    i64 first_track, const ColumnRows& out
) {
    ColumnMaker<Face> maker(storeys);
    SolidColumn<Face> column;
    auto& solids = column.solids;
    for (std::size_t n = 0; n < x.size(); ++n) {
        column.begin(
            {ground.height[n], ground.element[n], ground.surface[n], -1, ground.gradient(n, 0),
             ground.gradient(n, 1)}
        );
        maker.put_storeys(column, x[n], y[n], storeys.near(x[n], y[n]));
        maker.settle(column, field, x[n], y[n], first_track);
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

// Heights of points in place of those of the bare ground, in batches.
class TopHeights {
public:
    explicit TopHeights(const Storeys& storeys)
        : storeys_(storeys), maker_(storeys), columns_(BATCH), scratch_(*storeys.sheets[0].tops) {
        for (i64 k = 0; k < count_of(storeys.sheets); ++k) highest_first_.push_back(k);
        std::ranges::stable_sort(highest_first_, std::greater{}, [&](i64 k) {
            return storeys.sheets[k].most;
        });
        for (const Sheet& sheet : storeys.sheets) {
            batched_.push_back(PointBatch<false>::is_possible(*sheet.tops));
            if (count_of(scratch_.stack) < sheet.tops->pending)
                scratch_.stack.resize(sheet.tops->pending);
        }
    }

    // Put the highest top, or the highest not above `below`, in place of the height of the ground
    // where storeys may be. The ground has neither ruts nor relief.
    void put(In x, In y, In below, Out height) {
        std::size_t n = 0;
        while (n < x.size()) {
            std::size_t count = 0;
            u64 all = 0;
            for (; n < x.size() && count < BATCH; ++n) {
                i64 i = storeys_.column_near(x[n]), j = storeys_.row_near(y[n]);
                u64 near = i < 0 || j < 0 ? 0 : storeys_.lattice.cells(j, i);
                if (near && below.empty()) {
                    double level = storeys_.lattice.levels(j, i);
                    if (!isnan(level)) {
                        if (!(height[n] > level)) height[n] = level;
                        continue;
                    }
                }
                if (near) points_[count] = n, near_[count++] = near, all |= near;
                else if (!below.empty() && !(height[n] <= below[n])) height[n] = NaN;
            }
            bool highest = below.empty();  // of decks alone: no intervals are needed
            visit_sheets(storeys_, all, [&](i64 k) { highest &= !storeys_.sheets[k].is_bore; });
            if (highest) {
                for (i64 k : highest_first_) {
                    const Sheet& sheet = storeys_.sheets[k];
                    if (!(all & bit_of(k))) continue;
                    auto counts = [&](std::size_t at) {
                        return !(height[points_[at]] >= sheet.most);
                    };
                    ask(k, x, y, count, counts, [&](std::size_t at, i64 top, double z) {
                        put_highest(sheet, at, top, z, x, y, height);
                    });
                }
                continue;
            }
            for (std::size_t at = 0; at < count; ++at) columns_[at].begin({height[points_[at]]});
            visit_sheets(storeys_, all, [&](i64 k) {
                auto all_count = [](std::size_t) { return true; };
                ask(k, x, y, count, all_count, [&](std::size_t at, i64 top, double z) {
                    put(columns_[at], storeys_.sheets[k], x[points_[at]], y[points_[at]], top, z);
                });
            });
            for (std::size_t at = 0; at < count; ++at) {
                const auto& solids = columns_[at].solids;
                std::size_t point = points_[at];
                i64 k = count_of(solids) - 1;
                while (k >= 0 && !below.empty() && !(solids[k].top.z <= below[point])) --k;
                height[point] = k < 0 ? NaN : solids[k].top.z;
            }
        }
    }

private:
    const Storeys& storeys_;
    ColumnMaker<FaceHeight> maker_;
    std::vector<SolidColumn<FaceHeight>> columns_;
    std::vector<bool> batched_;
    std::vector<i64> highest_first_;  // sheets
    Scratch scratch_;
    std::array<std::size_t, BATCH> points_, some_;
    std::array<u64, BATCH> near_;
    std::array<double, BATCH> x_, y_, z_;

    // Call found(which point, top element or less than 0, height) for the points of a sheet that
    // count; where there is no element, or no height, that is left to a descent.
    template <class Counts, class Found>
    void ask(i64 k, In x, In y, std::size_t points, Counts counts, Found found) {
        const Sheet& sheet = storeys_.sheets[k];
        std::size_t count = 0;
        for (std::size_t at = 0; at < points; ++at) {
            if (!(near_[at] & bit_of(k)) || !counts(at)) continue;
            some_[count] = at, x_[count] = x[points_[at]], y_[count++] = y[points_[at]];
        }
        In xs(x_.data(), count), ys(y_.data(), count);
        if (batched_[k]) batch_heights(*sheet.tops, xs, ys, scratch_, Out{z_.data(), count});
        for (std::size_t n = 0; n < count; ++n) {
            i64 top = batched_[k] ? scratch_.top[n] : COMPLETE;
            if (top < 0 || sheet.storeys[top] >= 0) found(some_[n], top, z_[n]);
        }
    }

    void put(
        SolidColumn<FaceHeight>& column, const Sheet& sheet, double x, double y, i64 top, double z
    ) {
        if (top < 0 || isnan(z)) maker_.put_sheet(column, sheet, x, y);
        else maker_.put_top(column, sheet, x, y, {z, top, {-1, false}, 0.0, 0.0});
    }

    // Put the top of a deck in place of a height, if it is higher.
    void put_highest(
        const Sheet& sheet, std::size_t at, i64 top, double z, In x, In y, Out height
    ) {
        std::size_t point = points_[at];
        const StoreyTable& table = storeys_.table;
        i32 storey = top < 0 ? -1 : sheet.storeys[top];
        bool plain = storey >= 0 && !isnan(z) && !isnan(table.gaps[storey])
            && sheet.numbers[top] == table.numbers[storey];
        if (!plain) {
            columns_[0].begin({NaN});
            put(columns_[0], sheet, x[point], y[point], top, z);
            if (columns_[0].solids.empty()) return;
            z = columns_[0].solids[0].top.z;
        }
        if (!(height[point] > z)) height[point] = z;
    }
};

inline void top_heights(const Storeys& storeys, In x, In y, In below, Out height) {
    TopHeights(storeys).put(x, y, below, height);
}

}  // namespace terratool
