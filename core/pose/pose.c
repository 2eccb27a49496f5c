/* Forward kinematics of one pose, and the choice of the form for many rows that fits the processor. */
#include "pose/pose.h"

#include "numbers/one.h"
#include "pose/rows.h"
/* These need `num`. */
#include "pose/descent.h"
#include "pose/spread.h"

void towline_pose_from_lengths(const towline_robot *robot, ptrdiff_t rows, towline_lengths measured,
                               towline_poses results) {
#ifndef TOWLINE_NO_LANES
    if (rows > 1) {
        BEST_FORM(descend_rows, robot, rows, measured, results);
        return;
    }
#endif
    descend(robot, rows, measured, results);
}

void towline_pose_covariance(const towline_robot *robot, ptrdiff_t rows, towline_lengths measured, const double *poses,
                             double *covariances) {
#ifndef TOWLINE_NO_LANES
    if (rows > 1) {
        BEST_FORM(spread_rows, robot, rows, measured, poses, covariances);
        return;
    }
#endif
    spread_of_rows(robot, rows, measured, poses, covariances);
}
