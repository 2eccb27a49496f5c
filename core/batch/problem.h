/*
 * Tension problems in lanes: how they get there, and how their tensions are judged.
 *
 * As in standard_form.c the problem is to find the s of least norm with B s = b, low <= s <= high, where
 * t_i = t_ref_i + unit_i s_i. A solver leaves s in `s` and sets `good` to no wherever it is in doubt.
 */
#ifndef TOWLINE_BATCH_PROBLEM_H
#define TOWLINE_BATCH_PROBLEM_H

#include "batch/batch.h"
#include "distribution/tolerances.h"
#include "numbers/lanes.h"

enum { ROWS = TOWLINE_ROWS, CABLES = TOWLINE_CABLES };

/* Wrench matrices, weights and lengths. */
typedef struct {
    int n, m;
    mask good;
    num per_length;
    num unit[CABLES], per_unit[CABLES]; /* newtons in one unit of s, and the inverse */
    num norm[CABLES];                   /* of the columns of S A */
    num SA[ROWS * CABLES];              /* n x m, row by row: S A, */
    num B[ROWS * CABLES];               /* and with columns scaled to equal weights; later its reflectors and L */
    num diagonal[ROWS], tau[ROWS];      /* of L, and the factors of the reflectors */
    num normal[2][CABLES];              /* a basis of the null space: its columns are the normals of slabs */
} matrices;

/* What the cables are to give, and their limits. */
typedef struct {
    num Sw[ROWS], b[ROWS];
    num t_min[CABLES], t_max[CABLES], t_ref[CABLES];
    num low[CABLES], high[CABLES]; /* of s */
    num required, rounded, size;   /* as in `measure` of internal.h; the largest s nearest to zero */
    mask good;
    num s[CABLES]; /* later the tensions */
    mask proven;   /* out of reach, along the direction d */
    num d[ROWS], support, shortfall;
} demands;

/* The number i of each row that a lane has. */
INLINE num taken(towline_column column, const ptrdiff_t *row, int i) {
    if (column.per == 0) { return number(column.of[i]); }
    num x = number(0);
    for (int lane = 0; lane < LANES; lane++) { ((double *)&x)[lane] = column.of[row[lane] * column.per + i]; }
    return x;
}

/* Find the units in which cables have equal weights. */
INLINE void take_weights(matrices *M, const towline_batch *batch, const ptrdiff_t *row) {
    num heaviest = number(0), lightest = number(INFINITY);
    for (int c = 0; c < M->m; c++) { M->unit[c] = M->per_unit[c] = number(1); }
    for (int c = 0; c < M->m && batch->weights.of; c++) {
        const num weight = taken(batch->weights, row, c);
        M->unit[c] = weight;
        heaviest = larger(heaviest, weight);
        lightest = smaller(lightest, weight);
        M->good &= (weight >= 1 / HEAVIEST) & (weight <= HEAVIEST);
    }
    M->good &= heaviest <= WEIGHTS_APART * lightest;
    for (int c = 0; c < M->m && batch->weights.of; c++) {
        M->unit[c] = square_root(heaviest / M->unit[c]);
        M->per_unit[c] = 1.0 / M->unit[c];
    }
}

INLINE void take_matrices(matrices *M, const towline_batch *batch, const ptrdiff_t *row) {
    const int n = M->n = batch->n, m = M->m = batch->m;
    const num length = taken(batch->length, row, 0);
    M->per_length = 1.0 / length;
    M->good = (length >= 1 / HEAVIEST) & (length <= HEAVIEST);
    take_weights(M, batch, row);
    for (int c = 0; c < m; c++) {
        num square = number(0);
        for (int r = 0; r < n; r++) {
            const num a = taken(batch->A, row, r * m + c), x = n == 6 && r >= 3 ? a * M->per_length : a;
            M->SA[r * m + c] = x;
            M->B[r * m + c] = x * M->unit[c];
            square += x * x;
        }
        M->norm[c] = square_root(square);
        M->good &= M->norm[c] < LARGEST;
    }
}

/* b = S (w - A t_ref); sum up the wrench that is required. */
INLINE void take_wrenches(demands *p, const matrices *M, const towline_batch *batch, const ptrdiff_t *row) {
    const int n = M->n, m = M->m;
    num square = number(0);
    for (int r = 0; r < n; r++) {
        const num w = taken(batch->w, row, r);
        p->Sw[r] = n == 6 && r >= 3 ? w * M->per_length : w;
        square += p->Sw[r] * p->Sw[r];
        p->b[r] = p->Sw[r];
        for (int c = 0; c < m; c++) { p->b[r] -= M->SA[r * m + c] * p->t_ref[c]; }
    }
    p->good &= square < LARGEST * LARGEST;
    p->required = square_root(square);
}

/* The tension nearest to zero, or the s. */
INLINE num nearest(num low, num high) { return between(low, number(0), high); }

INLINE void take_demands(demands *p, const matrices *M, const towline_batch *batch, const ptrdiff_t *row) {
    for (int c = 0; c < M->m; c++) {
        p->t_min[c] = taken(batch->t_min, row, c);
        p->t_max[c] = taken(batch->t_max, row, c);
        p->t_ref[c] = taken(batch->t_ref, row, c);
    }
    p->good = M->good;
    p->proven = (mask){0};
    take_wrenches(p, M, batch, row);
    p->rounded = p->size = number(0);
    for (int c = 0; c < M->m; c++) {
        const num low = p->t_min[c], high = p->t_max[c], ref = p->t_ref[c];
        p->good &= (low <= high) & (low <= LARGEST) & (high >= -LARGEST) & (magnitude(ref) < LARGEST);
        p->required += M->norm[c] * magnitude(nearest(low, high));
        p->rounded += M->norm[c] * magnitude(ref);
        p->low[c] = (low - ref) * M->per_unit[c];
        p->high[c] = (high - ref) * M->per_unit[c];
        p->size = larger(magnitude(nearest(p->low[c], p->high[c])), p->size);
    }
}

/* |S (A t - w)| */
INLINE num wrench_error(const demands *p, const matrices *M) {
    num square = number(0);
    for (int r = 0; r < M->n; r++) {
        num total = -p->Sw[r];
        for (int c = 0; c < M->m; c++) { total += M->SA[r * M->m + c] * p->s[c]; }
        square += total * total;
    }
    return square_root(square);
}

/* Make tensions of s, inside their limits; return where their wrench is the one required, and the error. */
INLINE void judge(demands *p, const matrices *M, mask *met, num *error) {
    num terms = number(0);
    for (int c = 0; c < M->m; c++) {
        const num moved = where(M->norm[c] > 0, p->s[c], number(0)); /* what does not pull stays at its reference */
        p->s[c] = between(p->t_min[c], p->t_ref[c] + M->unit[c] * moved, p->t_max[c]);
        terms += M->norm[c] * magnitude(p->s[c]);
    }
    *error = wrench_error(p, M);
    const num rounded = p->rounded + smaller(terms, CANCELLED * p->required + p->rounded);
    *met = *error <= FEASIBILITY * p->required + ROUNDING * rounded;
}

#endif
