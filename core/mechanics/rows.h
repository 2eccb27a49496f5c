/* The mechanics of rows, a form for one at a time and one in lanes for each kind of processor. */
#ifndef TOWLINE_MECHANICS_ROWS_H
#define TOWLINE_MECHANICS_ROWS_H

#include "mechanics/mechanics.h"
#include "numbers/processor.h"

#define MECHANICS_OF_ROWS(form)                                                                                        \
    void lines_of_rows_##form(const towline_robot *robot, towline_places at, towline_lines want);                      \
    void required_wrench_of_rows_##form(const towline_robot *robot, ptrdiff_t rows, towline_motion_of_platform motion, \
                                        ptrdiff_t wind_per, double *w);                                                \
    void ends_of_rows_##form(const towline_robot *robot, towline_places at, double *anchors, double *attachments);     \
    void cable_distances_of_rows_##form(const towline_robot *robot, towline_places at, double *distances);             \
    void columns_by_geometry_of_rows_##form(const towline_robot *robot, towline_places at, double *S);                 \
    void wrench_by_pose_of_rows_##form(const towline_robot *robot, towline_places at, const double *tensions,          \
                                       int by_axes, double *D);

MECHANICS_OF_ROWS(one)
MECHANICS_OF_ROWS(plain)
MECHANICS_OF_ROWS(avx2)
MECHANICS_OF_ROWS(avx512)

#endif
