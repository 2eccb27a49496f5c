/* The mechanics for one pose, and the choice of the form for many rows that fits the processor. */
#include "mechanics/mechanics.h"

#include "mechanics/rows.h"
#include "numbers/one.h"
/* These need `num`. */
#include "mechanics/lines.h"
#include "mechanics/rigid_body.h"

void towline_lines_at(const towline_robot *robot, const double *pose, const double *carriers, towline_lines want) {
    const lines each = {want.lengths, want.A, want.J, want.anchors, want.sensitivity};
    lines_at(robot, pose, carriers, each);
}

void towline_required_wrench(const towline_robot *robot, towline_motion_of_platform motion, double *w) {
    required_wrench(robot, motion.pose, motion.velocity, motion.acceleration, motion.wind, w);
}

#ifdef TOWLINE_NO_LANES

void towline_lines_of_rows(const towline_robot *robot, ptrdiff_t rows, const double *poses, const double *carriers,
                           ptrdiff_t carriers_per, towline_lines want) {
    const int m = robot->cables;
    for (ptrdiff_t row = 0; row < rows; row++) {
        const towline_lines here = {
            want.lengths ? want.lengths + row * m : NULL,
            want.A ? want.A + row * 6 * m : NULL,
            want.J ? want.J + row * 6 * m : NULL,
            want.anchors ? want.anchors + row * 3 * m : NULL,
            want.sensitivity ? want.sensitivity + row * 7 * m : NULL,
        };
        towline_lines_at(robot, poses + 6 * row, carriers + carriers_per * row, here);
    }
}

void towline_required_wrench_of_rows(const towline_robot *robot, ptrdiff_t rows, towline_motion_of_platform motion,
                                     ptrdiff_t wind_per, double *w) {
    for (ptrdiff_t row = 0; row < rows; row++) {
        const towline_motion_of_platform here = {
            motion.pose + 6 * row,
            motion.velocity + 6 * row,
            motion.acceleration + 6 * row,
            motion.wind ? motion.wind + wind_per * row : NULL,
        };
        towline_required_wrench(robot, here, w + 6 * row);
    }
}

#else

void towline_lines_of_rows(const towline_robot *robot, ptrdiff_t rows, const double *poses, const double *carriers,
                           ptrdiff_t carriers_per, towline_lines want) {
    BEST_FORM(lines_of_rows, robot, rows, poses, carriers, carriers_per, want);
}

void towline_required_wrench_of_rows(const towline_robot *robot, ptrdiff_t rows, towline_motion_of_platform motion,
                                     ptrdiff_t wind_per, double *w) {
    BEST_FORM(required_wrench_of_rows, robot, rows, motion, wind_per, w);
}

#endif
