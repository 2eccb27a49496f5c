/*
 * Capacity margins by the Gale dual of A; included by facets_plain.c and its like after `num`.
 *
 * A facet with normal d is parallel to n - 1 columns: d . a_i is zero but for the m - n + 1 other cables, so p = A' d lies
 * in the row space of A and is given, up to its length, by the minors of these rows of N, a basis of the null space of A.
 * With A' = Q1 R, N the rest of Q, and H = R^-1 Q1', the normal is d = H p, and with t0 = H' w the reserve along it is
 * sum_i max(p_i (t_max,i - t0,i), p_i (t_min,i - t0,i)) / |H p|: no normal is computed.
 */
#include "available_wrench/facets.h"

enum { FEW = TOWLINE_MARGIN_CABLES };

/* Of p, with N orthonormal: below, the columns of the facet are dependent, and another subset has its facet. */
#define DEPENDENT 1e-24
/* Below, p has lost digits, and with it the reserve: it may not decide. */
#define DOUBTFUL 1e-8
/* Of (sum of squares of A) (sum of squares of H): beyond, squares of H cost too many digits. */
#define NEAR_SINGULAR 1e7

typedef struct {
    int n, m;
    num Q[FEW][FEW];      /* row by row; its last m - n columns are N */
    num R[FEW][ROWS];     /* A' while it is reduced */
    num H[FEW][ROWS];     /* its column of each cable */
    num G[FEW][FEW];      /* H' H */
    num up[FEW], dn[FEW]; /* limits less t0 */
    num minor[1 << FEW];  /* of the first columns of N, by the set of rows */
    mask singular;
} gale_dual;

/* A' = Q R by Householder reflections; Q begins as the identity and takes them from the right. */
INLINE void reduce(gale_dual *g) {
    const int n = g->n, m = g->m;
    for (int i = 0; i < m; i++) {
        for (int j = 0; j < m; j++) { g->Q[i][j] = number(i == j); }
    }
    for (int c = 0; c < n; c++) {
        num v[FEW], square = number(0);
        for (int i = c; i < m; i++) {
            v[i] = g->R[i][c];
            square += v[i] * v[i];
        }
        const num size = square_root(square);
        v[c] += where(v[c] > 0.0, size, -size);
        const num length = square + size * magnitude(g->R[c][c]); /* half of v' v */
        const num factor = where(length > 0.0, 1.0 / length, number(0));
        for (int j = c; j < n; j++) {
            num along = number(0);
            for (int i = c; i < m; i++) { along += v[i] * g->R[i][j]; }
            along *= factor;
            for (int i = c; i < m; i++) { g->R[i][j] -= along * v[i]; }
        }
        for (int i = 0; i < m; i++) {
            num along = number(0);
            for (int j = c; j < m; j++) { along += g->Q[i][j] * v[j]; }
            along *= factor;
            for (int j = c; j < m; j++) { g->Q[i][j] -= along * v[j]; }
        }
    }
}

INLINE void take_dual(gale_dual *g, const num *A, const num *w, const double *low, const double *high) {
    const int n = g->n, m = g->m;
    num size = number(0), inverse_size = number(0);
    for (int c = 0; c < m; c++) {
        for (int i = 0; i < n; i++) {
            g->R[c][i] = A[i * m + c];
            size += A[i * m + c] * A[i * m + c];
        }
    }
    reduce(g);
    for (int c = 0; c < m; c++) {
        num t0 = number(0);
        for (int i = n - 1; i >= 0; i--) {
            num left = g->Q[c][i];
            for (int k = i + 1; k < n; k++) { left -= g->R[i][k] * g->H[c][k]; }
            g->H[c][i] = left / g->R[i][i];
            t0 += g->H[c][i] * w[i];
        }
        g->up[c] = high[c] - t0;
        g->dn[c] = low[c] - t0;
        for (int e = 0; e <= c; e++) {
            g->G[c][e] = number(0);
            for (int i = 0; i < n; i++) { g->G[c][e] += g->H[c][i] * g->H[e][i]; }
        }
        inverse_size += g->G[c][c];
    }
    const num condition = size * inverse_size;
    g->singular = (condition > NEAR_SINGULAR) | (condition != condition);
}

/* Minors of every set of up to m - n rows of N, each along its last column. */
INLINE void take_minors(gale_dual *g) {
    const int n = g->n, m = g->m;
    g->minor[0] = number(1);
    for (int set = 1; set < 1 << m; set++) {
        int size = 0;
        for (int c = 0; c < m; c++) { size += set >> c & 1; }
        if (size > m - n) { continue; }
        num sum = number(0), sign = number(size % 2 ? 1 : -1);
        for (int c = 0; c < m; c++) {
            if (set >> c & 1) {
                sum += sign * g->Q[c][n + size - 1] * g->minor[set & ~(1 << c)];
                sign = -sign;
            }
        }
        g->minor[set] = sum;
    }
}

/* Compute the reserve along the normal of a facet, from its set of other cables; the square of p tells its digits. */
INLINE num reserve(const gale_dual *g, int others, num *square) {
    num p[FEW], sign = number(1), size = number(0), most = number(0), least = number(0);
    int cable[FEW], count = 0;
    *square = number(0);
    for (int c = 0; c < g->m; c++) {
        if (others >> c & 1) {
            const num x = p[count] = sign * g->minor[others & ~(1 << c)];
            const num at_high = x * g->up[c], at_low = x * g->dn[c];
            most += larger(at_high, at_low);
            least += smaller(at_high, at_low);
            num cross = number(0);
            for (int e = 0; e < count; e++) { cross += p[e] * g->G[c][cable[e]]; }
            size += x * (x * g->G[c][c] + 2.0 * cross);
            *square += x * x;
            cable[count++] = c;
            sign = -sign;
        }
    }
    return smaller(most, -least) / square_root(size);
}

/* The least reserve of the facets that decide, and of those whose columns nearly depend on each other. */
typedef struct {
    num sure, doubtful;
} least_reserves;

INLINE void start_least(least_reserves *least) { least->sure = least->doubtful = number(INFINITY); }

/* Compute the reserve of a facet, and keep it if it is the least. */
INLINE void take_reserve(const gale_dual *g, int others, num *value, least_reserves *least) {
    num square;
    *value = reserve(g, others, &square);
    *value = where(square > DEPENDENT, *value, number(INFINITY));
    least->sure = smaller(least->sure, where(square > DOUBTFUL, *value, number(INFINITY)));
    least->doubtful = smaller(least->doubtful, where(square > DOUBTFUL, number(INFINITY), *value));
}

INLINE void refuse_unsure(const gale_dual *g, least_reserves *least) {
    const num nearly = least->doubtful - 0.01 * magnitude(least->doubtful);
    least->sure = where(g->singular | (nearly < least->sure), number(NAN), least->sure);
}

/* Compute the margins, and where `reserves` is not NULL those along all normals, in the order of `facets_of_rows`. */
void FORM(margins_of_rows)(const towline_matrices *matrices, const double *w, ptrdiff_t w_per, const double *low,
                           const double *high, double *margins, double *reserves) {
    const int n = matrices->n, m = matrices->m;
    const ptrdiff_t facets = towline_facets_of(n, m);
    gale_dual g = {.n = n, .m = m};
    num A[ROWS * FEW], demand[ROWS];
    for (ptrdiff_t first = 0; first < matrices->count; first += LANES) {
        const int lanes = matrices->count - first < LANES ? (int)(matrices->count - first) : LANES;
        int columns[ROWS];
        for (int i = 0; i < n; i++) { columns[i] = i; }
        gather(A, matrices->A, (ptrdiff_t)n * m, first, matrices->count, n * m);
        gather(demand, w, w_per, first, matrices->count, n);
        take_dual(&g, A, demand, low, high);
        take_minors(&g);
        num value;
        least_reserves least;
        start_least(&least);
        for (ptrdiff_t k = 0; k < facets; k++) {
            int others = (1 << m) - 1;
            for (int i = 0; i < n - 1; i++) { others &= ~(1 << columns[i]); }
            take_reserve(&g, others, &value, &least);
            if (reserves) { put(reserves + first * facets + k, &value, lanes, facets, 1); }
            next_subset(columns, n - 1, m);
        }
        refuse_unsure(&g, &least);
        put(margins + first, &least.sure, lanes, 1, 1);
    }
}
