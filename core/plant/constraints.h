/*
 * Cables without stiffness, which hold the distance of their ends to at most L0, and impacts of such cables.
 *
 * With the Jacobian J of their elongations and the mass matrix M, tensions change the elongations' accelerations by
 * -G t, G = J M^-1 J^T, and impulses p their rates by -G p. Unilateral contact is
 *
 *     x >= 0,  G x - c >= 0,  x (G x - c) = 0
 *
 * with c what the elongations would do without cables. These are the conditions of min 1/2 x G x - c x over x >= 0, a
 * non-negative least-squares problem in the metric M^-1 (Gauss's principle of least constraint). An impact changes the
 * kinetic energy by -1/2 p G p where nothing else moves: it never grows. Where more cables are taut than their Jacobian
 * has rank, tensions are not unique: the solution has those of cables that stretch a little, all of the same E A.
 *
 * Source: C. Lawson, R. Hanson, Solving Least Squares Problems, 1974, chapter 23, with a Cholesky factor of G.
 */
#ifndef TOWLINE_PLANT_CONSTRAINTS_H
#define TOWLINE_PLANT_CONSTRAINTS_H

#include "plant/winches.h"

/* Of the mean entry on G's diagonal, added there: dependent cables share what they carry. */
static const double GIVING = 1e-10;
/* Solutions with that, of which each takes away all but some 1e-10 of what the one before has left. */
enum { REFINED = 2 };
/* Of a cable's own entry in G: with less left after elimination it depends on others. */
static const double DEPENDENT = 1e-14;

/* Write R I^-1 R^T of the free bodies: the angular acceleration in {G} by a moment in {G}. */
static void set_inverse_inertias(plant *p) {
    for (int b = 0; b < p->bodies; b++) {
        const double *R = p->body[b].R;
        for (int i = 0; i < 3 && is_free(p, b); i++) {
            double row[3];
            turn(p->robot->body[b].inverse_inertia, R + 3 * i, row);
            turn(R, row, p->body[b].inverse_inertia + 3 * i);
        }
    }
}

/* Write how a body yields to a pull at `arm` from its position. */
static void set_yielding(const plant *p, int b, const double *arm, const double *pull, yielding *by) {
    cross(arm, pull, by->moment);
    turn(p->body[b].inverse_inertia, by->moment, by->turned);
    for (int i = 0; i < 3; i++) { by->moved[i] = p->robot->body[b].inverse_mass[i] * pull[i]; }
}

/* What a body adds to G for two cables that pull on it. */
static double coupling(const cable_now *one, const yielding *by_one, const yielding *by_other) {
    return dot(one->pull, by_other->moved) + dot(by_one->moment, by_other->turned);
}

/* Write G among the candidates, and how bodies yield to them. */
static void set_gram(plant *p) {
    constraints *taut = &p->taut;
    double trace = 0, lengths = 1e-300;
    set_inverse_inertias(p);
    for (int i = 0; i < p->cables; i++) {
        cable_now *one = &p->cable[i];
        const int owner = owner_of(p, i);
        if (!taut->candidate[i]) { continue; }
        set_yielding(p, 0, one->arm, one->pull, &one->platform);
        if (is_free(p, owner)) { set_yielding(p, owner, one->carrier_arm, one->pull, &one->carrier); }
        for (int j = 0; j <= i; j++) {
            const cable_now *other = &p->cable[j];
            if (!taut->candidate[j]) { continue; }
            double total = coupling(one, &one->platform, &other->platform);
            if (owner == owner_of(p, j) && is_free(p, owner)) {
                total += coupling(one, &one->carrier, &other->carrier);
            }
            taut->gram[i][j] = taut->gram[j][i] = total;
        }
        taut->gram[i][i] += winch_yielding(p, i);
        trace += taut->gram[i][i];
        lengths += one->length;
    }
    for (int i = 0; i < p->cables; i++) { taut->give[i] = GIVING * trace * p->cable[i].length / lengths; }
}

/* Acceleration in {G} of the point of body `b` at `arm` from its position. */
static void accelerate_point(const plant *p, const motion *change, int b, const double *arm, double *acceleration) {
    const body_now *body = &p->body[b];
    double tangential[3], around[3], centripetal[3];
    cross(body->turning, arm, tangential);
    cross(body->omega, arm, around);
    cross(body->omega, around, centripetal);
    for (int i = 0; i < 3; i++) { acceleration[i] = change->body[b].velocity[i] + tangential[i] + centripetal[i]; }
}

/* Write d2e/dt2 [m/s^2] for the accelerations in `change` as the right-hand side for the candidates. */
static void set_stretch_accelerations(plant *p, const motion *change) {
    for (int b = 0; b < p->bodies; b++) { turn(p->body[b].R, change->body[b].rate, p->body[b].turning); }
    for (int i = 0; i < p->cables; i++) {
        const cable_now *on = &p->cable[i];
        const int owner = owner_of(p, i);
        double a[3], carrier_a[3], coriolis[3];
        if (!p->taut.candidate[i]) {
            p->taut.right[i] = 0;
            continue;
        }
        accelerate_point(p, change, 0, on->arm, a);
        accelerate_point(p, change, owner, on->carrier_arm, carrier_a);
        cross(p->body[owner].omega, on->drift, coriolis);
        for (int j = 0; j < 3; j++) { a[j] -= carrier_a[j] + 2 * coriolis[j]; }
        p->taut.right[i] = on->curvature - dot(on->pull, a) - change->rate[i];
    }
}

/* Add a cable to the factor; return 0, and leave it out, if it depends on those before. */
static int append(constraints *taut, int one) {
    const int at = taut->count;
    double *row = taut->factor[at], left = taut->gram[one][one] + taut->give[one];
    for (int b = 0; b < at; b++) {
        const double *other = taut->factor[b];
        double total = taut->gram[one][taut->picked[b]];
        for (int k = 0; k < b; k++) { total -= row[k] * other[k]; }
        row[b] = total * taut->inverse_diagonal[b];
        left -= row[b] * row[b];
    }
    if (!(left > DEPENDENT * taut->gram[one][one])) { return 0; }
    row[at] = sqrt(left);
    taut->inverse_diagonal[at] = 1 / row[at];
    taut->picked[at] = one;
    taut->count++;
    return 1;
}

/* Replace x by what the factor times its transpose makes x of. */
static void solve_factored(const constraints *taut, double *x) {
    for (int a = 0; a < taut->count; a++) {
        for (int k = 0; k < a; k++) { x[a] -= taut->factor[a][k] * x[k]; }
        x[a] *= taut->inverse_diagonal[a];
    }
    for (int a = taut->count - 1; a >= 0; a--) {
        for (int k = a + 1; k < taut->count; k++) { x[a] -= taut->factor[k][a] * x[k]; }
        x[a] *= taut->inverse_diagonal[a];
    }
}

/*
 * Solve G z = c over the picked cables.
 *
 * The factor is that of cables that give a little: each round after the first refines the solution to one of G.
 */
static void solve_picked(const constraints *taut, int rounds, double *z) {
    double step[CABLES];
    for (int a = 0; a < taut->count; a++) { z[a] = taut->right[taut->picked[a]]; }
    solve_factored(taut, z);
    for (int round = 1; round < rounds; round++) {
        for (int a = 0; a < taut->count; a++) {
            const double *row = taut->gram[taut->picked[a]];
            step[a] = taut->right[taut->picked[a]];
            for (int b = 0; b < taut->count; b++) { step[a] -= row[taut->picked[b]] * z[b]; }
        }
        solve_factored(taut, step);
        for (int a = 0; a < taut->count; a++) { z[a] += step[a]; }
    }
}

/* Solve G x = c for the picked cables; x of others is 0. */
static void solve_pulling(plant *p) {
    constraints *taut = &p->taut;
    double z[CABLES];
    solve_picked(taut, REFINED, z);
    memset(taut->solution, 0, (size_t)p->cables * sizeof taut->solution[0]);
    for (int a = 0; a < taut->count; a++) { taut->solution[taut->picked[a]] = z[a]; }
}

/* Factor G over the pulling cables without stiffness, but for those that depend on others. */
static void factor_pulling(plant *p) {
    constraints *taut = &p->taut;
    if (taut->holds) { return; }
    for (int i = 0; i < p->cables; i++) { taut->candidate[i] = never_stretches(p, i) && p->cable[i].mode == PULLS; }
    set_gram(p);
    taut->count = 0;
    for (int i = 0; i < p->cables; i++) {
        if (taut->candidate[i]) { append(taut, i); }
    }
    taut->holds = 1;
}

/* Take the picked cable at `gone` out of the factor and of x. */
static void drop(constraints *taut, int gone, double *x) {
    const int count = taut->count;
    int picked[CABLES];
    double kept[CABLES];
    memcpy(picked, taut->picked, (size_t)count * sizeof picked[0]);
    memcpy(kept, x, (size_t)count * sizeof kept[0]);
    taut->count = gone;
    for (int a = gone + 1; a < count; a++) {
        x[taut->count] = kept[a];
        append(taut, picked[a]);
    }
}

/* Move x to the solution over the picked cables, without those that would push. */
static void bring_inside(plant *p, int *barred, double *x) {
    constraints *taut = &p->taut;
    for (;;) {
        double z[CABLES], share = 1;
        int first = -1;
        solve_picked(taut, 1, z);
        for (int a = 0; a < taut->count; a++) {
            if (z[a] <= 0 && (first < 0 || x[a] < share * (x[a] - z[a]))) {
                share = x[a] / larger(x[a] - z[a], 1e-300);
                first = a;
            }
        }
        for (int a = 0; a < taut->count; a++) { x[a] += share * (z[a] - x[a]); }
        if (first < 0) { return; }
        drop(taut, first, x);
        for (int i = 0; i < p->cables; i++) { /* what depended on the one that goes may not any more */
            barred[i] = !taut->candidate[i];
        }
        for (int a = 0; a < taut->count; a++) { barred[taut->picked[a]] = 1; }
    }
}

/* Return the candidate that would stretch most for the tensions x, or -1 if none does by more than `most`. */
static int most_violated(const plant *p, const int *barred, const double *x, double most) {
    const constraints *taut = &p->taut;
    int best = -1;
    for (int i = 0; i < p->cables; i++) {
        double left = barred[i] ? 0 : taut->right[i];
        for (int a = 0; a < taut->count && !barred[i]; a++) { left -= taut->gram[i][taut->picked[a]] * x[a]; }
        if (left > most) {
            best = i;
            most = left;
        }
    }
    return best;
}

/* Solve x >= 0, G x - c >= 0, x (G x - c) = 0 for the candidates. */
static void solve_non_negative(plant *p) {
    constraints *taut = &p->taut;
    int barred[CABLES];
    double x[CABLES], largest = 0;
    for (int i = 0; i < p->cables; i++) {
        barred[i] = !taut->candidate[i];
        largest = larger(largest, taut->candidate[i] ? fabs(taut->right[i]) : 0);
    }
    taut->count = 0;
    taut->holds = 0;
    for (int tried = 0; tried < 10 * p->cables + 20; tried++) {
        const int best = most_violated(p, barred, x, 1e-13 * largest);
        if (best < 0) { break; }
        barred[best] = 1;
        if (append(taut, best)) {
            x[taut->count - 1] = 0;
            bring_inside(p, barred, x);
        }
    }
    solve_pulling(p);
}

#endif
