/* Observers of what acts on a body beside known forces: momentum less the integral of these, times a bandwidth. */
#ifndef TOWLINE_OBSERVER_H
#define TOWLINE_OBSERVER_H

#include "control/configuration.h"

/* Write the platform's momentum in {G}, linear and about the CoM (6), at a velocity (6) of its frame. */
INLINE void momentum_of(const towline_robot *robot, const attitude *at, const double *com, const double *velocity,
                        double *momentum) {
    double omega[3], rate[3], around[3], spin[3];
    body_rate(at, velocity + 3, omega);
    turn(at->R, omega, rate);
    cross(rate, com, around);
    for (int i = 0; i < 3; i++) { momentum[i] = robot->mass * (velocity[i] + around[i]); }
    constant_times(robot->body[0].inertia, omega, spin);
    turn(at->R, spin, momentum + 3);
}

/*
 * Update one coordinate: `estimate` is the force that acts beside `known` ones, `explained` the momentum without it.
 *
 * A bandwidth beyond the inverse of the time since the last update, `dt` [s], would be unstable; 0 starts the observer.
 */
INLINE void observe(double bandwidth, double dt, double momentum, double known, double *estimate, double *explained) {
    const double gain = dt * bandwidth < 1 ? bandwidth : 1 / dt;
    *explained = dt > 0 ? *explained + dt * (known + *estimate) : momentum;
    *estimate = gain * (momentum - *explained);
}

#endif
