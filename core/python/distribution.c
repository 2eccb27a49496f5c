/* Tension distribution for Python: one problem, and the rows of a batch. */
#include "python/extension.h"

#include <math.h>

#include "distribution/towline_core.h"
#include "python/arrays.h"

/* Solve a problem of A, w, t_min, t_max, t_ref, weights and length, one after another; return the status. */
static int solve(const double *data, Py_ssize_t size, double *t, Py_ssize_t m, double *direction, Py_ssize_t n) {
    if (m < 1 || m > TOWLINE_CABLES || n < 1 || n > TOWLINE_ROWS || size != n * m + n + 4 * m + 1) {
        return -1;
    }
    const double *w = data + n * m, *limits = w + n;
    const towline_problem problem = {(int)n,         (int)m,         data,          w, limits, limits + m,
                                     limits + 2 * m, limits + 3 * m, limits[4 * m], 0};
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

PyObject *towline_py_solve_packed(PyObject *module, PyObject *const *arguments, Py_ssize_t count) {
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

enum { A, W, T_MIN, T_MAX, T_REF, WEIGHTS, LENGTH, PER, GIVEN };      /* arrays of a batch, */
enum { TENSIONS = GIVEN, DIRECTION, INFO, RESIDUAL, STATUS, ARRAYS }; /* and what it gets */

enum { UNSURE = 6 }; /* of kernels/codes.py */

/* Solve each row of a batch whose status is UNSURE, see `towline_solve_soft` if rho > 0; return how many are optimal. */
static Py_ssize_t solve_batch(double *const *array, Py_ssize_t rows, int n, int m, double rho) {
    Py_ssize_t optimal = 0;
    for (Py_ssize_t row = 0; row < rows; row++) {
        const double *given[PER];
        if (array[STATUS][row] < UNSURE) {
            optimal += array[STATUS][row] == TOWLINE_OPTIMAL;
            continue;
        }
        for (int i = 0; i < PER; i++) {
            given[i] = array[i] ? array[i] + row * (Py_ssize_t)array[PER][i] : NULL;
        }
        const towline_problem problem = {
            n, m, given[A], given[W], given[T_MIN], given[T_MAX], given[T_REF], given[WEIGHTS], *given[LENGTH], 0};
        towline_answer answer;
        const towline_status status =
            rho > 0 ? towline_solve_soft(&problem, rho, &answer) : towline_solve(&problem, &answer);
        const int proven = status == TOWLINE_INFEASIBLE || status == TOWLINE_SINGULAR;
        int code = (int)status;
        if (rho > 0 && status != TOWLINE_INVALID && status != TOWLINE_OPTIMAL) {
            code = TOWLINE_INACCURATE;
        }
        if (rho > 0 ? status != TOWLINE_INVALID && !answer.soft_is_proven : status == TOWLINE_INACCURATE) {
            code = UNSURE;
        }
        array[STATUS][row] = code;
        optimal += code == TOWLINE_OPTIMAL;
        array[RESIDUAL][row] = answer.residual;
        array[INFO][2 * row] = answer.support;
        array[INFO][2 * row + 1] = proven ? answer.shortfall : (double)NAN;
        for (int c = 0; c < m && code != UNSURE && (status == TOWLINE_OPTIMAL || answer.soft); c++) {
            array[TENSIONS][row * m + c] = answer.tensions[c];
        }
        for (int i = 0; i < n && proven; i++) {
            array[DIRECTION][row * n + i] = answer.direction[i];
        }
    }
    return optimal;
}

PyObject *towline_py_solve_rows(PyObject *module, PyObject *const *arguments, Py_ssize_t count) {
    (void)module;
    Py_buffer views[ARRAYS];
    double *array[ARRAYS];
    int taken = 0, fits = 0;
    Py_ssize_t optimal = 0;
    if (count != ARRAYS + 3) {
        PyErr_SetString(PyExc_TypeError, "solve_rows takes n, m, rho and thirteen arrays");
        return NULL;
    }
    const long n = PyLong_AsLong(arguments[0]), m = PyLong_AsLong(arguments[1]);
    const double rho = PyFloat_AsDouble(arguments[2]);
    while (!PyErr_Occurred() && taken < ARRAYS) {
        Py_ssize_t size;
        array[taken] = numbers_of(arguments[3 + taken], &views[taken], taken >= TENSIONS, &size);
        taken += array[taken] != NULL;
    }
    if (taken == ARRAYS && n >= 1 && n <= TOWLINE_ROWS && m >= 1 && m <= TOWLINE_CABLES &&
        views[PER].len == PER * DOUBLE) {
        const Py_ssize_t rows = views[STATUS].len / DOUBLE;
        const long sizes[ARRAYS] = {n * m, n, m, m, m, m, 1, 0, m, n, 2, 1, 1};
        fits = 1;
        for (int i = 0; i < ARRAYS; i++) {
            const Py_ssize_t per = i < PER ? (Py_ssize_t)array[PER][i] : sizes[i];
            const Py_ssize_t least =
                i == PER || rows == 0 || (i == WEIGHTS && views[i].len == 0) ? 0 : per * (rows - 1) + sizes[i];
            fits = fits && (per == 0 || per == sizes[i]) && views[i].len >= least * DOUBLE;
            if (i == WEIGHTS && views[i].len == 0) {
                array[i] = NULL; /* all are equal */
                fits = fits && per == 0;
            }
        }
        if (fits) {
            Py_BEGIN_ALLOW_THREADS optimal = solve_batch(array, rows, (int)n, (int)m, rho);
            Py_END_ALLOW_THREADS
        }
    }
    while (taken > 0) {
        PyBuffer_Release(&views[--taken]);
    }
    if (!fits) {
        if (!PyErr_Occurred()) {
            PyErr_SetString(PyExc_ValueError, "the arrays must be those of one batch, of a size that the core has");
        }
        return NULL;
    }
    return PyLong_FromSsize_t(optimal);
}
