/* The memory of the arrays that a function of the Python module is called with. */
#ifndef TOWLINE_ARRAYS_H
#define TOWLINE_ARRAYS_H

#include <Python.h>

#include "robot.h"

enum { DOUBLE = (int)sizeof(double), MOST = 24 };

/* Return the numbers of an array, which the caller releases, or NULL with an exception. */
static inline double *numbers_of(PyObject *array, Py_buffer *view, int writable, Py_ssize_t *size) {
    if (PyObject_GetBuffer(array, view, writable ? PyBUF_WRITABLE : PyBUF_SIMPLE) < 0) {
        return NULL;
    }
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
        if (given->of[i]) {
            PyBuffer_Release(&given->view[i]);
        }
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
        PyErr_SetString(PyExc_ValueError, "the arrays must be a robot's record and rows of the sizes that fit it");
        return NULL;
    }
    Py_RETURN_NONE;
}

/* Return the robot if the first array is the record of one that the core can take, else NULL. */
static inline const towline_robot *robot_of(const arrays *given) {
    const towline_robot *robot = (const void *)given->of[0];
    if (!robot || given->view[0].len != (Py_ssize_t)sizeof(towline_robot) || robot->cables < 1 ||
        robot->cables > TOWLINE_MOST_CABLES || robot->carriers < 1 || robot->carriers > TOWLINE_MOST_CARRIERS) {
        return NULL;
    }
    for (int i = 0; i < robot->cables; i++) {
        if (robot->cable[i].carrier < 0 || robot->cable[i].carrier >= robot->carriers) {
            return NULL;
        }
    }
    return robot;
}

#endif
