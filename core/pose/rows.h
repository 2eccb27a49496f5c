/* Forward kinematics of rows in lanes, a form for each kind of processor. */
#ifndef TOWLINE_POSE_ROWS_H
#define TOWLINE_POSE_ROWS_H

#include "numbers/processor.h"
#include "pose/pose.h"

#define DESCEND_ROWS(form)                                                                         \
    void descend_rows_##form(const towline_robot *robot, ptrdiff_t rows, towline_lengths measured, \
                             towline_poses results)
#define SPREAD_ROWS(form)                                                                                              \
    void spread_rows_##form(const towline_robot *robot, ptrdiff_t rows, towline_lengths measured, const double *poses, \
                            double *covariances)

DESCEND_ROWS(plain);
DESCEND_ROWS(avx2);
DESCEND_ROWS(avx512);
SPREAD_ROWS(plain);
SPREAD_ROWS(avx2);
SPREAD_ROWS(avx512);

#endif
