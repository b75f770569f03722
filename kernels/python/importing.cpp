// What Python sees of kernels/importing.
#include "../importing/bilinear.hpp"
#include "../importing/heights.hpp"
#include "../importing/numbers.hpp"
#include "../importing/polygons.hpp"
#include "../importing/rows.hpp"
#include "../importing/structure.hpp"
#include "../importing/zbuffer.hpp"

#include "bind.hpp"
#include "modules.hpp"

namespace terratool::python {

using namespace importing;

void bind_importing(nb::module_ m) {
    def<&round_rows>(
        m, "round_rows", "Round a block of rows to whole steps.",
        {"heights[n,w]", "size", "step", "base", "?above[w]", "counts[n,w]", "levels[n,w]"}
    );
    def<&write_integers>(m, "write_integers", "Whole numbers as an array of JSON.", {"numbers[_]"});
    def<&cut_rectangles>(
        m, "cut_rectangles", "Rectangles of one class each: column, row, width, height, class.",
        {"classes[_,_]"}
    );
    def<&compare>(
        m, "compare", "The largest difference of heights, and the sum of squares.",
        {"heights[n]", "ours[n]", "sums[2]"}
    );

    def<&to_pixels>(
        m, "to_pixels", "Vertices as points in pixels.",
        {"vertices[_,3]", "west", "south", "dx", "dy"}
    );
    def<&paint_faces>(
        m, "paint_faces", "The highest surface at the centre of each pixel.",
        {"points[_,3]", "faces[_,3]", "tolerance", "heights[h,w]", "counts[h,w]"}
    );
    def<&count_overhangs>(
        m, "count_overhangs", "Pixels with an open surface below the highest.",
        {"points[_,3]", "faces[_,3]", "tolerance", "heights[h,w]", "counts[h,w]"}
    );
    def<&count_holes>(
        m, "count_holes", "Pixels without a height, enclosed by others and not enclosed.",
        {"heights[_,_]"}
    );
    def<&find_extent>(
        m, "find_extent", "Least and greatest x, y and z of the corners of faces.",
        {"vertices[_,3]", "faces[_,3]"}
    );
    def<&survey_faces>(
        m, "survey_faces",
        "Area of vertical faces within; how many are seen, vertical, flat, outside.",
        {"vertices[_,3]", "faces[_,3]", "west", "south", "east", "north"}
    );

    def<&locate_all>(
        m, "locate", "The nodes before places on a curve, and the way to the next.",
        {"nodes[_]", "t[_]"}
    );
    def<&residuals>(m, "residuals", "Heights minus those of the terms.", {"problem", "terms"});
    def<&normal_equations>(
        m, "normal_equations", "Add up the normal equations of points.",
        {"problem", "terms", "weights[n]", "matrix[m,m]", "right[m]"}
    );
    def<&worst_pixels>(
        m, "worst_pixels",
        "The pixel with the largest error of each block, and the largest of all.",
        {"heights[_,_]", "affine[4]", "terms", "block"}
    );
    def<&error_range>(
        m, "error_range", "The smallest and the largest error of all pixels.",
        {"heights[_,_]", "affine[4]", "terms"}
    );
    def<&solve>(
        m, "solve", "Solve a symmetric system; whether it is positive definite.",
        {"matrix[m,m]", "right[m]"}
    );

    i64 code = FLAT;
    for (const char* name :
         {"FLAT", "RAMP", "FALL", "TENT", "COS", "COSBELL", "DOME", "GAUSS", "RISE", "SINK"})
        m.attr(name) = code++;
    def<&sample_curve>(m, "sample_curve", "Values of a known curve.", {"code", "t[_]"});
    def<&fit_curve>(
        m, "fit_curve", "The curve and cell that fit a profile best.",
        {"profile", "begins[_]", "ends[_]", "good"}
    );
    def<&least_size>(
        m, "least_size", "The least size of a difference and its neighbours.",
        {"mixed[_,_]", "row", "column", "down", "across"}
    );
    def<&find_strongest>(
        m, "find_strongest",
        "The place in each block where the least size of neighbours is largest.",
        {"mixed[_,_]", "down", "across", "block"}
    );

    def<&read_numbers>(
        m, "read_numbers",
        "Numbers of a text; which of them are hard, and where they begin; where they end.",
        {"text[_]", "at", "powers[121,2]"}
    );
    def<&read_rows>(
        m, "read_rows",
        "Numbers of fields of lines; which Python must read, and where; the first bad line.",
        {"text[_]", "places[_]", "powers[121,2]"}
    );
    def<&triangulate>(
        m, "triangulate", "Triangles of polygons; how many have no area, and cross themselves.",
        {"points[_,3]", "indices[_]"}
    );
}

}  // namespace terratool::python
