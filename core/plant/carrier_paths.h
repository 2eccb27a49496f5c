/*
 * How the references of carriers move during a command.
 *
 * A command has the pose, the velocity and the acceleration of a reference at its beginning, and the next command has
 * those at its end; without a next one the acceleration is constant. In between each coordinate is the polynomial of
 * fifth degree in time that has position, velocity and acceleration of the reference at both ends. Where the end is not
 * known it has the fourth degree, and any acceleration there: Runge-Kutta integrates this without an error.
 *
 * The motion of an imposed carrier begins with the position and the velocity that the carrier has. The end of the last
 * command may have missed its reference, by what a changing acceleration does in one step. So carriers move without
 * jumps, and a taut cable that never stretches stays taut. Where the reference is farther away than either moves in the
 * step, or so far that the way there needs an acceleration beyond SUDDEN, it has jumped, and the carrier does.
 */
#ifndef TOWLINE_PLANT_CARRIER_PATHS_H
#define TOWLINE_PLANT_CARRIER_PATHS_H

#include "plant/state.h"

static const double PI = 3.14159265358979323846;
/* [m/s^2, rad/s^2] that a polynomial would need beyond those of its reference: the carrier jumps to it. */
static const double SUDDEN = 100.0;

static double position_on(const double *c, double s) {
    return c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * (c[4] + s * c[5]))));
}

static double velocity_on(const double *c, double s) {
    return c[1] + s * (2 * c[2] + s * (3 * c[3] + s * (4 * c[4] + s * (5 * c[5]))));
}

static double acceleration_on(const double *c, double s) {
    return 2 * c[2] + s * (6 * c[3] + s * (12 * c[4] + s * (20 * c[5])));
}

/* Where a body is and how fast, each as roll, pitch and yaw too. */
typedef struct {
    double position[6], velocity[6];
} coordinates;

static coordinates coordinates_of(const body_motion *body) {
    const double *q = body->quaternion, *rate = body->rate;
    coordinates at = {{body->position[0], body->position[1], body->position[2], 0, 0, 0},
                      {body->velocity[0], body->velocity[1], body->velocity[2], rate[0], rate[1], rate[2]}};
    if (q[1] == 0 && q[2] == 0 && q[3] == 0) { return at; }
    /* The last row of R, and its first column. */
    const double minus_sine = 2 * (q[1] * q[3] - q[0] * q[2]);
    const double rolled = 2 * (q[2] * q[3] + q[0] * q[1]), upright = 1 - 2 * (q[1] * q[1] + q[2] * q[2]);
    const double cosine = larger(sqrt(rolled * rolled + upright * upright), 1e-300);
    const double sr = rolled / cosine, cr = upright / cosine, yaw_rate = (sr * rate[1] + cr * rate[2]) / cosine;
    at.position[3] = atan2(rolled, upright);
    at.position[4] = atan2(-minus_sine, cosine);
    at.position[5] = atan2(2 * (q[1] * q[2] + q[0] * q[3]), 1 - 2 * (q[2] * q[2] + q[3] * q[3]));
    at.velocity[3] = rate[0] - minus_sine * yaw_rate;
    at.velocity[4] = cr * rate[1] - sr * rate[2];
    at.velocity[5] = yaw_rate;
    return at;
}

/* Take the reference from where an imposed carrier is; return whether it continues there: not if it jumps, or is on it. */
static int continues(const body_motion *body, const carrier_command *to, double period, coordinates *off) {
    const coordinates at = coordinates_of(body);
    int sudden = 0, missed = 0;
    double away = 0, way = 0;
    for (int i = 0; i < 6; i++) {
        const double p = to->pose[i], v = to->velocity[i];
        double gap = at.position[i] - p, faster = at.velocity[i] - v;
        if (i >= 3) { gap -= 2 * PI * floor(0.5 + gap / (2 * PI)); }
        if (i == 3) { /* translation and rotation each have moved some way */
            sudden |= away > way;
            away = way = 0;
        }
        /* Rounding would make a carrier that rests turn, and short steps shake it. */
        gap = fabs(gap) > 1e-15 * (1 + fabs(p)) ? gap : 0;
        faster = fabs(faster) > 1e-14 * (1 + fabs(v)) ? faster : 0;
        missed |= gap != 0 || faster != 0;
        sudden |= 6 * fabs(gap) + 4 * period * fabs(faster) > SUDDEN * period * period;
        away += fabs(gap);
        way += period * (fabs(v) + fabs(at.velocity[i]) + 0.5 * period * fabs(to->acceleration[i]));
        off->position[i] = gap;
        off->velocity[i] = faster;
    }
    return missed && !sudden && !(away > way);
}

/* Return whether a reference goes on to that of the next command, and does not jump there. */
static int leads_on(const carrier_command *from, const carrier_command *to, double period) {
    double away = 0, way = 0;
    for (int i = 0; i < 6; i++) {
        const double v = from->velocity[i], a = from->acceleration[i];
        const double gap = to->pose[i] - from->pose[i] - period * (v + 0.5 * period * a);
        const double faster = to->velocity[i] - v - period * a;
        if (i == 3) {
            if (away > way) { return 0; }
            away = way = 0;
        }
        away += fabs(gap);
        way += period * (fabs(v) + fabs(to->velocity[i]) + 0.5 * period * fabs(a));
        if (6 * fabs(gap) + 4 * period * fabs(faster) > SUDDEN * period * period) { return 0; }
    }
    return !(away > way);
}

/* Write the coefficients of coordinate `i`, see the head of this file; return whether it moves. */
static int set_polynomial(double *c, const carrier_command *from, const carrier_command *to, const coordinates *off,
                          double period, int i) {
    const double p = from->pose[i], v = from->velocity[i], a = from->acceleration[i];
    const double ahead = off ? off->position[i] : 0, faster = off ? off->velocity[i] : 0;
    double gap = -ahead - faster * period, speed = -faster * period;
    double bend = 6 * speed - 12 * gap; /* all of them lengths, or angles; this makes the fifth coefficient 0 */
    c[0] = p + ahead, c[1] = v + faster, c[2] = 0.5 * a;
    c[3] = c[4] = c[5] = 0;
    if (to) { /* how far away from where a constant acceleration leads */
        gap += to->pose[i] - p - period * (v + 0.5 * period * a);
        speed += period * (to->velocity[i] - v - period * a);
        bend = period * period * (to->acceleration[i] - a);
    }
    if (off || to) {
        const double cube = period * period * period;
        c[3] = (10 * gap - 4 * speed + 0.5 * bend) / cube;
        c[4] = (7 * speed - 15 * gap - bend) / (cube * period);
        c[5] = (6 * gap - 3 * speed + 0.5 * bend) / (cube * period * period);
    }
    return v != 0 || a != 0 || gap != 0 || speed != 0 || bend != 0;
}

static void set_paths(plant *p, const motion *now, const carrier_command *command, const carrier_command *after,
                      double period) {
    for (int k = 0; k < p->robot->carriers; k++) {
        const int32_t moved_by = p->robot->body[1 + k].motion;
        if (moved_by != TOWLINE_IMPOSED && moved_by != TOWLINE_LAGGED) { continue; }
        const int imposed = moved_by == TOWLINE_IMPOSED;
        carrier_path *path = &p->path[k];
        coordinates off;
        const int misses = imposed && continues(&now->body[1 + k], &command[k], period, &off);
        const carrier_command *to = after && leads_on(&command[k], &after[k], period) ? &after[k] : NULL;
        path->moves = path->turns = 0;
        for (int i = 0; i < (imposed ? 6 : 3); i++) {
            const int moves = set_polynomial(path->coefficient[i], &command[k], to, misses ? &off : NULL, period, i);
            *(i < 3 ? &path->moves : &path->turns) |= moves;
        }
    }
}

#endif
