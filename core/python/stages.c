/* The model of predictive control for Python: its stages, the reference that obeys them, and tethered carriers. */
#include "control/control.h"

#include <string.h>

#include "python/arrays.h"
#include "python/extension.h"

enum { STATES = 12, ORDER = 18, MOST_MOVED = 6 * TOWLINE_MOST_CARRIERS, MOST_STAGES = 100000 };

/* Matrices of stages as an array has them. */
typedef struct {
    Py_buffer view;
    int taken;
    Py_ssize_t stages, rows, columns;
    towline_matrices of;
} matrices;

/* Take matrices (N, rows, columns), or rows (N, columns), whose columns are side by side; return 0 with an exception. */
static int take_matrices(PyObject *array, matrices *to) {
    to->taken = view_of(array, &to->view, PyBUF_STRIDES | PyBUF_WRITABLE) == 0;
    if (!to->taken) { return 0; }
    const Py_buffer *view = &to->view;
    const int last = view->ndim - 1;
    if (last < 1 || last > 2 || view->itemsize != DOUBLE || (view->shape[last] > 1 && view->strides[last] != DOUBLE)) {
        PyErr_SetString(PyExc_ValueError, "the matrices must be rows of float64 whose numbers are side by side");
        return 0;
    }
    to->stages = view->shape[0];
    to->rows = last == 2 ? view->shape[1] : 1;
    to->columns = view->shape[last];
    to->of.at = view->buf;
    to->of.stage = view->strides[0] / DOUBLE;
    to->of.row = last == 2 ? view->strides[1] / DOUBLE : 1;
    return 1;
}

/* A, B and c of all stages. */
typedef struct {
    matrices A, B, c;
} dynamics;

static void release_dynamics(dynamics *from) {
    matrices *const all[] = {&from->A, &from->B, &from->c};
    for (int i = 0; i < 3; i++) {
        if (all[i]->taken) { PyBuffer_Release(&all[i]->view); }
    }
}

/* Take three arguments; return 0 with an exception if they are no matrices, or not of as many stages and states. */
static int take_dynamics(PyObject *const *arguments, dynamics *to) {
    to->A.taken = to->B.taken = to->c.taken = 0;
    if (!take_matrices(arguments[0], &to->A) || !take_matrices(arguments[1], &to->B) ||
        !take_matrices(arguments[2], &to->c)) {
        release_dynamics(to);
        return 0;
    }
    const Py_ssize_t stages = to->A.stages, n = to->A.columns;
    if (to->A.rows != n || n < STATES || n > STATES + 2 * MOST_MOVED || n % 2 || to->B.rows != n || to->c.rows != 1 ||
        to->c.columns != n || to->B.stages != stages || to->c.stages != stages || stages > MOST_STAGES) {
        PyErr_SetString(PyExc_ValueError, "the matrices must be A (N, n, n), B (N, n, u) and c (N, n)");
        release_dynamics(to);
        return 0;
    }
    return 1;
}

static towline_stages stages_of(const dynamics *from, const double *steps) {
    return (towline_stages){(int)from->A.stages, steps, from->A.of, from->B.of, from->c.of};
}

/* Return how many tethers an array has whose carriers and cables are those of a robot, or -1. */
static int tethers_of(const arrays *given, int index, const towline_robot *robot) {
    const Py_ssize_t count = given->view[index].len / (Py_ssize_t)sizeof(towline_tether);
    const towline_tether *tethers = (const void *)given->of[index];
    if (given->size[index] * DOUBLE != count * (Py_ssize_t)sizeof(towline_tether) || count > robot->carriers) {
        return -1;
    }
    for (Py_ssize_t k = 0; k < count; k++) {
        const towline_tether *tether = &tethers[k];
        if (tether->carrier < 0 || tether->carrier >= robot->carriers || tether->cables < 1 ||
            tether->cables > TOWLINE_MOST_TETHERS) {
            return -1;
        }
        for (int j = 0; j < tether->cables; j++) {
            if (tether->cable[j] < 0 || tether->cable[j] >= robot->cables) { return -1; }
        }
    }
    return (int)count;
}

/* Set the coordinates that are moved; return 0 if there are none such. */
static int moved_of(const arrays *given, int freed, int tethers, const towline_robot *robot, towline_moved *moved) {
    const Py_ssize_t count = given->size[freed] / 2;
    const int tethered = tethers_of(given, tethers, robot);
    if (count > MOST_MOVED || tethered < 0 || given->size[freed] % 2) { return 0; }
    *moved = (towline_moved){(int)count, (const void *)given->of[freed], tethered, (const void *)given->of[tethers]};
    for (Py_ssize_t f = 0; f < count; f++) {
        const int64_t carrier = moved->coordinates[2 * f], coordinate = moved->coordinates[2 * f + 1];
        if (carrier < 0 || carrier >= robot->carriers || coordinate < 0 || coordinate >= 6) { return 0; }
    }
    return towline_moved_count(*moved) <= MOST_MOVED;
}

TOWLINE_PY(control_stages) {
    enum { ROBOT, FREED, TETHERS, STEPS, DISTURBANCE, CARRIERS, AT_STATES, CONTROLS, ALL };
    arrays given;
    dynamics to;
    towline_moved moved;
    if (!take(&given, arguments, count - 3, ALL, ALL)) { return NULL; }
    if (!take_dynamics(arguments + ALL, &to)) {
        release(&given);
        return NULL;
    }
    const towline_robot *robot = robot_of(&given);
    int fits = robot && moved_of(&given, FREED, TETHERS, robot, &moved);
    if (fits) {
        const Py_ssize_t stages = to.A.stages, n = to.A.columns, u = to.B.columns, free = towline_moved_count(moved);
        fits = n == STATES + 2 * free && u == robot->cables + free && given.size[STEPS] == stages &&
               given.size[DISTURBANCE] == 6 && given.size[CARRIERS] >= stages * STATES * robot->carriers &&
               given.size[AT_STATES] >= stages * n && given.size[CONTROLS] == stages * u;
    }
    if (fits) {
        Py_BEGIN_ALLOW_THREADS;
        towline_write_stages(robot, moved, given.of[DISTURBANCE], given.of[CARRIERS], given.of[AT_STATES],
                             given.of[CONTROLS], stages_of(&to, given.of[STEPS]));
        Py_END_ALLOW_THREADS;
    }
    release_dynamics(&to);
    return done(&given, fits);
}

TOWLINE_PY(control_aim) {
    enum { LENGTH, A, B, C, FIRST };
    enum { STEPS, EFFORTS, WANTED, PLANNED, ALL };
    arrays given;
    dynamics of;
    if (!take(&given, arguments + FIRST, count - FIRST, ALL, WANTED)) { return NULL; }
    const double length = PyFloat_AsDouble(arguments[LENGTH]);
    if (PyErr_Occurred() || !take_dynamics(arguments + A, &of)) {
        release(&given);
        return NULL;
    }
    const Py_ssize_t stages = of.A.stages, n = of.A.columns, u = of.B.columns;
    const Py_ssize_t moved = (n - STATES) / 2, sizes[ALL] = {stages, u, (1 + stages) * n, (1 + stages) * u};
    int fits = u > moved && u - moved <= TOWLINE_MOST_CABLES;
    for (int i = 0; i < ALL; i++) { fits = fits && given.of[i] && given.size[i] == sizes[i]; }
    if (fits) {
        towline_aim(stages_of(&of, given.of[STEPS]), (int)(u - moved), (int)moved, length, given.of[EFFORTS],
                    given.of[WANTED], given.of[PLANNED]);
    }
    release_dynamics(&of);
    return done(&given, fits);
}

TOWLINE_PY(control_coordinates) {
    enum { ROBOT, TETHERS, MOTIONS, COORDINATES, ALL };
    arrays given;
    if (!take(&given, arguments, count, ALL, COORDINATES)) { return NULL; }
    const towline_robot *robot = robot_of(&given);
    const int tethered = robot ? tethers_of(&given, TETHERS, robot) : -1;
    int fits = tethered >= 0;
    if (fits) {
        const towline_tether *tethers = (const void *)given.of[TETHERS];
        const Py_ssize_t motion = ORDER * (1 + robot->carriers), rows = given.size[MOTIONS] / motion;
        const Py_ssize_t found = 3 * towline_moved_count((towline_moved){0, NULL, tethered, tethers});
        fits = given.size[MOTIONS] == rows * motion && given.size[COORDINATES] == rows * found;
        for (Py_ssize_t row = 0; fits && row < rows; row++) {
            towline_tethered_coordinates(robot, tethered, tethers, given.of[MOTIONS] + row * motion,
                                         given.of[COORDINATES] + row * found);
        }
    }
    return done(&given, fits);
}

TOWLINE_PY(control_carriers) {
    enum { ROBOT, TETHERS, MOTION, CARRIERS, ALL };
    arrays given;
    if (!take(&given, arguments, count, ALL, CARRIERS)) { return NULL; }
    const towline_robot *robot = robot_of(&given);
    const int tethered = robot ? tethers_of(&given, TETHERS, robot) : -1;
    int fits = tethered >= 0 && given.size[CARRIERS] == ORDER * robot->carriers;
    if (fits) {
        const towline_tether *tethers = (const void *)given.of[TETHERS];
        const int free = towline_moved_count((towline_moved){0, NULL, tethered, tethers});
        fits = given.size[MOTION] == 3 * (6 + free);
        if (fits) { towline_tethered_carriers(robot, tethered, tethers, given.of[MOTION], given.of[CARRIERS]); }
    }
    return done(&given, fits);
}
