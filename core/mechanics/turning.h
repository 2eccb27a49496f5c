/* How the directions of the cables turn when their ends move, and what that does to the wrench of their tensions. */
#ifndef TOWLINE_TURNING_H
#define TOWLINE_TURNING_H

#include "mechanics/lines.h"

/* How the direction t = -pull of a cable turns: with its attachment, and against its anchor, by T; with the radius. */
typedef struct {
    num T[9];         /* symmetric [1/m] */
    num by_radius[3]; /* [1/m]; 0 for a point anchor */
} turning;

/* A straight cable: T = (1 - t t') / length. */
INLINE turning turning_of_straight(const line *run) {
    turning how;
    const num inverse = 1.0 / run->length;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            how.T[3 * i + j] = ((i == j ? 1.0 : 0.0) - run->pull[i] * run->pull[j]) * inverse;
        }
        how.by_radius[i] = number(0);
    }
    return how;
}

/*
 * A cable over a sheave, with e, k and the wrap as in models/cables/pulley.py, n = cos(wrap) e - sin(wrap) k and f = k x e:
 *
 *     T = n n' / straight + sin(wrap) / distance f f'        by the radius: (1 - cos(wrap)) / straight n
 *
 * The straight part turns about the sheave, and the sheave about its axis. Source: derived here.
 */
INLINE turning turning_over_sheave(double r, const placed_cable *cable) {
    const num *k = cable->axis, *pull = cable->run.pull;
    const num up = dot(cable->span, k), cosine = -dot(pull, k);
    num across[3], n[3], f[3];
    for (int i = 0; i < 3; i++) { across[i] = cable->span[i] - up * k[i]; }
    const num distance = square_root(dot(across, across)), inverse = 1.0 / distance;
    const num straight = square_root(distance * distance - (2 * r) * distance + up * up);
    for (int i = 0; i < 3; i++) { across[i] *= inverse; /* e */ }
    const num sine = -dot(pull, across);
    cross(k, across, f);
    turning how;
    for (int i = 0; i < 3; i++) {
        n[i] = cosine * across[i] - sine * k[i];
        how.by_radius[i] = (1.0 - cosine) / straight * n[i];
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) { how.T[3 * i + j] = n[i] * n[j] / straight + sine * inverse * f[i] * f[j]; }
    }
    return how;
}

INLINE turning turning_of(const towline_cable *cable, const placed_cable *here) {
    return cable->radius == 0 ? turning_of_straight(&here->run) : turning_over_sheave(cable->radius, here);
}

/* The change of a cable's column of A, (pull, arm x pull), as its direction changes by `turned` and its arm by `swing`. */
INLINE void change_of_column(const num *pull, const num *arm, const num *turned, const num *swing, num *change) {
    num leverage[3], swung[3];
    cross(arm, turned, leverage);
    cross(swing, pull, swung);
    for (int i = 0; i < 3; i++) {
        change[i] = -turned[i];
        change[3 + i] = swung[i] - leverage[i];
    }
}

/* The columns of A by anchor (3, in the carrier's frame), attachment (3, in the platform's) and radius: S is (m, 6, 7). */
INLINE void columns_by_geometry(const towline_robot *robot, const num *pose, const num *carriers, num *S) {
    const num still[3] = {number(0), number(0), number(0)};
    attitudes at = attitudes_of(pose, carriers);
    num com[3];
    turn_constant(at.platform.R, robot->com, com);
    for (int i = 0; i < robot->cables; i++) {
        const placed_cable here = place_cable(&robot->cable[i], pose, carriers, 0, &at);
        const turning how = turning_of(&robot->cable[i], &here);
        const num arm[3] = {here.arm[0] - com[0], here.arm[1] - com[1], here.arm[2] - com[2]};
        num changes[7][6];
        for (int axis = 0; axis < 3; axis++) {
            num anchor[3], attachment[3], turned[3];
            for (int j = 0; j < 3; j++) {
                anchor[j] = -at.carrier.R[3 * j + axis];
                attachment[j] = at.platform.R[3 * j + axis];
            }
            turn(how.T, anchor, turned);
            change_of_column(here.run.pull, arm, turned, still, changes[axis]);
            turn(how.T, attachment, turned);
            change_of_column(here.run.pull, arm, turned, attachment, changes[3 + axis]);
        }
        change_of_column(here.run.pull, arm, how.by_radius, still, changes[6]);
        for (int row = 0; row < 6; row++) {
            for (int column = 0; column < 7; column++) { S[42 * i + 7 * row + column] = changes[column][row]; }
        }
    }
}

/* Velocities of the platform's CoM and rates about it, in {G}. */
typedef struct {
    num velocity[3], rate[3];
} twist;

/* The wrench A t at constant tensions t (m) along six motions of the platform: D (6, 6), a column for each. */
INLINE void wrench_by_motions(const towline_robot *robot, const num *pose, const num *carriers, const num *tensions,
                              const twist *motions, num *D) {
    attitudes at = attitudes_of(pose, carriers);
    num com[3];
    turn_constant(at.platform.R, robot->com, com);
    for (int i = 0; i < 36; i++) { D[i] = number(0); }
    for (int i = 0; i < robot->cables; i++) {
        const placed_cable here = place_cable(&robot->cable[i], pose, carriers, 0, &at);
        const turning how = turning_of(&robot->cable[i], &here);
        const num arm[3] = {here.arm[0] - com[0], here.arm[1] - com[1], here.arm[2] - com[2]};
        for (int column = 0; column < 6; column++) {
            num swing[3], moved[3], turned[3], change[6];
            cross(motions[column].rate, arm, swing);
            for (int j = 0; j < 3; j++) { moved[j] = motions[column].velocity[j] + swing[j]; }
            turn(how.T, moved, turned);
            change_of_column(here.run.pull, arm, turned, swing, change);
            for (int row = 0; row < 6; row++) { D[6 * row + column] += tensions[i] * change[row]; }
        }
    }
}

/* Displacements of the CoM along the axes of {G}, and turns about them. */
INLINE void twists_of_axes(twist *motions) {
    for (int k = 0; k < 6; k++) {
        for (int j = 0; j < 3; j++) {
            motions[k].velocity[j] = number(k == j ? 1 : 0);
            motions[k].rate[j] = number(k == 3 + j ? 1 : 0);
        }
    }
}

/* Changes of the six coordinates of a pose: x, y and z of the frame, roll, pitch and yaw. */
INLINE void twists_of_pose(const towline_robot *robot, const num *pose, twist *motions) {
    const attitude at = attitude_of(pose + 3);
    num com[3], axes[3][3];
    turn_constant(at.R, robot->com, com);
    turning_axes(&at, axes);
    twists_of_axes(motions);
    for (int angle = 0; angle < 3; angle++) {
        cross(axes[angle], com, motions[3 + angle].velocity);
        for (int j = 0; j < 3; j++) { motions[3 + angle].rate[j] = axes[angle][j]; }
    }
}

/* The same along the coordinates of the pose or, `by_axes`, along displacements of the CoM and turns about the axes. */
INLINE void wrench_by_pose(const towline_robot *robot, const num *pose, const num *carriers, const num *tensions,
                           int by_axes, num *D) {
    twist motions[6];
    if (by_axes) {
        twists_of_axes(motions);
    } else {
        twists_of_pose(robot, pose, motions);
    }
    wrench_by_motions(robot, pose, carriers, tensions, motions, D);
}

#endif
