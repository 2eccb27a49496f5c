/* The set of wrenches that tensions inside their limits give, for many wrench matrices at once. */
#ifndef TOWLINE_AVAILABLE_WRENCH_H
#define TOWLINE_AVAILABLE_WRENCH_H

#include <stddef.h>

#include "distribution/towline_types.h"

typedef struct {
    int n;           /* wrench rows, 1 to TOWLINE_ROWS */
    int m;           /* cables, 1 to TOWLINE_CABLES */
    ptrdiff_t count; /* of matrices */
    const double *A; /* count x n x m, rows of one unit */
} towline_matrices;

/* The number of subsets of n - 1 columns, and so of normals that may be those of facets. */
ptrdiff_t towline_facets_of(int n, int m);

/*
 * Compute these normals, count x facets x n, of length one, each orthogonal to a subset of n - 1 columns in
 * lexicographic order, and the least and the most that tensions inside low and high (m) give along them,
 * count x facets.
 */
void towline_facets(const towline_matrices *matrices, const double *low, const double *high, double *normals,
                    double *least, double *most);

/* Most cables of `towline_margins`: it keeps a number for each set of them. */
enum { TOWLINE_MARGIN_CABLES = 10 };

/*
 * Compute the capacity margin of wrenches, count x n, or of one for all if `w_per` is 0 instead of n: the least of the
 * reserves along all normals, negative outside the set; m >= n. It is nan near a matrix without n independent columns,
 * and where a facet decides whose columns nearly depend on each other: `towline_facets` is exact there. The reserves,
 * count x facets in the order of `towline_facets`, may be NULL; they are infinite where the columns are dependent.
 */
void towline_margins(const towline_matrices *matrices, const double *w, ptrdiff_t w_per, const double *low,
                     const double *high, double *margins, double *reserves);

/*
 * Find whether each matrix has n independent columns, by QR with column pivoting, 1 or 0: a column counts as dependent
 * if less than `tolerance` of the longest one is left of it.
 */
void towline_full_rank(const towline_matrices *matrices, double tolerance, double *full);

#endif
