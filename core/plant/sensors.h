/* What perfect sensors measure: poses, velocities and cable lengths of states, in the coordinates of the house. */
#ifndef TOWLINE_PLANT_SENSORS_H
#define TOWLINE_PLANT_SENSORS_H

#include "plant/bodies.h"
#include "plant/cables.h"

/* Write position, Euler angles and their derivatives (12) of the frame of a body whose CoM is at `com` in it. */
static void write_motion(const body_motion *now, const body_now *body, const double *com, double *motion) {
    const double *R = body->R, *rate = now->rate;
    double offset[3], moved[3], sr, cr;
    turn(R, com, offset);
    cross(body->omega, offset, moved);
    for (int i = 0; i < 3; i++) {
        motion[i] = now->position[i] - offset[i];
        motion[6 + i] = now->velocity[i] - moved[i];
    }
    const double cp = sqrt(R[7] * R[7] + R[8] * R[8]);
    motion[3] = atan2(R[7], R[8]);
    motion[4] = atan2(-R[6], cp);
    sine_and_cosine(motion[3], &sr, &cr);
    /* The yaw that belongs to this roll: at a pitch of 90 degrees both are rounding, and only together an attitude. */
    motion[5] = atan2(sr * R[2] - cr * R[1], cr * R[4] - sr * R[5]);
    motion[11] = cp > 0 ? (sr * rate[1] + cr * rate[2]) / cp : NAN;
    motion[9] = rate[0] - R[6] * motion[11];
    motion[10] = cr * rate[1] - sr * rate[2];
}

#endif
