/* Attitudes by roll, pitch and yaw: the rotation, and what rates and accelerations of the angles mean. */
#ifndef TOWLINE_ATTITUDE_H
#define TOWLINE_ATTITUDE_H

#include "vectors.h"

typedef struct {
    num R[9]; /* from the body's axes to {G} */
    num sin_roll, cos_roll, sin_pitch, cos_pitch;
} attitude;

/* R = Rz(yaw) Ry(pitch) Rx(roll) */
INLINE attitude attitude_of(const num *angles) {
    attitude at;
    num sr, cr, sp, cp, sy, cy;
    sine_and_cosine(angles[0], &sr, &cr);
    sine_and_cosine(angles[1], &sp, &cp);
    sine_and_cosine(angles[2], &sy, &cy);
    const num R[9] = {
        cy * cp,
        cy * sp * sr - sy * cr,
        cy * sp * cr + sy * sr, /* */
        sy * cp,
        sy * sp * sr + cy * cr,
        sy * sp * cr - cy * sr, /* */
        -sp,
        cp * sr,
        cp * cr, /* */
    };
    for (int i = 0; i < 9; i++) { at.R[i] = R[i]; }
    at.sin_roll = sr, at.cos_roll = cr, at.sin_pitch = sp, at.cos_pitch = cp;
    return at;
}

/* Omega = P dTheta, the rate in the body's axes. */
INLINE void body_rate(const attitude *at, const num *rates, num *omega) {
    omega[0] = rates[0] - at->sin_pitch * rates[2];
    omega[1] = at->cos_roll * rates[1] + at->sin_roll * at->cos_pitch * rates[2];
    omega[2] = at->cos_roll * at->cos_pitch * rates[2] - at->sin_roll * rates[1];
}

/* alpha = P ddTheta + dP dTheta, the angular acceleration in the body's axes. */
INLINE void body_acceleration(const attitude *at, const num *rates, const num *accelerations, num *alpha) {
    const num sr = at->sin_roll, cr = at->cos_roll, sp = at->sin_pitch, cp = at->cos_pitch;
    const num roll = rates[0], pitch = rates[1], yaw = rates[2];
    body_rate(at, accelerations, alpha);
    alpha[0] -= cp * pitch * yaw;
    alpha[1] += (cr * cp * roll - sr * sp * pitch) * yaw - sr * roll * pitch;
    alpha[2] -= (sr * cp * roll + cr * sp * pitch) * yaw + cr * roll * pitch;
}

#endif
