/* Compute poses from lengths in standard input, their covariances and curvatures, for tests/test_core_pose.py. */
#include <stdio.h>
#include <stdlib.h>

#include "pose/pose.h"

#include "numbers/one.h"
/* These need `num`. */
#include "pose/step.h"

/* Return so many numbers of standard input, or zeros; memory is exactly as large as it must be, so that sanitizers see its end. */
static void *numbers(size_t bytes, int given) {
    void *to = calloc(bytes ? bytes : 1, 1);
    if (!to || (given && fread(to, 1, bytes, stdin) != bytes)) {
        exit(1);
    }
    return to;
}

/* Write the part of the second derivative of half the sum of squared errors that comes from the curvature of the lengths. */
static void write_curvature(const towline_robot *robot, towline_lengths measured, const double *carriers,
                            const double *lengths, const double *pose) {
    static origins from;
    static deviations here;
    double matrix[TRIANGLE] = {0};
    const place at = place_of(pose);
    place_origins(robot, carriers, &from);
    deviations_at(robot, &at, &from, lengths, measured.weights, measured.free, &here);
    for (int i = 0; i < robot->cables; i++) {
        reach to;
        reach_of(robot, i, &at, &from, &to);
        add_curvature(&to, here.e[i] * measured.weights[i], measured.free, matrix);
    }
    fwrite(matrix, sizeof *matrix, TRIANGLE, stdout);
}

int main(int argc, char **argv) {
    if (argc != 3) {
        return 1;
    }
    const size_t rows = (size_t)atol(argv[1]), size = sizeof(double);
    towline_robot *robot = numbers(sizeof *robot, 1);
    const size_t m = (size_t)robot->cables, c = (size_t)robot->carriers;
    double *carriers = numbers(rows * c * 6 * size, 1), *lengths = numbers(rows * m * size, 1);
    double *weights = numbers(m * size, 1), *poses = numbers(rows * 6 * size, 1);
    double *errors = numbers(rows * m * size, 0), *steps = numbers(rows * size, 0);
    double *covariances = numbers(rows * 36 * size, 0);
    const towline_lengths measured = {carriers, (ptrdiff_t)(6 * c), lengths, weights, robot->freedom, atof(argv[2])};
    for (size_t row = 0; row < rows; row++) {
        write_curvature(robot, measured, carriers + row * c * 6, lengths + row * m, poses + row * 6);
    }
    const towline_poses results = {poses, errors, steps};
    towline_pose_from_lengths(robot, (ptrdiff_t)rows, measured, results);
    towline_pose_covariance(robot, (ptrdiff_t)rows, measured, poses, covariances);
    fwrite(poses, size, rows * 6, stdout);
    fwrite(errors, size, rows * m, stdout);
    fwrite(steps, size, rows, stdout);
    fwrite(covariances, size, rows * 36, stdout);
    free(robot), free(carriers), free(lengths), free(weights);
    free(poses), free(errors), free(steps), free(covariances);
    return 0;
}
