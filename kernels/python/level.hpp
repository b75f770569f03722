// Whether this processor can run the variant of the kernels for x86-64-v3.
#pragma once

#if defined(__x86_64__) || defined(_M_X64)
#if defined(_MSC_VER)
#include <immintrin.h>
#include <intrin.h>
#else
#include <cpuid.h>
#endif
#include <array>
#include <cstdint>
#include <initializer_list>

namespace terratool {

using Registers = std::array<std::uint32_t, 4>;  // eax, ebx, ecx, edx

inline Registers cpuid(std::uint32_t leaf) {
    Registers r{};
#if defined(_MSC_VER)
    __cpuidex(reinterpret_cast<int*>(r.data()), int(leaf), 0);
#else
    if (!__get_cpuid_count(leaf, 0, &r[0], &r[1], &r[2], &r[3])) r = {};
#endif
    return r;
}

inline bool has(std::uint32_t word, std::initializer_list<int> bits) {
    for (int bit : bits)
        if (!(word >> bit & 1)) return false;
    return true;
}

// The system keeps the registers of AVX.
inline bool keeps_avx() {
#if defined(_MSC_VER)
    return (_xgetbv(0) & 6) == 6;
#else
    std::uint32_t low, high;
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return (low & 6) == 6;
#endif
}

// The x86-64 psABI's level 3: AVX, AVX2, BMI1, BMI2, F16C, FMA, LZCNT, MOVBE, OSXSAVE.
inline bool is_v3() {
    return has(cpuid(1)[2], {12, 22, 27, 28, 29}) && has(cpuid(7)[1], {3, 5, 8})
        && has(cpuid(0x80000001)[2], {5}) && keeps_avx();
}

}  // namespace terratool
#else
namespace terratool {
inline bool is_v3() { return false; }
}  // namespace terratool
#endif
