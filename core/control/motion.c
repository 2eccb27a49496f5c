/*
 * States of now, from states that were measured earlier and what was commanded since.
 *
 * Flying carriers move by their equations too, so that the loops around them are as stable as without the delay. Forces
 * that act on them beside thrust, weight and cables are left out: their observer uses these states, and would correct
 * its own prediction.
 */
#include "control/internal.h"
#include "control/mobility.h"

static const double AXES[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, STILL[3] = {0, 0, 0};

/* Move coordinates on by `dt` with constant accelerations. */
static void move(double dt, int count, const double *acceleration, double *position, double *rate) {
    for (int i = 0; i < count; i++) {
        const double faster = dt * acceleration[i];
        position[i] += dt * (rate[i] + 0.5 * faster);
        rate[i] += faster;
    }
}

/* Move a body on by `dt` with a constant acceleration (6) in {G}; angles do not jump by whole turns. */
static void move_body(double dt, const double *acceleration, attitude *at, double *motion) {
    double omega[3], rate[3], vector[3] = {0, 0, 0}, angles[3];
    body_rate(at, motion + 9, omega);
    turn(at->R, omega, rate);
    move(dt, 3, acceleration, motion, motion + 6);
    move(dt, 3, acceleration + 3, vector, rate);
    turn_body(vector, at->R);
    turn_back(at->R, rate, omega);
    angles_of(at->R, omega, angles, motion + 9);
    for (int i = 0; i < 3; i++) { motion[3 + i] += turn_between(motion[3 + i], angles[i]); }
}

/* Write the acceleration (6) in {G} of a flying carrier by its cables and by what its actuators give. */
static void accelerate_carrier(const towline_robot *robot, const configuration *at, int carrier, const double *tensions,
                               const double *given, const double *motion, double *acceleration) {
    const towline_body *body = &robot->body[1 + carrier];
    const attitude *turned = &at->carrier[carrier];
    double wrench[6] = {0}, force[3], pull[3] = {0}, moment[3] = {0}, around[3], omega[3], spin[3], gyroscopic[3];
    for (int a = 0; a < body->actuators; a++) {
        for (int k = 0; k < 6; k++) { wrench[k] += given[a] * body->actuator[a].wrench[k]; }
    }
    for (int i = 0; i < robot->cables; i++) {
        if (robot->cable[i].carrier == carrier) {
            cross(at->cable[i].carrier_arm, at->cable[i].pull, around);
            for (int k = 0; k < 3; k++) {
                pull[k] -= tensions[i] * at->cable[i].pull[k];
                moment[k] -= tensions[i] * around[k];
            }
        }
    }
    turn(turned->R, wrench, force);
    turn_back(turned->R, moment, around);
    body_rate(turned, motion + 9, omega);
    constant_times(body->inertia, omega, spin);
    cross(omega, spin, gyroscopic);
    for (int k = 0; k < 3; k++) {
        acceleration[k] = (force[k] + pull[k]) / body->mass[0] + robot->gravity[k];
        around[k] += wrench[3 + k] - gyroscopic[k];
    }
    constant_times(body->inverse_inertia, around, spin);
    turn(turned->R, spin, acceleration + 3);
}

void towline_move_on(const towline_robot *robot, double dt, int parts, towline_commanded commanded,
                     const double *disturbance, double *motion) {
    configuration at;
    const int most = towline_most_actuators(robot);
    double A[6 * TOWLINE_MOST_CABLES], omega[3], needed[6], acceleration[6];
    for (int part = 0; part < parts; part++) {
        configuration_at(robot, motion, &at);
        wrench_matrix(robot, &at, A);
        const mobility by = mobility_at(robot, &at, AXES);
        body_rate(&at.platform, motion + 9, omega);
        wrench_of_motion(robot, at.platform.R, motion + 6, omega, STILL, STILL, NULL, needed);
        const double *tensions = commanded.tensions + commanded.per_tensions * part;
        acceleration_by(robot, &by, A, tensions, disturbance, needed, acceleration);
        move_body(dt, acceleration, &at.platform, motion);
        for (int c = 0; c < robot->carriers; c++) {
            double *carrier = motion + MOTION * (1 + c);
            const double *given =
                commanded.actuation ? commanded.actuation + commanded.per_actuation * part + most * c : NULL;
            int flies = 0;
            for (int a = 0; given && a < robot->body[1 + c].actuators; a++) { flies |= given[a] != 0; }
            if (flies) {
                accelerate_carrier(robot, &at, c, tensions, given, carrier, acceleration);
                move_body(dt, acceleration, &at.carrier[c], carrier);
            } else {
                move(dt, 6, commanded.accelerations + 6 * c, carrier, carrier + 6);
            }
        }
    }
}
