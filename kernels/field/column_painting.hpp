// Pixels under which there may be storeys: each gets the column that a query finds at its centre.
//
// The ground of a tile is painted first, as if there were no storeys, and is right wherever no bit
// of the lattice is set.
#pragma once

#include "columns.hpp"
#include "painting.hpp"

namespace terratool {

// What of the columns of a window only the highest top is shown of.
struct Hidden {
    Span<const i64> within;  // rows and columns that count: first and last one, exclusive, of each
    Out figures;             // pixels with two tops or more, the most tops, the least gap between
                             // two, and its row and column
    Span<u8> seen;           // whether a top of each storey is the highest at a pixel

    bool exists() const { return !figures.empty(); }

    void count(i64 row, i64 column, Span<const Solid> solids) const {
        bool counts =
            within[0] <= row && row < within[1] && within[2] <= column && column < within[3];
        if (!counts || solids.empty()) return;
        if (i32 storey = solids.back().top.storey; storey >= 0) seen[storey] = 1;
        figures[1] = max(figures[1], double(solids.size()));
        if (solids.size() < 2) return;
        figures[0] += 1.0;
        double gap = INF;
        for (std::size_t k = 1; k < solids.size(); ++k)
            gap = min(gap, solids[k].bottom.z - solids[k - 1].top.z);
        double r = double(row), c = double(column);
        bool earlier = r < figures[3] || (r == figures[3] && c < figures[4]);
        if (gap < figures[2] || (gap == figures[2] && earlier))
            figures[2] = gap, figures[3] = r, figures[4] = c;
    }
};

// Bands of columns: ground, clearance over it, number of tops, then top, bottom, top, bottom …
constexpr i64 GROUND_BAND = 0, CLEARANCE_BAND = 1, COUNT_BAND = 2, FIRST_BAND = 3;

// Faces so close to one another, as a share of their height, are left to the descents.
constexpr double DOUBT = 1e-9;

// Canvas for the tops or other faces of sheets: elements in place of surfaces, and each edge may be
// a wall.
class SheetCanvas {
    std::vector<u8> edges_;

public:
    Canvas<u32> canvas;

    SheetCanvas(
        const Storeys& storeys, const Field* const Sheet::* fields, bool slopes, bool labels
    )
        : canvas(*(storeys.sheets[0].*fields), slopes, labels, edges(storeys, fields)) {
        canvas.numbered = true;
        i64 most = 1;
        for (const Sheet& sheet : storeys.sheets) most = max(most, (sheet.*fields)->pending);
        canvas.stack.resize(most);
    }

private:
    Span<const u8> edges(const Storeys& storeys, const Field* const Sheet::* fields) {
        std::size_t most = 0;
        for (const Sheet& sheet : storeys.sheets) most = max(most, (sheet.*fields)->kinds.size());
        edges_.assign(most, 1);
        return edges_;
    }
};

// A pixel over which a storey was met: its ground, and the first and last storey in order.
struct StoreyPixel {
    i64 row, column;  // of the tile, rows from the south
    i64 first, last;  // of what was met
    Face ground;
    bool unsure;  // whether rounding might decide what is over what
};

// What was met over a pixel in a sheet.
struct MetStorey {
    i64 next;
    i32 sheet, storey;
    i32 surface;
    u32 label;
    double top, face, slope_x, slope_y;  // top: -INF where it is void
};

// A pixel, and its column among those of a tile.
struct PixelColumn {
    i64 row, column;  // of the tile, rows from the south
    i64 first, last;  // of its solids
};

// Paints what is above the ground of a tile; each thread needs its own.
//
// The sheets are painted as the ground is, over the cells of the lattice in which they have a bit.
// Where rounding might decide which of two faces is higher, a pixel is left to the descents.
template <class Id> class ColumnPainting {
public:
    // All pixels over which storeys were met in the tile that was painted last.
    std::vector<PixelColumn> pixels;
    std::vector<Solid> solids;

    ColumnPainting(const Field& field, const Storeys& storeys, bool slopes, bool labelled)
        : field_(field), storeys_(storeys), maker_(storeys),
          tops_(storeys, &Sheet::tops, slopes, labelled),
          faces_(storeys, &Sheet::faces, false, false), slots_(true) {
        slots_.fill({0, TILE_WIDTH, 0, TILE_HEIGHT}, -1);
    }

    void clear() {
        for (const StoreyPixel& pixel : found_) slots_(pixel.row, pixel.column) = -1;
        found_.clear(), met_.clear(), pixels.clear(), solids.clear();
    }

    // Look for storeys over a part of a tile whose elements are painted, but neither tracks nor
    // reliefs are. `exact` leaves all to the descents, so that all bits are those of queries;
    // `kept` are columns that somebody looks at, and not at the highest tops alone.
    void find(
        Canvas<Id>& canvas, Span<const bool> voids, In x, In y, double resolution,
        const Rectangle& part, bool exact, bool kept
    ) {
        clear();
        find_runs(x, part);
        exact_ = exact, direct_ = !exact && !kept && !has_tracks(field_) && !has_reliefs(field_);
        for (i64 k = 0; k < count_of(storeys_.sheets); ++k) {
            if (k <= last_bit) list_rectangles(u64(1) << k, y, part);
            for (const NearPixels& one : rectangles_)
                paint_sheet(canvas, voids, k, x, y, resolution, one);
        }
    }

    // Put the highest tops into the part of the tile, after tracks and reliefs.
    void put(Canvas<Id>& canvas, Span<const bool> voids, In x, In y) {
        for (const StoreyPixel& pixel : found_) {
            auto [r, c] = std::pair(pixel.row, pixel.column);
            u32 label = put_column(canvas, voids, pixel, x[c], y[r]);
            const auto& own = column_.solids;
            const Face top = own.empty() ? Face{NaN, 0, -1, -1, NaN, NaN} : own.back().top;
            canvas.heights(r, c) = top.z;
            if (!own.empty()) canvas.surfaces(r, c) = Id(top.surface + 1);
            if (canvas.slope_x.exists())
                canvas.slope_x(r, c) = top.slope_x, canvas.slope_y(r, c) = top.slope_y;
            if (canvas.labels.exists() && top.storey >= 0)
                canvas.labels(r, c) = label_of(top, label);
            i64 first = count_of(solids);
            solids.insert(solids.end(), own.begin(), own.end());
            pixels.push_back({r, c, first, count_of(solids)});
        }
    }

    // Count what is hidden in the tile, whose south-west pixel has this row and column.
    void count(const Hidden& hidden, i64 row, i64 column) const {
        if (!hidden.exists()) return;
        for (const PixelColumn& pixel : pixels) {
            Span<const Solid> own{
                solids.data() + pixel.first, std::size_t(pixel.last - pixel.first)
            };
            hidden.count(row - pixel.row, column + pixel.column, own);
        }
    }

    // The bits of the sheets that may have a storey at a point.
    INLINE u64 near(double x, double y) const { return storeys_.near(x, y); }

    // The column at a point within the bounds, by descents.
    const std::vector<Solid>& column_at(Canvas<Id>& canvas, double x, double y, u64 near) {
        Found found = find_elements(field_, x, y, canvas);
        Worn worn = worn_of(field_, found);
        double z = worn.is_void ? NaN : found.z;
        column_.begin({z, found.top, i32(worn.surface), -1, found.slope_x, found.slope_y});
        maker_.put_storeys(column_, x, y, near);
        maker_.settle(column_, field_, x, y, 0);
        return column_.solids;
    }

    // The label of the top of a storey at a point.
    u32 label_at(const Face& top, double x, double y, double resolution) {
        i64 k = 0;
        while (std::ranges::find(storeys_.sheets[k].storeys, top.storey)
               == storeys_.sheets[k].storeys.end())
            ++k;
        In xs(&x, 1), ys(&y, 1);
        paint_tile(*storeys_.sheets[k].tops, tops_.canvas, xs, ys, resolution, {0, 1, 0, 1});
        return label_of(top, tops_.canvas.labels(0, 0));
    }

private:
    static constexpr i64 last_bit = 63;
    struct NearPixels {
        Rectangle part;
        bool alone;  // whether no other sheet may have storeys there
    };
    struct Run {
        i64 begin, column;  // first column of the tile, and its column of the lattice
    };
    const Field& field_;
    const Storeys& storeys_;
    ColumnMaker<Face> maker_;
    SolidColumn<Face> column_;
    SheetCanvas tops_, faces_;
    TileOf<i32> slots_;  // of each pixel in `found_`; -1 for none
    std::vector<StoreyPixel> found_;
    std::vector<MetStorey> met_;
    std::vector<Run> runs_;
    std::vector<NearPixels> rectangles_, open_, still_;
    bool exact_ = false, direct_ = false;

    void find_runs(In x, const Rectangle& part) {
        runs_.clear();
        i64 last = -2;
        for (i64 c = part.west; c < part.east; ++c) {
            i64 column = storeys_.column_near(x[c]);
            if (column != last) runs_.push_back({c, last = column});
        }
        runs_.push_back({part.east, -1});
    }

    // Rectangles of pixels of a part of a tile whose cells have a bit.
    void list_rectangles(u64 bit, In y, const Rectangle& part) {
        rectangles_.clear(), open_.clear();
        for (i64 south = part.south, north; south < part.north; south = north) {
            i64 j = storeys_.row_near(y[south]);
            for (north = south + 1; north < part.north && storeys_.row_near(y[north]) == j;)
                ++north;
            still_.clear();
            for (std::size_t k = 0; j >= 0 && k + 1 < runs_.size(); ++k) {
                i64 i = runs_[k].column;
                u64 near = i < 0 ? 0 : storeys_.lattice.cells(j, i);
                if (!(near & bit)) continue;
                bool alone = near == bit && bit >> last_bit == 0;
                i64 west = runs_[k].begin, east = runs_[k + 1].begin;
                NearPixels* last = still_.empty() ? nullptr : &still_.back();
                if (last && last->part.east == west && last->alone == alone) last->part.east = east;
                else still_.push_back({{west, east, south, north}, alone});
            }
            for (const NearPixels& before : open_) {
                auto same = [&](const NearPixels& one) {
                    return one.part.west == before.part.west && one.part.east == before.part.east
                        && one.alone == before.alone;
                };
                auto after = std::ranges::find_if(still_, same);
                if (after == still_.end()) rectangles_.push_back(before);
                else after->part.south = before.part.south;
            }
            std::swap(open_, still_);
        }
        rectangles_.insert(rectangles_.end(), open_.begin(), open_.end());
    }

    // Meet the storeys of a sheet over a rectangle of pixels.
    void paint_sheet(
        Canvas<Id>& ground, Span<const bool> voids, i64 k, In x, In y, double resolution,
        const NearPixels& near
    ) {
        const Rectangle& part = near.part;
        const Sheet& sheet = storeys_.sheets[k];
        const StoreyTable& table = storeys_.table;
        Canvas<u32>&canvas = tops_.canvas, &faces = faces_.canvas;
        bool left = paint_tile(*sheet.tops, canvas, x, y, resolution, part);
        bool has_faces = false, direct = direct_ && near.alone, plain = false;
        i64 top = -2;
        i32 storey = -1;
        Kind kind{};
        for (i64 r = part.south; r < part.north; ++r) {
            Span<const u32> numbers = canvas.surfaces.row(r, part.west, part.east);
            for (i64 c = part.west; c < part.east; ++c) {
                if (i64 number = i64(numbers[c - part.west]) - 1; number != top) {
                    top = number;
                    storey = top < 0 ? -1 : sheet.storeys[top];
                    kind = sheet.tops->kinds[sheet.tops->elements[max(top, i64(0))].kind];
                    plain = storey >= 0 && !exact_ && !has_classes(kind) && !kind.is_void
                        && sheet.numbers[top] == table.numbers[storey];
                }
                double z = canvas.heights(r, c);
                if (storey < 0 && !(left && isnan(z))) continue;
                if (exact_ || isnan(z) || has_classes(kind)) {
                    pixel_at(ground, r, c).unsure = true;
                    continue;
                }
                if (plain && direct) {  // a gap that is NaN is not put
                    double face = sheet.beyond(z, table.gaps[storey]);
                    i32 worn = sheet.surface_of(kind.surface);
                    if (put_alone(ground, voids, sheet.is_bore, {z, 0, worn, storey}, face, r, c))
                        continue;
                }
                double gap = table.gaps[storey], own = z;
                if (isnan(gap) || sheet.numbers[top] != table.numbers[storey]) {
                    if (!has_faces) {
                        paint_tile(*sheet.faces, faces, x, y, resolution, part);
                        has_faces = true;
                    }
                    own = faces.heights(r, c);
                    if (isnan(own)) {
                        pixel_at(ground, r, c).unsure = true;
                        continue;
                    }
                    i64 face = i64(faces.surfaces(r, c)) - 1;
                    if (face < 0 || sheet.faced[face] != storey) continue;
                }
                bool sloped = canvas.slope_x.exists();
                MetStorey met{
                    -1,
                    i32(k),
                    storey,
                    sheet.surface_of(kind.surface),
                    canvas.labels.exists() ? canvas.labels(r, c) : 0,
                    kind.is_void ? -INF : z,
                    isnan(gap) ? own : sheet.beyond(own, gap),
                    sloped ? canvas.slope_x(r, c) : 0.0,
                    sloped ? canvas.slope_y(r, c) : 0.0
                };
                StoreyPixel& pixel = pixel_at(ground, r, c);
                i64 at = count_of(met_);
                met_.push_back(met);
                (pixel.first < 0 ? pixel.first : met_[pixel.last].next) = at;
                pixel.last = at;
            }
        }
    }

    // Put the highest top of ground and one storey into a pixel; false where rounding might decide.
    INLINE bool put_alone(
        Canvas<Id>& canvas, Span<const bool> voids, bool is_bore, const Face& top, double face,
        i64 r, i64 c
    ) {
        double z = canvas.heights(r, c);
        // where there is no ground, or no other face, that is left to columns
        bool close = isnan(z) || isnan(face) || is_close(z, top.z) || is_close(z, face)
            || is_close(face, top.z);
        if (close || voids[canvas.surfaces(r, c)]) return false;
        bool shown = is_bore ? top.z < z && z < face : top.z > z && top.z > face;
        if (!shown) return true;
        canvas.heights(r, c) = top.z;
        canvas.surfaces(r, c) = Id(top.surface + 1);
        if (canvas.slope_x.exists()) {
            canvas.slope_x(r, c) = tops_.canvas.slope_x(r, c);
            canvas.slope_y(r, c) = tops_.canvas.slope_y(r, c);
        }
        if (canvas.labels.exists()) canvas.labels(r, c) = label_of(top, tops_.canvas.labels(r, c));
        return true;
    }

    StoreyPixel& pixel_at(Canvas<Id>& canvas, i64 r, i64 c) {
        i32& slot = slots_(r, c);
        if (slot >= 0) return found_[slot];
        slot = i32(found_.size());
        bool sloped = canvas.slope_x.exists();
        Face ground{
            canvas.heights(r, c),
            0,
            i32(canvas.surfaces(r, c)) - 1,
            -1,
            sloped ? canvas.slope_x(r, c) : 0.0,
            sloped ? canvas.slope_y(r, c) : 0.0
        };
        return found_.emplace_back(StoreyPixel{r, c, -1, -1, ground, false});
    }

    // Make the column of a pixel; the label that was painted of the storey that is its top.
    u32 put_column(
        Canvas<Id>& canvas, Span<const bool> voids, const StoreyPixel& pixel, double x, double y
    ) {
        if (pixel.unsure || is_close(pixel, met_)) {
            column_at(canvas, x, y, storeys_.near(x, y));
        } else {
            Face ground = pixel.ground;
            if (voids[ground.surface + 1]) ground.z = NaN;
            column_.begin(ground);
            for (i64 n = pixel.first; n >= 0; n = met_[n].next) {
                const MetStorey& met = met_[n];
                Face top{met.top, 0, met.surface, met.storey, met.slope_x, met.slope_y};
                Face face{met.face, 0, -1, met.storey};
                if (storeys_.sheets[met.sheet].is_bore) column_.take(top, face);
                else if (met.top > -INF) column_.add(face, top);
            }
            maker_.settle(column_, field_, x, y, 0);
        }
        if (!canvas.labels.exists() || column_.solids.empty()) return 0;
        i32 storey = column_.solids.back().top.storey;
        for (i64 n = pixel.first; n >= 0; n = met_[n].next)
            if (met_[n].storey == storey) return met_[n].label;
        return 0;
    }

    // Whether two faces are so close that rounding might decide which is higher.
    static bool is_close(double a, double b) { return abs(a - b) <= DOUBT * (1.0 + abs(a)); }

    // The same of any two over a pixel.
    static bool is_close(const StoreyPixel& pixel, const std::vector<MetStorey>& met) {
        double ground = pixel.ground.z;
        auto close = [](double a, double b) { return is_close(a, b); };
        for (i64 n = pixel.first; n >= 0; n = met[n].next) {
            const MetStorey& one = met[n];
            if (close(one.top, ground) || close(one.face, ground) || close(one.top, one.face))
                return true;
            for (i64 m = one.next; m >= 0; m = met[m].next) {
                const MetStorey& other = met[m];
                if (close(one.top, other.top) || close(one.face, other.face)
                    || close(one.top, other.face) || close(one.face, other.top))
                    return true;
            }
        }
        return false;
    }

    u32 label_of(const Face& top, u32 painted) const {
        u32 tracked = has_tracks(field_) ? hash32(std::bit_cast<u64>(top.z)) : 0;
        return painted + hash32(u64(FIRST_STOREY + top.storey)) + tracked;
    }
};

}  // namespace terratool
