/* States of now, from states that were measured earlier and the tensions that were commanded since. */
#include "control/internal.h"
#include "control/mobility.h"

/* Move a body (12) on by `dt` with a constant acceleration (6). */
static void move_body(double dt, const double *acceleration, double *motion) {
    for (int i = 0; i < 6; i++) {
        const double faster = dt * acceleration[i];
        motion[i] += dt * (motion[6 + i] + 0.5 * faster);
        motion[6 + i] += faster;
    }
}

void towline_move_on(const towline_robot *robot, double dt, int parts, const double *disturbance,
                     const double *tensions, ptrdiff_t per, const double *accelerations, double *motion) {
    configuration at;
    double A[6 * TOWLINE_MOST_CABLES], acceleration[6];
    for (int part = 0; part < parts; part++) {
        configuration_at(robot, motion, &at);
        wrench_matrix(robot, &at, A);
        const mobility by = mobility_at(robot, &at);
        acceleration_at(robot, &by, motion, A, tensions + per * part, disturbance, acceleration);
        move_body(dt, acceleration, motion);
        for (int c = 0; c < robot->carriers; c++) { move_body(dt, accelerations + 6 * c, motion + MOTION * (1 + c)); }
    }
}
