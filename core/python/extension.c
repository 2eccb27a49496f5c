/*
 * The Python module `towline.core._core`: functions on the memory of arrays. It keeps to Python's limited API of 3.11,
 * so that one wheel serves this version and all later ones.
 */
#include "python/extension.h"

#include "distribution/towline_core.h"
#include "numbers/processor.h"
#include "robot.h"

static PyMethodDef functions[] = {
    {"solve_packed", (PyCFunction)(void (*)(void))towline_py_solve_packed, METH_FASTCALL,
     "solve_packed(packed, tensions, direction=None)\n--\n\n"
     "Solve a packed problem; return its status and fill tensions (m,) if optimal, direction (n,) if out of reach."},
    {"solve_rows", (PyCFunction)(void (*)(void))towline_py_solve_rows, METH_FASTCALL,
     "solve_rows(n, m, rho, in_lanes, A, w, t_min, t_max, t_ref, weights, length, per, tensions, direction, info, "
     "residual, status)\n--\n\nSolve the rows of a batch whose status is UNSURE; return how many of all are optimal."},
    {"facets", (PyCFunction)(void (*)(void))towline_py_facets, METH_FASTCALL,
     "facets(A, low, high, normals, least, most)\n--\n\n"
     "Compute normals orthogonal to n - 1 columns, and the least and the most that tensions give along them."},
    {"full_rank", (PyCFunction)(void (*)(void))towline_py_full_rank, METH_FASTCALL,
     "full_rank(n, tolerance, A, full)\n--\n\n"
     "Find whether matrices of n rows have n independent columns, 1 or 0."},
    {"lines", (PyCFunction)(void (*)(void))towline_py_lines, METH_FASTCALL,
     "lines(robot, poses, carriers, lengths, A, J, anchors, sensitivity)\n--\n\n"
     "Compute the lines of the cables at each pose, of those results that are not None; carriers has as many rows or one."},
    {"required_wrench", (PyCFunction)(void (*)(void))towline_py_required_wrench, METH_FASTCALL,
     "required_wrench(robot, poses, velocities, accelerations, wind, w)\n--\n\n"
     "Compute the wrench that each motion needs; wind has as many rows, or one, or is None."},
    {"horizon_size", (PyCFunction)(void (*)(void))towline_py_horizon_size, METH_FASTCALL,
     "horizon_size(N, n, m, p)\n--\n\n"
     "Return how many numbers of memory a horizon of N stages, n states, m controls and p soft rows needs."},
    {"horizon_places", (PyCFunction)(void (*)(void))towline_py_horizon_places, METH_FASTCALL,
     "horizon_places(N, n, m, p, memory)\n--\n\nReturn where in memory the arrays of problem and solution begin."},
    {"horizon_relative_to", (PyCFunction)(void (*)(void))towline_py_horizon_relative_to, METH_FASTCALL,
     "horizon_relative_to(N, n, m, p, processor, memory, states, controls)\n--\n\n"
     "Write the same problem in differences from a reference."},
    {"horizon_solve", (PyCFunction)(void (*)(void))towline_py_horizon_solve, METH_FASTCALL,
     "horizon_solve(N, n, m, p, processor, beginning, iterations_max, tolerance, memory, residuals)\n--\n\n"
     "Solve the problem in memory; return how many iterations it took, and whether it converged."},
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
                   PyModule_AddIntConstant(module, "PROCESSOR", towline_processor()) < 0 ||
                   PyModule_AddIntConstant(module, "MOST_CARRIERS", TOWLINE_MOST_CARRIERS) < 0)) {
        Py_DECREF(module);
        return NULL;
    }
    return module;
}
