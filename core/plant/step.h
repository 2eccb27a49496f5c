/*
 * Classical Runge-Kutta steps of fourth order, whose ends are located where a contact changes.
 *
 * A step is computed with the modes of its beginning. If at its end a cable is in another mode, the time of the earliest
 * change is found by false position (Illinois) on steps of different length from the same beginning, the step ends
 * there, the modes are changed, and the rest follows. So no step contains a jump or a kink, and the order is that of
 * smooth motions. A cable that gets taut and slack again inside of one step is noticed by the cubic through its
 * elongations.
 */
#ifndef TOWLINE_PLANT_STEP_H
#define TOWLINE_PLANT_STEP_H

#include "plant/contacts.h"

enum {
    MOST_EVENTS = 40, /* in one step; those beyond are not located */
    FEW_EVENTS = 1,   /* each after them makes `PARTING` 16 times as large, so that a platform that rattles rests */
    MOST_TRIALS = 150 /* of steps to locate one */
};

/* Memory of a step, of which slope[0] is the derivative at its beginning. */
enum { SLOPES = 5 };

typedef struct {
    motion slope[SLOPES], trial;
    double stretch[CABLES], stretch_rate[CABLES]; /* at the low end of the bracket of a change */
    /* Tensions at the beginning of a step, 6 times their mean in it [N], and their integral over a run [N s]. */
    double first[CABLES], mean[CABLES], impulse[CABLES];
} step_memory;

/* to = from + h slope, for n numbers. */
INLINE void move_numbers(int n, const double *from, double h, const double *slope, double *to) {
    for (int i = 0; i < n; i++) { to[i] = from[i] + h * slope[i]; }
}

/* The same for all that is integrated. Imposed carriers are where their path is, and some rest. */
static void move_on(const plant *p, const motion *from, double h, const motion *slope, motion *to) {
    for (int b = 0; b < p->bodies; b++) {
        const body_motion *x = &from->body[b], *dx = &slope->body[b];
        body_motion *y = &to->body[b];
        const int32_t moved_by = p->robot->body[b].motion;
        if (moved_by != TOWLINE_FREE && moved_by != TOWLINE_LAGGED) { continue; }
        move_numbers(3, x->position, h, dx->position, y->position);
        move_numbers(3, x->velocity, h, dx->velocity, y->velocity);
        if (moved_by == TOWLINE_FREE) {
            move_numbers(4, x->quaternion, h, dx->quaternion, y->quaternion);
            move_numbers(3, x->rate, h, dx->rate, y->rate);
        }
    }
    move_numbers(p->cables, from->length, h, slope->length, to->length);
    move_numbers(p->cables, from->rate, h, slope->rate, to->rate);
}

INLINE void sum_numbers(int n, const double *a, const double *b, const double *c, double *d) {
    for (int i = 0; i < n; i++) { d[i] = a[i] + 2 * (b[i] + c[i]) + d[i]; }
}

/* Add up the slopes with the weights of Runge and Kutta, 6 times the mean, into the last of them. */
static void sum_slopes(const plant *p, motion *slope) {
    motion *a = &slope[0], *b = &slope[1], *c = &slope[2], *d = &slope[3];
    for (int k = 0; k < p->bodies; k++) {
        const body_motion *x = &a->body[k], *y = &b->body[k], *z = &c->body[k];
        body_motion *to = &d->body[k];
        sum_numbers(3, x->position, y->position, z->position, to->position);
        sum_numbers(4, x->quaternion, y->quaternion, z->quaternion, to->quaternion);
        sum_numbers(3, x->velocity, y->velocity, z->velocity, to->velocity);
        sum_numbers(3, x->rate, y->rate, z->rate, to->rate);
    }
    sum_numbers(p->cables, a->length, b->length, c->length, d->length);
    sum_numbers(p->cables, a->rate, b->rate, c->rate, d->rate);
}

/* Copy the bodies and cables that the robot has. */
static void copy(const plant *p, const motion *from, motion *to) {
    memcpy(to->body, from->body, (size_t)p->bodies * sizeof from->body[0]);
    memcpy(to->length, from->length, (size_t)p->cables * sizeof from->length[0]);
    memcpy(to->rate, from->rate, (size_t)p->cables * sizeof from->rate[0]);
}

/* Write into `trial` what `from` becomes after a step with its modes; return by how much it is beyond them. */
static double attempt(plant *p, const motion *from, step_memory *of, double time, double step) {
    motion *slope = of->slope, *trial = &of->trial;
    memcpy(of->mean, of->first, (size_t)p->cables * sizeof of->mean[0]);
    for (int stage = 1; stage < 4; stage++) {
        const double share = stage == 3 ? step : 0.5 * step;
        move_on(p, from, share, &slope[stage - 1], trial);
        evaluate(p, trial, &slope[stage], time + share);
        for (int i = 0; i < p->cables; i++) { of->mean[i] += (stage == 3 ? 1 : 2) * p->cable[i].tension; }
    }
    sum_slopes(p, slope);
    move_on(p, from, step / 6, &slope[3], trial);
    normalise(p, trial);
    p->taut.holds = 0;
    if (!p->locates) { return 0; }
    set_geometry(p, trial, &slope[4], time + step);
    if (p->kind == CONSTRAINED) { hold(p, trial, &slope[4], time + step); }
    if (p->kind != ELASTIC) { set_forces(p, trial, &slope[4], time + step); }
    return largest_violation(p, trial);
}

static void keep_stretches(const plant *p, step_memory *of) {
    for (int i = 0; i < p->cables; i++) {
        of->stretch[i] = p->cable[i].stretch;
        of->stretch_rate[i] = p->cable[i].stretch_rate;
    }
}

/*
 * Return the length of the step [s] that ends just after the earliest change of a mode; `trial` is its end.
 *
 * A slack cable is caught where the cubic through its elongations and their rates at both ends of the bracket rises
 * above zero; false position finds the other changes. Both aim at half of CAUGHT_LENGTH, which ends the search.
 */
static double locate(plant *p, const motion *from, step_memory *of, double time, double high, double at_low,
                     double at_high) {
    const double half = 0.5 * CAUGHT_LENGTH * p->robot->length_scale;
    double low = 0, last = high, width = high, weighted = at_high - half;
    int side = 0, caught = caught_of(p, at_high);
    at_low -= half, at_high -= half;
    double rate = caught >= 0 ? p->cable[caught].stretch_rate : 0;
    for (int tried = 0; tried < MOST_TRIALS && at_high > half && high - low > 1e-15 * high; tried++) {
        const double step = high - low;
        double middle = high - weighted * step / (weighted - at_low);
        if (caught >= 0) {
            const cable_now *on = &p->cable[caught];
            const double below = of->stretch[caught] - on->stretch + on->beyond - half;
            middle = low + step * rise_of(below, step * of->stretch_rate[caught], at_high, step * rate);
        }
        if (tried % 3 == 2) {
            middle = step > 0.25 * width ? 0.5 * (low + high) : middle;
            width = step;
        }
        if (!(low < middle && middle < high)) { middle = 0.5 * (low + high); }
        const double found = attempt(p, from, of, time, middle);
        last = middle;
        if (found > 0) {
            high = middle;
            weighted = at_high = found - half;
            at_low *= side == 1 ? 0.5 : 1;
            side = 1;
            caught = caught_of(p, found);
            rate = caught >= 0 ? p->cable[caught].stretch_rate : 0;
        } else {
            low = middle;
            at_low = found - half;
            weighted *= side == -1 ? 0.5 : 1;
            side = -1;
            keep_stretches(p, of);
        }
    }
    if (last != high) { attempt(p, from, of, time, high); }
    return high;
}

/* Compute a step of at most `left` [s], to where a contact changes if one does; return its length, and whether. */
static double step_to_change(plant *p, const motion *now, step_memory *of, double time, double left, int may_change,
                             int *changes) {
    double high = left, at_low = 0;
    if (p->locates) {
        keep_stretches(p, of);
        at_low = smaller(largest_violation(p, now), 0);
    }
    double at_high = attempt(p, now, of, time, high);
    if (p->locates && at_high <= 0) {
        high = graze_of(p, of->stretch, of->stretch_rate, left);
        if (high < left) {
            at_high = attempt(p, now, of, time, high);
            if (at_high <= 0) {
                high = left;
                at_high = attempt(p, now, of, time, high);
            }
        }
    }
    *changes = p->locates && may_change && at_high > 0;
    return *changes ? locate(p, now, of, time, high, at_low, at_high) : high;
}

/* Move on by a step, through all changes of contact inside of it; `begin_contacts` has written slope[0]. */
static void advance(plant *p, motion *now, step_memory *of, double time, double step) {
    int events = 0;
    double left = step, parting = PARTING;
    copy(p, now, &of->trial);
    while (left > 1e-14 * step) {
        int changes;
        record_tensions(p, of->first);
        const double passed = step_to_change(p, now, of, time, left, events < MOST_EVENTS, &changes);
        copy(p, &of->trial, now);
        for (int i = 0; i < p->cables; i++) { of->impulse[i] += passed / 6 * of->mean[i]; }
        time += passed;
        left -= passed;
        if (changes) {
            events++;
            parting *= events > FEW_EVENTS ? 16 : 1;
            change_contacts(p, now, &of->slope[0], time, parting);
        }
    }
}

#endif
