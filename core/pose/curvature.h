/*
 * The second derivative of the lengths, which Gauss and Newton's matrix leaves out.
 *
 * A length changes to second order by (dx, dphi)^T H (dx, dphi) / 2, with r the arm and G = (1, -[r]),
 *
 *     H = G^T T G + (0, 0; 0, (r n^T + n r^T) / 2 - (r . n) 1)
 *
 * where T, the derivative of n by the attachment, is (1 - n n^T) / s + (sin(theta) / a - 1 / s) f f^T: s is the free part,
 * f the normal of the sheave's plane, a the distance from the swivel axis; without a pulley the last term is zero.
 */
#ifndef TOWLINE_CURVATURE_H
#define TOWLINE_CURVATURE_H

#include "pose/reach.h"

/* Place of row j and column k <= j in a lower triangle of 6 x 6. */
INLINE int under(int j, int k) { return j * (j + 1) / 2 + k; }

/* Add factor v v^T to the matrix, for v = G^T a, of the coordinates that move. */
INLINE void add_product(num factor, const num *a, const num *arm, const double *free, num *matrix) {
    num v[6];
    cross(arm, a, v + 3);
    for (int j = 0; j < 3; j++) {
        v[j] = a[j] * free[j];
        v[3 + j] = v[3 + j] * free[3 + j];
    }
    for (int j = 0; j < 6; j++) {
        for (int k = 0; k <= j; k++) { matrix[under(j, k)] += factor * v[j] * v[k]; }
    }
}

/* Add H times `error` of a cable that reaches its attachment so. */
INLINE void add_curvature(const reach *to, num error, const double *free, num *matrix) {
    const num along = error / to->straight, inside = error * dot(to->arm, to->n);
    add_product(error * to->turning, to->across, to->arm, free, matrix);
    for (int i = 0; i < 3; i++) {
        const num axis[3] = {number(i == 0), number(i == 1), number(i == 2)};
        add_product(along, axis, to->arm, free, matrix);
    }
    add_product(-along, to->n, to->arm, free, matrix);
    for (int j = 0; j < 3; j++) {
        for (int k = 0; k <= j; k++) {
            const num turn = 0.5 * error * (to->arm[j] * to->n[k] + to->arm[k] * to->n[j]);
            matrix[under(3 + j, 3 + k)] += (j == k ? turn - inside : turn) * (free[3 + j] * free[3 + k]);
        }
    }
}

#endif
