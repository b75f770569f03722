// Which surface an element wears at a place: its own, or that of a class.
//
// Over the footprint of an element with a raster of classes the pixel that holds (u, v) decides, if
// its class stands for a surface. The pixel is found on the way; its class is read when it is
// asked.
#pragma once

#include "rasters.hpp"

namespace terratool {

// The surface at a place, -1 for none.
struct Worn {
    i64 surface;
    bool is_void;
};

// A pixel of a raster of classes, from the south-west, and the element that has the raster.
struct ClassPixel {
    i64 element = -1, i = 0, j = 0;
};

INLINE bool has_classes(const Kind& kind) { return kind.classes >= 0; }

// Whether heights depend on surfaces, and so on classes.
INLINE bool surfaces_matter(const Field& field) {
    return field.voids || !field.tracks.masks.empty() || !field.reliefs.empty();
}

// What an element wears of its own.
INLINE Worn own_surface(const Kind& kind) { return {i64(kind.surface), kind.is_void != 0}; }

// A raster of classes.
class ClassesAt {
public:
    ClassesAt(const Field& field, const Kind& kind)
        : all_(field.classes), grid_(all_.grids[kind.classes]),
          raster_(field.curves, field.curves.rasters[grid_.raster]), own_(own_surface(kind)) {}

    i64 count(int axis) const { return raster_.raster().count[axis]; }

    // What is worn in the pixel at column `i` from the west and row `j` from the south.
    Worn at(i64 i, i64 j) const {
        In numbers = all_.numbers.subspan(grid_.first, grid_.count);
        double number = raster_.number(i, j);
        auto found = std::lower_bound(numbers.begin(), numbers.end(), number);
        if (found == numbers.end() || *found != number) return own_;
        i64 k = grid_.first + (found - numbers.begin());
        return {i64(all_.surfaces[k]), all_.voids[k] != 0};
    }

    // The column or row of pixels at `t` where no edge in the world decides; `ahead` is added.
    i64 cell(int axis, double t, double ahead) const {
        return cell_at(clamp(t, 0.0, 1.0) + ahead, count(axis));
    }

private:
    const Classes& all_;
    const ClassGrid& grid_;
    RasterAt raster_;
    Worn own_;
};

// Whether the pixels of an element begin at exact places: it is neither turned nor a disc.
INLINE bool has_exact_pixels(const Kind& kind, const Pose& pose) {
    return !pose.turned && kind.combine != RADIAL;
}

// The column or row of pixels of such an element at `t`, at `x` in the world.
inline i64 exact_pixel(
    const ClassesAt& classes, const Element& element, const Pose& pose, const Grid& grid, int axis,
    double t, double x
) {
    return placed_cell(
        t, classes.count(axis), x, axis_of(grid, axis), block_of(element, pose, axis)
    );
}

// The pixel of an element with classes at (u, v), at (x, y) in the world.
NEVER_INLINE inline ClassPixel pixel_of(
    const Field& field, i64 index, const Element& element, const Pose& pose, const Grid& grid,
    UV at, double x, double y
) {
    const Kind& kind = field.kinds[element.kind];
    ClassesAt classes(field, kind);
    if (has_exact_pixels(kind, pose))
        return {
            index, exact_pixel(classes, element, pose, grid, X, at.u, x),
            exact_pixel(classes, element, pose, grid, Y, at.v, y)
        };
    return {index, classes.cell(X, at.u, STEP), classes.cell(Y, at.v, STEP)};
}

// The surface at a place by its top element, and the pixel that was found for that.
INLINE Worn worn_of(const Field& field, i64 top, const ClassPixel& pixel) {
    if (top < 0) return {-1, false};
    const Kind& kind = field.kinds[field.elements[top].kind];
    if (has_classes(kind) && pixel.element == top) [[unlikely]]
        return ClassesAt(field, kind).at(pixel.i, pixel.j);
    return own_surface(kind);
}

// Whether the class of a pixel decides what a top element wears.
INLINE bool is_classed(const Field& field, i64 top) {
    return top >= 0 && has_classes(field.kinds[field.elements[top].kind]);
}

// What may be worn in a block of pixels.
struct WornRange {
    bool differs, voids;
};

// What is worn from a column and row to another, both included; of large blocks what may be.
inline WornRange worn_in(const Field& field, const Kind& kind, const NumberBlock& block) {
    constexpr i64 most = 4096;
    const ClassGrid& grid = field.classes.grids[kind.classes];
    ClassesAt classes(field, kind);
    i64 pixels = (block.east - block.west + 1) * (block.north - block.south + 1);
    if (pixels > most) {
        auto voids = field.classes.voids.subspan(grid.first, grid.count);
        return {true, kind.is_void || std::ranges::count(voids, u8(0)) < count_of(voids)};
    }
    WornRange found{false, false};
    Worn first = classes.at(block.west, block.south);
    for (i64 j = block.south; j <= block.north; ++j)
        for (i64 i = block.west; i <= block.east; ++i) {
            Worn worn = classes.at(i, j);
            found.differs |= worn.surface != first.surface, found.voids |= worn.is_void;
        }
    return found;
}

}  // namespace terratool
