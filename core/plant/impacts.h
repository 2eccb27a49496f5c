/* What becomes of the cables without stiffness where contacts change, and their hold between such times. */
#ifndef TOWLINE_PLANT_IMPACTS_H
#define TOWLINE_PLANT_IMPACTS_H

#include "plant/forces.h"

enum { MOST_SHIFTS = 10 }; /* that bring cables to their lengths, a few where a state is far from them */

/* Move a quaternion by a small rotation about axes in {G}. */
static void rotate(double *q, const double *by) {
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    q[0] -= 0.5 * (by[0] * x + by[1] * y + by[2] * z);
    q[1] += 0.5 * (by[0] * w + by[1] * z - by[2] * y);
    q[2] += 0.5 * (by[1] * w + by[2] * x - by[0] * z);
    q[3] += 0.5 * (by[2] * w + by[0] * y - by[1] * x);
}

/* Apply an impulse [N s] to the velocities of a body, or a displacement [kg m] to its position. */
static void shift_body(const plant *p, motion *now, int b, double size, const yielding *by, int positions) {
    body_motion *body = &now->body[b];
    double *moved = positions ? body->position : body->velocity;
    const double turned[3] = {size * by->turned[0], size * by->turned[1], size * by->turned[2]};
    for (int i = 0; i < 3; i++) { moved[i] += size * by->moved[i]; }
    if (positions) {
        rotate(body->quaternion, turned);
    } else {
        double rate[3];
        turn_back(p->body[b].R, turned, rate);
        for (int i = 0; i < 3; i++) { body->rate[i] += rate[i]; }
    }
}

/* Apply the solution as impulses [N s] to velocities, or as displacements [kg m] to positions. */
static void shift(const plant *p, motion *now, int positions) {
    for (int i = 0; i < p->cables; i++) {
        const cable_now *on = &p->cable[i];
        const double size = p->taut.solution[i];
        const int owner = owner_of(p, i);
        if (size == 0) { continue; }
        *(positions ? &now->length[i] : &now->rate[i]) += size * winch_yielding(p, i);
        shift_body(p, now, 0, size, &on->platform, positions);
        if (is_free(p, owner)) { shift_body(p, now, owner, -size, &on->carrier, positions); }
    }
    if (positions) { normalise(p, now); }
}

/* Write elongations, or their rates, as the right-hand side for the candidates. */
static void set_right(plant *p, int positions) {
    for (int i = 0; i < p->cables; i++) {
        p->taut.right[i] = positions ? p->cable[i].stretch : p->cable[i].stretch_rate;
    }
}

static int is_intact(const plant *p, int i) { return never_stretches(p, i) && p->condition[i] != TOWLINE_CUT; }

/*
 * Make candidates of the taut cables without stiffness whose elongation does not fall faster than a rate [m/s].
 *
 * One that hardly moves is treated as taut also where rounding, far from the origin, has made it a little short.
 */
static void choose_touching(plant *p, double least_rate) {
    for (int i = 0; i < p->cables; i++) {
        const cable_now *on = &p->cable[i];
        const double short_of = fabs(on->stretch_rate) <= PARTING ? RESTING_LENGTH : TOUCHING_LENGTH;
        const int taut = on->stretch >= -short_of * p->robot->length_scale && on->stretch_rate >= least_rate;
        p->taut.candidate[i] = is_intact(p, i) && taut && on->length > NO_LENGTH;
    }
}

static int any_too_long(const plant *p) {
    for (int i = 0; i < p->cables; i++) {
        if (is_intact(p, i) && p->cable[i].stretch > CAUGHT_LENGTH * p->robot->length_scale) { return 1; }
    }
    return 0;
}

static int any_candidate_stretches(const plant *p) {
    for (int i = 0; i < p->cables; i++) {
        if (p->taut.candidate[i] && p->cable[i].stretch_rate > STILL) { return 1; }
    }
    return 0;
}

/* Return whether the cables that pulled still do and are taut, and all others are not. */
static int as_before(const plant *p) {
    for (int i = 0; i < p->cables; i++) {
        const cable_now *on = &p->cable[i];
        const int pulls = on->mode == PULLS;
        if (!never_stretches(p, i)) { continue; }
        if (!is_intact(p, i)) {
            if (pulls) { return 0; }
        } else if (pulls) {
            const double most = TOUCHING_LENGTH * p->robot->length_scale;
            if (on->tension <= 0 || fabs(on->stretch) > most || fabs(on->stretch_rate) > STILL) { return 0; }
        } else if (on->stretch > -RESTING_LENGTH * p->robot->length_scale) {
            return 0;
        }
    }
    return 1;
}

static int any_pushes(const plant *p) {
    for (int i = 0; i < p->cables; i++) {
        if (never_stretches(p, i) && p->cable[i].mode == PULLS && p->cable[i].tension <= 0) { return 1; }
    }
    return 0;
}

/* Bring cables that are too long to their lengths, and apply the impact of those that stretch. */
static void collide(plant *p, motion *now, motion *change, double time) {
    for (int tried = 0; tried <= MOST_SHIFTS; tried++) { /* positions until they fit, and then velocities */
        const int positions = tried < MOST_SHIFTS && any_too_long(p);
        choose_touching(p, -1e300);
        if (!positions && !any_candidate_stretches(p)) { return; }
        set_gram(p);
        set_right(p, positions);
        solve_non_negative(p);
        shift(p, now, positions);
        set_geometry(p, now, change, time);
        if (!positions) { return; }
    }
}

/* Bring the elongations of the pulling cables without stiffness, and their rates, back to zero. */
static void hold(plant *p, motion *now, motion *change, double time) {
    factor_pulling(p); /* the positions hardly change it */
    if (p->taut.count == 0) { return; }
    for (int positions = 1; positions >= 0; positions--) {
        set_right(p, positions);
        solve_pulling(p);
        shift(p, now, positions);
        set_geometry(p, now, change, time);
    }
}

/*
 * Apply the impact of cables that have got taut, and choose those that pull from now on.
 *
 * A taut cable gets slack where its tension would be negative, or where the impact shortens it faster than `parting`.
 */
static void resolve(plant *p, motion *now, motion *change, double time, double parting) {
    if (parting == PARTING && as_before(p)) {
        set_forces(p, now, change, time);
        if (!any_pushes(p)) { return; }
    }
    for (int i = 0; i < p->cables; i++) {
        if (never_stretches(p, i)) { p->cable[i].mode = SLACK; }
    }
    collide(p, now, change, time);
    set_forces(p, now, change, time);
    choose_touching(p, -parting);
    set_gram(p);
    set_stretch_accelerations(p, change);
    solve_non_negative(p);
    p->taut.holds = 1;
    for (int a = 0; a < p->taut.count; a++) {
        const int i = p->taut.picked[a];
        if (p->taut.solution[i] > 0) {
            p->cable[i].mode = PULLS;
        } else {
            p->taut.holds = 0;
        }
    }
    if (parting > PARTING) { hold(p, now, change, time); }
    set_forces(p, now, change, time);
}

#endif
