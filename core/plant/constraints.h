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

/* The angular acceleration in {G} of a body by a moment in {G}. */
static void turning_by(const plant *p, int b, const double *moment, double *turning) {
    double own[3], result[3];
    turn_back(p->body[b].R, moment, own);
    turn(p->robot->body[b].inverse_inertia, own, result);
    turn(p->body[b].R, result, turning);
}

/* What a body adds to G for two cables that pull on it. */
static double coupling(const double *inverse_mass, const double *pull, const double *moment, const double *other_pull,
                       const double *other_turning) {
    const double accelerated[3] = {inverse_mass[0] * other_pull[0], inverse_mass[1] * other_pull[1],
                                   inverse_mass[2] * other_pull[2]};
    return dot(pull, accelerated) + dot(moment, other_turning);
}

/* Write G among the candidates, and the angular accelerations per newton of them. */
static void set_gram(plant *p) {
    constraints *taut = &p->taut;
    double trace = 0, lengths = 1e-300;
    for (int i = 0; i < p->cables; i++) {
        cable_now *one = &p->cable[i];
        const int owner = owner_of(p, i);
        if (!taut->candidate[i]) {
            continue;
        }
        cross(one->arm, one->pull, one->moment);
        turning_by(p, 0, one->moment, one->turning);
        if (is_free(p, owner)) {
            cross(one->carrier_arm, one->pull, one->carrier_moment);
            turning_by(p, owner, one->carrier_moment, one->carrier_turning);
        }
        for (int j = 0; j <= i; j++) {
            const cable_now *other = &p->cable[j];
            if (!taut->candidate[j]) {
                continue;
            }
            double total =
                coupling(p->robot->body[0].inverse_mass, one->pull, one->moment, other->pull, other->turning);
            if (owner == owner_of(p, j) && is_free(p, owner)) {
                total += coupling(p->robot->body[owner].inverse_mass, one->pull, one->carrier_moment, other->pull,
                                  other->carrier_turning);
            }
            taut->gram[i][j] = taut->gram[j][i] = total;
        }
        taut->gram[i][i] += winch_yielding(p, i);
        trace += taut->gram[i][i];
        lengths += one->length;
    }
    for (int i = 0; i < p->cables; i++) {
        taut->give[i] = GIVING * trace * p->cable[i].length / lengths;
    }
}

/* Acceleration in {G} of the point of body `b` at `arm` from its position, and its velocity. */
static void moved_point(const plant *p, const motion *now, const motion *change, int b, const double *arm,
                        double *acceleration, double *velocity) {
    const double *omega = p->body[b].omega;
    double turning[3], tangential[3], around[3], centripetal[3];
    turn(p->body[b].R, change->body[b].rate, turning);
    cross(turning, arm, tangential);
    cross(omega, arm, around);
    cross(omega, around, centripetal);
    for (int i = 0; i < 3; i++) {
        acceleration[i] = change->body[b].velocity[i] + tangential[i] + centripetal[i];
        velocity[i] = now->body[b].velocity[i] + around[i];
    }
}

/* d2e/dt2 [m/s^2] of cable `i` for the accelerations in `change`. */
static double free_stretch_acceleration(const plant *p, const motion *now, const motion *change, int i) {
    const cable_now *on = &p->cable[i];
    const int owner = owner_of(p, i);
    double a[3], v[3], carrier_a[3], carrier_v[3], coriolis[3];
    moved_point(p, now, change, 0, on->arm, a, v);
    moved_point(p, now, change, owner, on->carrier_arm, carrier_a, carrier_v);
    for (int j = 0; j < 3; j++) {
        v[j] -= carrier_v[j];
    }
    cross(p->body[owner].omega, v, coriolis);
    for (int j = 0; j < 3; j++) {
        a[j] -= carrier_a[j] + 2 * coriolis[j];
    }
    return on->curvature - dot(on->pull, a) - change->rate[i];
}

/* Add a cable to the factor; return 0, and leave it out, if it depends on those before. */
static int append(constraints *taut, int one) {
    const int at = taut->count;
    double *row = taut->factor[at], left = taut->gram[one][one] + taut->give[one];
    for (int b = 0; b < at; b++) {
        const double *other = taut->factor[b];
        double total = taut->gram[one][taut->picked[b]];
        for (int k = 0; k < b; k++) {
            total -= row[k] * other[k];
        }
        row[b] = total * taut->inverse_diagonal[b];
        left -= row[b] * row[b];
    }
    if (!(left > DEPENDENT * taut->gram[one][one])) {
        return 0;
    }
    row[at] = sqrt(left);
    taut->inverse_diagonal[at] = 1 / row[at];
    taut->picked[at] = one;
    taut->count++;
    return 1;
}

/* Replace x by what the factor times its transpose makes x of. */
static void solve_factored(const constraints *taut, double *x) {
    for (int a = 0; a < taut->count; a++) {
        for (int k = 0; k < a; k++) {
            x[a] -= taut->factor[a][k] * x[k];
        }
        x[a] *= taut->inverse_diagonal[a];
    }
    for (int a = taut->count - 1; a >= 0; a--) {
        for (int k = a + 1; k < taut->count; k++) {
            x[a] -= taut->factor[k][a] * x[k];
        }
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
    for (int a = 0; a < taut->count; a++) {
        z[a] = taut->right[taut->picked[a]];
    }
    solve_factored(taut, z);
    for (int round = 1; round < rounds; round++) {
        for (int a = 0; a < taut->count; a++) {
            const double *row = taut->gram[taut->picked[a]];
            step[a] = taut->right[taut->picked[a]];
            for (int b = 0; b < taut->count; b++) {
                step[a] -= row[taut->picked[b]] * z[b];
            }
        }
        solve_factored(taut, step);
        for (int a = 0; a < taut->count; a++) {
            z[a] += step[a];
        }
    }
}

/* Solve G x = c for the picked cables; x of others is 0. */
static void solve_pulling(plant *p) {
    constraints *taut = &p->taut;
    double z[CABLES];
    solve_picked(taut, REFINED, z);
    memset(taut->solution, 0, (size_t)p->cables * sizeof taut->solution[0]);
    for (int a = 0; a < taut->count; a++) {
        taut->solution[taut->picked[a]] = z[a];
    }
}

/* Factor G over the candidates, but for those that depend on others. */
static void factor_pulling(plant *p) {
    p->taut.count = 0;
    for (int i = 0; i < p->cables; i++) {
        if (p->taut.candidate[i]) {
            append(&p->taut, i);
        }
    }
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
        for (int a = 0; a < taut->count; a++) {
            x[a] += share * (z[a] - x[a]);
        }
        if (first < 0) {
            return;
        }
        drop(taut, first, x);
        for (int i = 0; i < p->cables; i++) { /* what depended on the one that goes may not any more */
            barred[i] = !taut->candidate[i];
        }
        for (int a = 0; a < taut->count; a++) {
            barred[taut->picked[a]] = 1;
        }
    }
}

/* Return the candidate that would stretch most for the tensions x, or -1 if none does by more than `most`. */
static int most_violated(const plant *p, const int *barred, const double *x, double most) {
    const constraints *taut = &p->taut;
    int best = -1;
    for (int i = 0; i < p->cables; i++) {
        double left = barred[i] ? 0 : taut->right[i];
        for (int a = 0; a < taut->count && !barred[i]; a++) {
            left -= taut->gram[i][taut->picked[a]] * x[a];
        }
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
        if (best < 0) {
            break;
        }
        barred[best] = 1;
        if (append(taut, best)) {
            x[taut->count - 1] = 0;
            bring_inside(p, barred, x);
        }
    }
    solve_pulling(p);
}

#endif
