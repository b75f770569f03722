// What Python sees of kernels/raster.
#include "../raster/statistics.hpp"
#include "../raster/triangles.hpp"

#include "bind.hpp"
#include "modules.hpp"

namespace terratool::python {

void bind_raster(nb::module_ m) {
    def<&raster::first_number>(
        m, "first_number", "The first pixel that is not NaN, or 0.", {"pixels[_,_]"}
    );
    def<&raster::gather>(
        m, "gather", "Statistics of pixels by column.", {"pixels[_,_]", "shift", "sums[5,_]"}
    );
    def<&raster::nearest_faces>(
        m, "nearest_faces", "The face with the largest z at the centre of each pixel.",
        {"points[_,3]", "faces[_,3]", "depths[h,w]", "nearest[h,w]"}
    );
}

}  // namespace terratool::python
