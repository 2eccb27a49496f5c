/* The step of a controller for Python: what it is given, and what core/control does with it. */
#include "control/control.h"

#include <math.h>
#include <string.h>

#include "batch/batch.h"
#include "control/configuration.h"
#include "python/arrays.h"
#include "python/extension.h"

/* Where an array of a state or a reference goes: (inner), or (outer, inner) with outer > 0, in each row. */
typedef struct {
    double *to; /* NULL: only its shape matters */
    Py_ssize_t row, outer_step, inner_step;
    Py_ssize_t outer, inner;
} place;

static int has_shape(const Py_buffer *view, Py_ssize_t rows, const place *at) {
    const int core = at->outer ? 2 : 1, lead = view->ndim - core;
    if (!view->format || strcmp(view->format, "d") != 0 || lead < 0 || lead > 1 || (lead && view->shape[0] != rows)) {
        return 0;
    }
    return view->shape[view->ndim - 1] == at->inner && (!at->outer || view->shape[lead] == at->outer);
}

/* Copy an array of each row, or of all rows, to its place; return 0 with an exception if it is no such array. */
static int put(PyObject *array, Py_ssize_t rows, place at) {
    Py_buffer view;
    if (view_of(array, &view, PyBUF_STRIDED_RO | PyBUF_FORMAT) < 0) { return 0; }
    const int fits = has_shape(&view, rows, &at);
    if (!fits) {
        PyErr_SetString(PyExc_ValueError, "the array must be of float64 and of the shape that fits the robot");
    } else if (at.to) {
        const int last = view.ndim - 1, batch = view.ndim > (at.outer ? 2 : 1);
        for (Py_ssize_t row = 0; row < rows; row++) {
            for (Py_ssize_t i = 0; i < (at.outer ? at.outer : 1); i++) {
                const char *from = (const char *)view.buf + (batch ? row * view.strides[0] : 0) +
                                   (at.outer ? i * view.strides[last - 1] : 0);
                for (Py_ssize_t j = 0; j < at.inner; j++) {
                    memcpy(at.to + row * at.row + i * at.outer_step + j * at.inner_step, from + j * view.strides[last],
                           sizeof(double));
                }
            }
        }
    }
    PyBuffer_Release(&view);
    return fits;
}

/* Whether the arrays of a call, as far as they are there, have so many rows of their sizes. */
static int have_rows(const arrays *given, int first, int last, Py_ssize_t rows, const Py_ssize_t *sizes) {
    int fits = 1;
    for (int i = first; i < last; i++) { fits = fits && (!given->of[i] || given->size[i] == rows * sizes[i]); }
    return fits;
}

static const Py_ssize_t PER_CABLE = sizeof(towline_cable_memory) / sizeof(double);
static const Py_ssize_t PER_PLATFORM = sizeof(towline_platform_memory) / sizeof(double);
static const Py_ssize_t PER_CARRIER = sizeof(towline_carrier_memory) / sizeof(double);
static const Py_ssize_t PER_TURNING = sizeof(towline_turning) / sizeof(double);

enum { ORDER = 18, MOST_PARTS = 1000000 }; /* numbers of pose, velocity and acceleration; and of parts of a time */

enum { TENSIONS_OF_STATE = 4 }; /* place in its tuple */

/* Put the pose and the velocity of all bodies in a state, and its tensions; return 0 with an exception if they do not fit. */
static int put_state(PyObject *state, const towline_robot *robot, Py_ssize_t rows, double *measured, double *cables) {
    enum { POSE, CARRIER_POSE = 2 };
    const Py_ssize_t c = robot->carriers, m = robot->cables, motions = MOTION * (1 + c);
    for (int order = 0; order < 2; order++) {
        double *motion = measured + 6 * order;
        if (!put(PyTuple_GetItem(state, POSE + order), rows, (place){motion, motions, 0, 1, 0, 6}) ||
            !put(PyTuple_GetItem(state, CARRIER_POSE + order), rows,
                 (place){motion + MOTION, motions, MOTION, 1, c, 6})) {
            return 0;
        }
    }
    PyObject *tensions = PyTuple_GetItem(state, TENSIONS_OF_STATE);
    return tensions == Py_None || put(tensions, rows, (place){cables, m * PER_CABLE, 0, PER_CABLE, 0, m});
}

/* The same of a reference; where it has no tensions they are zero, and where carriers have no orders these are NULL. */
static int put_reference(PyObject *reference, const towline_robot *robot, Py_ssize_t rows, double *wanted,
                         double *carriers, double *t_ref) {
    enum { POSE, CARRIER_POSE = 3, TENSIONS = 6 };
    const Py_ssize_t c = robot->carriers, m = robot->cables;
    for (int order = 0; order < 3; order++) {
        double *motion = carriers ? carriers + 6 * order : NULL;
        if (!put(PyTuple_GetItem(reference, POSE + order), rows, (place){wanted + 6 * order, ORDER, 0, 1, 0, 6}) ||
            !put(PyTuple_GetItem(reference, CARRIER_POSE + order), rows, (place){motion, c * ORDER, ORDER, 1, c, 6})) {
            return 0;
        }
    }
    memset(t_ref, 0, (size_t)(rows * m) * sizeof *t_ref);
    PyObject *tensions = PyTuple_GetItem(reference, TENSIONS);
    return tensions == Py_None || put(tensions, rows, (place){t_ref, m, 0, 1, 0, m});
}

/* Whether state and reference are tuples as of control/controller.py. */
static int are_given(PyObject *state, PyObject *reference) {
    return PyTuple_Check(state) && PyTuple_Size(state) >= 5 && PyTuple_Check(reference) && PyTuple_Size(reference) >= 7;
}

/* Release the arrays, and return a number, or NULL with an exception if they do not fit. */
static PyObject *number_done(arrays *given, int fits, double number) {
    PyObject *nothing = done(given, fits);
    Py_XDECREF(nothing);
    return nothing ? PyFloat_FromDouble(number) : NULL;
}

/* Return the controller if the second array is the record of one, else NULL. */
static const towline_controller *controller_of(const arrays *given) {
    const int is_one = given->of[1] && given->view[1].len == (Py_ssize_t)sizeof(towline_controller);
    return is_one ? (const void *)given->of[1] : NULL;
}

/* Take numbers before the arrays of a call; return 0 with an exception if one is none. */
static int take_numbers(PyObject *const *arguments, Py_ssize_t count, int wanted, double *numbers) {
    for (int i = 0; i < wanted && i < count; i++) { numbers[i] = PyFloat_AsDouble(arguments[i]); }
    return !PyErr_Occurred();
}

/* The rows of problems of tension distribution in one block of memory, which solvers/in_place.py has as arrays. */
typedef struct {
    double *A, *w, *low, *high, *t_ref, *tensions, *direction, *info, *residual, *status;
} problems;

enum { WRENCH = 6, INFO = 2 };

/* How many numbers the problem of one row has. */
static Py_ssize_t numbers_of_problem(Py_ssize_t m) { return WRENCH * m + WRENCH + 4 * m + WRENCH + INFO + 2; }

static problems problems_in(double *block, Py_ssize_t rows, Py_ssize_t m) {
    problems at;
    at.A = block;
    at.w = at.A + rows * WRENCH * m;
    at.low = at.w + rows * WRENCH;
    at.high = at.low + rows * m;
    at.t_ref = at.high + rows * m;
    at.tensions = at.t_ref + rows * m;
    at.direction = at.tensions + rows * m;
    at.info = at.direction + rows * WRENCH;
    at.residual = at.info + rows * INFO;
    at.status = at.residual + rows;
    return at;
}

/* Solve the problems of all rows; return how many are optimal. */
static Py_ssize_t solve_all(problems at, Py_ssize_t rows, int m, double length, int in_lanes) {
    const towline_batch batch = {
        .n = WRENCH,
        .m = m,
        .A = {at.A, WRENCH * m},
        .w = {at.w, WRENCH},
        .t_min = {at.low, m},
        .t_max = {at.high, m},
        .t_ref = {at.t_ref, m},
        .length = {&length, 0},
        .tensions = at.tensions,
        .direction = at.direction,
        .info = at.info,
        .residual = at.residual,
        .status = at.status,
    };
    return towline_solve_batch(&batch, rows, in_lanes);
}

/* Count the rows whose pose is farther from its reference than a distance [m] or an angle [rad], or no number. */
static Py_ssize_t count_far(const double *measured, Py_ssize_t motions, const double *wanted, Py_ssize_t rows,
                            const double most[2]) {
    const double cosine = cos(most[1]);
    Py_ssize_t near = 0;
    for (Py_ssize_t row = 0; row < rows; row++, measured += motions, wanted += ORDER) {
        const double off[3] = {measured[0] - wanted[0], measured[1] - wanted[1], measured[2] - wanted[2]};
        const attitude now = attitude_of(measured + 3), planned = attitude_of(wanted + 3);
        near += dot(off, off) <= most[0] * most[0] && cosine_between(now.R, planned.R) >= cosine;
    }
    return rows - near;
}

/* Take it that what drives gave since the last step acted, and was delivered if nothing is `sensed`. */
static void hear_command(towline_cable_memory *cables, Py_ssize_t count, int sensed) {
    for (Py_ssize_t i = 0; i < count; i++) {
        cables[i].then = cables[i].given;
        cables[i].measured = sensed ? cables[i].measured : cables[i].then;
    }
}

/* The arrays of a step, after its numbers. */
enum { ROBOT, CONTROLLER, LATE, MEASURED, REFERENCE, CARRIERS, CABLES, PLATFORM, MEMORY, PROBLEMS, STEP_ARRAYS };

/* Update the memory of all rows, and write their problems. */
static void write_problems(const towline_robot *robot, const towline_controller *controller, double dt, double since,
                           Py_ssize_t rows, const arrays *given, problems at) {
    const Py_ssize_t m = robot->cables, c = robot->carriers, motions = MOTION * (1 + c);
    double *const *of = given->of;
    for (Py_ssize_t row = 0; row < rows; row++) {
        const towline_row here = {
            .measured = of[MEASURED] + row * motions,
            .late = of[LATE] ? of[LATE] + row * motions : NULL,
            .reference = of[REFERENCE] + row * ORDER,
            .t_ref = at.t_ref + row * m,
            .carriers = of[CARRIERS] ? of[CARRIERS] + row * c * ORDER : NULL,
            .cables = (towline_cable_memory *)(void *)of[CABLES] + row * m,
            .platform = (towline_platform_memory *)(void *)of[PLATFORM] + row,
            .carrier_memory = of[MEMORY] ? (towline_carrier_memory *)(void *)of[MEMORY] + row * c : NULL,
            .A = at.A + row * WRENCH * m,
            .w = at.w + row * WRENCH,
            .low = at.low + row * m,
            .high = at.high + row * m,
        };
        towline_write_problem(robot, controller, dt, since, here);
    }
}

/* Whether the arrays of a step fit the robot, of so many rows. */
static int are_of_step(const arrays *given, const towline_robot *robot, const towline_controller *controller,
                       Py_ssize_t rows) {
    const Py_ssize_t m = robot->cables, c = robot->carriers, motions = MOTION * (1 + c);
    const Py_ssize_t sizes[STEP_ARRAYS] = {
        0, 0, motions, motions, ORDER, ORDER * c, m * PER_CABLE, PER_PLATFORM, c * PER_CARRIER, numbers_of_problem(m),
    };
    int fits = have_rows(given, LATE, STEP_ARRAYS, rows, sizes);
    for (int i = MEASURED; i < STEP_ARRAYS; i++) {
        const int optional = i == CARRIERS || i == MEMORY;
        fits = fits && (given->of[i] || (optional && !controller->reacts));
    }
    return fits;
}

TOWLINE_PY(control_step) {
    enum { DT, SINCE, LENGTH, DISTANCE, ANGLE, NUMBERS, SOLVES = NUMBERS, STATE, TAKEN, BEFORE };
    arrays given;
    double numbers[NUMBERS] = {0, 0, 0, 0, 0};
    Py_ssize_t missing = 0, optimal = 0, far = 0;
    if (count != BEFORE + STEP_ARRAYS) {
        PyErr_SetString(PyExc_TypeError, "the function takes five numbers, a flag, state, reference, and arrays");
        return NULL;
    }
    const long solves = PyLong_AsLong(arguments[SOLVES]);
    PyObject *state = arguments[STATE], *reference = arguments[TAKEN];
    if (!take_numbers(arguments, count, NUMBERS, numbers) ||
        !take(&given, arguments + BEFORE, count - BEFORE, STEP_ARRAYS, MEASURED)) {
        return NULL;
    }
    const towline_robot *robot = robot_of(&given);
    const towline_controller *controller = controller_of(&given);
    double *const *of = given.of;
    const Py_ssize_t rows = given.size[REFERENCE] / ORDER;
    if (!robot || !controller || !are_of_step(&given, robot, controller, rows) ||
        (state != Py_None && !are_given(state, reference))) {
        return done(&given, 0);
    }
    const Py_ssize_t m = robot->cables;
    const problems at = problems_in(of[PROBLEMS], rows, m);
    towline_cable_memory *cables = (void *)of[CABLES];
    if (state != Py_None) {
        if (!put_state(state, robot, rows, of[MEASURED], of[CABLES]) ||
            !put_reference(reference, robot, rows, of[REFERENCE], of[CARRIERS], at.t_ref)) {
            release(&given);
            return NULL;
        }
        if (solves < 0) {
            release(&given);
            return Py_BuildValue("(iii)", 0, 0, 0);
        }
        hear_command(cables, rows * m, PyTuple_GetItem(state, TENSIONS_OF_STATE) != Py_None);
    }
    Py_BEGIN_ALLOW_THREADS;
    write_problems(robot, controller, numbers[DT], numbers[SINCE], rows, &given, at);
    for (Py_ssize_t row = 0; row < rows; row++) { at.status[row] = TOWLINE_UNSURE; }
    if (solves && m <= TOWLINE_CABLES) { optimal = solve_all(at, rows, robot->cables, numbers[LENGTH], solves > 1); }
    for (Py_ssize_t i = 0; i < rows * m; i++) {
        missing += cables[i].is_cut != 0;
        if (optimal == rows) { cables[i].last = cables[i].given = at.tensions[i]; }
    }
    for (Py_ssize_t row = 0; row < rows; row++) {
        missing += ((const towline_platform_memory *)(const void *)of[PLATFORM])[row].silent > 1;
    }
    far = count_far(of[MEASURED], MOTION * (1 + robot->carriers), of[REFERENCE], rows, numbers + DISTANCE);
    Py_END_ALLOW_THREADS;
    release(&given);
    return Py_BuildValue("(nnn)", missing, optimal, far);
}

TOWLINE_PY(control_thrusts) {
    enum { ROBOT, CONTROLLER, MEASURED, CARRIERS, TENSIONS, CABLES, PLATFORM, MEMORY, TURNING, ACTUATION, ALL };
    arrays given;
    double dt = 0, lacking = 0;
    if (!take_numbers(arguments, count, 1, &dt) || !take(&given, arguments + 1, count - 1, ALL, PLATFORM)) {
        return NULL;
    }
    const towline_robot *robot = robot_of(&given);
    const towline_controller *controller = controller_of(&given);
    double *const *of = given.of;
    int fits = robot && controller;
    for (int i = MEASURED; i < ALL; i++) { fits = fits && (of[i] || i == TURNING); }
    if (fits) {
        const Py_ssize_t m = robot->cables, c = robot->carriers, motions = MOTION * (1 + c);
        const Py_ssize_t rows = given.size[TENSIONS] / m, each = c * towline_most_actuators(robot);
        const Py_ssize_t sizes[ALL] = {
            0, 0, motions, ORDER * c, m, m * PER_CABLE, PER_PLATFORM, c * PER_CARRIER, PER_TURNING, each,
        };
        fits = have_rows(&given, MEASURED, ALL, rows, sizes);
        Py_BEGIN_ALLOW_THREADS;
        for (Py_ssize_t row = 0; fits && row < rows; row++) {
            const towline_flight here = {
                .measured = of[MEASURED] + row * motions,
                .carriers = of[CARRIERS] + row * ORDER * c,
                .tensions = of[TENSIONS] + row * m,
                .cables = (const towline_cable_memory *)(const void *)of[CABLES] + row * m,
                .platform = (towline_platform_memory *)(void *)of[PLATFORM] + row,
                .memory = (towline_carrier_memory *)(void *)of[MEMORY] + row * c,
                .turning = of[TURNING] ? (towline_turning *)(void *)of[TURNING] + row : NULL,
                .actuation = of[ACTUATION] + row * each,
            };
            lacking = fmax(lacking, towline_write_thrusts(robot, controller, dt, here));
        }
        Py_END_ALLOW_THREADS;
    }
    return number_done(&given, fits, lacking);
}

TOWLINE_PY(control_move_on) {
    enum { ROBOT, DISTURBANCE, TENSIONS, ACTUATION, ACCELERATIONS, MEASURED, ALL };
    arrays given;
    double dt = 0;
    if (!take_numbers(arguments, count, 1, &dt) || !take(&given, arguments + 1, count - 1, ALL, MEASURED)) {
        return NULL;
    }
    const towline_robot *robot = robot_of(&given);
    double *const *of = given.of;
    int fits = robot && of[DISTURBANCE] && of[TENSIONS] && of[ACCELERATIONS] && of[MEASURED];
    if (fits) {
        const Py_ssize_t m = robot->cables, c = robot->carriers, motions = MOTION * (1 + c);
        const Py_ssize_t rows = given.size[DISTURBANCE] / 6, parts = rows ? given.size[TENSIONS] / (rows * m) : 0;
        const Py_ssize_t each = of[ACTUATION] ? c * towline_most_actuators(robot) : 0;
        const Py_ssize_t sizes[ALL] = {0, 6, parts * m, parts * each, 6 * c, motions};
        fits = have_rows(&given, DISTURBANCE, ALL, rows, sizes) && parts < MOST_PARTS;
        Py_BEGIN_ALLOW_THREADS;
        for (Py_ssize_t row = 0; fits && row < rows; row++) {
            const towline_commanded commanded = {
                of[TENSIONS] + m * row,
                rows * m,
                of[ACTUATION] ? of[ACTUATION] + each * row : NULL,
                rows * each,
                of[ACCELERATIONS] + 6 * c * row,
            };
            towline_move_on(robot, dt, (int)parts, commanded, of[DISTURBANCE] + 6 * row, of[MEASURED] + motions * row);
        }
        Py_END_ALLOW_THREADS;
    }
    return done(&given, fits);
}
