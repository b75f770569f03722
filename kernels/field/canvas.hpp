// What a painter works on: a tile of pixels that stays in the cache, and scratch.
#pragma once

#include "query.hpp"

namespace terratool {

// The most pixels of a tile: a little over 1024 and 128, for windows with margins.
// Heights and surfaces of a tile take 1.2 MB, slopes 2.2 MB, labels 0.5 MB, tracks 3.8 MB.
constexpr i64 TILE_WIDTH = 1040, TILE_HEIGHT = 132;

struct Rectangle {  // columns and rows of a tile; rows run from the south
    i64 west, east, south, north;
    bool is_empty() const { return west >= east || south >= north; }
};

struct GridPart {  // a grid that waits with the pixels over it
    i64 grid;
    Rectangle part;
};

struct BinRun {  // columns or rows from `begin` on that lie in the same bin
    i64 begin, bin;
};

// Numbers of a tile's pixels; none where they are not wanted.
template <class T> class TileOf {
public:
    explicit TileOf(bool wanted) : values_(wanted ? TILE_WIDTH * TILE_HEIGHT : 0) {}
    i64 nbytes() const { return i64(sizeof(T)) * count_of(values_); }
    INLINE bool exists() const { return !values_.empty(); }
    INLINE T& operator()(i64 row, i64 column) { return values_[row * TILE_WIDTH + column]; }
    // Columns `begin` to `end` of a row.
    INLINE Span<T> row(i64 row, i64 begin, i64 end) {
        return {values_.data() + row * TILE_WIDTH + begin, std::size_t(end - begin)};
    }
    void fill(const Rectangle& part, T value) {
        for (i64 r = part.south; r < part.north; ++r) {
            auto cells = row(r, part.west, part.east);
            std::fill(cells.begin(), cells.end(), value);
        }
    }

private:
    std::vector<T> values_;
};

// What tracks leave on a pixel.
struct Trodden {
    double first, passes;  // depth of the deepest first pass, and all passes
    u32 deepest, worn;     // the track with that pass; the last with a surface and one, 0 for none
};

// A tile, and what is needed to paint it. Surfaces are their indices and one, 0 for none.
template <class Id> struct Canvas {
    TileOf<double> heights{true};
    TileOf<Id> surfaces{true};
    TileOf<double> slope_x, slope_y;
    TileOf<u32> labels;  // of regions
    TileOf<u32> stamps;  // the last track over a pixel and one, 0 for none
    TileOf<Trodden> trodden;
    std::vector<u64> near_segments;  // a bit for each, all 0 but while they are looked for
    Span<const u8> nonzero_edges;    // by kinds: whether a footprint's edge may be a wall
    std::vector<GridPart> queue;
    Stack stack;
    // by column and by row: cells of a grid and positions in them, positions in a block of cells,
    // values of curves, and scratch
    std::array<double, TILE_WIDTH> cell_x, in_x, u, fx, work_0, work_1, work_2;
    std::array<double, TILE_HEIGHT> cell_y, in_y, v, fy;
    std::array<u32, TILE_WIDTH> marks;  // what an element adds to the labels
    std::array<BinRun, TILE_WIDTH + 1> runs_x;
    std::array<BinRun, TILE_HEIGHT + 1> runs_y;

    Canvas(const Field& field, bool slopes, bool labelled, Span<const u8> nonzero)
        : slope_x(slopes), slope_y(slopes), labels(labelled), stamps(has_tracks(field)),
          trodden(has_tracks(field)), near_segments(field.tracks.segments.size() / 64 + 1),
          nonzero_edges(nonzero), stack(field.pending) {}

    i64 nbytes() const {
        return i64(sizeof(*this)) + heights.nbytes() + surfaces.nbytes() + slope_x.nbytes()
            + slope_y.nbytes() + labels.nbytes() + stamps.nbytes() + trodden.nbytes()
            + i64(sizeof(GridPart)) * i64(queue.capacity());
    }
};

template <std::size_t n> INLINE Out part_of(std::array<double, n>& all, i64 begin, i64 end) {
    return {all.data() + begin, std::size_t(end - begin)};
}

}  // namespace terratool
