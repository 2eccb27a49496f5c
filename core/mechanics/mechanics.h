/* A robot's mechanics: lines of the cables and required wrench, for one pose and for many. */
#ifndef TOWLINE_MECHANICS_H
#define TOWLINE_MECHANICS_H

#include <stddef.h>

#include "robot.h"

/* What is wanted at each row; each may be NULL. */
typedef struct {
    double *lengths;     /* (m) [m] */
    double *A;           /* (6, m), wrench matrix about the CoM, in {G} */
    double *J;           /* (m, 6), of the lengths with respect to the pose */
    double *anchors;     /* (m, 3), in {G} [m] */
    double *sensitivity; /* (m, 7), of the lengths with respect to anchor (3), attachment (3) and radius */
} towline_lines;

/* The motion of a row: pose, velocity and acceleration (6) of the platform, velocity of the air (3) or NULL. */
typedef struct {
    const double *pose, *velocity, *acceleration, *wind;
} towline_motion_of_platform;

void towline_lines_at(const towline_robot *robot, const double *pose, const double *carriers, towline_lines want);

void towline_required_wrench(const towline_robot *robot, towline_motion_of_platform motion, double *w);

/*
 * The same for many rows, with the same bits. `carriers_per` is how many numbers there are from the carriers of one row
 * to those of the next: 6 times their number, or 0 if all rows have them in one place; `wind_per` is 3 or 0.
 */
void towline_lines_of_rows(const towline_robot *robot, ptrdiff_t rows, const double *poses, const double *carriers,
                           ptrdiff_t carriers_per, towline_lines want);

void towline_required_wrench_of_rows(const towline_robot *robot, ptrdiff_t rows, towline_motion_of_platform motion,
                                     ptrdiff_t wind_per, double *w);

#endif
