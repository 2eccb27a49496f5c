/*
 * Small matrices, row by row, and the products and factors that the recursion of a horizon is made of.
 *
 * Columns are computed by fours: what is behind the last column of a result, up to a multiple of four, is overwritten by
 * sums of what is there in the arguments. Each sum has the same order on every processor, and so the same bits.
 */
#ifndef TOWLINE_HORIZON_MATRICES_H
#define TOWLINE_HORIZON_MATRICES_H

#include <stddef.h>

typedef struct {
    double *at;
    int rows, columns;
    ptrdiff_t step; /* from one row to the next */
} matrix;

static inline double *row_of(matrix a, int row) { return a.at + row * a.step; }

static inline double *entry(matrix a, int row, int column) { return a.at + row * a.step + column; }

static inline matrix block(matrix a, int row, int column, int rows, int columns) {
    const matrix part = {a.at + row * a.step + column, rows, columns, a.step};
    return part;
}

/* out = base + sign X' Y, of which `out` says the size; `base.at` may be NULL, for 0, and may be that of `out`. */
typedef struct {
    matrix out, base, x, y;
    double sign;
    int upper; /* 1: what is left of the diagonal is not wanted */
} product;

/* The functions on matrices, in a form for a kind of processor. */
typedef struct {
    void (*multiply)(const product *of);
    void (*add_product)(double *out, matrix x, const double *v); /* out += X v; v is 0 up to a multiple of four */
    void (*add_transposed_product)(double *out, matrix x, const double *v); /* out += X' v */
    /*
     * Cholesky's method on a symmetric matrix, of which the upper half is read, stopped after the rows of U: with
     * U = [U_uu U_ux] it is U' U + [[0, 0], [0, rest]]. Inverses of the diagonal of U_uu are written beside.
     */
    void (*factorise)(matrix U, double *inverse, matrix symmetric);
    /* zeta = inv(U_uu') v_u, and what is left of the rest of v is v_x - U_ux' zeta; v_u is overwritten. */
    void (*solve_lower)(double *v, double *zeta, matrix U, const double *inverse);
} towline_algebra;

/* A pivot below this part of what it was before elimination has no digits left: it becomes TOWLINE_HUGE. */
#define TOWLINE_FLAT 1e-14
#define TOWLINE_HUGE 1e200

/* The form for a processor, see towline_processor. */
const towline_algebra *towline_algebra_for(int processor);

#endif
