/* The mechanics of a robot at many poses, for Python. */
#include "mechanics/mechanics.h"

#include "python/arrays.h"
#include "python/extension.h"

/* The arrays with which a call begins. */
enum { ROBOT, POSES, CARRIERS, PLACES };

/* A call at many poses; without a robot that fits them there are no cables. */
typedef struct {
    arrays given;
    const towline_robot *robot;
    towline_places at;
    Py_ssize_t cables; /* of all poses */
    int fits;
} call;

/* Take the arrays of a call, of which those from `results` on are written to; return 0 with an exception if one is none. */
static int take_call(call *to, PyObject *const *arguments, Py_ssize_t count, int wanted, int results) {
    const arrays *given = &to->given;
    if (!take(&to->given, arguments, count, wanted, results)) { return 0; }
    const towline_robot *robot = robot_of(given);
    const Py_ssize_t carriers = robot ? 6 * robot->carriers : 0, rows = given->size[POSES] / 6;
    const int shared = given->size[CARRIERS] == carriers;
    to->robot = robot;
    to->at = (towline_places){rows, given->of[POSES], given->of[CARRIERS], shared ? 0 : carriers};
    to->cables = robot ? rows * robot->cables : 0;
    to->fits =
        robot && has_size(given, POSES, 6 * rows) && has_size(given, CARRIERS, shared ? carriers : rows * carriers);
    return 1;
}

TOWLINE_PY(lines) {
    enum { LENGTHS = PLACES, A, J, ANCHORS, SENSITIVITY, ALL };
    call of;
    if (!take_call(&of, arguments, count, ALL, LENGTHS)) { return NULL; }
    double *const *to = of.given.of;
    for (int i = LENGTHS; i < ALL; i++) {
        const Py_ssize_t per_cable[] = {1, 6, 6, 3, 7};
        of.fits &= !to[i] || of.given.size[i] == of.cables * per_cable[i - LENGTHS];
    }
    const towline_lines want = {to[LENGTHS], to[A], to[J], to[ANCHORS], to[SENSITIVITY]};
    FINISH(&of.given, of.fits, towline_lines_of_rows(of.robot, of.at, want));
}

TOWLINE_PY(ends) {
    enum { ANCHORS = PLACES, ATTACHMENTS, ALL };
    call of;
    if (!take_call(&of, arguments, count, ALL, ANCHORS)) { return NULL; }
    double *const *to = of.given.of;
    of.fits &= has_size(&of.given, ANCHORS, 3 * of.cables) && has_size(&of.given, ATTACHMENTS, 3 * of.cables);
    FINISH(&of.given, of.fits, towline_ends(of.robot, of.at, to[ANCHORS], to[ATTACHMENTS]));
}

TOWLINE_PY(cable_distances) {
    enum { DISTANCES = PLACES, ALL };
    call of;
    if (!take_call(&of, arguments, count, ALL, DISTANCES)) { return NULL; }
    of.fits = of.fits && has_size(&of.given, DISTANCES, of.cables * (of.robot->cables - 1) / 2);
    FINISH(&of.given, of.fits, towline_cable_distances(of.robot, of.at, of.given.of[DISTANCES]));
}

TOWLINE_PY(columns_by_geometry) {
    enum { S = PLACES, ALL };
    call of;
    if (!take_call(&of, arguments, count, ALL, S)) { return NULL; }
    of.fits &= has_size(&of.given, S, 42 * of.cables);
    FINISH(&of.given, of.fits, towline_columns_by_geometry(of.robot, of.at, of.given.of[S]));
}

/* The derivative of the wrench of tensions along the coordinates of the pose, or `by_axes`. */
static PyObject *wrench_derivative(PyObject *const *arguments, Py_ssize_t count, int by_axes) {
    enum { TENSIONS = PLACES, D, ALL };
    call of;
    if (!take_call(&of, arguments, count, ALL, D)) { return NULL; }
    double *const *to = of.given.of;
    of.fits &= has_size(&of.given, TENSIONS, of.cables) && has_size(&of.given, D, 36 * of.at.rows);
    FINISH(&of.given, of.fits, towline_wrench_by_pose(of.robot, of.at, to[TENSIONS], by_axes, to[D]));
}

TOWLINE_PY(wrench_by_pose) { return wrench_derivative(arguments, count, 0); }

TOWLINE_PY(wrench_by_axes) { return wrench_derivative(arguments, count, 1); }

TOWLINE_PY(required_wrench) {
    enum { VELOCITIES = POSES + 1, ACCELERATIONS, WIND, W, ALL };
    arrays given;
    if (!take(&given, arguments, count, ALL, W)) { return NULL; }
    const towline_robot *robot = robot_of(&given);
    const Py_ssize_t rows = given.size[POSES] / 6, numbers = 6 * rows;
    const int shared = given.size[WIND] == 3;
    const int fits = robot && has_size(&given, POSES, numbers) && given.size[VELOCITIES] == numbers &&
                     given.size[ACCELERATIONS] == numbers && has_size(&given, W, numbers) &&
                     (!given.of[WIND] || shared || given.size[WIND] == 3 * rows);
    const towline_motion_of_platform motion = {given.of[POSES], given.of[VELOCITIES], given.of[ACCELERATIONS],
                                               given.of[WIND]};
    FINISH(&given, fits, towline_required_wrench(robot, rows, motion, shared ? 0 : 3, given.of[W]));
}
