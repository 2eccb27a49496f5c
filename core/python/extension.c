/*
 * The Python module `towline.core._core`: functions on the memory of arrays. It keeps to Python's limited API of 3.11,
 * so that one wheel serves this version and all later ones.
 */
#include "python/extension.h"

#include "distribution/towline_core.h"
#include "robot.h"

static PyMethodDef functions[] = {
    {"solve_packed", (PyCFunction)(void (*)(void))towline_py_solve_packed, METH_FASTCALL,
     "solve_packed(packed, tensions, direction=None)\n--\n\n"
     "Solve a packed problem; return its status and fill tensions (m,) if optimal, direction (n,) if out of reach."},
    {"solve_rows", (PyCFunction)(void (*)(void))towline_py_solve_rows, METH_FASTCALL,
     "solve_rows(n, m, rho, A, w, t_min, t_max, t_ref, weights, length, per, tensions, direction, info, residual, "
     "status)\n--\n\nSolve the rows of a batch whose status is UNSURE; return how many of all are optimal."},
    {"lines", (PyCFunction)(void (*)(void))towline_py_lines, METH_FASTCALL,
     "lines(robot, poses, carriers, lengths, A, J, anchors, sensitivity)\n--\n\n"
     "Compute the lines of the cables at each pose, of those results that are not None; carriers has as many rows or one."},
    {"required_wrench", (PyCFunction)(void (*)(void))towline_py_required_wrench, METH_FASTCALL,
     "required_wrench(robot, poses, velocities, accelerations, wind, w)\n--\n\n"
     "Compute the wrench that each motion needs; wind has as many rows, or one, or is None."},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "_core", "The numeric core of towline, in C.", 0, functions, NULL, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit__core(void) {
    PyObject *module = PyModule_Create(&definition);
    if (module && (PyModule_AddIntConstant(module, "CABLES", TOWLINE_CABLES) < 0 ||
                   PyModule_AddIntConstant(module, "ROWS", TOWLINE_ROWS) < 0 ||
                   PyModule_AddIntConstant(module, "ROBOT_BYTES", (long)sizeof(towline_robot)) < 0 ||
                   PyModule_AddIntConstant(module, "MOST_CABLES", TOWLINE_MOST_CABLES) < 0 ||
                   PyModule_AddIntConstant(module, "MOST_CARRIERS", TOWLINE_MOST_CARRIERS) < 0)) {
        Py_DECREF(module);
        return NULL;
    }
    return module;
}
