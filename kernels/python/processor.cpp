// Which of the variants of the kernels this processor can run.
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#if defined(__x86_64__) || defined(_M_X64)
#if defined(_MSC_VER)
#include <immintrin.h>
#include <intrin.h>
#else
#include <cpuid.h>
#endif
#include <array>
#include <cstdint>

namespace {

using Registers = std::array<std::uint32_t, 4>;  // eax, ebx, ecx, edx

Registers cpuid(std::uint32_t leaf) {
    Registers r{};
#if defined(_MSC_VER)
    __cpuidex(reinterpret_cast<int*>(r.data()), int(leaf), 0);
#else
    if (!__get_cpuid_count(leaf, 0, &r[0], &r[1], &r[2], &r[3])) r = {};
#endif
    return r;
}

bool has(std::uint32_t word, std::initializer_list<int> bits) {
    for (int bit : bits)
        if (!(word >> bit & 1)) return false;
    return true;
}

// The system keeps the registers of AVX.
bool keeps_avx() {
#if defined(_MSC_VER)
    return (_xgetbv(0) & 6) == 6;
#else
    std::uint32_t low, high;
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return (low & 6) == 6;
#endif
}

// The x86-64 psABI's level 3: AVX, AVX2, BMI1, BMI2, F16C, FMA, LZCNT, MOVBE, OSXSAVE.
bool is_v3() {
    return has(cpuid(1)[2], {12, 22, 27, 28, 29}) && has(cpuid(7)[1], {3, 5, 8})
        && has(cpuid(0x80000001)[2], {5}) && keeps_avx();
}

}  // namespace
#else
namespace {
bool is_v3() { return false; }
}  // namespace
#endif

static PyObject* ask(PyObject*, PyObject*) { return PyBool_FromLong(is_v3()); }

static PyMethodDef methods[] = {
    {"is_v3", ask, METH_NOARGS, "is_v3() -> bool\n\nWhether the processor has x86-64-v3."},
    {nullptr, nullptr, 0, nullptr},
};

static PyModuleDef module = {
    PyModuleDef_HEAD_INIT,
    "_processor",
    "Which variant of the kernels runs here.",
    -1,
    methods,
    nullptr,
    nullptr,
    nullptr,
    nullptr,
};

PyMODINIT_FUNC PyInit__processor() { return PyModule_Create(&module); }
