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
    for (int i = 0; i < 3; i++) { run.pull[i] = d[i] * inverse; }
    run.wrap = number(0);
    return run;
}

/*
 * A cable that comes up a swivel axis k at the anchor, runs over a sheave and then straight to a point d from there.
 *
 * models/cables/pulley.py has the derivation: with e the direction across the axis, the sheave's centre is at r e, and
 * `straight` is the length of the free part, in the direction sine e + cosine k. Only if `measured` are wrap and length
 * those of the cable; they take half of the time.
 */
INLINE line line_over_sheave(double r, const num *d, const num *k, int measured) {
    const num up = dot(d, k);
    const num across[3] = {d[0] - up * k[0], d[1] - up * k[1], d[2] - up * k[2]};
    const num distance = square_root(dot(across, across)), out = distance - r;
    const num straight = square_root(distance * distance - (2 * r) * distance + up * up);
    const num inverse = 1.0 / (out * out + up * up);
    const num sine = (straight * out + r * up) * inverse, cosine = (straight * up - r * out) * inverse;
    const num along = sine / distance;
    line run;
    for (int i = 0; i < 3; i++) { run.pull[i] = -(along * across[i] + cosine * k[i]); }
    run.wrap = number(0), run.length = straight;
    if (measured) {
        run.wrap = 3.14159265358979323846 - angle_of(straight, number(r)) - angle_of(up, out);
        run.length += r * run.wrap;
    }
    return run;
}

/* The attitudes that the cables of a robot have in common. */
typedef struct {
    attitude platform, carrier;
    int owner; /* the carrier whose attitude that is */
} attitudes;

INLINE attitudes attitudes_of(const num *pose, const num *carriers) {
    attitudes at;
    at.platform = attitude_of(pose + 3);
    at.carrier = attitude_of(carriers + 3);
    at.owner = 0;
    return at;
}

/* Where a cable is, in {G}, and how it runs. */
typedef struct {
    num anchor[3];
    num arm[3];  /* the attachment less the origin of the platform's frame */
    num span[3]; /* from the anchor to the attachment */
    num axis[3]; /* of its pulley, if it has one */
    line run;
} placed_cable;

/* The attitude of the cable's carrier is kept in `at` for the next cable; for `measured` see `line_over_sheave`. */
INLINE placed_cable place_cable(const towline_cable *cable, const num *pose, const num *carriers, int measured,
                                attitudes *at) {
    const num *origin = carriers + 6 * cable->carrier;
    placed_cable here;
    if (cable->carrier != at->owner) {
        at->owner = cable->carrier;
        at->carrier = attitude_of(origin + 3);
    }
    turn_constant(at->platform.R, cable->attachment, here.arm);
    turn_constant(at->carrier.R, cable->anchor, here.anchor);
    for (int j = 0; j < 3; j++) {
        here.anchor[j] += origin[j];
        here.span[j] = pose[j] + here.arm[j] - here.anchor[j];
    }
    if (cable->radius == 0) {
        here.run = straight_line(here.span);
    } else {
        turn_constant(at->carrier.R, cable->axis, here.axis);
        here.run = line_over_sheave(cable->radius, here.span, here.axis, measured);
    }
    return here;
}

/* Columns of R P, the axes in {G} about which roll, pitch and yaw turn. */
INLINE void turning_axes(const attitude *at, num axes[3][3]) {
    const num P[3][3] = {
        {number(1), number(0), number(0)},
        {number(0), at->cos_roll, -at->sin_roll},
        {-at->sin_pitch, at->sin_roll * at->cos_pitch, at->cos_roll * at->cos_pitch},
    };
    for (int angle = 0; angle < 3; angle++) { turn(at->R, P[angle], axes[angle]); }
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
    for (int i = 3; i < 6; i++) { row[i] = -row[i]; }
    /*
     * The arc about a centre at rest becomes longer by the wrap, and the centre moves across the axis, which takes the
     * sine. Where the cable leaves the sheave may vary freely, since the length is stationary there.
     */
    row[6] = run->wrap - sine;
}

/* The lines at a pose (6) of the platform and poses (c, 6) of the carriers. */
INLINE void lines_at(const towline_robot *robot, const num *pose, const num *carriers, lines want) {
    const int m = robot->cables, measured = want.lengths || want.sensitivity;
    attitudes at = attitudes_of(pose, carriers);
    num com[3], axes[3][3] = {{number(0)}}; /* else compilers warn: they do not see that J alone reads the axes */
    turn_constant(at.platform.R, robot->com, com);
    if (want.J) { turning_axes(&at.platform, axes); }
    for (int i = 0; i < m; i++) {
        const placed_cable here = place_cable(&robot->cable[i], pose, carriers, measured, &at);
        if (want.lengths) { want.lengths[i] = here.run.length; }
        if (want.A) {
            const num arm[3] = {here.arm[0] - com[0], here.arm[1] - com[1], here.arm[2] - com[2]};
            num moment[3];
            cross(arm, here.run.pull, moment);
            for (int j = 0; j < 3; j++) {
                want.A[j * m + i] = here.run.pull[j];
                want.A[(3 + j) * m + i] = moment[j];
            }
        }
        for (int j = 0; want.anchors && j < 3; j++) { want.anchors[3 * i + j] = here.anchor[j]; }
        if (want.J) { length_by_pose(&here.run, here.arm, (const num(*)[3])axes, want.J + 6 * i); }
        if (want.sensitivity) { length_by_geometry(&here.run, &at.platform, &at.carrier, want.sensitivity + 7 * i); }
    }
}

/* Where the cables end, in {G}: anchors and attachments, (m, 3) each. */
INLINE void ends_at(const towline_robot *robot, const num *pose, const num *carriers, num *anchors, num *attachments) {
    attitudes at = attitudes_of(pose, carriers);
    for (int i = 0; i < robot->cables; i++) {
        const placed_cable here = place_cable(&robot->cable[i], pose, carriers, 0, &at);
        for (int j = 0; j < 3; j++) {
            anchors[3 * i + j] = here.anchor[j];
            attachments[3 * i + j] = pose[j] + here.arm[j];
        }
    }
}

#endif
