/* Whether numbers of sensors and references can be used: finite, and no larger than any sensor reports. */
#ifndef TOWLINE_USABLE_H
#define TOWLINE_USABLE_H

#include "control/configuration.h"
#include "control/control.h"

INLINE int are_numbers(const double *x, int count) {
    const double largest = 1e9; /* [m, rad, m/s, rad/s, N]: squares of larger ones would become infinite */
    int yes = 1;
    for (int i = 0; i < count; i++) { yes &= fabs(x[i]) <= largest; /* no for nan */ }
    return yes;
}

/* Of motions (1 + c, 12) and tensions. */
INLINE int is_measured(const towline_robot *robot, const double *motions, const towline_cable_memory *cables) {
    int yes = are_numbers(motions, MOTION * (1 + robot->carriers));
    for (int i = 0; i < robot->cables; i++) { yes &= are_numbers(&cables[i].measured, 1); }
    return yes;
}

/* Of all that a row is given. */
INLINE int is_usable(const towline_robot *robot, const towline_row *row) {
    return is_measured(robot, row->measured, row->cables) && are_numbers(row->reference, 18) &&
           are_numbers(row->t_ref, robot->cables) &&
           (!row->carriers || are_numbers(row->carriers, 18 * robot->carriers));
}

#endif
