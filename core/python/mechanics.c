/* The mechanics of a robot at many poses, for Python. */
#include "mechanics/mechanics.h"

#include "python/arrays.h"
#include "python/extension.h"

/* The robot and the poses with which a call begins; return whether they fit each other. */
static int places_of(const arrays *given, const towline_robot **robot, towline_places *at) {
    enum { ROBOT, POSES, CARRIERS };
    *robot = robot_of(given);
    if (!*robot || !given->of[POSES] || !given->of[CARRIERS] || given->size[POSES] % 6 != 0) {
        return 0;
    }
    const Py_ssize_t carriers = 6 * (*robot)->carriers, rows = given->size[POSES] / 6;
    const int shared = given->size[CARRIERS] == carriers;
    const towline_places places = {rows, given->of[POSES], given->of[CARRIERS], shared ? 0 : carriers};
    *at = places;
    return shared || given->size[CARRIERS] == rows * carriers;
}

TOWLINE_PY(lines) {
    enum { ROBOT, POSES, CARRIERS, LENGTHS, A, J, ANCHORS, SENSITIVITY, ALL };
    arrays given;
    const towline_robot *robot;
    towline_places at;
    if (!take(&given, arguments, count, ALL, LENGTHS)) {
        return NULL;
    }
    int fits = places_of(&given, &robot, &at);
    for (int i = LENGTHS; i < ALL && fits; i++) {
        const Py_ssize_t per_cable[] = {1, 6, 6, 3, 7};
        fits = !given.of[i] || given.size[i] == at.rows * robot->cables * per_cable[i - LENGTHS];
    }
    if (fits) {
        const towline_lines want = {given.of[LENGTHS], given.of[A], given.of[J], given.of[ANCHORS],
                                    given.of[SENSITIVITY]};
        Py_BEGIN_ALLOW_THREADS;
        towline_lines_of_rows(robot, at, want);
        Py_END_ALLOW_THREADS;
    }
    return done(&given, fits);
}

TOWLINE_PY(ends) {
    enum { ROBOT, POSES, CARRIERS, ANCHORS, ATTACHMENTS, ALL };
    arrays given;
    const towline_robot *robot;
    towline_places at;
    if (!take(&given, arguments, count, ALL, ANCHORS)) {
        return NULL;
    }
    int fits = places_of(&given, &robot, &at);
    for (int i = ANCHORS; i < ALL && fits; i++) {
        fits = given.of[i] && given.size[i] == 3 * robot->cables * at.rows;
    }
    if (fits) {
        Py_BEGIN_ALLOW_THREADS;
        towline_ends(robot, at, given.of[ANCHORS], given.of[ATTACHMENTS]);
        Py_END_ALLOW_THREADS;
    }
    return done(&given, fits);
}

TOWLINE_PY(cable_distances) {
    enum { ROBOT, POSES, CARRIERS, DISTANCES, ALL };
    arrays given;
    const towline_robot *robot;
    towline_places at;
    if (!take(&given, arguments, count, ALL, DISTANCES)) {
        return NULL;
    }
    const int fits = places_of(&given, &robot, &at) && given.of[DISTANCES] &&
                     given.size[DISTANCES] == at.rows * (robot->cables * (robot->cables - 1) / 2);
    if (fits) {
        Py_BEGIN_ALLOW_THREADS;
        towline_cable_distances(robot, at, given.of[DISTANCES]);
        Py_END_ALLOW_THREADS;
    }
    return done(&given, fits);
}

TOWLINE_PY(columns_by_geometry) {
    enum { ROBOT, POSES, CARRIERS, S, ALL };
    arrays given;
    const towline_robot *robot;
    towline_places at;
    if (!take(&given, arguments, count, ALL, S)) {
        return NULL;
    }
    const int fits = places_of(&given, &robot, &at) && given.of[S] && given.size[S] == 42 * robot->cables * at.rows;
    if (fits) {
        Py_BEGIN_ALLOW_THREADS;
        towline_columns_by_geometry(robot, at, given.of[S]);
        Py_END_ALLOW_THREADS;
    }
    return done(&given, fits);
}

/* The derivative of the wrench of tensions along the coordinates of the pose, or `by_axes`. */
static PyObject *wrench_derivative(PyObject *const *arguments, Py_ssize_t count, int by_axes) {
    enum { ROBOT, POSES, CARRIERS, TENSIONS, D, ALL };
    arrays given;
    const towline_robot *robot;
    towline_places at;
    if (!take(&given, arguments, count, ALL, D)) {
        return NULL;
    }
    const int fits = places_of(&given, &robot, &at) && given.of[TENSIONS] && given.of[D] &&
                     given.size[TENSIONS] == robot->cables * at.rows && given.size[D] == 36 * at.rows;
    if (fits) {
        Py_BEGIN_ALLOW_THREADS;
        towline_wrench_by_pose(robot, at, given.of[TENSIONS], by_axes, given.of[D]);
        Py_END_ALLOW_THREADS;
    }
    return done(&given, fits);
}

TOWLINE_PY(wrench_by_pose) { return wrench_derivative(arguments, count, 0); }

TOWLINE_PY(wrench_by_axes) { return wrench_derivative(arguments, count, 1); }

TOWLINE_PY(required_wrench) {
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
            towline_required_wrench(robot, rows, motion, shared ? 0 : 3, given.of[W]);
            Py_END_ALLOW_THREADS;
        }
    }
    return done(&given, fits);
}
