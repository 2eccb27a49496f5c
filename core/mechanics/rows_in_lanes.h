/* The mechanics of many rows, some at a time; included by rows_plain.c and its like after `num`. */
#include "mechanics/lines.h"
/* These need `dot`. */
#include "mechanics/distances.h"
#include "mechanics/rigid_body.h"
#include "mechanics/rows.h"
#include "mechanics/turning.h"

enum { CABLES = TOWLINE_MOST_CABLES, CARRIERS = TOWLINE_MOST_CARRIERS };

/* The poses of the next rows; those of carriers that all rows have in one place stay as they are. */
INLINE void gather_places(const towline_robot *robot, towline_places at, ptrdiff_t first, num *pose, num *carrier) {
    gather(pose, at.poses, 6, first, at.rows, 6);
    if (first == 0 || at.carriers_per) {
        gather(carrier, at.carriers, at.carriers_per, first, at.rows, 6 * robot->carriers);
    }
}

void FORM(lines_of_rows)(const towline_robot *robot, towline_places at, towline_lines want) {
    const int m = robot->cables;
    num pose[6], carrier[6 * CARRIERS];
    num lengths[CABLES], A[6 * CABLES], J[6 * CABLES], anchors[3 * CABLES], sensitivity[7 * CABLES];
    const lines each = {
        want.lengths ? lengths : NULL,         want.A ? A : NULL, want.J ? J : NULL, want.anchors ? anchors : NULL,
        want.sensitivity ? sensitivity : NULL,
    };
    for (ptrdiff_t first = 0; first < at.rows; first += LANES) {
        gather_places(robot, at, first, pose, carrier);
        lines_at(robot, pose, carrier, each);
        scatter(want.lengths, lengths, first, at.rows, m);
        scatter(want.A, A, first, at.rows, 6 * m);
        scatter(want.J, J, first, at.rows, 6 * m);
        scatter(want.anchors, anchors, first, at.rows, 3 * m);
        scatter(want.sensitivity, sensitivity, first, at.rows, 7 * m);
    }
}

void FORM(required_wrench_of_rows)(const towline_robot *robot, ptrdiff_t rows, towline_motion_of_platform motion,
                                   ptrdiff_t wind_per, double *w) {
    num pose[6], velocity[6], acceleration[6], wind[3], wrench[6];
    for (ptrdiff_t first = 0; first < rows; first += LANES) {
        gather(pose, motion.pose, 6, first, rows, 6);
        gather(velocity, motion.velocity, 6, first, rows, 6);
        gather(acceleration, motion.acceleration, 6, first, rows, 6);
        if (motion.wind) { gather(wind, motion.wind, wind_per, first, rows, 3); }
        required_wrench(robot, pose, velocity, acceleration, motion.wind ? wind : NULL, wrench);
        scatter(w, wrench, first, rows, 6);
    }
}

void FORM(ends_of_rows)(const towline_robot *robot, towline_places at, double *anchors, double *attachments) {
    const int m = robot->cables;
    num pose[6], carrier[6 * CARRIERS], starts[3 * CABLES], ends[3 * CABLES];
    for (ptrdiff_t first = 0; first < at.rows; first += LANES) {
        gather_places(robot, at, first, pose, carrier);
        ends_at(robot, pose, carrier, starts, ends);
        scatter(anchors, starts, first, at.rows, 3 * m);
        scatter(attachments, ends, first, at.rows, 3 * m);
    }
}

void FORM(cable_distances_of_rows)(const towline_robot *robot, towline_places at, double *distances) {
    const int m = robot->cables, pairs = m * (m - 1) / 2;
    num pose[6], carrier[6 * CARRIERS], starts[3 * CABLES], ends[3 * CABLES], distance[CABLES * (CABLES - 1) / 2 + 1];
    for (ptrdiff_t first = 0; first < at.rows; first += LANES) {
        gather_places(robot, at, first, pose, carrier);
        ends_at(robot, pose, carrier, starts, ends);
        distances_of_pairs(m, starts, ends, distance);
        scatter(distances, distance, first, at.rows, pairs);
    }
}

void FORM(columns_by_geometry_of_rows)(const towline_robot *robot, towline_places at, double *S) {
    num pose[6], carrier[6 * CARRIERS], changes[42 * CABLES];
    for (ptrdiff_t first = 0; first < at.rows; first += LANES) {
        gather_places(robot, at, first, pose, carrier);
        columns_by_geometry(robot, pose, carrier, changes);
        scatter(S, changes, first, at.rows, 42 * robot->cables);
    }
}

void FORM(wrench_by_pose_of_rows)(const towline_robot *robot, towline_places at, const double *tensions, int by_axes,
                                  double *D) {
    const int m = robot->cables;
    num pose[6], carrier[6 * CARRIERS], tension[CABLES], derivative[36];
    for (ptrdiff_t first = 0; first < at.rows; first += LANES) {
        gather_places(robot, at, first, pose, carrier);
        gather(tension, tensions, m, first, at.rows, m);
        wrench_by_pose(robot, pose, carrier, tension, by_axes, derivative);
        scatter(D, derivative, first, at.rows, 36);
    }
}
