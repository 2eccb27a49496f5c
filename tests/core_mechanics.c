/* Compute all results of the mechanics from standard input and write them, for tests/test_core_mechanics.py. */
#include <stdio.h>
#include <stdlib.h>

#include "mechanics/mechanics.h"
#include "numbers/processor.h"

/* As the test says, in place of the core's function. */
static int processor;

int towline_processor(void) { return processor; }

/* Return as many bytes of standard input; memory is exactly as large as it must be, so that sanitizers see the end. */
static void *given(ptrdiff_t bytes) {
    void *to = malloc((size_t)bytes);
    if (!to || fread(to, 1, (size_t)bytes, stdin) != (size_t)bytes) {
        exit(1);
    }
    return to;
}

static double *given_rows(ptrdiff_t rows, ptrdiff_t size) { return given(rows * size * (ptrdiff_t)sizeof(double)); }

static double *results(ptrdiff_t rows, ptrdiff_t size) {
    double *to = malloc((size_t)(rows * size) * sizeof *to);
    if (!to) {
        exit(1);
    }
    return to;
}

static void put(double *from, ptrdiff_t count) {
    fwrite(from, sizeof *from, (size_t)count, stdout);
    free(from);
}

int main(int argc, char **argv) {
    if (argc != 3) {
        return 1;
    }
    const ptrdiff_t rows = atol(argv[1]);
    processor = atoi(argv[2]);
    towline_robot *robot = given(sizeof *robot);
    const ptrdiff_t m = robot->cables, c = robot->carriers;
    double *poses = given_rows(rows, 6), *velocities = given_rows(rows, 6), *accelerations = given_rows(rows, 6);
    double *carriers = given_rows(rows, 6 * c), *tensions = given_rows(rows, m);
    const towline_places at = {rows, poses, carriers, 6 * c};
    const towline_lines want = {results(rows, m), results(rows, 6 * m), results(rows, 6 * m), results(rows, 3 * m),
                                results(rows, 7 * m)};
    const towline_motion_of_platform motion = {poses, velocities, accelerations, NULL};
    double *anchors = results(rows, 3 * m), *attachments = results(rows, 3 * m), *S = results(rows, 42 * m);
    double *distances = results(rows, m * (m - 1) / 2), *by_pose = results(rows, 36), *by_axes = results(rows, 36),
           *w = results(rows, 6);
    towline_lines_of_rows(robot, at, want);
    towline_ends(robot, at, anchors, attachments);
    towline_cable_distances(robot, at, distances);
    towline_columns_by_geometry(robot, at, S);
    towline_wrench_by_pose(robot, at, tensions, 0, by_pose);
    towline_wrench_by_pose(robot, at, tensions, 1, by_axes);
    towline_required_wrench(robot, rows, motion, 0, w);
    put(want.lengths, rows * m), put(want.A, rows * 6 * m), put(want.J, rows * 6 * m);
    put(want.anchors, rows * 3 * m), put(want.sensitivity, rows * 7 * m);
    put(anchors, rows * 3 * m), put(attachments, rows * 3 * m), put(S, rows * 42 * m);
    put(distances, rows * (m * (m - 1) / 2));
    put(by_pose, rows * 36), put(by_axes, rows * 36), put(w, rows * 6);
    free(robot), free(poses), free(velocities), free(accelerations), free(carriers), free(tensions);
    return 0;
}
