/*
 * Tension distribution of many problems of one shape: some at a time in lanes (numbers/lanes.h), and one after another
 * where lanes are in doubt. Statuses are those of `towline_solve`.
 *
 * Lanes take methods that need no branches: one slab after another for m - n of 0, 1 or 2 (slabs.h), Newton's method
 * on the dual for other numbers of cables and for soft answers (newton.h). Where rounding might decide, or a matrix
 * needs pivoting or lacks a rank, the row stays unsure, and the solver of one problem takes it. Neither the rows beside
 * it nor the number of lanes changes a bit of a row's result.
 */
#ifndef TOWLINE_BATCH_H
#define TOWLINE_BATCH_H

#include <stddef.h>

#include "distribution/towline_core.h"

/* The status of a row that is to be solved, and of one that could not be: rounding keeps the core from proving any. */
#define TOWLINE_UNSURE 6.0

/* Numbers of the rows, one row after another. */
typedef struct {
    const double *of;
    ptrdiff_t per; /* numbers from one row to the next; 0: one row serves all */
} towline_column;

typedef struct {
    int n;                  /* wrench rows, 1 to TOWLINE_ROWS */
    int m;                  /* cables, 1 to TOWLINE_CABLES */
    double rho;             /* as in `towline_solve_soft`; 0: the wrench must be met */
    towline_column A;       /* n x m, as in `towline_problem`, and so are the others */
    towline_column w;       /* n */
    towline_column t_min;   /* m */
    towline_column t_max;   /* m */
    towline_column t_ref;   /* m */
    towline_column weights; /* m; of = NULL: all are equal */
    towline_column length;  /* 1 */
    /* What each row gets; NAN where there is none. */
    double *tensions;  /* m, [N] */
    double *direction; /* n, where w is proven out of reach */
    double *info;      /* 2, support and shortfall along it [N] */
    double *residual;  /* 1, wrench error of the tensions [N] */
    double *status;    /* 1, a `towline_status`, or TOWLINE_UNSURE */
} towline_batch;

/*
 * Solve those of so many rows whose status is TOWLINE_UNSURE; with `lanes`, in lanes first. Return how many of all rows
 * are optimal. With rho, a row whose tensions do not give w is TOWLINE_INACCURATE.
 */
ptrdiff_t towline_solve_batch(const towline_batch *batch, ptrdiff_t rows, int lanes);

#endif
