/* Derivatives: of the wrench that a motion needs, and of what a cable with a tension gives. */
#ifndef TOWLINE_SLOPES_H
#define TOWLINE_SLOPES_H

#include "control/configuration.h"

/*
 * Write the derivatives of `required_wrench` by the three angles, and by their three rates, at an acceleration (6). The
 * position and its rate change nothing.
 */
void towline_wrench_slopes(const towline_robot *robot, const attitude *at, const double *velocity,
                           const double *acceleration, double slopes[6][6]);

/* The stiffness of a tension: minus the derivative of the force on the platform by the attachment's displacement. */
typedef struct {
    double force[3];        /* t u */
    double stiffness[3][3]; /* t times the second derivative of the length */
} tensioned;

tensioned towline_tensioned(const towline_robot *robot, const configuration *at, int cable, double tension);

/* Add to a wrench what a displacement (3) of the attachment from the anchor changes. */
INLINE void add_displacement(const tensioned *cable, const double *arm, const double *displacement, double *w) {
    double force[3], moment[3];
    for (int i = 0; i < 3; i++) { force[i] = -dot(cable->stiffness[i], displacement); }
    cross(arm, force, moment);
    for (int i = 0; i < 3; i++) {
        w[i] += force[i];
        w[3 + i] += moment[i];
    }
}

#endif
