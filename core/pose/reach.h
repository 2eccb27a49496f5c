/* How cables reach their attachments at a place of the platform, also where no cable could run: a descent passes there. */
#ifndef TOWLINE_REACH_H
#define TOWLINE_REACH_H

#include "mechanics/attitude.h"
#include "robot.h"

/* Where the platform is. */
typedef struct {
    num x[3], R[9];
} place;

/* Where the cables come from, in {G}. */
typedef struct {
    num anchor[3 * TOWLINE_MOST_CABLES], axis[3 * TOWLINE_MOST_CABLES];
} origins;

typedef struct {
    num arm[3];    /* from the platform frame's origin to the attachment */
    num n[3];      /* the unit vector along which the cable reaches it */
    num length;    /* from the anchor, over the sheave, to the attachment */
    num straight;  /* of that the free part */
    num across[3]; /* the normal of the sheave's plane */
    num turning;   /* how fast n turns in that plane's normal, less 1 / straight; for a point anchor 0 */
} reach;

INLINE place place_of(const num *pose) {
    const attitude at = attitude_of(pose + 3);
    place there;
    for (int i = 0; i < 3; i++) { there.x[i] = pose[i]; }
    for (int i = 0; i < 9; i++) { there.R[i] = at.R[i]; }
    return there;
}

/* The origins with the carriers at poses (c, 6). */
INLINE void place_origins(const towline_robot *robot, const num *carriers, origins *from) {
    attitude carrier = attitude_of(carriers + 3);
    int placed = 0; /* the carrier whose attitude that is */
    for (int i = 0; i < robot->cables; i++) {
        const towline_cable *cable = &robot->cable[i];
        const num *origin = carriers + 6 * cable->carrier;
        if (cable->carrier != placed) {
            placed = cable->carrier;
            carrier = attitude_of(origin + 3);
        }
        turn_constant(carrier.R, cable->anchor, from->anchor + 3 * i);
        turn_constant(carrier.R, cable->axis, from->axis + 3 * i);
        for (int j = 0; j < 3; j++) { from->anchor[3 * i + j] += origin[j]; }
    }
}

/* A cable from a point, to d from there. */
INLINE void reach_straight(const num *d, reach *to) {
    to->length = square_root(dot(d, d));
    to->straight = larger(to->length, number(1e-12));
    const num inverse = 1.0 / to->straight;
    for (int i = 0; i < 3; i++) {
        to->n[i] = d[i] * inverse;
        to->across[i] = number(0);
    }
    to->turning = number(0);
}

/*
 * A cable that comes up a swivel axis k, runs over a sheave and then straight to d from its anchor: mechanics/lines.h.
 * The two angles there are one here, that of n from the axis. Inside the sheave, where there is no tangent, the free part
 * has no length.
 */
INLINE void reach_over_sheave(double r, const num *d, const num *k, reach *to) {
    const num up = dot(d, k);
    const num out_of_axis[3] = {d[0] - up * k[0], d[1] - up * k[1], d[2] - up * k[2]};
    const num distance = larger(square_root(dot(out_of_axis, out_of_axis)), number(1e-12)), out = distance - r;
    const num free_part = larger(distance * distance - (2 * r) * distance + up * up, number(1e-18));
    to->straight = square_root(free_part);
    const num inverse = 1.0 / (out * out + up * up), by_distance = 1.0 / distance;
    const num sine = (to->straight * out + r * up) * inverse, cosine = (to->straight * up - r * out) * inverse;
    const num wrap = angle_of(sine, cosine);
    to->length = to->straight + r * where(wrap < 0, wrap + 6.28318530717958647692, wrap);
    const num e[3] = {out_of_axis[0] * by_distance, out_of_axis[1] * by_distance, out_of_axis[2] * by_distance};
    for (int i = 0; i < 3; i++) { to->n[i] = sine * e[i] + cosine * k[i]; }
    cross(k, e, to->across);
    to->turning = sine * by_distance - 1.0 / to->straight;
}

/* How cable i reaches its attachment. */
INLINE void reach_of(const towline_robot *robot, int i, const place *at, const origins *from, reach *to) {
    const towline_cable *cable = &robot->cable[i];
    num d[3];
    turn_constant(at->R, cable->attachment, to->arm);
    for (int j = 0; j < 3; j++) { d[j] = at->x[j] + to->arm[j] - from->anchor[3 * i + j]; }
    if (cable->radius == 0) {
        reach_straight(d, to);
    } else {
        reach_over_sheave(cable->radius, d, from->axis + 3 * i, to);
    }
}

/*
 * With the unit vector n along which it reaches its attachment, at r from the platform frame's origin, a length changes by
 *
 *     dl = n . dx + (r x n) . dphi
 *
 * for a displacement dx of that frame and a small rotation dphi, both in {G}. `row` (6) gets this times `weight`, 0 for
 * coordinates that do not move.
 */
INLINE void gradient_of(const reach *to, double weight, const double *free, num *row) {
    num moment[3];
    cross(to->arm, to->n, moment);
    for (int j = 0; j < 3; j++) {
        row[j] = to->n[j] * (weight * free[j]);
        row[3 + j] = moment[j] * (weight * free[3 + j]);
    }
}

/* Metres that make a rotation comparable with a displacement: the farthest attachment from the CoM. */
INLINE double size_of_platform(const towline_robot *robot) {
    double most = 0;
    for (int i = 0; i < robot->cables; i++) {
        double square = 0;
        for (int j = 0; j < 3; j++) {
            const double arm = robot->cable[i].attachment[j] - robot->com[j];
            square += arm * arm;
        }
        most = square > most ? square : most;
    }
    return most > 0 ? sqrt(most) : 1;
}

#endif
