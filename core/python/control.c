/* The step of a controller for Python: what it is given, and what core/control does with it. */
#include "control/control.h"

#include <math.h>
#include <string.h>

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
    if (PyObject_GetBuffer(array, &view, PyBUF_STRIDED_RO | PyBUF_FORMAT) < 0) {
        return 0;
    }
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
    for (int i = first; i < last; i++) {
        fits = fits && (!given->of[i] || given->size[i] == rows * sizes[i]);
    }
    return fits;
}

static const Py_ssize_t PER_CABLE = sizeof(towline_cable_memory) / sizeof(double);
static const Py_ssize_t PER_PLATFORM = sizeof(towline_platform_memory) / sizeof(double);
static const Py_ssize_t PER_CARRIER = sizeof(towline_carrier_memory) / sizeof(double);
static const Py_ssize_t PER_TURNING = sizeof(towline_turning) / sizeof(double);

enum {
    MOTION = 12,
    ORDER = 18,
    MOST_PARTS = 1000000
}; /* numbers of pose and velocity, and of these and the acceleration */

/* Put the pose and the velocity of all bodies in a state, and its tensions; return 0 with an exception if they do not fit. */
static int put_state(PyObject *state, const towline_robot *robot, Py_ssize_t rows, double *measured, double *cables) {
    enum { POSE, CARRIER_POSE = 2, TENSIONS = 4 };
    const Py_ssize_t c = robot->carriers, m = robot->cables, motions = MOTION * (1 + c);
    for (int order = 0; order < 2; order++) {
        double *motion = measured + 6 * order;
        if (!put(PyTuple_GetItem(state, POSE + order), rows, (place){motion, motions, 0, 1, 0, 6}) ||
            !put(PyTuple_GetItem(state, CARRIER_POSE + order), rows,
                 (place){motion + MOTION, motions, MOTION, 1, c, 6})) {
            return 0;
        }
    }
    PyObject *tensions = PyTuple_GetItem(state, TENSIONS);
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

PyObject *towline_py_control_take(PyObject *module, PyObject *const *arguments, Py_ssize_t count) {
    (void)module;
    enum { ROBOT, MEASURED, CABLES, REFERENCE, CARRIERS, T_REF, ALL };
    arrays given;
    PyObject *state = count > 1 ? arguments[0] : NULL, *reference = count > 1 ? arguments[1] : NULL;
    if (!state || !PyTuple_Check(state) || PyTuple_Size(state) < 5 || !PyTuple_Check(reference) ||
        PyTuple_Size(reference) < 7) {
        PyErr_SetString(PyExc_TypeError, "the function takes a state, a reference and arrays");
        return NULL;
    }
    if (!take(&given, arguments + 2, count - 2, ALL, MEASURED)) {
        return NULL;
    }
    const towline_robot *robot = robot_of(&given);
    const Py_ssize_t rows = given.size[REFERENCE] / ORDER;
    int fits = robot && given.of[MEASURED] && given.of[CABLES] && given.of[REFERENCE] && given.of[T_REF];
    if (fits) {
        const Py_ssize_t c = robot->carriers, m = robot->cables;
        const Py_ssize_t sizes[ALL] = {0, MOTION * (1 + c), m * PER_CABLE, ORDER, ORDER * c, m};
        fits = have_rows(&given, MEASURED, ALL, rows, sizes);
    }
    if (!fits) {
        return done(&given, 0);
    }
    fits = put_state(state, robot, rows, given.of[MEASURED], given.of[CABLES]) &&
           put_reference(reference, robot, rows, given.of[REFERENCE], given.of[CARRIERS], given.of[T_REF]);
    release(&given);
    if (!fits) {
        return NULL;
    }
    Py_RETURN_NONE;
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
    for (int i = 0; i < wanted && i < count; i++) {
        numbers[i] = PyFloat_AsDouble(arguments[i]);
    }
    return !PyErr_Occurred();
}

PyObject *towline_py_control_problem(PyObject *module, PyObject *const *arguments, Py_ssize_t count) {
    (void)module;
    enum { ROBOT, CONTROLLER, MEASURED, LATE, REFERENCE, T_REF, CARRIERS, CABLES, PLATFORM, MEMORY, A, W, BOUNDS, ALL };
    arrays given;
    double times[2] = {0, 0};
    Py_ssize_t cut = 0;
    if (!take_numbers(arguments, count, 2, times) || !take(&given, arguments + 2, count - 2, ALL, CARRIERS)) {
        return NULL;
    }
    const towline_robot *robot = robot_of(&given);
    const towline_controller *controller = controller_of(&given);
    double *const *of = given.of;
    int fits = robot && controller && of[MEASURED] && of[REFERENCE] && of[T_REF] && of[CABLES] && of[PLATFORM] &&
               of[A] && of[W] && of[BOUNDS] && (!controller->reacts || (of[CARRIERS] && of[MEMORY]));
    if (fits) {
        const Py_ssize_t rows = given.size[W] / 6, m = robot->cables, c = robot->carriers, motions = MOTION * (1 + c);
        const Py_ssize_t sizes[ALL] = {
            0, 0, motions, motions, ORDER, m, ORDER * c, m * PER_CABLE, PER_PLATFORM, c * PER_CARRIER, 6 * m, 6, 2 * m,
        };
        fits = have_rows(&given, MEASURED, ALL, rows, sizes);
        Py_BEGIN_ALLOW_THREADS;
        for (Py_ssize_t row = 0; fits && row < rows; row++) {
            const towline_row here = {
                .measured = of[MEASURED] + row * motions,
                .late = of[LATE] ? of[LATE] + row * motions : NULL,
                .reference = of[REFERENCE] + row * ORDER,
                .t_ref = of[T_REF] + row * m,
                .carriers = of[CARRIERS] ? of[CARRIERS] + row * c * ORDER : NULL,
                .cables = (towline_cable_memory *)(void *)of[CABLES] + row * m,
                .platform = (towline_platform_memory *)(void *)of[PLATFORM] + row,
                .carrier_memory = of[MEMORY] ? (towline_carrier_memory *)(void *)of[MEMORY] + row * c : NULL,
                .A = of[A] + row * 6 * m,
                .w = of[W] + row * 6,
                .low = of[BOUNDS] + row * m,
                .high = of[BOUNDS] + (rows + row) * m,
            };
            towline_write_problem(robot, controller, times[0], times[1], here);
            for (Py_ssize_t i = 0; i < m; i++) {
                cut += here.cables[i].is_cut != 0;
            }
        }
        Py_END_ALLOW_THREADS;
    }
    return number_done(&given, fits, (double)cut);
}

PyObject *towline_py_control_thrusts(PyObject *module, PyObject *const *arguments, Py_ssize_t count) {
    (void)module;
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
    for (int i = MEASURED; i < ALL; i++) {
        fits = fits && (of[i] || i == TURNING);
    }
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

PyObject *towline_py_control_move_on(PyObject *module, PyObject *const *arguments, Py_ssize_t count) {
    (void)module;
    enum { ROBOT, DISTURBANCE, TENSIONS, ACCELERATIONS, MEASURED, ALL };
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
        const Py_ssize_t sizes[ALL] = {0, 6, parts * m, 6 * c, motions};
        fits = have_rows(&given, DISTURBANCE, ALL, rows, sizes) && parts < MOST_PARTS;
        Py_BEGIN_ALLOW_THREADS;
        for (Py_ssize_t row = 0; fits && row < rows; row++) {
            towline_move_on(robot, dt, (int)parts, of[DISTURBANCE] + 6 * row, of[TENSIONS] + m * row, rows * m,
                            of[ACCELERATIONS] + 6 * c * row, of[MEASURED] + motions * row);
        }
        Py_END_ALLOW_THREADS;
    }
    return done(&given, fits);
}
