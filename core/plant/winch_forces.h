/*
 * Forces with which the motors of winches give commanded tensions t*, as a drive computes them:
 *
 *     u = t* + P (t* - t) - J a - D de/dt - friction s,      a = d2l/dt2 L0 / l,     de/dt = dl/dt L0 / l - dL0/dt
 *
 * with d2l/dt2, the acceleration of the cable with the tensions of elastic cables as they are, and of others as
 * commanded. P and D are for cables that stretch: with the stiffness K = E A / L0 and the damping C, the error of the
 * elongation e then decays without oscillation, however the bodies move,
 *
 *     J d2e/dt2 + 2 sqrt((1 + P) K J) de/dt + (1 + P) K (e - e*) = 0
 *
 * at QUICK or the frequency of winch and cable, whichever is higher, but no faster than the period permits. A cable
 * with (1 + P) C > 2 sqrt((1 + P) K J) gets a smaller P, since held forces must not exceed its damper's. The sign s
 * of the winch's speed is the mean over the period, so that friction neither holds nor drives the winch.
 */
#ifndef TOWLINE_PLANT_WINCH_FORCES_H
#define TOWLINE_PLANT_WINCH_FORCES_H

#include "plant/forces.h"

static const double QUICK = 400;      /* [rad/s]: a tension follows its command with a lag of 2 / QUICK, 5 ms */
static const double PER_PERIOD = 0.4; /* [rad]: of a loop with forces that are held for a period */

/* The tension of elastic cable `i` now, by its stretch and the speed of its winch; negative if it is slack [N]. */
static double stretched_tension(const plant *p, const double *state, int i) {
    const towline_cable *cable = &p->robot->cable[i];
    const double *of_cable = state + TOWLINE_BODY_NUMBERS * p->bodies + i;
    const double L0 = of_cable[0], rate = p->cable[i].length_rate - of_cable[p->cables];
    return cable->stiffness / L0 * (p->cable[i].length - L0) + cable->damping * rate;
}

/* The motor's force of winch `i` for a tension of its cable, which is accelerated by the tensions of now [N]. */
static double winch_force(const plant *p, const double *state, double tension, double acceleration, double period,
                          int i) {
    const towline_cable *cable = &p->robot->cable[i];
    const double *of_cable = state + TOWLINE_BODY_NUMBERS * p->bodies + i;
    const double L0 = of_cable[0], speed = of_cable[p->cables], given = p->cable[i].tension;
    const double J = cable->winch_inertia;
    double force = tension - J * acceleration;
    if (cable->stiffness > 0) {
        const double K = cable->stiffness / L0, C = cable->damping, share = L0 / p->cable[i].length;
        const double bandwidth = smaller(QUICK, PER_PERIOD / period), quick = bandwidth * bandwidth * J / K;
        const double gain = larger(C > 0 ? smaller(quick, 2 * bandwidth * J / C) : quick, 1);
        const double damping = larger(2 * sqrt(gain * K * J) - gain * C, 0);
        /* A slack cable is wound in with more than what friction may differ by, but not with an impact. */
        const double now = larger(stretched_tension(p, state, i), -tension - 2 * cable->winch_friction);
        force = given + gain * (tension - now) - J * acceleration * share;
        force -= damping * (p->cable[i].length_rate * share - speed);
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
    for (int i = 0; i < p->cables; i++) {
        p->taut.candidate[i] = 1;
        forces[i] = p->condition[i] == TOWLINE_CUT ? 0 : larger(forces[i], 0);
        if (p->robot->cable[i].stiffness > 0) {
            const int taut = p->cable[i].length > state[TOWLINE_BODY_NUMBERS * p->bodies + i];
            now->length[i] = taut ? stretched_tension(p, state, i) : 0; /* negative ones count as 0 */
        }
    }
    set_forces(p, now, &change, 0);
    set_stretch_accelerations(p, &change);
    for (int i = 0; i < p->cables; i++) { forces[i] = winch_force(p, state, forces[i], p->taut.right[i], period, i); }
}

#endif
