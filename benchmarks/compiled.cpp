// What the kernels are compared with.
#include <algorithm>
#include <cstdint>

extern "C" {

// Heights of a DEM at points, as a user would write it: rows from the south.
void bilinear(
    const float* dem, std::int64_t side, const double* x, const double* y, std::int64_t points,
    double per, double* out
) {
    std::int64_t last = side - 2;
    for (std::int64_t n = 0; n < points; ++n) {
        double u = x[n] * per - 0.5, v = y[n] * per - 0.5;
        std::int64_t i = std::clamp<std::int64_t>(std::int64_t(u), 0, last);
        std::int64_t j = std::clamp<std::int64_t>(std::int64_t(v), 0, last);
        u -= double(i), v -= double(j);
        const float* row = dem + j * side + i;
        double south = row[0] + u * (row[1] - row[0]);
        double north = row[side] + u * (row[side + 1] - row[side]);
        out[n] = south + v * (north - south);
    }
}

// Work that touches no memory, to see what a second thread is worth just now.
double busy(std::int64_t rounds) {
    double x = 0.0;
    for (std::int64_t n = 0; n < rounds; ++n) x = x * 0.5 + double(n);
    return x;
}
}
