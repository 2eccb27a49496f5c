/* Where a robot is: the attitudes of its bodies, and how its cables run between them. */
#ifndef TOWLINE_CONFIGURATION_H
#define TOWLINE_CONFIGURATION_H

#include <stddef.h>

#include "numbers/one.h"
/* These need `num`. */
#include "mechanics/lines.h"
#include "mechanics/rigid_body.h"
#include "mechanics/rotations.h"

enum { MOTION = 12 };                 /* numbers of a body's motion: pose and velocity */
static const double SHORTEST = 1e-12; /* [m]: of less, a cable has no direction */

/* A cable, in the axes of {G}. */
typedef struct {
    double pull[3];        /* the unit vector in which it pulls the platform */
    double arm[3];         /* from the platform's CoM to the attachment */
    double carrier_arm[3]; /* from the carrier's frame to the attachment */
    double length; /* 0 without a line: both ends are one point, or one is inside the sheave; it does not pull */
} cable_run;

typedef struct {
    attitude platform, carrier[TOWLINE_MOST_CARRIERS];
    double com[3];      /* from the platform's frame to its CoM, */
    double position[3]; /* and the CoM itself, in {G} */
    cable_run cable[TOWLINE_MOST_CABLES];
} configuration;

/* Put the platform and the attitudes of carriers where motions (1 + c, 12) have them. */
INLINE void put_bodies(const towline_robot *robot, const double *motions, configuration *at) {
    at->platform = attitude_of(motions + 3);
    turn_constant(at->platform.R, robot->com, at->com);
    for (int i = 0; i < 3; i++) { at->position[i] = motions[i] + at->com[i]; }
    for (int c = 0; c < robot->carriers; c++) { at->carrier[c] = attitude_of(motions + MOTION * (1 + c) + 3); }
}

/* From the platform's CoM to the attachment of a cable. */
INLINE void arm_of(const towline_robot *robot, const configuration *at, int cable, double *arm) {
    turn_constant(at->platform.R, robot->cable[cable].attachment, arm);
    for (int i = 0; i < 3; i++) { arm[i] -= at->com[i]; }
}

/* Run the cables from carriers at positions that are `per` numbers apart. */
INLINE void run_cables(const towline_robot *robot, const double *positions, ptrdiff_t per, configuration *at) {
    for (int i = 0; i < robot->cables; i++) {
        const towline_cable *cable = &robot->cable[i];
        const attitude *carrier = &at->carrier[cable->carrier];
        const double *origin = positions + per * cable->carrier;
        cable_run *run = &at->cable[i];
        double anchor[3], axis[3], d[3];
        arm_of(robot, at, i, run->arm);
        turn_constant(carrier->R, cable->anchor, anchor);
        for (int j = 0; j < 3; j++) {
            run->carrier_arm[j] = at->position[j] + run->arm[j] - origin[j];
            d[j] = run->carrier_arm[j] - anchor[j];
        }
        line found;
        if (cable->radius == 0) {
            found = straight_line(d);
        } else {
            turn_constant(carrier->R, cable->axis, axis);
            found = line_over_sheave(cable->radius, d, axis, 1);
        }
        const int runs = found.length > SHORTEST && dot(found.pull, found.pull) > 0.5; /* not of nan */
        run->length = runs ? found.length : 0;
        for (int j = 0; j < 3; j++) { run->pull[j] = runs ? found.pull[j] : 0; }
    }
}

/* The configuration of motions (1 + c, 12). */
INLINE void configuration_at(const towline_robot *robot, const double *motions, configuration *at) {
    put_bodies(robot, motions, at);
    run_cables(robot, motions + MOTION, MOTION, at);
}

/* Write the columns (u, r x u) of A (6, m), with zeros where the platform has no freedom. */
INLINE void wrench_matrix(const towline_robot *robot, const configuration *at, double *A) {
    const int m = robot->cables;
    for (int i = 0; i < m; i++) {
        const cable_run *run = &at->cable[i];
        double moment[3];
        cross(run->arm, run->pull, moment);
        for (int j = 0; j < 3; j++) {
            A[j * m + i] = robot->freedom[j] * run->pull[j];
            A[(3 + j) * m + i] = robot->freedom[3 + j] * moment[j];
        }
    }
}

/* w = A t, (6) */
INLINE void wrench_of(const towline_robot *robot, const double *A, const double *tensions, double *w) {
    for (int k = 0; k < 6; k++) {
        w[k] = 0;
        for (int i = 0; i < robot->cables; i++) { w[k] += A[k * robot->cables + i] * tensions[i]; }
    }
}

/* The difference of two angles, between half turns. */
INLINE double turn_between(double from, double to) {
    const double whole = 2 * 3.14159265358979323846;
    return (to - from) - whole * floor((to - from) / whole + 0.5);
}

#endif
