/* The functions of the Python module, one file for each part of the core. */
#ifndef TOWLINE_EXTENSION_H
#define TOWLINE_EXTENSION_H

#include <Python.h>

/* distribution.c */
PyObject *towline_py_solve_packed(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_solve_rows(PyObject *module, PyObject *const *arguments, Py_ssize_t count);

/* finite.c */
PyObject *towline_py_finite(PyObject *module, PyObject *array);

/* available_wrench.c */
PyObject *towline_py_margins(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_facets(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_full_rank(PyObject *module, PyObject *const *arguments, Py_ssize_t count);

/* mechanics.c */
PyObject *towline_py_lines(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_required_wrench(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_ends(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_cable_distances(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_columns_by_geometry(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_wrench_by_pose(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_wrench_by_axes(PyObject *module, PyObject *const *arguments, Py_ssize_t count);

/* pose.c */
PyObject *towline_py_pose_from_lengths(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_pose_covariance(PyObject *module, PyObject *const *arguments, Py_ssize_t count);

/* horizon.c */
PyObject *towline_py_horizon_size(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_horizon_places(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_horizon_relative_to(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_horizon_solve(PyObject *module, PyObject *const *arguments, Py_ssize_t count);

/* control.c */
PyObject *towline_py_control_take(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_control_step(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_control_thrusts(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_control_move_on(PyObject *module, PyObject *const *arguments, Py_ssize_t count);

/* stages.c */
PyObject *towline_py_control_stages(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_control_aim(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_control_coordinates(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_control_carriers(PyObject *module, PyObject *const *arguments, Py_ssize_t count);

/* plant.c */
PyObject *towline_py_run_plant(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_sense(PyObject *module, PyObject *const *arguments, Py_ssize_t count);
PyObject *towline_py_winch_lengths(PyObject *module, PyObject *const *arguments, Py_ssize_t count);

#endif
