/* A robot's mechanics: lines of the cables and required wrench, at many poses. */
#ifndef TOWLINE_MECHANICS_H
#define TOWLINE_MECHANICS_H

#include <stddef.h>

#include "robot.h"

/*
 * Poses (6) of the platform and (c, 6) of the carriers at many rows. `carriers_per` is how many numbers there are from
 * the carriers of one row to those of the next: 6 times their number, or 0 if all rows have them in one place.
 */
typedef struct {
    ptrdiff_t rows;
    const double *poses, *carriers;
    ptrdiff_t carriers_per;
} towline_places;

/* What is wanted at each row; each may be NULL. */
typedef struct {
    double *lengths;     /* (m) [m] */
    double *A;           /* (6, m), wrench matrix about the CoM, in {G} */
    double *J;           /* (m, 6), of the lengths with respect to the pose */
    double *anchors;     /* (m, 3), in {G} [m] */
    double *sensitivity; /* (m, 7), of the lengths with respect to anchor (3), attachment (3) and radius */
} towline_lines;

/* The motion of each row: pose, velocity and acceleration (6) of the platform, velocity of the air (3) or NULL. */
typedef struct {
    const double *pose, *velocity, *acceleration, *wind;
} towline_motion_of_platform;

/* A row has the same bits whether it is computed alone or with others. */
void towline_lines_of_rows(const towline_robot *robot, towline_places at, towline_lines want);

/* w (6); `wind_per` is 3, or 0 if all rows have the wind in one place. */
void towline_required_wrench(const towline_robot *robot, ptrdiff_t rows, towline_motion_of_platform motion,
                             ptrdiff_t wind_per, double *w);

/* Anchors and attachments of the cables in {G}, (m, 3) each [m]. */
void towline_ends(const towline_robot *robot, towline_places at, double *anchors, double *attachments);

/* Distances of all pairs of cables, (m (m - 1) / 2) from the first and second to the last two [m]. */
void towline_cable_distances(const towline_robot *robot, towline_places at, double *distances);

/* S (m, 6, 7): the column of A of each cable with respect to its anchor (3), attachment (3) and radius. */
void towline_columns_by_geometry(const towline_robot *robot, towline_places at, double *S);

/*
 * D (6, 6): the wrench A t at constant tensions t (m) with respect to the pose or, `by_axes`, to displacements of the CoM
 * and turns about it, along and about the axes of {G}; then -D is the stiffness at constant tensions.
 */
void towline_wrench_by_pose(const towline_robot *robot, towline_places at, const double *tensions, int by_axes,
                            double *D);

#endif
