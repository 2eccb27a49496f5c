/* The mechanics of rows by the form that fits the processor; a single row takes less time without lanes. */
#include "mechanics/mechanics.h"

#include "mechanics/rows.h"
#include "numbers/one.h"

#define FORM(name) name##_one
/* This needs `num`. */
#include "mechanics/rows_in_lanes.h"

void towline_lines_of_rows(const towline_robot *robot, towline_places at, towline_lines want) {
    if (at.rows == 1) {
        lines_of_rows_one(robot, at, want);
        return;
    }
    BEST_FORM(lines_of_rows, robot, at, want);
}

void towline_required_wrench(const towline_robot *robot, ptrdiff_t rows, towline_motion_of_platform motion,
                             ptrdiff_t wind_per, double *w) {
    if (rows == 1) {
        required_wrench_of_rows_one(robot, rows, motion, wind_per, w);
        return;
    }
    BEST_FORM(required_wrench_of_rows, robot, rows, motion, wind_per, w);
}

void towline_ends(const towline_robot *robot, towline_places at, double *anchors, double *attachments) {
    if (at.rows == 1) {
        ends_of_rows_one(robot, at, anchors, attachments);
        return;
    }
    BEST_FORM(ends_of_rows, robot, at, anchors, attachments);
}

void towline_cable_distances(const towline_robot *robot, towline_places at, double *distances) {
    if (at.rows == 1) {
        cable_distances_of_rows_one(robot, at, distances);
        return;
    }
    BEST_FORM(cable_distances_of_rows, robot, at, distances);
}

void towline_columns_by_geometry(const towline_robot *robot, towline_places at, double *S) {
    if (at.rows == 1) {
        columns_by_geometry_of_rows_one(robot, at, S);
        return;
    }
    BEST_FORM(columns_by_geometry_of_rows, robot, at, S);
}

void towline_wrench_by_pose(const towline_robot *robot, towline_places at, const double *tensions, int by_axes,
                            double *D) {
    if (at.rows == 1) {
        wrench_by_pose_of_rows_one(robot, at, tensions, by_axes, D);
        return;
    }
    BEST_FORM(wrench_by_pose_of_rows, robot, at, tensions, by_axes, D);
}
