/*
 * Normals of facets and what tensions give along them; included by facets_plain.c and its like after `num`.
 *
 * Each normal is orthogonal to n - 1 columns. The subsets come in lexicographic order, so that one shares its first
 * columns with the one before: an orthonormal basis of what is orthogonal to them is kept for every number of columns,
 * and a Householder reflection takes the next column out of it.
 */
#include "available_wrench/facets.h"

enum { ROWS = TOWLINE_ROWS, CABLES = TOWLINE_CABLES };

typedef struct {
    int n, m;
    num A[ROWS * CABLES];
    num per_length[CABLES];       /* of columns: a short one decides as much as a long one where its facet is */
    num basis[ROWS][ROWS * ROWS]; /* by number of columns taken out: vectors, row by row */
} wrench_sets;

INLINE void take_sets(wrench_sets *s, const towline_matrices *matrices, ptrdiff_t first) {
    const int n = s->n = matrices->n, m = s->m = matrices->m;
    gather(s->A, matrices->A, (ptrdiff_t)n * m, first, matrices->count, n * m);
    for (int j = 0; j < m; j++) {
        num square = number(0);
        for (int i = 0; i < n; i++) { square += s->A[i * m + j] * s->A[i * m + j]; }
        s->per_length[j] = where(square > 0.0, 1.0 / square_root(square), number(0));
    }
    for (int i = 0; i < n * n; i++) { s->basis[0][i] = number(i % (n + 1) == 0); }
}

/* Make the basis of what is orthogonal to one more column, j: reflect that column onto the first vector, and drop it. */
INLINE void take_out(wrench_sets *s, int depth, int j) {
    const int n = s->n, m = s->m, left = n - depth;
    const num *basis = s->basis[depth];
    num along[ROWS], onto[ROWS], rest = number(0);
    for (int v = 0; v < left; v++) {
        num dot = number(0);
        for (int i = 0; i < n; i++) { dot += basis[v * n + i] * s->A[i * m + j]; }
        along[v] = dot * s->per_length[j];
        rest += v > 0 ? along[v] * along[v] : number(0);
    }
    const num size = square_root(along[0] * along[0] + rest);
    along[0] += where(along[0] > 0.0, size, -size);
    const num square = along[0] * along[0] + rest;
    /* A column that depends on those before leaves any basis as good as another. */
    const num factor = where(square > 0.0, 2.0 / square, number(0));
    for (int i = 0; i < n; i++) {
        num dot = number(0);
        for (int v = 0; v < left; v++) { dot += basis[v * n + i] * along[v]; }
        onto[i] = factor * dot;
    }
    for (int v = 1; v < left; v++) {
        for (int i = 0; i < n; i++) { s->basis[depth + 1][(v - 1) * n + i] = basis[v * n + i] - onto[i] * along[v]; }
    }
}

/* Compute the least and the most that tensions give along a normal. */
INLINE void support(const wrench_sets *s, const num *normal, const double *low, const double *high, num *least,
                    num *most) {
    *least = *most = number(0);
    for (int j = 0; j < s->m; j++) {
        num pull = number(0);
        for (int i = 0; i < s->n; i++) { pull += normal[i] * s->A[i * s->m + j]; }
        const num at_low = pull * low[j], at_high = pull * high[j];
        *least += smaller(at_low, at_high);
        *most += larger(at_low, at_high);
    }
}

/* Write `size` numbers of each lane, `per` from one to the next. */
INLINE void put(double *to, const num *from, int lanes, ptrdiff_t per, int size) {
    for (int lane = 0; lane < lanes; lane++) {
        for (int i = 0; i < size; i++) { to[lane * per + i] = ((const double *)from)[LANES * i + lane]; }
    }
}

/* Find the next subset of `size` columns; return the first place that has another one, or -1 after the last. */
INLINE int next_subset(int *columns, int size, int m) {
    int place = size - 1;
    while (place >= 0 && columns[place] == m - size + place) { place--; }
    for (int i = place; i >= 0 && i < size; i++) { columns[i] = i == place ? columns[i] + 1 : columns[i - 1] + 1; }
    return place;
}

void FORM(facets_of_rows)(const towline_matrices *matrices, const double *low, const double *high, double *normals,
                          double *least, double *most) {
    const int n = matrices->n, m = matrices->m;
    const ptrdiff_t facets = towline_facets_of(n, m);
    wrench_sets s;
    num down, up;
    for (ptrdiff_t first = 0; first < matrices->count; first += LANES) {
        const int lanes = matrices->count - first < LANES ? (int)(matrices->count - first) : LANES;
        int columns[ROWS], depth = 0;
        for (int i = 0; i < n - 1; i++) { columns[i] = i; }
        take_sets(&s, matrices, first);
        for (ptrdiff_t k = 0; k < facets; k++) {
            for (; depth < n - 1; depth++) { take_out(&s, depth, columns[depth]); }
            const num *normal = s.basis[n - 1];
            support(&s, normal, low, high, &down, &up);
            put(normals + (first * facets + k) * n, normal, lanes, facets * n, n);
            put(least + first * facets + k, &down, lanes, facets, 1);
            put(most + first * facets + k, &up, lanes, facets, 1);
            depth = next_subset(columns, n - 1, m);
        }
    }
}
