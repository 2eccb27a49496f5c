/* The mechanics of a robot for Python: lines and required wrenches of rows. */
#include "mechanics/mechanics.h"

#include "python/arrays.h"
#include "python/extension.h"

PyObject *towline_py_lines(PyObject *module, PyObject *const *arguments, Py_ssize_t count) {
    (void)module;
    enum { ROBOT, POSES, CARRIERS, LENGTHS, A, J, ANCHORS, SENSITIVITY, ALL };
    arrays given;
    if (!take(&given, arguments, count, ALL, LENGTHS)) {
        return NULL;
    }
    const towline_robot *robot = robot_of(&given);
    int fits = robot && given.of[POSES] && given.of[CARRIERS] && given.size[POSES] % 6 == 0;
    if (fits) {
        const Py_ssize_t rows = given.size[POSES] / 6, m = robot->cables, carriers = 6 * robot->carriers;
        const Py_ssize_t per_row[] = {m, 6 * m, 6 * m, 3 * m, 7 * m};
        const int shared = given.size[CARRIERS] == carriers;
        fits = shared || given.size[CARRIERS] == rows * carriers;
        for (int i = LENGTHS; i < ALL; i++) {
            fits = fits && (!given.of[i] || given.size[i] == rows * per_row[i - LENGTHS]);
        }
        if (fits) {
            const towline_lines want = {given.of[LENGTHS], given.of[A], given.of[J], given.of[ANCHORS],
                                        given.of[SENSITIVITY]};
            Py_BEGIN_ALLOW_THREADS;
            if (rows == 1) {
                towline_lines_at(robot, given.of[POSES], given.of[CARRIERS], want);
            } else {
                towline_lines_of_rows(robot, rows, given.of[POSES], given.of[CARRIERS], shared ? 0 : carriers, want);
            }
            Py_END_ALLOW_THREADS;
        }
    }
    return done(&given, fits);
}

PyObject *towline_py_required_wrench(PyObject *module, PyObject *const *arguments, Py_ssize_t count) {
    (void)module;
    enum { ROBOT, POSES, VELOCITIES, ACCELERATIONS, WIND, W, ALL };
    arrays given;
    if (!take(&given, arguments, count, ALL, W)) {
        return NULL;
    }
    const towline_robot *robot = robot_of(&given);
    int fits = robot && given.of[POSES] && given.size[POSES] % 6 == 0 && given.of[W];
    if (fits) {
        const Py_ssize_t rows = given.size[POSES] / 6;
        const int shared = given.size[WIND] == 3;
        for (int i = VELOCITIES; i < ALL; i++) {
            fits = fits && (i == WIND || given.size[i] == 6 * rows);
        }
        fits = fits && (!given.of[WIND] || shared || given.size[WIND] == 3 * rows);
        if (fits) {
            const towline_motion_of_platform motion = {given.of[POSES], given.of[VELOCITIES], given.of[ACCELERATIONS],
                                                       given.of[WIND]};
            Py_BEGIN_ALLOW_THREADS;
            if (rows == 1) {
                towline_required_wrench(robot, motion, given.of[W]);
            } else {
                towline_required_wrench_of_rows(robot, rows, motion, shared ? 0 : 3, given.of[W]);
            }
            Py_END_ALLOW_THREADS;
        }
    }
    return done(&given, fits);
}
