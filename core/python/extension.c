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
    {"run_plant", (PyCFunction)(void (*)(void))towline_py_run_plant, METH_FASTCALL,
     "run_plant(robot, settings, states, commands, history, tensions, steps, period, substeps, keep)\n--\n\n"
     "Run each state under its commands, and write every keep-th state and its tensions."},
    {"sense", (PyCFunction)(void (*)(void))towline_py_sense, METH_FASTCALL,
     "sense(robot, states, motions, lengths)\n--\n\n"
     "Write the motions of platform and carriers in states of a plant, and lengths of the cables with their rates."},
    {"winch_lengths", (PyCFunction)(void (*)(void))towline_py_winch_lengths, METH_FASTCALL,
     "winch_lengths(robot, states, lengths, tensions, last_rates, commands, period)\n--\n\n"
     "Write the unstrained lengths that give tensions within a period into commands of a plant."},
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
