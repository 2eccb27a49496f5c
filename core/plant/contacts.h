/*
 * Contacts: which cables pull and which winches slip, and how far these are from another mode.
 *
 * Modes are fixed during a step; step.c finds where one changes, and here the next ones are chosen.
 */
#ifndef TOWLINE_PLANT_CONTACTS_H
#define TOWLINE_PLANT_CONTACTS_H

#include "plant/impacts.h"

/* By how much a cable is beyond its mode [m]; above zero it has changed. */
static double cable_violation(const plant *p, const motion *now, int i) {
    const towline_robot *robot = p->robot;
    const cable_now *on = &p->cable[i];
    if (never_stretches(p, i)) {
        return on->mode == PULLS ? -on->tension * (robot->length_scale / robot->force_scale)
                                 : on->stretch - CAUGHT_LENGTH * robot->length_scale;
    }
    if (on->mode == SLACK) { return on->stretch; }
    const double pull = on->spring * now->length[i] / robot->cable[i].stiffness;
    return on->mode == PULLS ? -pull : larger(-on->stretch, pull);
}

static int can_stick(const plant *p, int i) {
    return p->settings->drive == TOWLINE_FORCES && p->condition[i] == TOWLINE_WORKS &&
           p->robot->cable[i].winch_friction > 0;
}

/* By how much a winch is beyond its mode [m]. */
static double winch_violation(const plant *p, const motion *now, int i) {
    if (p->cable[i].slip != 0) { return -p->cable[i].slip * now->rate[i]; }
    const double beyond = fabs(drive_force(p, i)) - p->robot->cable[i].winch_friction;
    return beyond * (p->robot->length_scale / p->robot->force_scale);
}

/* Write by how much each cable and winch is beyond its mode, and return the largest; above zero it has changed. */
static double largest_violation(plant *p, const motion *now) {
    double largest = -1;
    for (int i = 0; i < p->cables; i++) {
        cable_now *on = &p->cable[i];
        const int counts = p->condition[i] != TOWLINE_CUT;
        on->beyond = counts ? cable_violation(p, now, i) : -1;
        on->sliding = counts && can_stick(p, i) ? winch_violation(p, now, i) : -1;
        largest = larger(largest, larger(on->beyond, on->sliding));
    }
    return largest;
}

/* Return the time at which a slack cable may get taut and slack again inside of a step, or else the step's end. */
static double graze_of(const plant *p, const double *stretch, const double *rate, double step) {
    for (int i = 0; i < p->cables; i++) {
        const double e0 = stretch[i], d0 = step * rate[i];
        const double e1 = p->cable[i].stretch, d1 = step * p->cable[i].stretch_rate;
        if (p->cable[i].mode != SLACK || !(d0 > 0 && d1 < 0)) { continue; }
        /* Where the cubic through both ends has no slope: a root of a s^2 + b s + d0. */
        const double a = 6 * (e0 - e1) + 3 * (d0 + d1), b = -6 * (e0 - e1) - 4 * d0 - 2 * d1;
        const double q = -0.5 * (b + copysign(sqrt(larger(b * b - 4 * a * d0, 0)), b));
        double s = q != 0 ? d0 / q : 0;
        if (!(0 < s && s < 1)) { s = a != 0 ? q / a : 0; }
        if (0 < s && s < 1) {
            const double top = e0 + s * s * (3 - 2 * s) * (e1 - e0) + s * (1 - s) * ((1 - s) * d0 - s * d1);
            if (top > 0) { return s * step; }
        }
    }
    return step;
}

/* Return which slack cable is beyond its mode by `most`, or -1. */
static int caught_of(const plant *p, double most) {
    for (int i = 0; i < p->cables; i++) {
        if (p->cable[i].mode == SLACK && p->cable[i].beyond == most) { return i; }
    }
    return -1;
}

/* Return where in (0, 1) the cubic with these values and slopes at the ends, e0 <= 0 < e1, gets above zero. */
static double rise_of(double e0, double d0, double e1, double d1) {
    double low = 0, high = 1;
    for (int halved = 0; halved < 40; halved++) {
        const double s = 0.5 * (low + high), r = 1 - s;
        const double value = r * r * (e0 * (1 + 2 * s) + s * d0) + s * s * (e1 * (3 - 2 * s) - r * d1);
        *(value > 0 ? &high : &low) = s;
    }
    return high;
}

/* Return the direction in which a winch slips, or 0 where friction holds it at the tension of its cable. */
static int slip_of(const plant *p, const motion *now, int i) {
    const double speed = now->rate[i], force = drive_force(p, i), friction = p->robot->cable[i].winch_friction;
    if (speed != 0) { return speed > 0 ? 1 : -1; }
    if (fabs(force) > friction || friction == 0) { return signbit(force) ? -1 : 1; }
    return 0;
}

/* Let the winches that friction does not hold at the tensions of now slip; return whether there are any. */
static int begin_to_slip(plant *p, const motion *now) {
    int slipped = 0;
    for (int i = 0; i < p->cables; i++) {
        if (p->cable[i].slip == 0) {
            p->cable[i].slip = slip_of(p, now, i);
            slipped |= p->cable[i].slip != 0;
        }
    }
    if (slipped) { p->taut.holds = 0; }
    return slipped;
}

/*
 * Choose the modes of cables without stiffness, and whether winches slip, and write derivative and tensions.
 *
 * Whether friction holds a winch depends on the tension with the winch at rest, so that is computed first.
 */
static void settle(plant *p, motion *now, motion *change, double time, double parting) {
    do {
        if (p->kind == CONSTRAINED) {
            resolve(p, now, change, time, parting);
        } else {
            set_forces(p, now, change, time);
        }
    } while (p->settings->drive == TOWLINE_FORCES && begin_to_slip(p, now));
}

/* A winch with friction is held at first if it rests. */
static void set_slip(plant *p, const motion *now, int i) {
    const int rests = now->rate[i] == 0 && p->robot->cable[i].winch_friction > 0;
    p->cable[i].slip = rests ? 0 : slip_of(p, now, i);
    p->taut.holds = 0;
}

/* Choose the modes of a state, with the impacts that this needs, and write its derivative and tensions. */
static void begin_contacts(plant *p, motion *now, motion *change, double time) {
    set_geometry(p, now, change, time);
    if (p->settings->drive != TOWLINE_TENSIONS) { set_modes(p); }
    for (int i = 0; i < p->cables && p->settings->drive == TOWLINE_FORCES; i++) { set_slip(p, now, i); }
    settle(p, now, change, time, PARTING);
}

/* The next mode of an elastic cable that is beyond its own. */
static contact next_mode(const cable_now *on) {
    const int stretched = on->stretch > 0;
    if (on->mode == PULLS) { return stretched ? LIMP : SLACK; }
    if (on->spring > 0 && (stretched || on->mode == SLACK)) { return PULLS; }
    return on->mode == SLACK ? LIMP : SLACK;
}

/* Bring cables and winches that are beyond their modes into other ones, and write derivative and tensions. */
static void change_contacts(plant *p, motion *now, motion *change, double time, double parting) {
    for (int i = 0; i < p->cables; i++) {
        cable_now *on = &p->cable[i];
        if (on->beyond > 0 && !never_stretches(p, i)) { on->mode = next_mode(on); }
        if (on->sliding > 0) { now->rate[i] = 0; }
    }
    set_geometry(p, now, change, time);
    for (int i = 0; i < p->cables; i++) {
        if (p->cable[i].sliding > 0) { set_slip(p, now, i); }
    }
    settle(p, now, change, time, parting);
}

#endif
