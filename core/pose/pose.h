/* Forward kinematics: the pose of the platform from the lengths of its cables, and how the noise of these spreads it. */
#ifndef TOWLINE_POSE_H
#define TOWLINE_POSE_H

#include <stddef.h>

#include "robot.h"

/* Rows of measured lengths. */
typedef struct {
    const double *carriers; /* (c, 6), poses of the carriers of a row */
    ptrdiff_t
        carriers_per; /* numbers from those of one row to those of the next: 6 c, or 0 if all have them in one place */
    const double *lengths; /* (rows, m) [m] */
    const double *weights; /* (m), of the error of each cable, 1 / sigma [1/m] */
    const double *free;    /* (6), 1 for coordinates that move in this descent, else 0 */
    double damping;        /* of the first step: 0 from nearby */
} towline_lengths;

typedef struct {
    double *poses;  /* (rows, 6): from where to descend, and then where to */
    double *errors; /* (rows, m): get the weighted errors of the lengths there */
    double *steps;  /* (rows): get how many steps it took, or 0 where the descent did not end at a minimum */
} towline_poses;

/* Move poses to the nearest minimum of the sum of squared errors of their lengths. */
void towline_pose_from_lengths(const towline_robot *robot, ptrdiff_t rows, towline_lengths measured,
                               towline_poses results);

/*
 * Covariances (rows, 6, 6) of x, y, z and a small rotation in {G} at poses (rows, 6): zero for coordinates in which the
 * platform cannot move, and infinite where the lengths do not determine the pose. Lengths and damping of `measured` are
 * not read.
 */
void towline_pose_covariance(const towline_robot *robot, ptrdiff_t rows, towline_lengths measured, const double *poses,
                             double *covariances);

#endif
