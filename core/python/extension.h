/* The functions of the Python module. */
#ifndef TOWLINE_EXTENSION_H
#define TOWLINE_EXTENSION_H

#include <Python.h>

/* A function that is called with an array of arguments. */
#define TOWLINE_PY(name) \
    PyObject *towline_py_##name(PyObject *Py_UNUSED(module), PyObject *const *arguments, Py_ssize_t count)

#define FUNCTION(name, arguments, text) TOWLINE_PY(name);
#include "python/functions.h"
#undef FUNCTION

PyObject *towline_py_finite(PyObject *module, PyObject *array);
PyObject *towline_py_extent(PyObject *module, PyObject *array);

#endif
