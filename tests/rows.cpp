// Loops along rows, each a function of its own, for a look at what the compiler makes of them.
#include "../kernels/field/painting.hpp"
#include "../kernels/raster/statistics.hpp"

using namespace terratool;

extern "C" {

void lays_products(Out row, In fx) { lay_products(row, fx, 2.0, 3.0); }
void adds_products(Out row, In fx, double a, double b) { add_products(row, fx, a, b); }
void adds_constant(Out row, double a) { add_constant(row, a); }
void adds_labels(Span<u32> row, u32 a) { add_constant(row, a); }
void adds_row(u8 how, Out row, In fx, double a, double b, double c) {
    add_row(how, row, fx, a, b, c);
}
void adds_both(u8 how, Out row, In fx, In fy, double a, double b) {
    add_both(how, row, fx, fy, a, b);
}
void adds_pieces(Out row, In u, In pieces, const Ramp& x, const Ramp& y, double a, double b) {
    add_pieces(row, u, stored_piece(pieces, 0), x, stored_piece(pieces, 1), y, a, b);
}
void adds_turned_pairs(Out row, In u, In pieces, const Painted& p) {
    add_turned_pairs(row, u, 0.5, pieces, p);
}
void lays_product_slopes(Out east, Out north, In fx, In slope, double a, double b) {
    lay_product_slopes(east, north, fx, slope, a, b);
}
void adds_product_slopes(Out east, Out north, In fx, In slope, double a, double b) {
    add_product_slopes(east, north, fx, slope, a, b);
}
void adds_chosen_slopes(Out east, Out north, In fx, In slope, double a, double b) {
    add_chosen_slopes(true, east, north, fx, slope, a, a, b);
}
void finds_positions(In x, const GridAxis& axis, Out whole, Out part) {
    positions(x, axis, whole, part);
}
void gathers(Matrix<const float> pixels, double shift, Matrix<double> sums) {
    raster::gather(pixels, shift, sums);
}
}
