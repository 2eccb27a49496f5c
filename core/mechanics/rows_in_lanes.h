/* The mechanics of many rows, some at a time; included by rows_plain.c and its like. */
#include "numbers/lanes.h"
/* These need `num`. */
#include "mechanics/lines.h"
#include "mechanics/rigid_body.h"
#include "mechanics/rows.h"

enum { CABLES = TOWLINE_MOST_CABLES, CARRIERS = TOWLINE_MOST_CARRIERS };

void FORM(lines_of_rows)(const towline_robot *robot, ptrdiff_t rows, const double *poses, const double *carriers,
                         ptrdiff_t carriers_per, towline_lines want) {
    const int m = robot->cables;
    num pose[6], carrier[6 * CARRIERS];
    num lengths[CABLES], A[6 * CABLES], J[6 * CABLES], anchors[3 * CABLES], sensitivity[7 * CABLES];
    const lines each = {
        want.lengths ? lengths : NULL,         want.A ? A : NULL, want.J ? J : NULL, want.anchors ? anchors : NULL,
        want.sensitivity ? sensitivity : NULL,
    };
    for (ptrdiff_t first = 0; first < rows; first += LANES) {
        gather(pose, poses, 6, first, rows, 6);
        if (first == 0 || carriers_per) {
            gather(carrier, carriers, carriers_per, first, rows, 6 * robot->carriers);
        }
        lines_at(robot, pose, carrier, each);
        scatter(want.lengths, lengths, first, rows, m);
        scatter(want.A, A, first, rows, 6 * m);
        scatter(want.J, J, first, rows, 6 * m);
        scatter(want.anchors, anchors, first, rows, 3 * m);
        scatter(want.sensitivity, sensitivity, first, rows, 7 * m);
    }
}

void FORM(required_wrench_of_rows)(const towline_robot *robot, ptrdiff_t rows, towline_motion_of_platform motion,
                                   ptrdiff_t wind_per, double *w) {
    num pose[6], velocity[6], acceleration[6], wind[3], wrench[6];
    for (ptrdiff_t first = 0; first < rows; first += LANES) {
        gather(pose, motion.pose, 6, first, rows, 6);
        gather(velocity, motion.velocity, 6, first, rows, 6);
        gather(acceleration, motion.acceleration, 6, first, rows, 6);
        if (motion.wind) {
            gather(wind, motion.wind, wind_per, first, rows, 3);
        }
        required_wrench(robot, pose, velocity, acceleration, motion.wind ? wind : NULL, wrench);
        scatter(w, wrench, first, rows, 6);
    }
}
