/*
 * How the cables run between bodies.
 *
 * With d from the carrier's frame to the attachment B, and w the velocity of B in the carrier's frame, in {G}:
 *
 *     dl/dt = -u . w        d2l/dt2 = -u . (acceleration of B in the carrier's frame) + w . H w
 *
 * At a point anchor H = (1 - u u^T) / l. Over a pulley the direction comes from models/cables/pulley.py, and
 * H = n n^T / s + sin(theta) / a y y^T, with s the free part from the sheave to B, n across it in the sheave's plane, y
 * across that plane, a the distance of B from the swivel axis. The line is that of mechanics/lines.h, but it stays finite
 * where B is at the anchor or inside of the sheave.
 */
#ifndef TOWLINE_PLANT_CABLES_H
#define TOWLINE_PLANT_CABLES_H

#include "plant/state.h"

/* A cable from a point at the anchor to B, which is at `d` from there and moves with `w`. */
static void run_straight(cable_now *on, const double *d, const double *w) {
    const double length = sqrt(dot(d, d)), inverse = length > NO_LENGTH ? 1 / length : 0;
    const double rate = dot(d, w) * inverse;
    for (int i = 0; i < 3; i++) { on->pull[i] = -d[i] * inverse; }
    on->length = length;
    on->length_rate = rate;
    on->curvature = (dot(w, w) - rate * rate) * inverse;
}

/* The same over a sheave of radius `r`; mechanics/lines.h has the geometry. */
static void run_over_sheave(cable_now *on, double r, const double *d, const double *w) {
    const double *k = on->axis, up = dot(d, k);
    double e[3] = {d[0] - up * k[0], d[1] - up * k[1], d[2] - up * k[2]}, side[3];
    const double distance = larger(sqrt(dot(e, e)), 1e-12), out = distance - r, inverse = 1 / distance;
    for (int i = 0; i < 3; i++) { e[i] *= inverse; }
    /* Inside of the sheave there is no tangent; then the free part has no length. */
    const double straight = sqrt(larger(distance * distance - 2 * distance * r + up * up, 1e-18));
    const double share = 1 / (out * out + up * up);
    /* The free part runs along sine e + cosine k. */
    const double sine = (straight * out + r * up) * share, cosine = (straight * up - r * out) * share;
    for (int i = 0; i < 3; i++) { on->pull[i] = -(sine * e[i] + cosine * k[i]); }
    /* The angle of the free part from the axis, -pi/2 to 2 pi: negative where B is above the sheave, near its axis. */
    double wrap = angle_of(sine, cosine);
    if (wrap < 0 && up < 0) { wrap += 2 * 3.14159265358979323846; }
    on->length = r * wrap + straight;
    on->length_rate = sine * dot(e, w) + cosine * dot(k, w);
    cross(k, e, side);
    const double across = dot(side, w), inside = cosine * dot(e, w) - sine * dot(k, w);
    on->curvature = inside * inside / straight + sine * across * across * inverse;
}

/* Write directions, arms, lengths and elongations of all cables, and their rates. */
static void set_lines(plant *p, const motion *now) {
    const body_motion platform = now->body[0]; /* copies, which what is written below cannot change */
    const body_now on_platform = p->body[0];
    const int own_lengths = p->settings->drive != TOWLINE_TENSIONS;
    for (int i = 0; i < p->cables; i++) {
        const towline_cable *cable = &p->robot->cable[i];
        const body_motion *carrier = &now->body[owner_of(p, i)];
        const body_now *on_carrier = &p->body[owner_of(p, i)];
        cable_now *on = &p->cable[i];
        double arm[3], carrier_arm[3], d[3], w[3], moved[3];
        if (on_carrier->turned) {
            turn(on_carrier->R, cable->anchor, on->anchor);
            if (cable->radius != 0) { turn(on_carrier->R, cable->axis, on->axis); }
        }
        turn(on_platform.R, p->attachment[i], arm);
        cross(on_platform.omega, arm, w);
        for (int j = 0; j < 3; j++) {
            carrier_arm[j] = platform.position[j] + arm[j] - carrier->position[j];
            d[j] = carrier_arm[j] - on->anchor[j];
        }
        cross(on_carrier->omega, carrier_arm, moved);
        for (int j = 0; j < 3; j++) { w[j] += platform.velocity[j] - carrier->velocity[j] - moved[j]; }
        if (cable->radius == 0) {
            run_straight(on, d, w);
        } else {
            run_over_sheave(on, cable->radius, d, w);
        }
        for (int j = 0; j < 3; j++) {
            on->arm[j] = arm[j];
            on->carrier_arm[j] = carrier_arm[j];
            on->drift[j] = w[j];
        }
        if (own_lengths) {
            on->stretch = on->length - now->length[i];
            on->stretch_rate = on->length_rate - now->rate[i];
            on->spring = cable->stiffness * on->stretch / now->length[i] + cable->damping * on->stretch_rate;
        }
    }
}

#endif
