/* States of now, from states that were measured earlier and the tensions that were commanded since. */
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

/* Move the platform on by `dt` with a constant acceleration (6) in {G}; angles do not jump by whole turns. */
static void move_platform(double dt, const double *acceleration, attitude *at, double *motion) {
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

void towline_move_on(const towline_robot *robot, double dt, int parts, const double *disturbance,
                     const double *tensions, ptrdiff_t per, const double *accelerations, double *motion) {
    configuration at;
    double A[6 * TOWLINE_MOST_CABLES], omega[3], needed[6], acceleration[6];
    for (int part = 0; part < parts; part++) {
        configuration_at(robot, motion, &at);
        wrench_matrix(robot, &at, A);
        const mobility by = mobility_at(robot, &at, AXES);
        body_rate(&at.platform, motion + 9, omega);
        wrench_of_motion(robot, at.platform.R, motion + 6, omega, STILL, STILL, NULL, needed);
        acceleration_by(robot, &by, A, tensions + per * part, disturbance, needed, acceleration);
        move_platform(dt, acceleration, &at.platform, motion);
        for (int c = 0; c < robot->carriers; c++) {
            double *carrier = motion + MOTION * (1 + c);
            move(dt, 6, accelerations + 6 * c, carrier, carrier + 6);
        }
    }
}
