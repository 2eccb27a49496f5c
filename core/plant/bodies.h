/*
 * How platform and carriers stand and move, in {G}.
 *
 *     R(q), omega = R Omega                     for a unit quaternion q and a rate Omega in the body's axes
 *     dq = q (0, Omega) / 2
 *     I dOmega = R^T moment - Omega x I Omega
 */
#ifndef TOWLINE_PLANT_BODIES_H
#define TOWLINE_PLANT_BODIES_H

#include "plant/carrier_paths.h"

/* R and omega of a body. */
INLINE void set_attitude(const body_motion *now, body_now *body) {
    const double w = now->quaternion[0], x = now->quaternion[1], y = now->quaternion[2], z = now->quaternion[3];
    /* Inside of a step its norm leaves one by the error of the step. */
    const double two = 2 / (w * w + x * x + y * y + z * z);
    double *R = body->R;
    R[0] = 1 - two * (y * y + z * z), R[1] = two * (x * y - w * z), R[2] = two * (x * z + w * y);
    R[3] = two * (x * y + w * z), R[4] = 1 - two * (x * x + z * z), R[5] = two * (y * z - w * x);
    R[6] = two * (x * z - w * y), R[7] = two * (y * z + w * x), R[8] = 1 - two * (x * x + y * y);
    turn(R, now->rate, body->omega);
}

/* Write a motion by roll, pitch and yaw, and their derivatives, as quaternion, rate and its derivative. */
static void impose_attitude(const double *angles, const double *rates, const double *accelerations, body_motion *now,
                            body_motion *change) {
    double sine[3], cosine[3]; /* of half the angles */
    attitude at;
    for (int i = 0; i < 3; i++) { sine_and_cosine(0.5 * angles[i], &sine[i], &cosine[i]); }
    const double sr = sine[0], cr = cosine[0], sp = sine[1], cp = cosine[1], sy = sine[2], cy = cosine[2];
    now->quaternion[0] = cr * cp * cy + sr * sp * sy;
    now->quaternion[1] = sr * cp * cy - cr * sp * sy;
    now->quaternion[2] = cr * sp * cy + sr * cp * sy;
    now->quaternion[3] = cr * cp * sy - sr * sp * cy;
    at.sin_roll = 2 * sr * cr, at.cos_roll = (cr - sr) * (cr + sr);
    at.sin_pitch = 2 * sp * cp, at.cos_pitch = (cp - sp) * (cp + sp);
    body_rate(&at, rates, now->rate);
    body_acceleration(&at, rates, accelerations, change->rate);
}

/* Put an imposed carrier where its path is; return whether its attitude may be another than before. */
static int impose(const carrier_path *path, body_motion *now, body_motion *change, double time) {
    double angles[3], rates[3], accelerations[3];
    for (int i = 0; i < 3; i++) {
        const double *c = path->coefficient[i];
        now->position[i] = path->moves ? position_on(c, time) : c[0];
        now->velocity[i] = path->moves ? velocity_on(c, time) : 0;
        change->velocity[i] = path->moves ? acceleration_on(c, time) : 0;
    }
    if (time != 0 && !path->turns) {
        for (int i = 0; i < 3; i++) { now->rate[i] = change->rate[i] = 0; }
        return 0;
    }
    for (int i = 0; i < 3; i++) {
        const double *c = path->coefficient[3 + i];
        angles[i] = position_on(c, time);
        rates[i] = velocity_on(c, time);
        accelerations[i] = acceleration_on(c, time);
    }
    impose_attitude(angles, rates, accelerations, now, change);
    return 1;
}

static void set_lead(const carrier_path *path, body_motion *lead, double time) {
    for (int i = 0; i < 3; i++) {
        const double *c = path->coefficient[i];
        lead->position[i] = path->moves ? position_on(c, time) : c[0];
        lead->velocity[i] = path->moves ? velocity_on(c, time) : 0;
        lead->rate[i] = path->moves ? acceleration_on(c, time) : 0;
    }
}

/* Put imposed carriers where they are `time` [s] after the command began, and write R and omega of all bodies. */
static void place_bodies(plant *p, motion *now, motion *change, double time) {
    for (int b = 0; b < p->bodies; b++) {
        const int32_t moved_by = p->robot->body[b].motion;
        int turned = moved_by == TOWLINE_FREE || time == 0;
        if (moved_by == TOWLINE_IMPOSED) {
            turned = impose(&p->path[b - 1], &now->body[b], &change->body[b], time);
        } else if (moved_by == TOWLINE_LAGGED) {
            set_lead(&p->path[b - 1], &p->lead[b - 1], time);
        }
        p->body[b].turned = turned;
        if (turned) { set_attitude(&now->body[b], &p->body[b]); }
    }
}

/* Scale a vector to a length of at most `most`. */
static void shorten(double *x, double most) {
    const double square = dot(x, x);
    if (square > most * most) {
        const double share = most / sqrt(square);
        for (int i = 0; i < 3; i++) { x[i] *= share; }
    }
}

/*
 * Accelerate a lagged carrier: a = a_ref + 2 w (v* - v), v* = v_ref + w/2 (p_ref - p), cut at its limits.
 *
 * Without limits that is a critically damped lag of second order with bandwidth w. The wanted velocity v* is inside the
 * limit of speed, and so v stays inside. From farther away it grows with the root of the distance, so that a carrier can
 * brake with 0.8 of its largest acceleration.
 */
static void follow(const towline_body *body, const body_motion *lead, double bandwidth, const body_motion *now,
                   double *acceleration) {
    const double rate = 0.5 * bandwidth, most = 0.8 * body->acceleration_max;
    double away[3], wanted[3], share = rate;
    for (int i = 0; i < 3; i++) { away[i] = lead->position[i] - now->position[i]; }
    const double square = dot(away, away);
    if (square * (rate * rate * rate * rate) > most * most) {
        const double distance = sqrt(square);
        share = sqrt(most * (2 * distance - most / (rate * rate))) / distance;
    }
    for (int i = 0; i < 3; i++) { wanted[i] = lead->velocity[i] + share * away[i]; }
    shorten(wanted, body->speed_max);
    for (int i = 0; i < 3; i++) { acceleration[i] = lead->rate[i] + 4 * rate * (wanted[i] - now->velocity[i]); }
    shorten(acceleration, body->acceleration_max);
}

/* Write how positions and quaternions change, and what lagged carriers do. */
static void move_bodies(const plant *p, const motion *now, motion *change) {
    for (int b = 0; b < p->bodies; b++) {
        const towline_body *body = &p->robot->body[b];
        const body_motion *at = &now->body[b];
        body_motion *by = &change->body[b];
        if (body->motion != TOWLINE_FREE && body->motion != TOWLINE_LAGGED) { continue; }
        memcpy(by->position, at->velocity, sizeof by->position);
        if (body->motion == TOWLINE_LAGGED) {
            follow(body, &p->lead[b - 1], p->settings->carrier_bandwidth, at, by->velocity);
            continue;
        }
        const double w = at->quaternion[0], *v = at->quaternion + 1;
        double turned[3];
        cross(v, at->rate, turned);
        by->quaternion[0] = -0.5 * dot(v, at->rate);
        for (int i = 0; i < 3; i++) { by->quaternion[1 + i] = 0.5 * (w * at->rate[i] + turned[i]); }
    }
}

/* Write the accelerations of free bodies, from the forces and moments on them. */
static void accelerate_bodies(const plant *p, const motion *now, motion *change) {
    for (int b = 0; b < p->bodies; b++) {
        const towline_body *body = &p->robot->body[b];
        const double *rate = now->body[b].rate;
        double spin[3], gyroscopic[3], moment[3];
        if (body->motion != TOWLINE_FREE) { continue; }
        turn(body->inertia, rate, spin);
        cross(rate, spin, gyroscopic);
        turn_back(p->body[b].R, p->body[b].moment, moment);
        for (int i = 0; i < 3; i++) {
            change->body[b].velocity[i] = body->inverse_mass[i] * p->body[b].force[i];
            moment[i] -= gyroscopic[i];
        }
        turn(body->inverse_inertia, moment, change->body[b].rate);
    }
}

/* Give the quaternions of free bodies their length of one. */
static void normalise(const plant *p, motion *now) {
    for (int b = 0; b < p->bodies; b++) {
        double *q = now->body[b].quaternion;
        if (is_free(p, b)) {
            const double inverse = 1 / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
            for (int i = 0; i < 4; i++) { q[i] *= inverse; }
        }
    }
}

#endif
