/* The functions of the Python module, one file for each part of the core. */
#ifndef TOWLINE_EXTENSION_H
#define TOWLINE_EXTENSION_H

#include <Python.h>

/* distribution.c */
PyObject *towline_py_solve_packed(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_solve_rows(PyObject *module, PyObject *const *arguments, Py_ssize_t count);

/* available_wrench.c */
PyObject *towline_py_facets(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_full_rank(PyObject *module, PyObject *const *arguments, Py_ssize_t count);

/* mechanics.c */
PyObject *towline_py_lines(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_required_wrench(PyObject *module, PyObject *const *arguments, Py_ssize_t count);

/* horizon.c */
PyObject *towline_py_horizon_size(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_horizon_places(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_horizon_relative_to(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_horizon_solve(PyObject *module, PyObject *const *arguments, Py_ssize_t count);

/* plant.c */
PyObject *towline_py_run_plant(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_sense(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_winch_lengths(PyObject *module, PyObject *const *arguments, Py_ssize_t count);

#endif
