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

/* Add a step of `dt` [s] without a usable state to the time without any; the first step has dt = 0. */
INLINE void observe_nothing(double dt, double *unseen) { *unseen = dt > 0 ? *unseen + dt : INFINITY; }

/*
 * Update one coordinate: `estimate` is the force that acts beside `known` ones, `explained` the momentum without it.
 *
 * A bandwidth beyond the inverse of the time since the last step, `dt` [s], would be unstable; 0 starts the observer.
 * The estimate stays if the time `unseen` without a usable state before is longer than the observer remembers, because
 * what is known of it, which is in `explained`, is then too inexact.
 */
INLINE void observe(double bandwidth, double dt, double unseen, double momentum, double known, double *estimate,
                    double *explained) {
    const double gain = dt * bandwidth < 1 ? bandwidth : 1 / dt;
    *explained = dt > 0 ? *explained + dt * (known + *estimate) : momentum;
    if (unseen > 0 && !((dt + unseen) * bandwidth < 1)) {
        *explained = gain > 0 ? momentum - *estimate / gain : momentum;
    } else {
        *estimate = gain * (momentum - *explained);
    }
}

#endif
