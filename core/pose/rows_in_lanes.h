/* Forward kinematics of many rows, eight at a time; included by rows_plain.c and its like. */
#include "numbers/lanes.h"
/* These need `num`. */
#include "pose/descent.h"
#include "pose/rows.h"
#include "pose/spread.h"

void FORM(descend_rows)(const towline_robot *robot, ptrdiff_t rows, towline_lengths measured, towline_poses results) {
    descend(robot, rows, measured, results);
}

void FORM(spread_rows)(const towline_robot *robot, ptrdiff_t rows, towline_lengths measured, const double *poses,
                       double *covariances) {
    spread_of_rows(robot, rows, measured, poses, covariances);
}
