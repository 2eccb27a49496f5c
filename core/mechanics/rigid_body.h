/* The wrench about the platform's CoM that a motion needs: Newton and Euler, less what the air gives. */
#ifndef TOWLINE_RIGID_BODY_H
#define TOWLINE_RIGID_BODY_H

#include "mechanics/attitude.h"
#include "robot.h"

/* Subtract the force of the air on the platform, from the velocity of its CoM; see models/air.py. */
INLINE void subtract_air(const towline_robot *robot, const num *wind, const num *velocity, num *force) {
    const num x = wind[0] - velocity[0], y = wind[1] - velocity[1];
    force[0] -= robot->drag * x * (robot->printed_aero ? x : magnitude(x));
    force[1] -= robot->drag * y * (robot->printed_aero ? y : magnitude(y));
    force[2] -= robot->lift * (x * x + y * y);
}

/*
 * w (6), force and moment in {G}, at an attitude R: velocity and acceleration (3) of the frame in {G}, rate Omega and its
 * derivative alpha (3) in the body's axes; wind (3) may be NULL: no air.
 */
INLINE void wrench_of_motion(const towline_robot *robot, const num *R, const num *velocity, const num *omega,
                             const num *acceleration, const num *alpha, const num *wind, num *w) {
    const double *inertia = robot->body[0].inertia;
    num rate[3], turning[3], com[3], tangential[3], around[3], centripetal[3];
    turn_constant(R, robot->com, com);
    turn(R, omega, rate);
    turn(R, alpha, turning);
    cross(turning, com, tangential);
    cross(rate, com, around); /* velocity of the CoM about the frame's origin */
    cross(rate, around, centripetal);
    for (int i = 0; i < 3; i++) {
        w[i] = robot->mass * (acceleration[i] + tangential[i] + centripetal[i] - robot->gravity[i]);
    }
    num spin[3], gyroscopic[3], moment[3]; /* in the body's axes, where the inertia is constant */
    constant_times(inertia, omega, spin);
    constant_times(inertia, alpha, moment);
    cross(omega, spin, gyroscopic);
    for (int i = 0; i < 3; i++) { moment[i] += gyroscopic[i]; }
    turn(R, moment, w + 3);
    if (wind) {
        const num speed[3] = {velocity[0] + around[0], velocity[1] + around[1], velocity[2] + around[2]};
        subtract_air(robot, wind, speed, w);
    }
}

/* The same for pose, velocity and acceleration (6) as in robot.h. */
INLINE void required_wrench(const towline_robot *robot, const num *pose, const num *velocity, const num *acceleration,
                            const num *wind, num *w) {
    const attitude at = attitude_of(pose + 3);
    num omega[3], alpha[3];
    body_rate(&at, velocity + 3, omega);
    body_acceleration(&at, velocity + 3, acceleration + 3, alpha);
    wrench_of_motion(robot, at.R, velocity, omega, acceleration, alpha, wind, w);
}

#endif
