/* The step of a controller for Python: what it is given, and what core/control does with it. */
#include "control/control.h"

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

/* Whether an array is missing, or has so many numbers. */
static int has(const arrays *given, int index, Py_ssize_t size) { return !given->of[index] || given->size[index] == size; }

static const Py_ssize_t PER_CABLE = sizeof(towline_cable_memory) / sizeof(double);
static const Py_ssize_t PER_PLATFORM = sizeof(towline_platform_memory) / sizeof(double);
static const Py_ssize_t PER_CARRIER = sizeof(towline_carrier_memory) / sizeof(double);

enum { MOTION = 12, ORDER = 18 }; /* numbers of pose and velocity, and of these and the acceleration */

PyObject *towline_py_control_take(PyObject *module, PyObject *const *arguments, Py_ssize_t count) {
    (void)module;
    enum { MEASURED, REFERENCE, CARRIERS, T_REF, CABLES, ALL };
    enum { POSE, VELOCITY, CARRIER_POSE, CARRIER_VELOCITY, TENSIONS };
    PyObject *state = count == ALL + 2 ? arguments[0] : NULL, *reference = count == ALL + 2 ? arguments[1] : NULL;
    arrays given;
    if (!state || !PyTuple_Check(state) || PyTuple_Size(state) < 5 || !PyTuple_Check(reference) ||
        PyTuple_Size(reference) < 7) {
        PyErr_SetString(PyExc_TypeError, "control_take takes a state, a reference and five arrays");
        return NULL;
    }
    if (!take(&given, arguments + 2, count - 2, ALL, MEASURED)) {
        return NULL;
    }
    const Py_ssize_t rows = given.size[REFERENCE] / ORDER, m = rows ? given.size[T_REF] / rows : 0;
    const Py_ssize_t c = rows ? given.size[MEASURED] / rows / MOTION - 1 : 0;
    double *const *to = given.of;
    if (m < 1 || c < 1 || !to[MEASURED] || !to[CABLES] || given.size[MEASURED] != rows * MOTION * (1 + c) ||
        given.size[REFERENCE] != rows * ORDER || !has(&given, CARRIERS, rows * c * ORDER) ||
        given.size[T_REF] != rows * m || given.size[CABLES] != rows * m * PER_CABLE) {
        return done(&given, 0);
    }
    const Py_ssize_t motions = MOTION * (1 + c);
    PyObject *measured = PyTuple_GetItem(state, TENSIONS), *planned = PyTuple_GetItem(reference, 6);
    int fits = 1;
    for (int order = 0; fits && order < 2; order++) {
        double *motion = to[MEASURED] + 6 * order;
        fits = put(PyTuple_GetItem(state, POSE + order), rows, (place){motion, motions, 0, 1, 0, 6}) &&
               put(PyTuple_GetItem(state, CARRIER_POSE + order), rows,
                   (place){motion + MOTION, motions, MOTION, 1, c, 6});
    }
    for (int order = 0; fits && order < 3; order++) {
        double *carriers = to[CARRIERS] ? to[CARRIERS] + 6 * order : NULL;
        fits = put(PyTuple_GetItem(reference, order), rows, (place){to[REFERENCE] + 6 * order, ORDER, 0, 1, 0, 6}) &&
               put(PyTuple_GetItem(reference, 3 + order), rows, (place){carriers, c * ORDER, ORDER, 1, c, 6});
    }
    memset(to[T_REF], 0, (size_t)(rows * m) * sizeof(double));
    fits = fits && (planned == Py_None || put(planned, rows, (place){to[T_REF], m, 0, 1, 0, m}));
    fits = fits && (measured == Py_None || put(measured, rows, (place){to[CABLES], m * PER_CABLE, 0, PER_CABLE, 0, m}));
    release(&given);
    return fits ? PyBool_FromLong(measured != Py_None) : NULL;
}

/* Return the controller if the second array is the record of one, else NULL. */
static const towline_controller *controller_of(const arrays *given) {
    const int is_one = given->of[1] && given->view[1].len == (Py_ssize_t)sizeof(towline_controller);
    return is_one ? (const void *)given->of[1] : NULL;
}

/* Take two numbers before the arrays of a call; return 0 with an exception if they are none. */
static int take_numbers(PyObject *const *arguments, Py_ssize_t count, double *first, double *second) {
    if (count < 2) {
        PyErr_SetString(PyExc_TypeError, "the function takes two numbers and arrays");
        return 0;
    }
    *first = PyFloat_AsDouble(arguments[0]);
    *second = PyFloat_AsDouble(arguments[1]);
    return !PyErr_Occurred();
}

PyObject *towline_py_control_problem(PyObject *module, PyObject *const *arguments, Py_ssize_t count) {
    (void)module;
    enum { ROBOT, CONTROLLER, MEASURED, LATE, REFERENCE, T_REF, CARRIERS, CABLES, PLATFORM, MEMORY, A, W, BOUNDS, ALL };
    arrays given;
    double dt, since;
    if (!take_numbers(arguments, count, &dt, &since) || !take(&given, arguments + 2, count - 2, ALL, CARRIERS)) {
        return NULL;
    }
    const towline_robot *robot = robot_of(&given);
    const towline_controller *controller = controller_of(&given);
    double *const *of = given.of;
    int fits = robot && controller && of[MEASURED] && of[REFERENCE] && of[T_REF] && of[CABLES] && of[PLATFORM] &&
               of[A] && of[W] && of[BOUNDS] && (!controller->reacts || (of[CARRIERS] && of[MEMORY]));
    if (fits) {
        const Py_ssize_t rows = given.size[W] / 6, m = robot->cables, c = robot->carriers;
        const Py_ssize_t sizes[ALL] = {
            0,  0, MOTION * (1 + c), MOTION * (1 + c), ORDER, m, ORDER * c, m * PER_CABLE, PER_PLATFORM, c * PER_CARRIER,
            6 * m, 6, 2 * m};
        for (int i = MEASURED; i < ALL; i++) {
            fits = fits && has(&given, i, rows * sizes[i]);
        }
        Py_BEGIN_ALLOW_THREADS;
        for (Py_ssize_t row = 0; fits && row < rows; row++) {
            const towline_row here = {
                .measured = of[MEASURED] + row * sizes[MEASURED],
                .late = of[LATE] ? of[LATE] + row * sizes[LATE] : NULL,
                .reference = of[REFERENCE] + row * sizes[REFERENCE],
                .t_ref = of[T_REF] + row * sizes[T_REF],
                .carriers = of[CARRIERS] ? of[CARRIERS] + row * sizes[CARRIERS] : NULL,
                .cables = (towline_cable_memory *)(void *)of[CABLES] + row * m,
                .platform = (towline_platform_memory *)(void *)of[PLATFORM] + row,
                .carrier_memory = of[MEMORY] ? (towline_carrier_memory *)(void *)of[MEMORY] + row * c : NULL,
                .A = of[A] + row * sizes[A],
                .w = of[W] + row * sizes[W],
                .low = of[BOUNDS] + row * m,
                .high = of[BOUNDS] + (rows + row) * m,
            };
            towline_write_problem(robot, controller, dt, since, here);
        }
        Py_END_ALLOW_THREADS;
    }
    return done(&given, fits);
}

PyObject *towline_py_control_thrusts(PyObject *module, PyObject *const *arguments, Py_ssize_t count) {
    (void)module;
    enum { ROBOT, CONTROLLER, MEASURED, CARRIERS, TENSIONS, CABLES, PLATFORM, MEMORY, ACTUATION, ALL };
    arrays given;
    double dt;
    if (!take_numbers(arguments, count, &dt, &dt) || !take(&given, arguments + 1, count - 1, ALL, MEMORY)) {
        return NULL;
    }
    return done(&given, 0);
}
