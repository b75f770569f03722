// What Python sees of kernels/raster.
#include "../raster/statistics.hpp"

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
}

}  // namespace terratool::python
