/*
 * Whether the numbers of an array are finite, and between which they lie, for Python: one call of NumPy takes longer
 * than the mechanics of a pose.
 */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "python/arrays.h"
#include "python/extension.h"

PyObject *towline_py_finite(PyObject *module, PyObject *array) {
    (void)module;
    const uint64_t exponent = (uint64_t)0x7ff
                              << 52; /* all of its bits are set in infinities and in what is no number */
    Py_buffer view;
    if (view_of(array, &view, PyBUF_SIMPLE) < 0) { return NULL; }
    const char *bytes = view.buf; /* of numbers at any address: arrays need not be aligned */
    int finite = 1;
    for (Py_ssize_t at = 0; at + DOUBLE <= view.len; at += DOUBLE) {
        uint64_t bits;
        memcpy(&bits, bytes + at, sizeof bits);
        finite &= (bits & exponent) != exponent;
    }
    PyBuffer_Release(&view);
    return PyBool_FromLong(finite);
}

PyObject *towline_py_extent(PyObject *module, PyObject *array) {
    (void)module;
    Py_buffer view;
    if (view_of(array, &view, PyBUF_SIMPLE) < 0) { return NULL; }
    const char *bytes = view.buf;
    double least = INFINITY, largest = -INFINITY;
    for (Py_ssize_t at = 0; at + DOUBLE <= view.len; at += DOUBLE) {
        double x;
        memcpy(&x, bytes + at, sizeof x);
        least = x < least ? x : least;
        largest = x > largest ? x : largest;
    }
    PyBuffer_Release(&view);
    return Py_BuildValue("(dd)", least, largest);
}
