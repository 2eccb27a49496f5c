/* What perfect sensors measure: poses, velocities and cable lengths of states, in the coordinates of the house. */
#ifndef TOWLINE_PLANT_SENSORS_H
#define TOWLINE_PLANT_SENSORS_H

#include "plant/bodies.h"
#include "plant/cables.h"
/* This needs `num`. */
#include "mechanics/rotations.h"

/* Write position, Euler angles and their derivatives (12) of the frame of a body whose CoM is at `com` in it. */
static void write_motion(const body_motion *now, const body_now *body, const double *com, double *motion) {
    double offset[3], moved[3];
    turn(body->R, com, offset);
    cross(body->omega, offset, moved);
    for (int i = 0; i < 3; i++) {
        motion[i] = now->position[i] - offset[i];
        motion[6 + i] = now->velocity[i] - moved[i];
    }
    angles_of(body->R, now->rate, motion + 3, motion + 9);
}

#endif
