/*
 * How the platform accelerates by a wrench: with H ddx + h = w(x, dx, ddx), ddx = H^-1 (w - h).
 *
 * H is block triangular: the moments M = R J R' N ddTheta turn the platform about three axes, the columns of N, and the
 * forces m (ddp + N ddTheta x c) move it. These axes are those of roll, pitch and yaw, N = R P, or those of {G}.
 */
#ifndef TOWLINE_MOBILITY_H
#define TOWLINE_MOBILITY_H

#include "control/configuration.h"
#include "control/equations.h"

typedef struct {
    double lightness[3];  /* accelerations of the position by forces, */
    double turning[3][3]; /* about the axes by moments, */
    double carried[3][3]; /* and of the position by those about the axes, since the CoM is off the frame's origin */
} mobility;

/* All of it is zero where the platform has no freedom. */
INLINE mobility mobility_at(const towline_robot *robot, const configuration *at, const double axes[3][3]) {
    const double *freedom = robot->freedom;
    mobility by;
    double inertia[3][3], column[3], spin[3], moment[3];
    for (int k = 0; k < 3; k++) {
        turn_back(at->platform.R, axes[k], column);
        constant_times(robot->body[0].inertia, column, spin);
        turn(at->platform.R, spin, moment);
        cross(axes[k], at->com, column);
        for (int i = 0; i < 3; i++) {
            inertia[i][k] = freedom[3 + i] * freedom[3 + k] * moment[i] + (i == k ? 1 - freedom[3 + k] : 0);
            by.carried[i][k] = -freedom[i] * column[i];
        }
        by.lightness[k] = freedom[k] / robot->mass;
    }
    const double inverse = 1 / adjugate((const double (*)[3])inertia, by.turning);
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) { by.turning[i][k] *= inverse * freedom[3 + i] * freedom[3 + k]; }
    }
    return by;
}

/* Write the acceleration of the position and about the axes by a wrench, both (6). */
INLINE void accelerate(const mobility *by, const double *w, double *acceleration) {
    double *turning = acceleration + 3;
    for (int i = 0; i < 3; i++) { turning[i] = dot(by->turning[i], w + 3); }
    for (int i = 0; i < 3; i++) { acceleration[i] = by->lightness[i] * w[i] + dot(by->carried[i], turning); }
}

/* Write it with tensions and a disturbance; `needed` (6) is the wrench with which nothing accelerates. */
INLINE void acceleration_by(const towline_robot *robot, const mobility *by, const double *A, const double *tensions,
                            const double *disturbance, const double *needed, double *acceleration) {
    double w[6];
    wrench_of(robot, A, tensions, w);
    for (int k = 0; k < 6; k++) { w[k] += disturbance[k] - needed[k]; }
    accelerate(by, w, acceleration);
}

#endif
