/* The lines of the cables at a pose: lengths, directions, wrench matrix, and how the lengths change. */
#ifndef TOWLINE_LINES_H
#define TOWLINE_LINES_H

#include "mechanics/attitude.h"
#include "robot.h"

/* Results of `lines_at`, arrays of num in the layout of `towline_lines`; each may be NULL. */
typedef struct {
    num *lengths, *A, *J, *anchors, *sensitivity;
} lines;

/* How one cable runs. */
typedef struct {
    num pull[3]; /* the unit vector in which it pulls the platform */
    num length;  /* from the anchor, over the sheave, to the attachment */
    num wrap;    /* the angle of the sheave that it touches; 0 for a point anchor */
} line;

/* A cable to a point d from its anchor. */
INLINE line straight_line(const num *d) {
    line run;
    run.length = square_root(dot(d, d));
    const num inverse = -1.0 / run.length;
    for (int i = 0; i < 3; i++) {
        run.pull[i] = d[i] * inverse;
    }
    run.wrap = number(0);
    return run;
}

/*
 * A cable that comes up a swivel axis k at the anchor, runs over a sheave and then straight to a point d from there.
 *
 * models/cables/pulley.py has the derivation: with e the direction across the axis, the sheave's centre is at r e, and
 * `straight` is the length of the free part, in the direction sine e + cosine k.
 */
INLINE line line_over_sheave(double r, const num *d, const num *k) {
    const num up = dot(d, k);
    const num across[3] = {d[0] - up * k[0], d[1] - up * k[1], d[2] - up * k[2]};
    const num distance = square_root(dot(across, across)), out = distance - r;
    const num straight = square_root(distance * distance - (2 * r) * distance + up * up);
    const num inverse = 1.0 / (out * out + up * up);
    const num sine = (straight * out + r * up) * inverse, cosine = (straight * up - r * out) * inverse;
    const num along = sine / distance;
    line run;
    for (int i = 0; i < 3; i++) {
        run.pull[i] = -(along * across[i] + cosine * k[i]);
    }
    run.wrap = 3.14159265358979323846 - angle_of(straight, number(r)) - angle_of(up, out);
    run.length = r * run.wrap + straight;
    return run;
}

/* Columns of R P, the axes in {G} about which roll, pitch and yaw turn. */
INLINE void turning_axes(const attitude *at, num axes[3][3]) {
    const num P[3][3] = {
        {number(1), number(0), number(0)},
        {number(0), at->cos_roll, -at->sin_roll},
        {-at->sin_pitch, at->sin_roll * at->cos_pitch, at->cos_roll * at->cos_pitch},
    };
    for (int angle = 0; angle < 3; angle++) {
        turn(at->R, P[angle], axes[angle]);
    }
}

/* A row of the Jacobian of the lengths with respect to the pose; `arm` is the attachment less the frame's origin. */
INLINE void length_by_pose(const line *run, const num *arm, const num axes[3][3], num *row) {
    num moment[3];
    cross(arm, run->pull, moment);
    for (int i = 0; i < 3; i++) {
        row[i] = -run->pull[i];
        row[3 + i] = -dot(moment, axes[i]);
    }
}

/* A length by the anchor in its carrier's frame, the attachment in the platform's, and the radius of the sheave. */
INLINE void length_by_geometry(const line *run, const attitude *platform, const attitude *carrier, num *row) {
    num sine, cosine;
    turn_back(carrier->R, run->pull, row);
    turn_back(platform->R, run->pull, row + 3);
    sine_and_cosine(run->wrap, &sine, &cosine);
    for (int i = 3; i < 6; i++) {
        row[i] = -row[i];
    }
    row[6] = run->wrap - sine; /* both ends of the wrapped arc move with the radius */
}

/* The lines at a pose (6) of the platform and poses (c, 6) of the carriers. */
INLINE void lines_at(const towline_robot *robot, const num *pose, const num *carriers, lines want) {
    const int m = robot->cables;
    const attitude platform = attitude_of(pose + 3);
    attitude carrier = attitude_of(carriers + 3);
    int placed = 0; /* the carrier whose attitude that is */
    num com[3], axes[3][3];
    turn_constant(platform.R, robot->com, com);
    if (want.J) {
        turning_axes(&platform, axes);
    }
    for (int i = 0; i < m; i++) {
        const towline_cable *cable = &robot->cable[i];
        const num *origin = carriers + 6 * cable->carrier;
        num anchor[3], attachment[3], axis[3], d[3];
        if (cable->carrier != placed) {
            placed = cable->carrier;
            carrier = attitude_of(origin + 3);
        }
        turn_constant(platform.R, cable->attachment, attachment);
        turn_constant(carrier.R, cable->anchor, anchor);
        for (int j = 0; j < 3; j++) {
            anchor[j] += origin[j];
            d[j] = pose[j] + attachment[j] - anchor[j];
        }
        line run;
        if (cable->radius == 0) {
            run = straight_line(d);
        } else {
            turn_constant(carrier.R, cable->axis, axis);
            run = line_over_sheave(cable->radius, d, axis);
        }
        if (want.lengths) {
            want.lengths[i] = run.length;
        }
        if (want.A) {
            const num arm[3] = {attachment[0] - com[0], attachment[1] - com[1], attachment[2] - com[2]};
            num moment[3];
            cross(arm, run.pull, moment);
            for (int j = 0; j < 3; j++) {
                want.A[j * m + i] = run.pull[j];
                want.A[(3 + j) * m + i] = moment[j];
            }
        }
        for (int j = 0; want.anchors && j < 3; j++) {
            want.anchors[3 * i + j] = anchor[j];
        }
        if (want.J) {
            length_by_pose(&run, attachment, (const num(*)[3])axes, want.J + 6 * i);
        }
        if (want.sensitivity) {
            length_by_geometry(&run, &platform, &carrier, want.sensitivity + 7 * i);
        }
    }
}

#endif
