/*
 * Thrusts and torques with which flying carriers follow their commanded motion under the pull of their cables.
 *
 *     F   = m (a + 2 k (v - v_q) + k^2 (p - p_q) - g) + sum of t u - d
 *     tau = J (alpha + 2 h (Omega - Omega_q + r)) + Omega_q x J Omega_q - M
 *
 *     d   = K (m v_q - m v_0 - integral of (T + m g - sum of t u + d))
 *
 * F is the wanted thrust in {G}, T the one given, d the estimate of all other forces (air, a mass that is not as in the
 * robot file), e the rotation from the thrust's axis to F, inside a cone, and to the ordered yaw, M the moment of the
 * cables about the CoM, k and h the bandwidths of position and attitude; q marks what is measured. Only the part of F
 * along the thrust's axis acts at once; the rest follows when the carrier has turned. It is missing if the carrier
 * cannot turn as commanded: if F is outside the cone, or the actuators are at their limits most of the time. An
 * unstable attitude loop is noticed in this way too, because its oscillations grow until they reach the limits. Source:
 * T. Lee, M. Leok and N. H. McClamroch, "Geometric tracking control of a quadrotor UAV on SE(3)", CDC 2010, to first
 * order in e.
 *
 * r is the rate with which the carrier turns back by e: h e / 2 while e is small, the usual law. A carrier that turns
 * back by a large e so fast cannot stop in time, and oscillates for good if its rotors lag. So r, about each axis, is at
 * most the rate from which half the largest torque stops it within what is left of e, 2 a / h^2 less:
 *
 *     |r| = sqrt(a (2 |e| - 4 a / h^2)),  |e| > 4 a / h^2,  a = half the largest angular acceleration
 *
 * Value and slope of both are equal where they meet. The other half is for lags, and for M.
 *
 * While a state is missing, F and M stay, and e is predicted from the commands, so that the carrier completes its turn
 * and stops. To hold the last command instead would hold its angular acceleration, which noise makes so large that a
 * carrier turns over in 0.3 s.
 */
#include <string.h>

#include "control/internal.h"
#include "control/observer.h"
#include "control/usable.h"

static const double NO_FORCE = 1e-9; /* [N], and of a rotation [rad] */
static const double WINDOW = 0.1;    /* [s]: well-damped turns towards a new force stay at limits for less */
static const double MOSTLY = 0.5;    /* of the window */
static const double SLOWER = 4;      /* bandwidths of the attitude loop: what is quicker is noise */
static const double BRAKES = 0.5;    /* of the largest torque: with all of it, lags of 30 ms still leave oscillations */
static const double UPRIGHT = 0.2;   /* of the weight: the least upward force for which a carrier turns */

/* One carrier of a flight. */
typedef struct {
    const towline_robot *robot;
    const towline_controller *controller;
    const towline_body *body;
    const configuration *at;
    const double *motion, *order; /* (12) as measured, and (3, 6) as ordered */
    double attitude;              /* bandwidth h */
    int index;
    towline_carrier_memory *memory;
} flier;

/* Add what the cables of a carrier, with tensions that are `per` numbers apart, do to it: force and moment in {G}. */
static void add_pull(const flier *it, const double *tensions, ptrdiff_t per, double *force, double *moment) {
    for (int i = 0; i < it->robot->cables; i++) {
        if (it->robot->cable[i].carrier == it->index) {
            const cable_run *run = &it->at->cable[i];
            double turning[3];
            cross(run->carrier_arm, run->pull, turning);
            for (int k = 0; k < 3; k++) {
                force[k] -= tensions[per * i] * run->pull[k];
                moment[k] -= tensions[per * i] * turning[k];
            }
        }
    }
}

/* Update the estimate of the force that thrust, weight and cables do not explain. */
static void observe_carrier(const flier *it, double dt, const towline_cable_memory *cables, const double *given) {
    const double mass = it->body->mass[0];
    double thrust[3] = {0, 0, 0}, known[3], moment[3] = {0, 0, 0};
    for (int a = 0; a < it->body->actuators; a++) {
        for (int k = 0; k < 3; k++) { thrust[k] += given[a] * it->body->actuator[a].wrench[k]; }
    }
    turn(it->at->carrier[it->index].R, thrust, known);
    const ptrdiff_t per = sizeof(towline_cable_memory) / sizeof(double);
    add_pull(it, &cables[0].known, per, known, moment);
    for (int k = 0; k < 3; k++) {
        double *estimate = &it->memory->force[k], *explained = &it->memory->explained[k];
        known[k] += mass * it->robot->gravity[k];
        *explained += it->memory->unseen * (known[k] + *estimate); /* thrust and pull stay while a state is missing */
        observe(it->controller->observer, dt, it->memory->unseen, mass * it->motion[6 + k], known[k], estimate,
                explained);
    }
    it->memory->unseen = 0;
}

/* Write the thrust F that a carrier needs, in {G}, and the moment of its cables. */
static void needed_force(const flier *it, const double *tensions, double *force, double *moment) {
    const double mass = it->body->mass[0], place = it->controller->place * it->attitude / it->controller->attitude;
    const double *order = it->order, *motion = it->motion;
    for (int k = 0; k < 3; k++) {
        const double away = order[k] - motion[k], slower = order[6 + k] - motion[6 + k];
        force[k] = mass * (order[12 + k] + place * (2 * slower + place * away)) - mass * it->robot->gravity[k] -
                   it->memory->force[k];
        moment[k] = 0;
    }
    double pull[3] = {0, 0, 0};
    add_pull(it, tensions, 1, pull, moment);
    for (int k = 0; k < 3; k++) { force[k] -= pull[k]; }
}

/*
 * Write the force for which a carrier turns, F inside the cone of its largest tilt, and return what of F is outside.
 *
 * Where F points down or vanishes, its direction turns over at once, and a carrier that follows it tumbles.
 */
static double force_in_cone(const flier *it, const double *force, double *turning) {
    const double *gravity = it->robot->gravity, size = sqrt(dot(gravity, gravity));
    memcpy(turning, force, 3 * sizeof *turning);
    if (size == 0) { return 0; }
    const double up = -dot(force, gravity) / size;
    double side[3];
    for (int k = 0; k < 3; k++) { side[k] = force[k] + up * gravity[k] / size; }
    const double kept = fmax(up, UPRIGHT * it->body->mass[0] * size), sideways = sqrt(dot(side, side));
    const double most = it->controller->lean[it->index] * kept, share = sideways > most ? most / sideways : 1;
    for (int k = 0; k < 3; k++) { turning[k] = share * side[k] - kept * gravity[k] / size; }
    return (1 - share) * sideways;
}

/* Write e, in the carrier's axes: from the thrust's axis to F, beyond a right angle as far as at one, and to the yaw. */
static void rotation_to(const flier *it, const double *force, double *e) {
    const double *R = it->at->carrier[it->index].R;
    const double axis[3] = {R[2], R[5], R[8]};
    double from_axis[3];
    cross(axis, force, from_axis);
    const double size = fmax(sqrt(dot(force, force)), NO_FORCE);
    double sine = 1;
    if (dot(axis, force) < 0) { sine = fmax(sqrt(dot(from_axis, from_axis)) / size, NO_FORCE); }
    for (int k = 0; k < 3; k++) { from_axis[k] /= size * sine; }
    turn_back(R, from_axis, e);
    e[2] += axis[2] * turn_between(it->motion[5], it->order[5]);
}

/* Write how a carrier turns by what is measured, and return F across the thrust [N]. */
static double turn_measured(const flier *it, const double *tensions, towline_turn *now) {
    const attitude *at = &it->at->carrier[it->index];
    const double axis[3] = {at->R[2], at->R[5], at->R[8]}, *inertia = it->body->inertia;
    double force[3], turning[3], pulled[3], wanted[3], bent[3], moment[3], spin[3], gyroscopic[3], turned[3];
    double *rate = it->memory->turning;
    needed_force(it, tensions, force, pulled);
    it->memory->lacking = force_in_cone(it, force, turning);
    rotation_to(it, turning, now->away);
    body_rate(at, it->order + 9, wanted);
    body_rate(at, it->order + 15, bent);
    body_rate(at, it->motion + 9, rate);
    constant_times(inertia, bent, moment);
    constant_times(inertia, rate, spin);
    cross(rate, spin, gyroscopic);
    turn_back(at->R, pulled, turned);
    for (int k = 0; k < 3; k++) {
        now->rate[k] = wanted[k] - rate[k];
        now->steady[k] = 0;
        now->steady[3 + k] = moment[k] + gyroscopic[k] - turned[k];
        now->bent[k] = bent[k];
    }
    now->steady[2] = dot(force, axis);
    return sqrt(fmax(dot(force, force) - now->steady[2] * now->steady[2], 0));
}

/* Predict how a carrier turns under what it was commanded last, after `dt` [s]. */
static void turn_on(const towline_body *body, double dt, const double *given, towline_turn *it) {
    double moment[3], faster[3];
    for (int k = 0; k < 3; k++) {
        moment[k] = -it->steady[3 + k];
        for (int a = 0; a < body->actuators; a++) { moment[k] += given[a] * body->actuator[a].wrench[3 + k]; }
    }
    constant_times(body->inverse_inertia, moment, faster);
    for (int k = 0; k < 3; k++) {
        it->away[k] += dt * (it->rate[k] - dt / 2 * faster[k]);
        it->rate[k] -= dt * faster[k];
    }
}

/* Return the largest angular acceleration about an axis that the actuators give [rad/s^2]. */
static double largest_acceleration(const flier *it, int axis) {
    double least = INFINITY;
    for (int a = 0; a < it->body->actuators; a++) {
        const double *by = it->controller->by_wrench[it->index][a] + 3;
        double per = 0;
        for (int k = 0; k < 3; k++) { per += by[k] * it->body->inertia[3 * k + axis]; }
        if (per != 0) { least = fmin(least, (it->body->actuator[a].high - it->body->actuator[a].low) / 2 / fabs(per)); }
    }
    return least;
}

/* Return r about an axis, at which a carrier has to turn by `away`. */
static double turning_back(const flier *it, int axis, double away) {
    const double usual = it->attitude / 2, most = BRAKES * largest_acceleration(it, axis);
    const double linear = most / (usual * usual), size = fabs(away);
    return size > linear ? copysign(sqrt(most * (2 * size - linear)), away) : usual * away;
}

/* Write force and moment, in its own axes, that a carrier needs of its actuators; return F across the thrust [N]. */
static double wrench_of_carrier(const flier *it, double dt, const double *tensions, const double *given,
                                double *wrench) {
    const double h = it->attitude;
    towline_turn now, *turn = &it->memory->turn;
    double faster[3], moment[3];
    const double across = turn_measured(it, tensions, &now);
    const int measured = are_numbers(now.steady, 6) && are_numbers(now.away, 3) && are_numbers(now.rate, 3);
    if (measured) {
        *turn = now;
    } else {
        turn_on(it->body, dt, given, turn);
        it->memory->lacking = 0;
    }
    for (int k = 0; k < 3; k++) {
        faster[k] = 2 * h * (turning_back(it, k, turn->away[k]) + turn->rate[k]);
        it->memory->ordered[k] = turn->bent[k] + faster[k];
        if (!measured) { it->memory->turning[k] = NAN; }
    }
    constant_times(it->body->inertia, faster, moment);
    for (int k = 0; k < 3; k++) {
        wrench[k] = turn->steady[k];
        wrench[3 + k] = turn->steady[3 + k] + moment[k];
    }
    return measured ? across : 0;
}

/* Write commands inside their limits, where they are numbers, and remember what they lack of F, `across` or along. */
static void command(const flier *it, double dt, const double *wrench, double across, double *actuation) {
    const double share = 1 - exp(-SLOWER * it->attitude * dt);
    int limited = 0;
    double thrust = 0, moment[3] = {0, 0, 0}, faster[3]; /* what limits add */
    for (int a = 0; a < it->body->actuators; a++) {
        const towline_actuator *limits = &it->body->actuator[a];
        double wanted = 0;
        for (int k = 0; k < 6; k++) { wanted += it->controller->by_wrench[it->index][a][k] * wrench[k]; }
        const double inside = wanted < limits->low ? limits->low : wanted > limits->high ? limits->high : wanted;
        if (isfinite(inside)) {
            double *smooth = &it->memory->wanted[a];
            actuation[a] = inside;
            *smooth = dt > 0 ? *smooth + share * (wanted - *smooth) : wanted;
            limited |= *smooth < limits->low || *smooth > limits->high;
        }
        for (int k = 0; k < 3; k++) { moment[k] += (actuation[a] - wanted) * limits->wrench[3 + k]; }
        thrust += actuation[a] * limits->wrench[2];
    }
    it->memory->limited += fmin(dt / WINDOW, 1) * (limited - it->memory->limited);
    const double missing = fmax(fabs(wrench[2] - thrust), it->memory->limited > MOSTLY ? across : 0);
    it->memory->lacking = fmax(it->memory->lacking, missing);
    constant_times(it->body->inverse_inertia, moment, faster);
    for (int k = 0; k < 3; k++) { it->memory->ordered[k] += faster[k]; }
}

double towline_write_thrusts(const towline_robot *robot, const towline_controller *controller, double dt,
                             towline_flight flight) {
    const int most = towline_most_actuators(robot);
    double ordered[TOWLINE_MOST_CARRIERS][3], lacking = 0;
    const int measured = is_measured(robot, flight.measured, flight.cables);
    configuration at;
    configuration_at(robot, flight.measured, &at);
    for (int c = 0; c < robot->carriers; c++) {
        const towline_body *body = &robot->body[1 + c];
        const double *motion = flight.measured + MOTION * (1 + c);
        const flier it = {
            robot, controller,        body, &at, motion, flight.carriers + 18 * c, flight.platform->attitude,
            c,     &flight.memory[c],
        };
        double wrench[6], *actuation = flight.actuation + most * c;
        memcpy(ordered[c], it.memory->ordered, sizeof ordered[c]);
        if (body->actuators > 0) {
            if (measured) {
                observe_carrier(&it, dt, flight.cables, actuation);
            } else {
                observe_nothing(dt, &it.memory->unseen);
            }
            const double across = wrench_of_carrier(&it, dt, flight.tensions, actuation, wrench);
            command(&it, dt, wrench, across, actuation);
            lacking = fmax(lacking, it.memory->lacking); /* not a number that is none */
        }
    }
    if (flight.turning) {
        towline_measure_turning(robot, controller->attitude, dt, (const double (*)[3])ordered, flight.memory,
                                flight.turning);
        if (flight.turning->lag > 0) {
            flight.platform->attitude = fmin(controller->attitude, 1 / flight.turning->lag);
        }
    }
    return lacking;
}

int towline_most_actuators(const towline_robot *robot) {
    int most = 0;
    for (int c = 0; c < robot->carriers; c++) {
        const int own = robot->body[1 + c].actuators;
        most = own > most ? own : most;
    }
    return most;
}
