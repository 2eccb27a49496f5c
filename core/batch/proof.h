/* Proofs in lanes that wrenches are not available: as `towline_proves_infeasible`, but without its test of the rank. */
#ifndef TOWLINE_BATCH_PROOF_H
#define TOWLINE_BATCH_PROOF_H

#include "batch/problem.h"

/* What the cables give along a direction. */
typedef struct {
    num support, rounded;
    mask usable; /* no cable without a limit pulls along it */
    mask pulls;  /* a cable pulls along it */
} reach;

/* Add what cable c gives along d, a unit vector in the rows of S A. */
INLINE void add_reach(reach *of_all, const demands *p, const matrices *M, const num *d, int c) {
    num pull = number(0), terms = number(0);
    for (int i = 0; i < M->n; i++) {
        const num x = d[i] * M->SA[i * M->m + c];
        pull += x;
        terms += magnitude(x);
    }
    const num norm = M->norm[c], side = where(pull > 0.0, p->t_max[c], p->t_min[c]);
    /* Known amounts count at any size; of a cable without a limit that pulls nothing is known. */
    const mask known = magnitude(side) <= LARGEST;
    const num limit = where(known, side, number(0)), gives = pull * limit;
    of_all->pulls |= magnitude(pull) > NEGLIGIBLE * norm;
    of_all->usable &= known | (magnitude(pull) <= ORTHOGONAL * norm);
    of_all->support += gives;
    const mask counts = ~known & (magnitude(pull) > ROUNDED_PULL * terms);
    of_all->rounded += where(counts, magnitude(pull) / norm * (CANCELLED / ROUNDING) * p->required, number(0));
    of_all->rounded += norm * (magnitude(p->t_ref[c]) + magnitude(nearest(p->t_min[c], p->t_max[c])));
    of_all->rounded += REACH_OF_PULL * magnitude(gives) + REACH_OF_TERMS * terms * magnitude(limit);
}

/* Keep the directions, in the rows of S A, where chosen and proven; return where. */
INLINE mask prove(demands *p, const matrices *M, mask chosen, const num *direction) {
    num d[ROWS], square = number(0), demand = number(0);
    for (int i = 0; i < M->n; i++) { square += direction[i] * direction[i]; }
    const mask usable = chosen & (square > 0.0) & (square < LARGEST * LARGEST * LARGEST * LARGEST);
    const num unit = 1.0 / square_root(where(usable, square, number(1)));
    for (int i = 0; i < M->n; i++) {
        d[i] = unit * direction[i];
        demand += d[i] * p->Sw[i];
    }
    reach all = {number(0), number(0), usable, (mask){0}};
    for (int c = 0; c < M->m; c++) { add_reach(&all, p, M, d, c); }
    const num shortfall = demand - all.support, doubt = CLEAR * (FEASIBILITY * p->required + ROUNDING * all.rounded);
    const mask proven = all.usable & all.pulls & (shortfall > doubt);
    p->proven |= proven;
    p->support = where(proven, all.support, p->support);
    p->shortfall = where(proven, shortfall, p->shortfall);
    for (int i = 0; i < M->n; i++) {
        p->d[i] = where(proven, M->n == 6 && i >= 3 ? d[i] * M->per_length : d[i], p->d[i]);
    }
    return proven;
}

#endif
