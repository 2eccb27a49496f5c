/*
 * The Python module `towline.solvers.core._core`: one function, `solve_packed`, on the memory of arrays. It keeps to
 * Python's limited API of 3.11, so that one wheel serves this version and all later ones.
 */
#include <Python.h>

#include "towline_core.h"

enum { DOUBLE = (int)sizeof(double) };

/* Return the numbers of an array, which the caller releases, or NULL with an exception. */
static double *numbers_of(PyObject *array, Py_buffer *view, int writable, Py_ssize_t *size) {
    if (PyObject_GetBuffer(array, view, writable ? PyBUF_WRITABLE : PyBUF_SIMPLE) < 0) {
        return NULL;
    }
    *size = view->len / DOUBLE;
    return view->buf;
}

/* Solve a problem of A, w, t_min, t_max, t_ref, weights and length, one after another; return the status. */
static int solve(const double *data, Py_ssize_t size, double *t, Py_ssize_t m, double *direction, Py_ssize_t n) {
    if (m < 1 || m > TOWLINE_CABLES || n < 1 || n > TOWLINE_ROWS || size != n * m + n + 4 * m + 1) {
        return -1;
    }
    const double *w = data + n * m, *limits = w + n;
    const towline_problem problem = {(int)n,         (int)m,         data,         w, limits, limits + m,
                                     limits + 2 * m, limits + 3 * m, limits[4 * m]};
    towline_answer answer;
    const towline_status status = towline_solve(&problem, &answer);
    if (status == TOWLINE_OPTIMAL) {
        for (int c = 0; c < m; c++) {
            t[c] = answer.tensions[c];
        }
    } else if (direction && (status == TOWLINE_INFEASIBLE || status == TOWLINE_SINGULAR)) {
        for (int i = 0; i < n; i++) {
            direction[i] = answer.direction[i];
        }
    }
    return (int)status;
}

static PyObject *solve_packed(PyObject *module, PyObject *const *arguments, Py_ssize_t count) {
    (void)module;
    Py_buffer given, tensions, proof;
    Py_ssize_t size, m, n = 0;
    int status = -1;
    if (count < 2 || count > 3) {
        PyErr_SetString(PyExc_TypeError, "solve_packed takes a problem, tensions and, if wanted, a direction");
        return NULL;
    }
    const double *data = numbers_of(arguments[0], &given, 0, &size);
    if (data) {
        double *t = numbers_of(arguments[1], &tensions, 1, &m);
        if (t) {
            double *direction = count == 3 ? numbers_of(arguments[2], &proof, 1, &n) : NULL;
            if (count == 2) {
                n = (size - 4 * m - 1) / (m + 1);
            }
            if (count == 2 || direction) {
                status = solve(data, size, t, m, direction, n);
            }
            if (direction) {
                PyBuffer_Release(&proof);
            }
            PyBuffer_Release(&tensions);
        }
        PyBuffer_Release(&given);
    }
    if (status < 0) {
        if (!PyErr_Occurred()) {
            PyErr_SetString(PyExc_ValueError, "the arrays must be those of one problem, of a size that the core has");
        }
        return NULL;
    }
    return PyLong_FromLong(status);
}

static PyMethodDef functions[] = {
    {"solve_packed", (PyCFunction)(void (*)(void))solve_packed, METH_FASTCALL,
     "solve_packed(packed, tensions, direction=None)\n--\n\n"
     "Solve a packed problem; return its status and fill tensions (m,) if optimal, direction (n,) if out of reach."},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "_core", "The C core of towline's solvers.", 0, functions, NULL, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit__core(void) {
    PyObject *module = PyModule_Create(&definition);
    if (module && (PyModule_AddIntConstant(module, "CABLES", TOWLINE_CABLES) < 0 ||
                   PyModule_AddIntConstant(module, "ROWS", TOWLINE_ROWS) < 0)) {
        Py_DECREF(module);
        return NULL;
    }
    return module;
}
