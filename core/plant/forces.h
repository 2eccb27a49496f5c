/*
 * The time derivative of a motion.
 *
 *     t = max(0, E A e / L0 + C de/dt) while e = l - L0 > 0, else 0         an elastic cable
 *     t >= 0, d2e/dt2 <= 0, t d2e/dt2 = 0 while e = 0, else t = 0           one without stiffness
 *
 * Which cables pull, and which winches slip, is fixed while a step is computed: then the derivative is smooth and
 * Runge-Kutta keeps its order. step.c finds the times at which that changes.
 */
#ifndef TOWLINE_PLANT_FORCES_H
#define TOWLINE_PLANT_FORCES_H

#include "plant/bodies.h"
#include "plant/cables.h"
#include "plant/constraints.h"
#include "plant/loads.h"

/* Write all that depends on the motion alone. */
static void set_geometry(plant *p, motion *now, motion *change, double time) {
    place_bodies(p, now, change, time);
    set_lines(p, now);
}

/* Write which elastic cables pull, by their elongation and its rate. */
static void set_modes(plant *p) {
    for (int i = 0; i < p->cables; i++) {
        cable_now *on = &p->cable[i];
        if (never_stretches(p, i)) { continue; }
        if (on->stretch <= 0 || p->condition[i] == TOWLINE_CUT) {
            on->mode = SLACK;
        } else {
            on->mode = on->spring > 0 ? PULLS : LIMP;
        }
    }
}

/* Write the tensions of a robot of which they are commanded, and their derivatives. */
static void commanded_tensions(plant *p, const motion *now, motion *change) {
    const double lag = p->settings->tension_lag;
    for (int i = 0; i < p->cables; i++) {
        const int pulls = p->condition[i] != TOWLINE_CUT && p->cable[i].length > NO_LENGTH;
        p->cable[i].tension = pulls ? larger(now->length[i], 0) : 0;
        change->length[i] = lag > 0 ? (larger(p->commanded[i], 0) - now->length[i]) / lag : 0;
    }
}

/* Write the tensions of elastic cables in their modes, and 0 for others; return whether one of these pulls. */
static int elastic_tensions(plant *p, const motion *now, motion *change) {
    int constrained = 0;
    for (int i = 0; i < p->cables; i++) {
        cable_now *on = &p->cable[i];
        const int pulls = on->mode == PULLS, elastic = !never_stretches(p, i);
        on->tension = pulls && elastic ? on->spring : 0;
        constrained |= pulls && !elastic;
        change->length[i] = now->rate[i];
    }
    return constrained;
}

/* Write the tensions that keep the pulling cables without stiffness from stretching, and what they accelerate. */
static void constrain(plant *p, const motion *now, motion *change, double time) {
    constraints *taut = &p->taut;
    factor_pulling(p);
    set_stretch_accelerations(p, change);
    solve_pulling(p);
    for (int i = 0; i < p->cables; i++) {
        if (taut->candidate[i]) { p->cable[i].tension = taut->solution[i]; }
    }
    pull_bodies(p, taut->candidate);
    accelerate_bodies(p, now, change);
    if (p->has_winches) { move_winches(p, now, change, time); }
}

/* Write the derivative of a motion whose geometry is written, and all tensions. */
static void set_forces(plant *p, const motion *now, motion *change, double time) {
    int constrained = 0;
    if (p->settings->drive == TOWLINE_TENSIONS) {
        commanded_tensions(p, now, change);
    } else {
        constrained = elastic_tensions(p, now, change);
    }
    load_bodies(p, now);
    pull_bodies(p, NULL);
    move_bodies(p, now, change);
    accelerate_bodies(p, now, change);
    if (p->has_winches) { move_winches(p, now, change, time); }
    if (constrained) { constrain(p, now, change, time); }
}

/* Write the derivative of a motion; elastic cables pull by their elongation unless contacts are located. */
static void evaluate(plant *p, motion *now, motion *change, double time) {
    set_geometry(p, now, change, time);
    p->taut.holds = 0;
    if (!p->settings->located && p->settings->drive != TOWLINE_TENSIONS) { set_modes(p); }
    set_forces(p, now, change, time);
}

#endif
