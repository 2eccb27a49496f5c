/*
 * A step of Levenberg and Marquardt's method: the solution of
 *
 *     (J^T J + lambda diag(J^T J)) (dx, dphi) = -J^T e
 *
 * for errors e of the lengths, in standard deviations, and their gradient J.
 */
#ifndef TOWLINE_STEP_H
#define TOWLINE_STEP_H

#include "pose/curvature.h"

enum { TRIANGLE = 21 };

/* The error of each length times its weight, and its gradient. */
typedef struct {
    num e[TOWLINE_MOST_CABLES], J[6 * TOWLINE_MOST_CABLES];
} deviations;

/* Set the deviations at a place, and return the sum of squared errors. */
INLINE num deviations_at(const towline_robot *robot, const place *at, const origins *from, const num *lengths,
                         const double *weights, const double *free, deviations *of) {
    num cost = number(0);
    for (int i = 0; i < robot->cables; i++) {
        reach to;
        reach_of(robot, i, at, from, &to);
        gradient_of(&to, weights[i], free, of->J + 6 * i);
        of->e[i] = (to.length - lengths[i]) * weights[i];
        cost += of->e[i] * of->e[i];
    }
    return cost;
}

/* Row j of the lower triangle of J^T J; compilers unroll it, since j is known where it is called. */
INLINE void normal_row(const num *J, int m, int j, num *row) {
    for (int k = 0; k <= j; k++) { row[k] = number(0); }
    for (int i = 0; i < m; i++) {
        for (int k = 0; k <= j; k++) { row[k] += J[6 * i + j] * J[6 * i + k]; }
    }
}

/* The lower triangle of J^T J, with 1 on the diagonal for coordinates that do not move. */
INLINE void normal_matrix(const num *J, int m, const double *free, num *matrix) {
    normal_row(J, m, 0, matrix + under(0, 0));
    normal_row(J, m, 1, matrix + under(1, 0));
    normal_row(J, m, 2, matrix + under(2, 0));
    normal_row(J, m, 3, matrix + under(3, 0));
    normal_row(J, m, 4, matrix + under(4, 0));
    normal_row(J, m, 5, matrix + under(5, 0));
    for (int j = 0; j < 6; j++) {
        if (free[j] == 0) { matrix[under(j, j)] = number(1); }
    }
}

/* Solve row j of L x = b, with inverses on the diagonal of L; x has the rows before, and b from there on. */
INLINE void forward(const num *L, int j, num *x) {
    for (int k = 0; k < j; k++) { x[j] -= L[under(j, k)] * x[k]; }
    x[j] *= L[under(j, j)];
}

/* The same of L^T x = b, from the last row on. */
INLINE void backward(const num *L, int j, num *x) {
    for (int k = j + 1; k < 6; k++) { x[j] -= L[under(k, j)] * x[k]; }
    x[j] *= L[under(j, j)];
}

/* Row j of the factor of Cholesky, from the rows before it; return where its pivot is positive. */
INLINE mask factor_row(num damping, int j, num *L) {
    const double least = 1e-15; /* of a pivot, relative to the diagonal */
    num *row = L + under(j, 0);
    num pivot = row[j] + damping * row[j];
    for (int k = 0; k < j; k++) {
        forward(L, k, row);
        pivot -= row[k] * row[k];
    }
    const mask positive = pivot > least * row[j];
    row[j] = 1.0 / square_root(where(positive, pivot, number(1)));
    return positive;
}

/* Make a matrix its factor of Cholesky, with inverses on the diagonal; return where it is positive definite. */
INLINE mask factorise(num damping, num *L) {
    const mask first = factor_row(damping, 0, L) & factor_row(damping, 1, L) & factor_row(damping, 2, L);
    return first & factor_row(damping, 3, L) & factor_row(damping, 4, L) & factor_row(damping, 5, L);
}

/* Set the step (6), the solution of L L^T step = -J^T e. */
INLINE void set_step(const deviations *of, int m, const num *L, num *step) {
    num x[6];
    for (int j = 0; j < 6; j++) { x[j] = number(0); }
    for (int i = 0; i < m; i++) {
        for (int j = 0; j < 6; j++) { x[j] -= of->J[6 * i + j] * of->e[i]; }
    }
    for (int j = 0; j < 6; j++) { forward(L, j, x); }
    for (int j = 5; j >= 0; j--) { backward(L, j, x); }
    for (int j = 0; j < 6; j++) { step[j] = x[j]; }
}

/*
 * The place that a step (6) leads to: x + dx and Q(dphi) R, with Cayley's rotation Q = (1 - S / 2)^-1 (1 + S / 2) of the
 * cross product S with dphi, which agrees with the exponential to second order and never leaves SO(3).
 */
INLINE void move(const place *at, const num *step, place *to) {
    const num a = 0.5 * step[3], b = 0.5 * step[4], c = 0.5 * step[5];
    const num inverse = 1.0 / (1.0 + a * a + b * b + c * c), twice = inverse + inverse;
    const num Q[9] = {
        (1.0 + a * a - b * b - c * c) * inverse,
        (a * b - c) * twice,
        (a * c + b) * twice, /* */
        (a * b + c) * twice,
        (1.0 - a * a + b * b - c * c) * inverse,
        (b * c - a) * twice, /* */
        (a * c - b) * twice,
        (b * c + a) * twice,
        (1.0 - a * a - b * b + c * c) * inverse, /* */
    };
    for (int i = 0; i < 3; i++) {
        to->x[i] = at->x[i] + step[i];
        for (int j = 0; j < 3; j++) {
            to->R[3 * i + j] = Q[3 * i] * at->R[j] + Q[3 * i + 1] * at->R[3 + j] + Q[3 * i + 2] * at->R[6 + j];
        }
    }
}

#endif
