/*
 * Forces with which the motors of winches give commanded tensions t*, as a drive computes them:
 *
 *     u = t* + P (t* - t) - J a - D de/dt - friction s,      a = d2l/dt2 L0 / l,     de/dt = dl/dt L0 / l - dL0/dt
 *
 * with d2l/dt2, the acceleration of the cable if all tensions are as commanded. P and D are for cables that stretch: with
 * the stiffness K = E A / L0, the error of the elongation e then decays without oscillation,
 *
 *     J d2e/dt2 + 2 sqrt((1 + P) K J) de/dt + (1 + P) K (e - e*) = 0        while the bodies move as commanded,
 *
 * at QUICK or the frequency of winch and cable, whichever is higher, but no faster than the period permits. The sign s
 * of the winch's speed is the mean over the period, so that friction neither holds nor drives the winch.
 */
#ifndef TOWLINE_PLANT_WINCH_FORCES_H
#define TOWLINE_PLANT_WINCH_FORCES_H

#include "plant/forces.h"

static const double QUICK = 400;      /* [rad/s]: a tension follows its command with a lag of 2 / QUICK, 5 ms */
static const double PER_PERIOD = 0.4; /* [rad]: of a loop with forces that are held for a period */

/* The motor's force of winch `i` for a tension of its cable [N]. */
static double winch_force(const plant *p, const double *state, double acceleration, double period, int i) {
    const towline_cable *cable = &p->robot->cable[i];
    const double *of_cable = state + TOWLINE_BODY_NUMBERS * p->bodies + i;
    const double L0 = of_cable[0], speed = of_cable[p->cables], tension = p->cable[i].tension;
    const double J = cable->winch_inertia, stretch = p->cable[i].length - L0;
    double force = tension - J * acceleration;
    if (cable->stiffness > 0) {
        const double K = cable->stiffness / L0, share = L0 / p->cable[i].length;
        const double bandwidth = smaller(QUICK, PER_PERIOD / period), gain = larger(bandwidth * bandwidth * J / K, 1);
        const double rate = p->cable[i].length_rate * share - speed;
        const double given = stretch > 0 ? larger(K * stretch + cable->damping * rate, 0) : 0;
        const double damping = larger(2 * sqrt(gain * K * J) - cable->damping, 0);
        force = tension + (gain - 1) * (tension - given) - J * acceleration * share - damping * rate;
        acceleration = (given - force) / J;
    }
    const double after = speed + period * acceleration, most = fabs(speed) + fabs(after);
    return most > 0 ? force - (speed + after) / most * cable->winch_friction : force;
}

/* Write these forces in place of the tensions of a command that has begun, with `p` of a plant with tensions. */
static void write_winch_forces(plant *p, motion *now, const double *state, double period, double *forces) {
    motion change;
    clear(p, &change);
    set_geometry(p, now, &change, 0);
    set_forces(p, now, &change, 0);
    for (int i = 0; i < p->cables; i++) { p->taut.candidate[i] = 1; }
    set_stretch_accelerations(p, &change);
    for (int i = 0; i < p->cables; i++) { forces[i] = winch_force(p, state, p->taut.right[i], period, i); }
}

#endif
