/* Tension distribution for Python: one problem, and the rows of a batch. */
#include "python/extension.h"

#include "batch/batch.h"
#include "distribution/towline_core.h"
#include "python/arrays.h"

/* Solve a problem of A, w, t_min, t_max, t_ref, weights and length, one after another; return the status. */
static int solve(const double *data, Py_ssize_t size, double *t, Py_ssize_t m, double *direction, Py_ssize_t n) {
    if (m < 1 || n < 1 || size != n * m + n + 4 * m + 1) { return -1; }
    if (m > TOWLINE_CABLES || n > TOWLINE_ROWS) { return (int)TOWLINE_UNSURE; /* the core has no room for it */ }
    const double *w = data + n * m, *limits = w + n;
    const towline_problem problem = {(int)n,         (int)m,         data,          w, limits, limits + m,
                                     limits + 2 * m, limits + 3 * m, limits[4 * m], 0};
    towline_answer answer;
    const towline_status status = towline_solve(&problem, &answer);
    if (status == TOWLINE_OPTIMAL) {
        for (int c = 0; c < m; c++) { t[c] = answer.tensions[c]; }
    } else if (direction && (status == TOWLINE_INFEASIBLE || status == TOWLINE_SINGULAR)) {
        for (int i = 0; i < n; i++) { direction[i] = answer.direction[i]; }
    }
    return (int)status;
}

TOWLINE_PY(solve_packed) {
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
            if (count == 2) { n = (size - 4 * m - 1) / (m + 1); }
            if (count == 2 || direction) { status = solve(data, size, t, m, direction, n); }
            if (direction) { PyBuffer_Release(&proof); }
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

/* Return whether an array has the numbers of all rows: `per` from one row to the next, `size` in each. */
static int has(const arrays *given, int i, Py_ssize_t per, Py_ssize_t size, Py_ssize_t rows) {
    const Py_ssize_t least = rows == 0 ? 0 : per * (rows - 1) + size;
    return (per == 0 || per == size) && given->size[i] >= least;
}

static int is_batch(const arrays *given, Py_ssize_t n, Py_ssize_t m) {
    const Py_ssize_t sizes[ARRAYS] = {n * m, n, m, m, m, m, 1, 0, m, n, 2, 1, 1}, rows = given->size[STATUS];
    int fits = n >= 1 && n <= TOWLINE_ROWS && m >= 1 && m <= TOWLINE_CABLES && given->size[PER] == PER;
    for (int i = 0; fits && i < PER; i++) {
        const Py_ssize_t per = (Py_ssize_t)given->of[PER][i];
        const int equal_weights = i == WEIGHTS && given->size[i] == 0;
        fits = equal_weights ? per == 0 : has(given, i, per, sizes[i], rows);
    }
    for (int i = TENSIONS; fits && i < ARRAYS; i++) { fits = has(given, i, sizes[i], sizes[i], rows); }
    return fits;
}

static towline_column column(const arrays *given, int i) {
    return (towline_column){given->size[i] > 0 ? given->of[i] : NULL, (ptrdiff_t)given->of[PER][i]};
}

TOWLINE_PY(solve_rows) {
    enum { N, M, RHO, IN_LANES, BEFORE };
    arrays given;
    if (count < BEFORE) {
        PyErr_SetString(PyExc_TypeError, "solve_rows takes n, m, rho, in_lanes and thirteen arrays");
        return NULL;
    }
    const long n = PyLong_AsLong(arguments[N]), m = PyLong_AsLong(arguments[M]);
    const double rho = PyFloat_AsDouble(arguments[RHO]);
    const int in_lanes = PyObject_IsTrue(arguments[IN_LANES]);
    if (PyErr_Occurred() || !take(&given, arguments + BEFORE, count - BEFORE, ARRAYS, TENSIONS)) { return NULL; }
    Py_ssize_t optimal = 0;
    const int fits = is_batch(&given, n, m);
    if (fits) {
        const towline_batch batch = {
            (int)n,
            (int)m,
            rho,
            column(&given, A),
            column(&given, W),
            column(&given, T_MIN),
            column(&given, T_MAX),
            column(&given, T_REF),
            column(&given, WEIGHTS),
            column(&given, LENGTH),
            given.of[TENSIONS],
            given.of[DIRECTION],
            given.of[INFO],
            given.of[RESIDUAL],
            given.of[STATUS],
        };
        Py_BEGIN_ALLOW_THREADS;
        optimal = towline_solve_batch(&batch, given.size[STATUS], in_lanes);
        Py_END_ALLOW_THREADS;
    }
    release(&given);
    if (!fits) {
        PyErr_SetString(PyExc_ValueError, "the arrays must be those of one batch, of a size that the core has");
        return NULL;
    }
    return PyLong_FromSsize_t(optimal);
}
