/* Rotations of one body: as vectors, whose length is the angle [rad], and as roll, pitch and yaw. This needs attitude.h. */
#ifndef TOWLINE_ROTATIONS_H
#define TOWLINE_ROTATIONS_H

#include "mechanics/attitude.h"

/* Write the rotation vector of a matrix M, at most half a turn long. */
INLINE void rotation_vector(const double *M, double *vector) {
    const double cosine = 0.5 * (M[0] + M[4] + M[8] - 1);
    double axis[3] = {0.5 * (M[7] - M[5]), 0.5 * (M[2] - M[6]), 0.5 * (M[3] - M[1])};
    const double sine = sqrt(dot(axis, axis)), angle = angle_of(sine, cosine);
    if (cosine < 0) { /* near half a turn the sine is rounding, but (1 - cosine) a a' has the axis a */
        int k = M[4] > M[0] ? 1 : 0;
        if (M[8] > M[4 * k]) { k = 2; }
        const double sign = axis[k] < 0 ? -1 : 1;
        for (int i = 0; i < 3; i++) { axis[i] = sign * (0.5 * (M[3 * i + k] + M[3 * k + i]) - (i == k ? cosine : 0)); }
    }
    const double size = sqrt(dot(axis, axis)), by = size > 0 ? angle / size : 0;
    for (int i = 0; i < 3; i++) { vector[i] = by * axis[i]; }
}

/* The cosine of the angle between two attitudes. */
INLINE double cosine_between(const double *R, const double *other) {
    double trace = 0;
    for (int i = 0; i < 9; i++) { trace += R[i] * other[i]; }
    return 0.5 * (trace - 1);
}

/* Turn a body with the attitude R by a rotation vector, both in {G} (Rodrigues). */
INLINE void turn_body(const double *vector, double *R) {
    const double angle = sqrt(dot(vector, vector));
    double sine, cosine;
    sine_and_cosine(angle, &sine, &cosine);
    const double along = angle > 0 ? sine / angle : 1, across = angle > 0 ? (1 - cosine) / (angle * angle) : 0.5;
    for (int k = 0; k < 3; k++) {
        const double column[3] = {R[k], R[3 + k], R[6 + k]};
        double moved[3], bent[3];
        cross(vector, column, moved);
        cross(vector, moved, bent);
        for (int i = 0; i < 3; i++) { R[3 * i + k] += along * moved[i] + across * bent[i]; }
    }
}

/*
 * Write roll, pitch and yaw of an attitude R, and their rates with a rate Omega in the body's axes.
 *
 * The yaw is the one that belongs to the roll: at a pitch of 90 degrees both are rounding, and only together an attitude.
 * There a body that turns about more than two axes has no such rates: nan.
 */
INLINE void angles_of(const double *R, const double *omega, double *angles, double *rates) {
    const double cp = sqrt(R[7] * R[7] + R[8] * R[8]);
    double sr, cr;
    angles[0] = atan2(R[7], R[8]);
    angles[1] = atan2(-R[6], cp);
    sine_and_cosine(angles[0], &sr, &cr);
    angles[2] = atan2(sr * R[2] - cr * R[1], cr * R[4] - sr * R[5]);
    const double level = sr * omega[1] + cr * omega[2];
    rates[2] = cp > 0 ? level / cp : level == 0 ? 0 : NAN;
    rates[0] = omega[0] - R[6] * rates[2];
    rates[1] = cr * omega[1] - sr * omega[2];
}

#endif
