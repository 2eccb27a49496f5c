/* Forward kinematics for Python: poses from lengths, and their covariances. */
#include "pose/pose.h"

#include "python/arrays.h"
#include "python/extension.h"

/* Return whether carriers fit so many rows of a robot, and set how many numbers lie between those of two. */
static int carriers_fit(const towline_robot *robot, Py_ssize_t size, Py_ssize_t rows, ptrdiff_t *per) {
    const Py_ssize_t one = 6 * robot->carriers;
    *per = size == one ? 0 : one;
    return size == one || size == rows * one;
}

TOWLINE_PY(pose_from_lengths) {
    enum { ROBOT, CARRIERS, LENGTHS, WEIGHTS, FREE, DAMPING, POSES, ERRORS, STEPS, ALL };
    arrays given;
    if (!take(&given, arguments, count, ALL, POSES)) { return NULL; }
    const towline_robot *robot = robot_of(&given);
    int fits = robot != NULL;
    if (fits) {
        const Py_ssize_t m = robot->cables, rows = given.size[STEPS];
        ptrdiff_t per;
        fits = carriers_fit(robot, given.size[CARRIERS], rows, &per) && given.size[LENGTHS] == rows * m &&
               given.size[WEIGHTS] == m && given.size[FREE] == 6 && given.size[DAMPING] == 1 &&
               given.size[POSES] == 6 * rows && given.size[ERRORS] == rows * m;
        if (fits) {
            const towline_lengths measured = {
                given.of[CARRIERS], per, given.of[LENGTHS], given.of[WEIGHTS], given.of[FREE], *given.of[DAMPING]};
            const towline_poses results = {given.of[POSES], given.of[ERRORS], given.of[STEPS]};
            Py_BEGIN_ALLOW_THREADS;
            towline_pose_from_lengths(robot, rows, measured, results);
            Py_END_ALLOW_THREADS;
        }
    }
    return done(&given, fits);
}

TOWLINE_PY(pose_covariance) {
    enum { ROBOT, CARRIERS, WEIGHTS, POSES, COVARIANCES, ALL };
    arrays given;
    if (!take(&given, arguments, count, ALL, COVARIANCES)) { return NULL; }
    const towline_robot *robot = robot_of(&given);
    int fits = robot && given.size[POSES] % 6 == 0;
    if (fits) {
        const Py_ssize_t rows = given.size[POSES] / 6;
        ptrdiff_t per;
        fits = carriers_fit(robot, given.size[CARRIERS], rows, &per) && given.size[WEIGHTS] == robot->cables &&
               given.size[COVARIANCES] == 36 * rows;
        if (fits) {
            const towline_lengths measured = {given.of[CARRIERS], per, NULL, given.of[WEIGHTS], robot->freedom, 0};
            Py_BEGIN_ALLOW_THREADS;
            towline_pose_covariance(robot, rows, measured, given.of[POSES], given.of[COVARIANCES]);
            Py_END_ALLOW_THREADS;
        }
    }
    return done(&given, fits);
}

TOWLINE_PY(one_pose_from_lengths) {
    enum { ROBOT, CARRIERS, LENGTHS, SIGMA, POSE, RESIDUALS, COVARIANCE, ALL };
    arrays given;
    if (!take(&given, arguments, count, ALL, POSE)) { return NULL; }
    const towline_robot *robot = robot_of(&given);
    const int m = robot ? robot->cables : 0;
    double weights[TOWLINE_MOST_CABLES], steps = 0, *residuals = given.of[RESIDUALS];
    const int fits = robot && given.size[CARRIERS] == 6 * robot->carriers && given.size[LENGTHS] == m &&
                     given.size[SIGMA] == m && given.size[POSE] == 6 && given.size[RESIDUALS] == m &&
                     given.size[COVARIANCE] == 36;
    if (fits) {
        for (int i = 0; i < m; i++) { weights[i] = 1 / given.of[SIGMA][i]; }
        const towline_lengths measured = {given.of[CARRIERS], 0, given.of[LENGTHS], weights, robot->freedom, 0};
        towline_pose_from_lengths(robot, 1, measured, (towline_poses){given.of[POSE], residuals, &steps});
        towline_pose_covariance(robot, 1, measured, given.of[POSE], given.of[COVARIANCE]);
        for (int i = 0; i < m; i++) { residuals[i] *= given.of[SIGMA][i]; }
    }
    PyObject *none = done(&given, fits);
    Py_XDECREF(none);
    return none ? PyBool_FromLong(steps > 0) : NULL;
}
