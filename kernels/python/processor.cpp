// Which of the variants of the kernels this processor can run.
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include "level.hpp"

static PyObject* ask(PyObject*, PyObject*) { return PyBool_FromLong(terratool::is_v3()); }

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
