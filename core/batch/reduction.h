/*
 * B = [L 0] Q in lanes, as in reduction.c but without pivoting: a matrix that would need it, or lacks a rank, is left
 * to the solver of one problem.
 */
#ifndef TOWLINE_BATCH_REDUCTION_H
#define TOWLINE_BATCH_REDUCTION_H

#include "batch/problem.h"

#define PIVOTS_APART 1e10 /* square of the largest row, over that of a row's part that is left */

/* x -= tau v (v . x), beginning at entry `from`. */
INLINE void reflect(num *x, const num *v, num tau, int from, int m) {
    num dot = number(0);
    for (int c = from; c < m; c++) { dot += v[c] * x[c]; }
    dot *= tau;
    for (int c = from; c < m; c++) { x[c] -= dot * v[c]; }
}

/* x = Q x, of which the first n entries are those in the row space. */
INLINE void apply_Q(const matrices *M, num *x) {
    for (int j = 0; j < M->n; j++) { reflect(x, M->B + j * M->m, M->tau[j], j, M->m); }
}

/* x = Q^T x */
INLINE void apply_Q_transposed(const matrices *M, num *x) {
    for (int j = M->n - 1; j >= 0; j--) { reflect(x, M->B + j * M->m, M->tau[j], j, M->m); }
}

INLINE num square_of(const num *x, int first, int last) {
    num square = number(0);
    for (int c = first; c < last; c++) { square += x[c] * x[c]; }
    return square;
}

/* Make an orthonormal basis of the null space, of at most two dimensions; zero where it has less. */
INLINE void null_space(matrices *M) {
    for (int e = 0; e < 2; e++) {
        for (int c = 0; c < M->m; c++) { M->normal[e][c] = number(c == M->n + e); }
        if (M->n + e < M->m) { apply_Q_transposed(M, M->normal[e]); }
    }
}

INLINE void reduce(matrices *M) {
    const int n = M->n, m = M->m;
    num largest = number(0);
    for (int j = 0; j < n; j++) { largest = larger(largest, square_of(M->B + j * m, 0, m)); }
    for (int j = 0; j < n; j++) {
        num *v = M->B + j * m;
        const num square = square_of(v, j, m);
        M->good &= PIVOTS_APART * square > largest;
        const num length = square_root(where(M->good, square, number(1))), head = v[j];
        const num pivot = where(head > 0.0, -length, length);
        M->diagonal[j] = pivot;
        v[j] = head - pivot;
        M->tau[j] = -1.0 / (pivot * (head - pivot));
        for (int i = j + 1; i < n; i++) { reflect(M->B + i * m, v, M->tau[j], j, m); }
    }
    null_space(M);
}

/* Put the s of least norm that gives b into s; return its size. */
INLINE num least_norm(demands *p, const matrices *M) {
    num square = number(0);
    for (int j = 0; j < M->n; j++) {
        num x = p->b[j];
        for (int i = 0; i < j; i++) { x -= M->B[j * M->m + i] * p->s[i]; }
        p->s[j] = x / M->diagonal[j];
        square += p->s[j] * p->s[j];
    }
    for (int c = M->n; c < M->m; c++) { p->s[c] = number(0); }
    apply_Q_transposed(M, p->s);
    return square_root(square);
}

/* Solve B^T d = push, which is in the row space and is overwritten. */
INLINE void direction_of(const matrices *M, num *push, num *d) {
    apply_Q(M, push);
    for (int j = M->n - 1; j >= 0; j--) {
        num x = push[j];
        for (int r = j + 1; r < M->n; r++) { x -= M->B[r * M->m + j] * d[r]; }
        d[j] = x / M->diagonal[j];
    }
}

#endif
