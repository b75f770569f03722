// Classes of elements as rays need them: where the ray gets from one surface to another.
#pragma once

#include "ray_elements.hpp"

namespace terratool::rays {

// The pixel of an element with classes near a place of its footprint.
inline ClassPixel pixel_near(const Elements& elements, i64 index, double x, double y) {
    const Field& field = elements.field;
    ClassesAt classes(field, field.kinds[field.elements[index].kind]);
    auto [u, v] = elements.places[index].frame.at(x, y);
    return {index, classes.cell(X, u, STEP), classes.cell(Y, v, STEP)};
}

// What a top element wears near a place.
INLINE Worn worn_near(const Elements& elements, i64 top, double x, double y) {
    const Field& field = elements.field;
    if (!is_classed(field, top)) return worn_of(field, top, {});
    return worn_of(field, top, pixel_near(elements, top, x, y));
}

// Of an element in a rectangle: whether classes of different surfaces may be in it and matter, how
// many pixels then are, and whether there may be a void.
struct ClassPart {
    bool differs, voids;
    i64 pixels;
};

inline ClassPart class_part(const Elements& elements, u32 index, const Cell& plan) {
    const Field& field = elements.field;
    const Kind& kind = field.kinds[field.elements[index].kind];
    if (!has_classes(kind) || !surfaces_matter(field)) return {false, kind.is_void != 0, 0};
    constexpr double slack = 1e-9;
    Range u{INF, -INF}, v{INF, -INF};
    for (double x : {plan.west, plan.east})
        for (double y : {plan.south, plan.north}) {
            UV at = elements.places[index].frame.at(x, y);
            u = around(u, {at.u - slack, at.u + slack}),
            v = around(v, {at.v - slack, at.v + slack});
        }
    ClassesAt classes(field, kind);
    NumberBlock block{
        classes.cell(X, u.low, 0.0), classes.cell(X, u.high, 0.0), classes.cell(Y, v.low, 0.0),
        classes.cell(Y, v.high, 0.0)
    };
    auto [differs, voids] = worn_in(field, kind, block);
    i64 pixels = (block.east - block.west + 1) * (block.north - block.south + 1);
    return {differs, voids, differs ? pixels : 0};
}

}  // namespace terratool::rays
