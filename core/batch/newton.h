/*
 * The bounded least norm in lanes for any number of cables, also with a soft wrench: Newton's method on the dual.
 *
 * The dual has one unknown for each equation. With multipliers y the best s is s(y) = clip(B^T y), and y is right where
 *
 *     r(y) = b - B s(y) - y / rho = 0,
 *
 * the gradient of a concave, piecewise quadratic function (1 / rho is 0 where the wrench must be met). Newton's steps
 * with H = B_F B_F^T + 1 / rho, F the cables between their limits, end after as many as it takes to find F: three, most
 * often. A step that goes too far is shortened to the best place on its way, by Newton again, in one dimension. Where
 * the wrench is out of reach the dual has no maximum, and y, the step or r are soon directions that prove it. Whatever
 * is not decided in a few steps, or rests on a pivot that is nearly zero, is left to the solver of one problem.
 *
 * Most of these problems have a soft wrench (rho) and a wrench outside the available set: y is then about rho times the
 * missing wrench, and rounding errors of B^T y are as large as the tensions of the cables between their limits.
 */
#ifndef TOWLINE_BATCH_NEWTON_H
#define TOWLINE_BATCH_NEWTON_H

#include "batch/proof.h"

#define STEPS 4         /* two or three find the free cables of nearly all that have tensions */
#define ON_THE_WAY 4    /* steps of the search along a step */
#define MET 3e-14       /* wrench error that is rounding, relative to the terms that it is the sum of */
#define DAMPING 1e-12   /* relative to the mean of H's diagonal */
#define SMALL_IN_H 1e-8 /* of a pivot or an eigenvalue, relative to the same */
#define PROMISING 1e-9  /* gap of the dual, relative to the demand, from which a direction is worth a proof */
#define CLIMBS 1e-12    /* slope along a step that is rounding, relative to that at its start */

typedef struct {
    double soft;       /* 1 / rho */
    num size, damping; /* mean of H's diagonal, and what is added to it */
    num y[ROWS], step[ROWS], r[ROWS];
    num pull[CABLES], change[CABLES]; /* B^T y, and B^T step */
    num free[CABLES];                 /* one where a cable is between its limits */
    num H[ROWS * ROWS];               /* factored: L D below the diagonal, 1 / D on it, L^T above */
    mask going, found;
} newton;

/* pulls = B^T d */
INLINE void pulls_along(const matrices *M, const num *d, num *pulls) {
    for (int c = 0; c < M->m; c++) {
        num total = number(0);
        for (int i = 0; i < M->n; i++) { total += M->B[i * M->m + c] * d[i]; }
        pulls[c] = total;
    }
}

/* Find s, r and the free cables for y; s stays as it is where it is found. Return where r is rounding. */
INLINE mask evaluate(newton *f, demands *p, const matrices *M) {
    num terms = p->required, error = number(0);
    pulls_along(M, f->y, f->pull);
    for (int c = 0; c < M->m; c++) {
        const num pull = f->pull[c], s = between(p->low[c], pull, p->high[c]);
        f->free[c] = where((pull > p->low[c]) & (pull < p->high[c]), number(1), number(0));
        p->s[c] = where(f->found, p->s[c], s);
        terms += M->norm[c] * M->unit[c] * magnitude(p->s[c]);
    }
    for (int i = 0; i < M->n; i++) {
        const num given_up = f->soft * f->y[i];
        num r = p->b[i] - given_up;
        for (int c = 0; c < M->m; c++) { r -= M->B[i * M->m + c] * p->s[c]; }
        f->r[i] = r;
        terms += magnitude(given_up);
        error = larger(magnitude(r), error);
    }
    return error <= MET * terms;
}

/* Return where a direction, of such pulls, proves that the wrench is out of reach. */
INLINE mask prove_along(demands *p, const matrices *M, mask chosen, const num *d, const num *pulls) {
    num demand = number(0), support = number(0);
    for (int i = 0; i < M->n; i++) { demand += d[i] * p->b[i]; }
    for (int c = 0; c < M->m; c++) { support += pulls[c] * where(pulls[c] > 0.0, p->high[c], p->low[c]); }
    const mask promising = chosen & (demand - support > PROMISING * demand);
    return any(promising) ? prove(p, M, promising, d) : promising;
}

/* Make the lower triangle of H = B_F B_F^T. */
INLINE void make_H(newton *f, const matrices *M) {
    const int n = M->n, m = M->m;
    for (int i = 0; i < n; i++) {
        num row[CABLES];
        for (int c = 0; c < m; c++) { row[c] = f->free[c] * M->B[i * m + c]; }
        for (int j = 0; j <= i; j++) {
            num total = number(0);
            for (int c = 0; c < m; c++) { total += row[c] * M->B[j * m + c]; }
            f->H[i * n + j] = total;
        }
    }
}

/* Make H and factor it; return its least pivot. */
INLINE num factor(newton *f, const matrices *M) {
    const int n = M->n;
    num *H = f->H, least = number(INFINITY);
    make_H(f, M);
    for (int j = 0; j < n; j++) {
        num pivot = H[j * n + j] + f->damping;
        for (int e = 0; e < j; e++) { pivot -= H[j * n + e] * H[e * n + j]; }
        least = smaller(pivot, least);
        const num inverse = 1.0 / larger(pivot, 0.5 * f->damping);
        H[j * n + j] = inverse;
        for (int i = j + 1; i < n; i++) {
            num x = H[i * n + j];
            for (int e = 0; e < j; e++) { x -= H[i * n + e] * H[e * n + j]; }
            H[i * n + j] = x;
            H[j * n + i] = x * inverse;
        }
    }
    return least;
}

/*
 * Bound the least eigenvalue of H, factored, from below: by one over the trace of its inverse.
 *
 * The least pivot is no bound. Rows are not in the order of their size, and damping makes pivots of what depends on a
 * short row before it.
 */
INLINE num least_eigenvalue(const newton *f, int n) {
    const num *H = f->H;
    num column[ROWS], trace = number(0);
    for (int j = 0; j < n; j++) { /* column j of L^-1 */
        column[j] = number(1);
        trace += H[j * n + j];
        for (int i = j + 1; i < n; i++) {
            num x = number(0);
            for (int e = j; e < i; e++) { x -= H[e * n + i] * column[e]; }
            column[i] = x;
            trace += x * x * H[i * n + i];
        }
    }
    return 1.0 / trace;
}

/* step = H^-1 r */
INLINE void find_step(newton *f, int n) {
    const num *H = f->H;
    num *x = f->step;
    for (int i = 0; i < n; i++) {
        x[i] = f->r[i];
        for (int e = 0; e < i; e++) { x[i] -= H[e * n + i] * x[e]; }
    }
    for (int i = n - 1; i >= 0; i--) {
        x[i] *= H[i * n + i];
        for (int e = i + 1; e < n; e++) { x[i] -= H[i * n + e] * x[e]; }
    }
}

/* The dual function along a step: its slope at the place `length`, and how that falls. */
INLINE num slope_at(const newton *f, const demands *p, int m, num length, num *bend) {
    num slope = number(0), curve = number(0);
    for (int c = 0; c < m; c++) {
        const num q = f->change[c], low = p->low[c], high = p->high[c], x = f->pull[c] + length * q;
        slope -= q * between(low, x, high);
        curve += where((x > low) & (x < high), q * q, number(0));
    }
    *bend = curve;
    return slope;
}

/* Return how far to go along the step: all of it, or to where the dual function is largest. */
INLINE num length_of_step(const newton *f, const demands *p, const matrices *M) {
    num first = number(0), curve = number(0), bend;
    for (int i = 0; i < M->n; i++) {
        first += (p->b[i] - f->soft * f->y[i]) * f->step[i];
        curve += f->soft * f->step[i] * f->step[i];
    }
    const num start = first + slope_at(f, p, M->m, number(0), &bend);
    num length = number(1), left = number(0), right = number(INFINITY);
    for (int turn = 0; turn < ON_THE_WAY; turn++) {
        const num slope = (first - length * curve) + slope_at(f, p, M->m, length, &bend);
        const mask too_far = slope < -CLIMBS * start, searching = too_far | (right < INFINITY);
        if (!any(searching)) { break; }
        right = where(too_far, length, right);
        left = where(too_far, left, length);
        const num better = length + slope / (curve + bend), middle = 0.5 * (left + right);
        length = where(searching, where((better > left) & (better < right), better, middle), length);
    }
    return length;
}

/* Begin at the multipliers of the least norm without limits. Where H lacks a rank "infeasible" may be wrong: stop. */
INLINE num begin(newton *f, const demands *p, const matrices *M) {
    for (int c = 0; c < M->m; c++) { f->free[c] = number(1); }
    for (int i = 0; i < M->n; i++) { f->r[i] = p->b[i]; }
    const num least = factor(f, M);
    find_step(f, M->n);
    f->going &= f->step[0] <= INFINITY;
    if (f->soft == 0) { f->going &= least_eigenvalue(f, M->n) > SMALL_IN_H * f->size; }
    for (int i = 0; i < M->n; i++) { f->y[i] = f->step[i]; }
    return least;
}

/* Take a step where it goes on; return the least pivot. */
INLINE num take_step(newton *f, demands *p, const matrices *M) {
    const num least = factor(f, M);
    find_step(f, M->n);
    pulls_along(M, f->step, f->change);
    if (f->soft == 0) { f->going &= ~prove_along(p, M, f->going, f->step, f->change); }
    const num length = length_of_step(f, p, M);
    for (int i = 0; i < M->n; i++) { f->y[i] = where(f->going, f->y[i] + length * f->step[i], f->y[i]); }
    return least;
}

/* Look for proofs along y, and at first along r. */
INLINE void prove_out_of_reach(newton *f, demands *p, const matrices *M, int step) {
    f->going &= ~prove_along(p, M, f->going, f->y, f->pull);
    if (step == 0 && any(f->going)) {
        pulls_along(M, f->r, f->change);
        f->going &= ~prove_along(p, M, f->going, f->r, f->change);
    }
}

/* Find s in a few steps; where they do not decide, the lane is in doubt. */
INLINE void solve_by_newton(demands *p, const matrices *M, double soft) {
    newton f = {.soft = soft, .going = p->good};
    for (int i = 0; i < M->n * M->m; i++) { f.size += M->B[i] * M->B[i]; }
    f.size /= M->n;
    f.damping = DAMPING * f.size + soft;
    num least = begin(&f, p, M);
    for (int step = 0; step <= STEPS; step++) {
        mask met = f.going & evaluate(&f, p, M);
        if (soft == 0) { met &= least > SMALL_IN_H * f.size; }
        f.found |= met;
        f.going &= ~met;
        if (soft == 0 && any(f.going)) { prove_out_of_reach(&f, p, M, step); }
        if (step == STEPS || !any(f.going)) { break; }
        least = take_step(&f, p, M);
    }
    if (soft > 0 && any(f.found)) { /* r = y / rho is what is missing of the wrench: more than there is, or a trade */
        prove_along(p, M, f.found, f.y, f.pull);
    }
    p->good = f.found;
}

#endif
