/*
 * The point of least norm in slabs of any dimension, by the dual active-set method of Goldfarb and Idnani (1983) with
 * the identity as Hessian.
 *
 * s moves through points that are optimal for the slabs in the active set, starting with none. Each step takes the most
 * violated slab p and moves s along the part of its normal n_p that the active normals N_q do not span. The basis N of
 * the null space, whose columns are the normals, is kept rotated such that the q active ones are triangular:
 *
 *     N_q = [R; 0],   n_p = [d_1; d_2],   step = N^T [0; d_2],   r = R^-1 d_1
 *
 * Plane rotations of rows bring d_2 to its first entry before the step, and make R triangular again if a slab leaves:
 * R lies in the basis and needs no space of its own. While s moves by x, the multiplier of p grows by x and those of
 * the active slabs change by -x r; where one would become negative its slab leaves, and the move goes on. If no move is
 * possible, p and the active slabs exclude each other: their multipliers prove it.
 *
 * Each step ends at a point farther from the origin than the one before, so that no active set comes twice and the
 * method ends. Rounding could void that argument, and STEPS bounds it: six times what 10^6 random problems needed. A
 * slab that leaves has entered before, so that the inner loop runs at most twice as often as there are steps.
 */
#include "internal.h"

#define STEPS(columns) (10 * (columns) + 20)
#define SPANNED 16 /* roundings of a normal that the active ones span, over the shortest of what each adds to these */

typedef struct {
    int count;               /* active slabs */
    int active[CABLES];      /* which, */
    real side[CABLES];       /* at which limit: 1 lower, -1 upper, 0 not active, */
    real multiplier[CABLES]; /* and how strongly they push */
} active_set;

/* Rotate two rows of the basis such that entry i of the second one vanishes; return 0 if that of both does. */
static int rotate(real *restrict x, real *restrict y, int i, int width) {
    const real length = root(x[i] * x[i] + y[i] * y[i]);
    if (length == 0) { return 0; }
    const real cosine = x[i] / length, sine = y[i] / length;
    for (int e = 0; e < width; e += 4) { /* as in `dot` */
        const real a = x[e], b = x[e + 1], c = x[e + 2], d = x[e + 3];
        x[e] = cosine * a + sine * y[e];
        x[e + 1] = cosine * b + sine * y[e + 1];
        x[e + 2] = cosine * c + sine * y[e + 2];
        x[e + 3] = cosine * d + sine * y[e + 3];
        y[e] = cosine * y[e] - sine * a;
        y[e + 1] = cosine * y[e + 1] - sine * b;
        y[e + 2] = cosine * y[e + 2] - sine * c;
        y[e + 3] = cosine * y[e + 3] - sine * d;
    }
    return 1;
}

/* Remove the slab at position `leaving`; return 0 if rounding has made R singular. */
static int drop(form *f, active_set *set, int leaving) {
    const int width = f->width;
    set->side[set->active[leaving]] = 0;
    set->count--;
    for (int j = leaving; j < set->count; j++) { /* rotate the entry below the diagonal away */
        set->active[j] = set->active[j + 1];
        set->multiplier[j] = set->multiplier[j + 1];
        if (!rotate(f->basis + j * width, f->basis + (j + 1) * width, set->active[j], width)) { return 0; }
    }
    return 1;
}

/* Return the slab that s violates most, beyond the slack, and at which limit; -1 if none. */
static int most_violated(const form *f, const active_set *set, real *side) {
    int worst = -1;
    real most = f->slack;
    for (int i = 0; i < f->cables; i++) {
        const real below = f->low[i] - f->s[i], above = f->s[i] - f->high[i];
        if (set->side[i] == 0 && larger(below, above) > most) {
            worst = i;
            most = larger(below, above);
            *side = below > above ? (real)1 : (real)-1;
        }
    }
    return worst;
}

/* Bring slab p into the active set, dropping those that stand in its way. */
static outcome enter(form *f, active_set *set, int p, real side) {
    const int k = f->k, width = f->width;
    real own = 0;
    for (;;) {
        real r[CABLES], beyond = 0, least = 1;
        real *along = f->basis + set->count * width; /* what of n_p the active normals do not span, once rotated */
        f->inner++;
        for (int c = set->count + 1; c < k; c++) { rotate(along, f->basis + c * width, p, width); }
        if (set->count < k) { beyond = along[p] * along[p]; }
        for (int j = set->count - 1; j >= 0; j--) { /* of normals times their sides */
            const real *row = f->basis + j * width;
            real total = side * row[p];
            for (int e = j + 1; e < set->count; e++) {
                total -= set->side[set->active[e]] * row[set->active[e]] * r[e];
            }
            r[j] = set->side[set->active[j]] * total / row[set->active[j]];
            least = smaller(least, magnitude(row[set->active[j]]));
        }
        real length = (real)INFINITY;
        int leaving = -1;
        for (int j = 0; j < set->count; j++) {
            if (r[j] > 0 && set->multiplier[j] < length * r[j]) {
                length = set->multiplier[j] / r[j];
                leaving = j;
            }
        }
        const real rounding = larger(f->parallel, SPANNED * UNIT_ROUNDOFF / least);
        const int independent = beyond > rounding * rounding;
        if (!independent && leaving < 0) {
            f->push[p] = -side;
            for (int j = 0; j < set->count; j++) { f->push[set->active[j]] = set->side[set->active[j]] * r[j]; }
            return EXCLUDED;
        }
        int full = 0;
        if (independent) {
            const real missing = side > 0 ? f->low[p] - f->s[p] : f->s[p] - f->high[p];
            if (missing / beyond <= length) {
                length = missing / beyond;
                full = 1;
            }
            add_to(f->s, length * side * along[p], along, width);
        }
        for (int j = 0; j < set->count; j++) { set->multiplier[j] -= length * r[j]; }
        own += length;
        if (full) {
            set->active[set->count] = p;
            set->multiplier[set->count] = own;
            set->side[p] = side;
            set->count++;
            return REACHED;
        }
        if (!drop(f, set, leaving)) { return DOUBTFUL; }
    }
}

outcome towline_dual_active_set(form *f) {
    active_set set;
    set.count = 0;
    for (int i = 0; i < f->cables; i++) { set.side[i] = 0; }
    for (int t = 0; t < STEPS(f->columns); t++) {
        real side = 0;
        const int p = most_violated(f, &set, &side);
        if (p < 0) {
            for (int j = 0; j < set.count; j++) {
                const int i = set.active[j];
                f->s[i] = set.side[i] > 0 ? f->low[i] : f->high[i];
            }
            return towline_proves_optimum(f, set.active, set.side, set.multiplier, set.count) ? REACHED : DOUBTFUL;
        }
        f->steps++;
        const outcome entered = enter(f, &set, p, side);
        if (entered != REACHED) { return entered; }
    }
    return DOUBTFUL;
}
