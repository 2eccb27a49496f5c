/*
 * Winches: J d2L0/dt2 = t - u - friction sign(dL0/dt), with L0 the unstrained length and u the motor's force.
 *
 * Where lengths or rates are commanded, a winch is a servo loop that compensates tension and friction as far as its
 * limits permit. A cable without a winch in its file follows exactly.
 */
#ifndef TOWLINE_PLANT_WINCHES_H
#define TOWLINE_PLANT_WINCHES_H

#include "plant/state.h"

static int works(const plant *p, int i) { return p->condition[i] == TOWLINE_WORKS; }

/* 1 / J of a winch that the tension moves [1/kg], else 0. */
static double winch_yielding(const plant *p, int i) {
    const int slips = p->settings->drive == TOWLINE_FORCES && p->cable[i].slip != 0 && works(p, i);
    return slips ? 1 / p->robot->cable[i].winch_inertia : 0;
}

/* The force that would pay cable out, beside friction [N]. */
static double drive_force(const plant *p, int i) {
    const double strongest = p->robot->cable[i].winch_force_max;
    return p->cable[i].tension - between(-strongest, p->commanded[i], strongest);
}

/* The acceleration of a winch whose motor's force is commanded. */
static double acceleration_by_force(const plant *p, const motion *now, int i) {
    const towline_cable *cable = &p->robot->cable[i];
    const double speed = now->rate[i], fastest = cable->winch_speed_max;
    const int slip = p->cable[i].slip;
    const double result = (drive_force(p, i) - slip * cable->winch_friction) / cable->winch_inertia;
    if (slip == 0 || (speed >= fastest && result > 0) || (speed <= -fastest && result < 0)) { return 0; }
    return result;
}

/* The acceleration that a servo loop gives. */
static double acceleration_by_servo(const plant *p, const motion *now, double time, int i) {
    const towline_cable *cable = &p->robot->cable[i];
    const double J = cable->winch_inertia, bandwidth = p->settings->winch_bandwidth, speed = now->rate[i];
    const double fastest = cable->winch_speed_max, strongest = cable->winch_force_max;
    double wanted = p->commanded[i];
    if (p->settings->drive == TOWLINE_LENGTHS) {
        const double rate = p->cable[i].reference_rate;
        wanted = rate + 0.5 * bandwidth * (p->reference[i] + rate * time - now->length[i]);
    }
    wanted = between(-fastest, wanted, fastest);
    const double rubbing = speed > 0 ? cable->winch_friction : speed < 0 ? -cable->winch_friction : 0;
    const double without_motor = p->cable[i].tension - rubbing;
    const double force = without_motor - J * 2 * bandwidth * (wanted - speed);
    return (without_motor - between(-strongest, force, strongest)) / J;
}

/* Write the second derivatives of all unstrained lengths. */
static void move_winches(const plant *p, const motion *now, motion *change, double time) {
    for (int i = 0; i < p->cables; i++) {
        if (p->robot->cable[i].winch_inertia == 0 || !works(p, i)) {
            change->rate[i] = 0;
        } else if (p->settings->drive == TOWLINE_FORCES) {
            change->rate[i] = acceleration_by_force(p, now, i);
        } else {
            change->rate[i] = acceleration_by_servo(p, now, time, i);
        }
    }
}

/* Set the rates with which cables follow what is commanded. */
static void take_command(plant *p, motion *now, double period) {
    for (int i = 0; i < p->cables; i++) {
        const int follows = p->robot->cable[i].winch_inertia == 0;
        if (p->settings->drive == TOWLINE_TENSIONS) {
            if (p->settings->tension_lag == 0) { now->length[i] = larger(p->commanded[i], 0); }
        } else if (!works(p, i)) {
            now->rate[i] = 0;
        } else if (p->settings->drive == TOWLINE_LENGTHS) {
            p->commanded[i] = larger(p->commanded[i], SHORTEST);
            p->cable[i].reference_rate = (p->commanded[i] - p->reference[i]) / period;
            if (follows) { now->rate[i] = (p->commanded[i] - now->length[i]) / period; }
        } else if (p->settings->drive == TOWLINE_RATES && follows) {
            now->rate[i] = p->commanded[i];
        }
    }
}

/* Keep winches inside their speeds, and cables from being wound in completely. */
static void limit_winches(const plant *p, motion *now) {
    for (int i = 0; i < p->cables && p->settings->drive != TOWLINE_TENSIONS; i++) {
        const towline_cable *cable = &p->robot->cable[i];
        if (cable->winch_inertia > 0) {
            now->rate[i] = between(-cable->winch_speed_max, now->rate[i], cable->winch_speed_max);
        }
        if (now->length[i] < SHORTEST) {
            now->length[i] = SHORTEST;
            now->rate[i] = larger(now->rate[i], 0);
        }
    }
}

#endif
