/* The memory of the arrays that a function of the Python module is called with. */
#ifndef TOWLINE_ARRAYS_H
#define TOWLINE_ARRAYS_H

#include <Python.h>

#include "robot.h"

enum { DOUBLE = (int)sizeof(double), MOST = 24 };

/* The head of an array of NumPy, as in its headers: packages compiled for any of its versions 1.7 to 2 read these fields. */
typedef struct {
    PyObject_HEAD char *data;
    int dimensions;
    Py_ssize_t *shape, *strides; /* [bytes] */
    PyObject *base, *dtype;
    int flags;
} numpy_array;

enum { C_CONTIGUOUS = 0x1, WRITEABLE = 0x400 }; /* flags */

/* The types of arrays, and of float64, that are read without a buffer, which takes longer than a pose's mechanics; or NULL. */
extern PyTypeObject *towline_array_type;
extern PyObject *towline_float64;

/* Fill the view of an array as PyObject_GetBuffer does; return -1 with an exception if it is none. */
static inline int view_of(PyObject *array, Py_buffer *view, int flags) {
    const numpy_array *own = (const void *)array;
    const int needed = ((flags & PyBUF_STRIDES) == PyBUF_STRIDES ? 0 : C_CONTIGUOUS) |
                       ((flags & PyBUF_WRITABLE) == PyBUF_WRITABLE ? WRITEABLE : 0);
    if (Py_TYPE(array) != towline_array_type || own->dtype != towline_float64 || (own->flags & needed) != needed) {
        return PyObject_GetBuffer(array, view, flags);
    }
    view->obj = NULL; /* nothing is released: the caller of the function holds the array */
    view->buf = own->data;
    view->len = view->itemsize = DOUBLE;
    view->format = "d";
    view->ndim = own->dimensions;
    view->shape = own->shape;
    view->strides = own->strides;
    for (int i = 0; i < own->dimensions; i++) { view->len *= own->shape[i]; }
    return 0;
}

/* Return the numbers of an array, which the caller releases, or NULL with an exception. */
static inline double *numbers_of(PyObject *array, Py_buffer *view, int writable, Py_ssize_t *size) {
    if (view_of(array, view, writable ? PyBUF_WRITABLE : PyBUF_SIMPLE) < 0) { return NULL; }
    *size = view->len / DOUBLE;
    return view->buf;
}

/* The arrays of a call; None is NULL. */
typedef struct {
    Py_buffer view[MOST];
    double *of[MOST];
    Py_ssize_t size[MOST]; /* in numbers */
    int count;
} arrays;

static inline void release(arrays *given) {
    for (int i = 0; i < given->count; i++) {
        if (given->of[i]) { PyBuffer_Release(&given->view[i]); }
    }
}

/* Take the arrays of a call, of which those from `results` on are written to; return 0 with an exception if one is none. */
static inline int take(arrays *given, PyObject *const *arguments, Py_ssize_t count, int wanted, int results) {
    given->count = 0;
    if (count != wanted) {
        PyErr_Format(PyExc_TypeError, "the function takes %d arguments, got %zd", wanted, count);
        return 0;
    }
    for (int i = 0; i < wanted; i++) {
        given->of[i] = NULL;
        given->size[i] = 0;
        if (arguments[i] != Py_None) {
            given->of[i] = numbers_of(arguments[i], &given->view[i], i >= results, &given->size[i]);
            if (!given->of[i]) {
                release(given);
                return 0;
            }
        }
        given->count = i + 1;
    }
    return 1;
}

/* Release the arrays, and return None, or NULL with an exception if they do not fit. */
static inline PyObject *done(arrays *given, int fits) {
    release(given);
    if (!fits) {
        PyErr_SetString(PyExc_ValueError,
                        "the arrays must be a robot's record, or wrench matrices, and rows of the sizes that fit it");
        return NULL;
    }
    Py_RETURN_NONE;
}

/* End a function: call the core without the lock of the interpreter if the arrays fit, and return as `done` does. */
#define FINISH(given, fits, call_of_core) \
    do {                                  \
        if (fits) {                       \
            Py_BEGIN_ALLOW_THREADS;       \
            call_of_core;                 \
            Py_END_ALLOW_THREADS;         \
        }                                 \
        return done(given, fits);         \
    } while (0)

/* Whether an array of a call is there and has so many numbers. */
static inline int has_size(const arrays *given, int i, Py_ssize_t numbers) {
    return given->of[i] && given->size[i] == numbers;
}

/* Return the robot if the first array is the record of one that the core can take, else NULL. */
static inline const towline_robot *robot_of(const arrays *given) {
    const towline_robot *robot = (const void *)given->of[0];
    if (!robot || given->view[0].len != (Py_ssize_t)sizeof(towline_robot) || robot->cables < 1 ||
        robot->cables > TOWLINE_MOST_CABLES || robot->carriers < 1 || robot->carriers > TOWLINE_MOST_CARRIERS) {
        return NULL;
    }
    for (int b = 0; b <= robot->carriers; b++) {
        if (robot->body[b].actuators < 0 || robot->body[b].actuators > TOWLINE_MOST_ACTUATORS) { return NULL; }
    }
    for (int i = 0; i < robot->cables; i++) {
        if (robot->cable[i].carrier < 0 || robot->cable[i].carrier >= robot->carriers) { return NULL; }
    }
    return robot;
}

#endif
