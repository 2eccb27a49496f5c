/*
 * The Python module `towline.core._core`: functions on the memory of arrays. It keeps to Python's limited API of 3.11,
 * so that one wheel serves this version and all later ones.
 */
#include "python/extension.h"

#include "available_wrench/available_wrench.h"
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
    {"finite", towline_py_finite, METH_O,
     "finite(array)\n--\n\nReturn whether all numbers of an array of float64 in C order are finite."},
    {"facets", (PyCFunction)(void (*)(void))towline_py_facets, METH_FASTCALL,
     "facets(A, low, high, normals, least, most)\n--\n\n"
     "Compute normals orthogonal to n - 1 columns, and the least and the most that tensions give along them."},
    {"margins", (PyCFunction)(void (*)(void))towline_py_margins, METH_FASTCALL,
     "margins(A, w, low, high, margins, reserves)\n--\n\n"
     "Compute capacity margins, and the reserves along all normals unless None; w has as many rows, or one."},
    {"full_rank", (PyCFunction)(void (*)(void))towline_py_full_rank, METH_FASTCALL,
     "full_rank(n, tolerance, A, full)\n--\n\n"
     "Find whether matrices of n rows have n independent columns, 1 or 0."},
    {"lines", (PyCFunction)(void (*)(void))towline_py_lines, METH_FASTCALL,
     "lines(robot, poses, carriers, lengths, A, J, anchors, sensitivity)\n--\n\n"
     "Compute the lines of the cables at each pose, of those results that are not None; carriers has as many rows or "
     "one."},
    {"required_wrench", (PyCFunction)(void (*)(void))towline_py_required_wrench, METH_FASTCALL,
     "required_wrench(robot, poses, velocities, accelerations, wind, w)\n--\n\n"
     "Compute the wrench that each motion needs; wind has as many rows, or one, or is None."},
    {"pose_from_lengths", (PyCFunction)(void (*)(void))towline_py_pose_from_lengths, METH_FASTCALL,
     "pose_from_lengths(robot, carriers, lengths, weights, free, damping, poses, errors, steps)\n--\n\n"
     "Move poses to where the errors of their lengths are least; carriers has as many rows or one."},
    {"pose_covariance", (PyCFunction)(void (*)(void))towline_py_pose_covariance, METH_FASTCALL,
     "pose_covariance(robot, carriers, weights, poses, covariances)\n--\n\n"
     "Compute how the noise of the lengths spreads each pose; carriers has as many rows or one."},
    {"ends", (PyCFunction)(void (*)(void))towline_py_ends, METH_FASTCALL,
     "ends(robot, poses, carriers, anchors, attachments)\n--\n\nCompute where the cables end at each pose."},
    {"cable_distances", (PyCFunction)(void (*)(void))towline_py_cable_distances, METH_FASTCALL,
     "cable_distances(robot, poses, carriers, distances)\n--\n\n"
     "Compute the distances of all pairs of cables at each pose."},
    {"columns_by_geometry", (PyCFunction)(void (*)(void))towline_py_columns_by_geometry, METH_FASTCALL,
     "columns_by_geometry(robot, poses, carriers, S)\n--\n\n"
     "Compute the columns of the wrench matrix with respect to anchors, attachments and radii, (m, 6, 7) a row."},
    {"wrench_by_pose", (PyCFunction)(void (*)(void))towline_py_wrench_by_pose, METH_FASTCALL,
     "wrench_by_pose(robot, poses, carriers, tensions, D)\n--\n\n"
     "Compute the wrench of constant tensions with respect to the pose, (6, 6) a row."},
    {"wrench_by_axes", (PyCFunction)(void (*)(void))towline_py_wrench_by_axes, METH_FASTCALL,
     "wrench_by_axes(robot, poses, carriers, tensions, D)\n--\n\n"
     "The same with respect to displacements of the CoM and turns about it, along and about the axes of {G}."},
    {"horizon_size", (PyCFunction)(void (*)(void))towline_py_horizon_size, METH_FASTCALL,
     "horizon_size(N, n, m, p)\n--\n\n"
     "Return how many numbers of memory a horizon of N stages, n states, m controls and p soft rows needs."},
    {"horizon_places", (PyCFunction)(void (*)(void))towline_py_horizon_places, METH_FASTCALL,
     "horizon_places(N, n, m, p, memory)\n--\n\nReturn where in memory the arrays of problem and solution begin."},
    {"horizon_relative_to", (PyCFunction)(void (*)(void))towline_py_horizon_relative_to, METH_FASTCALL,
     "horizon_relative_to(N, n, m, p, processor, states, controls, memory)\n--\n\n"
     "Write the same problem in differences from a reference."},
    {"horizon_solve", (PyCFunction)(void (*)(void))towline_py_horizon_solve, METH_FASTCALL,
     "horizon_solve(N, n, m, p, processor, beginning, iterations_max, tolerance, memory, residuals)\n--\n\n"
     "Solve the problem in memory; return how many iterations it took, and whether it converged."},
    {"control_take", (PyCFunction)(void (*)(void))towline_py_control_take, METH_FASTCALL,
     "control_take(state, reference, robot, measured, cables, wanted, carriers, t_ref)\n--\n\n"
     "Copy a state and a reference, arrays of float64, to where the other functions read them."},
    {"control_step", (PyCFunction)(void (*)(void))towline_py_control_step, METH_FASTCALL,
     "control_step(dt, since, length, solves, state, reference, robot, controller, late, measured, wanted, carriers, "
     "cables, platform, memory, problems)\n--\n\n"
     "Take a state and a reference unless they are None, update the memory of each row, write the problem of tension "
     "distribution of this step, and solve it if `solves` is 1, or 2: in lanes. Return how many cables count as cut, "
     "and how many rows are optimal."},
    {"control_thrusts", (PyCFunction)(void (*)(void))towline_py_control_thrusts, METH_FASTCALL,
     "control_thrusts(dt, robot, controller, measured, carriers, tensions, cables, platform, memory, turning, "
     "actuation)\n--\n\n"
     "Write the commands of the actuators of flying carriers; return the most that a thrust lacks [N]."},
    {"control_move_on", (PyCFunction)(void (*)(void))towline_py_control_move_on, METH_FASTCALL,
     "control_move_on(dt, robot, disturbance, tensions, accelerations, measured)\n--\n\n"
     "Move motions that were measured earlier on, with the tensions (parts, N, m) since."},
    {"control_stages", (PyCFunction)(void (*)(void))towline_py_control_stages, METH_FASTCALL,
     "control_stages(robot, freed, tethers, steps, disturbance, carriers, states, controls, A, B, c)\n--\n\n"
     "Write the dynamics of stages to first order about states and controls."},
    {"control_aim", (PyCFunction)(void (*)(void))towline_py_control_aim, METH_FASTCALL,
     "control_aim(length, A, B, c, steps, efforts, wanted, planned)\n--\n\n"
     "Change a reference the least so that the platform obeys the dynamics of stages."},
    {"control_coordinates", (PyCFunction)(void (*)(void))towline_py_control_coordinates, METH_FASTCALL,
     "control_coordinates(robot, tethers, motions, coordinates)\n--\n\n"
     "Compute the coordinates that tethers leave carriers, and two derivatives over time."},
    {"control_carriers", (PyCFunction)(void (*)(void))towline_py_control_carriers, METH_FASTCALL,
     "control_carriers(robot, tethers, motion, carriers)\n--\n\n"
     "Compute how carriers move if the platform and those coordinates do."},
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
                   PyModule_AddIntConstant(module, "MARGIN_CABLES", TOWLINE_MARGIN_CABLES) < 0 ||
                   PyModule_AddIntConstant(module, "MOST_CABLES", TOWLINE_MOST_CABLES) < 0 ||
                   PyModule_AddIntConstant(module, "PROCESSOR", towline_processor()) < 0 ||
                   PyModule_AddIntConstant(module, "MOST_CARRIERS", TOWLINE_MOST_CARRIERS) < 0)) {
        Py_DECREF(module);
        return NULL;
    }
    return module;
}
