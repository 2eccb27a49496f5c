/* The functions of the Python module, one file for each part of the core. */
#ifndef TOWLINE_EXTENSION_H
#define TOWLINE_EXTENSION_H

#include <Python.h>

/* distribution.c */
PyObject *towline_py_solve_packed(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_solve_rows(PyObject *module, PyObject *const *arguments, Py_ssize_t count);

/* mechanics.c */
PyObject *towline_py_lines(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_required_wrench(PyObject *module, PyObject *const *arguments, Py_ssize_t count);

#endif
