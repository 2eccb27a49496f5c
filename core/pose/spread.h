/* How the noise of the lengths spreads a pose. */
#ifndef TOWLINE_SPREAD_H
#define TOWLINE_SPREAD_H

#include "pose/step.h"

/*
 * Make the columns of J (m, 6) orthogonal and of unit length, one after another: J = Q R, where Q takes the place of J.
 * A column of zeros, of a coordinate that does not move, stays.
 */
INLINE void orthogonalise(num *J, int m, const double *free, num R[6][6]) {
    for (int j = 0; j < 6; j++) {
        num square = number(0);
        for (int i = 0; i < m; i++) { square += J[6 * i + j] * J[6 * i + j]; }
        R[j][j] = free[j] == 0 ? number(1) : square_root(square);
        const num by_length = 1.0 / R[j][j];
        for (int i = 0; i < m; i++) { J[6 * i + j] = J[6 * i + j] * by_length; }
        for (int k = j + 1; k < 6; k++) {
            num along = number(0);
            for (int i = 0; i < m; i++) { along += J[6 * i + j] * J[6 * i + k]; }
            for (int i = 0; i < m; i++) { J[6 * i + k] -= along * J[6 * i + j]; }
            R[j][k] = along;
        }
    }
}

/* The inverse of an upper triangle. */
INLINE void invert_upper(num R[6][6], num inverse[6][6]) {
    for (int i = 0; i < 6; i++) {
        inverse[i][i] = 1.0 / R[i][i];
        for (int j = i + 1; j < 6; j++) {
            num total = number(0);
            for (int k = i; k < j; k++) { total += inverse[i][k] * R[k][j]; }
            inverse[i][j] = -total / R[j][j];
        }
    }
}

/*
 * The covariance (6, 6) of x, y, z and a small rotation in {G}: (J^T J)^-1 of the coordinates that move, J in standard
 * deviations, of which nothing is left. With J = Q R it is R^-1 R^-T, as exact as J and not as its square, so that motions
 * that the lengths leave open are told from rounding; then it is infinite. `size` makes rotations comparable [m].
 */
INLINE void set_covariance(num *J, int m, const double *free, double size, num *covariance) {
    const double most = 1e18; /* the square of the ratio of J's largest singular value to one that is not zero */
    num R[6][6], inverse[6][6], squares = number(0), spread = number(0);
    for (int i = 0; i < m; i++) {
        for (int j = 0; j < 6; j++) {
            J[6 * i + j] = J[6 * i + j] * (j < 3 ? 1.0 : 1.0 / size);
            squares += J[6 * i + j] * J[6 * i + j];
        }
    }
    orthogonalise(J, m, free, R);
    invert_upper(R, inverse);
    for (int i = 0; i < 6; i++) {
        for (int j = i; j < 6; j++) { spread += inverse[i][j] * inverse[i][j] * free[i]; }
    }
    const mask determined = squares * spread < most;
    for (int i = 0; i < 6; i++) {
        for (int j = i; j < 6; j++) {
            const double unit = (i < 3 ? 1.0 : 1.0 / size) * (j < 3 ? 1.0 : 1.0 / size);
            num total = number(0);
            for (int k = j; k < 6; k++) { total += inverse[i][k] * inverse[j][k]; }
            const int moves = free[i] > 0 && free[j] > 0;
            total = moves ? where(determined, total * unit, number(HUGE_VAL)) : number(0);
            covariance[6 * i + j] = covariance[6 * j + i] = total;
        }
    }
}

/* Covariances of rows, see `towline_pose_covariance`. */
INLINE void spread_of_rows(const towline_robot *robot, ptrdiff_t rows, towline_lengths measured, const double *poses,
                           double *covariances) {
    const double size = size_of_platform(robot);
    num pose[6], carriers[6 * TOWLINE_MOST_CARRIERS], J[6 * TOWLINE_MOST_CABLES], covariance[36];
    origins from;
    for (ptrdiff_t first = 0; first < rows; first += LANES) {
        gather(pose, poses, 6, first, rows, 6);
        if (first == 0 || measured.carriers_per) {
            gather(carriers, measured.carriers, measured.carriers_per, first, rows, 6 * robot->carriers);
            place_origins(robot, carriers, &from);
        }
        const place at = place_of(pose);
        for (int i = 0; i < robot->cables; i++) {
            reach to;
            reach_of(robot, i, &at, &from, &to);
            gradient_of(&to, measured.weights[i], measured.free, J + 6 * i);
        }
        set_covariance(J, robot->cables, measured.free, size, covariance);
        scatter(covariances, covariance, first, rows, 36);
    }
}

#endif
