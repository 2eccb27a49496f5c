/* The available wrench sets of many wrench matrices, for Python. */
#include "available_wrench/available_wrench.h"

#include "python/arrays.h"
#include "python/extension.h"

/* Return the matrices of an array of n x m numbers each; of a size that the core has not, none fit. */
static int matrices_of(const arrays *given, int i, Py_ssize_t n, Py_ssize_t m, towline_matrices *matrices) {
    if (!given->of[i] || n < 1 || n > TOWLINE_ROWS || m < 1 || m > TOWLINE_CABLES || given->size[i] % (n * m)) {
        return 0;
    }
    *matrices = (towline_matrices){(int)n, (int)m, given->size[i] / (n * m), given->of[i]};
    return 1;
}

TOWLINE_PY(facets) {
    enum { A, LOW, HIGH, NORMALS, LEAST, MOST_, ALL };
    arrays given;
    towline_matrices matrices;
    if (!take(&given, arguments, count, ALL, NORMALS)) { return NULL; }
    const Py_ssize_t m = given.size[LOW], rows = given.size[LEAST];
    const Py_ssize_t n = rows > 0 ? given.size[NORMALS] / rows : 0;
    int fits = matrices_of(&given, A, n, m, &matrices);
    if (fits) {
        const Py_ssize_t facets = matrices.count * towline_facets_of((int)n, (int)m);
        fits =
            given.size[HIGH] == m && given.size[NORMALS] == facets * n && rows == facets && given.size[MOST_] == facets;
    }
    FINISH(
        &given, fits,
        towline_facets(&matrices, given.of[LOW], given.of[HIGH], given.of[NORMALS], given.of[LEAST], given.of[MOST_]));
}

TOWLINE_PY(margins) {
    enum { A, W, LOW, HIGH, MARGINS, RESERVES, ALL };
    arrays given;
    towline_matrices matrices;
    if (!take(&given, arguments, count, ALL, MARGINS)) { return NULL; }
    const Py_ssize_t m = given.size[LOW], rows = given.size[MARGINS];
    const Py_ssize_t n = rows > 0 && m > 0 ? given.size[A] / (rows * m) : 0;
    int fits = matrices_of(&given, A, n, m, &matrices) && matrices.count == rows && m >= n && given.of[W] &&
               given.of[HIGH] && m <= TOWLINE_MARGIN_CABLES && given.size[HIGH] == m &&
               (given.size[W] == n || given.size[W] == n * rows);
    if (fits && given.of[RESERVES]) { fits = given.size[RESERVES] == rows * towline_facets_of((int)n, (int)m); }
    FINISH(&given, fits,
           towline_margins(&matrices, given.of[W], given.size[W] == n ? 0 : n, given.of[LOW], given.of[HIGH],
                           given.of[MARGINS], given.of[RESERVES]));
}

TOWLINE_PY(full_rank) {
    enum { N, TOLERANCE, BEFORE };
    enum { A, FULL, ALL };
    arrays given;
    towline_matrices matrices;
    if (count < BEFORE) {
        PyErr_SetString(PyExc_TypeError, "full_rank takes n, tolerance, A and full");
        return NULL;
    }
    const Py_ssize_t n = PyLong_AsSsize_t(arguments[N]);
    const double tolerance = PyFloat_AsDouble(arguments[TOLERANCE]);
    if (PyErr_Occurred() || !take(&given, arguments + BEFORE, count - BEFORE, ALL, FULL)) { return NULL; }
    const Py_ssize_t per = given.size[FULL] > 0 ? given.size[A] / given.size[FULL] : 0;
    const int fits = n > 0 && matrices_of(&given, A, n, per / n, &matrices) && matrices.count == given.size[FULL];
    FINISH(&given, fits, towline_full_rank(&matrices, tolerance, given.of[FULL]));
}
