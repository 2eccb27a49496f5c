/*
 * The point of least norm in slabs of any dimension, by the dual active-set method of Goldfarb and Idnani (1983) with
 * the identity as Hessian.
 *
 * s moves through points that are optimal for the slabs in the active set, starting with none. Each step takes the most
 * violated slab p and moves s along the part of its normal n_p that the active normals N_q do not span:
 *
 *     J^T n_p = d,   N_q = J_1 R,   step = J_2 d_2,   r = R^-1 d_1
 *
 * J = [J_1 J_2] is orthonormal and R triangular, updated by a reflector for a slab that enters and by plane rotations
 * for one that leaves. While s moves by x, the multiplier of p grows by x and those of the active slabs change by -x r;
 * where one would become negative its slab leaves, and the move goes on. If no move is possible, p and the active slabs
 * exclude each other: their multipliers prove it.
 *
 * Each step ends at a point farther from the origin than the one before, so that no active set comes twice and the
 * method ends. Rounding could void that argument, and STEPS bounds it: six times what 10^6 random problems needed. A
 * slab that leaves has entered before, so that the inner loop runs at most twice as often as there are steps.
 */
#include "internal.h"

#define STEPS(columns) (10 * (columns) + 20)

/* Where column j of R starts: it has j + 1 entries, and space for one more while a slab leaves. */
#define COLUMN(j) ((j) * ((j) + 3) / 2)

typedef struct {
    int count;                       /* active slabs */
    int active[CABLES];              /* which, */
    real side[COLUMNS];              /* at which limit: 1 lower, -1 upper, 0 not active, */
    real multiplier[COLUMNS];        /* and how strongly they push */
    int width;                       /* FILLED(k): numbers from one column of J to the next */
    real J[CABLES * FILLED(CABLES)]; /* column by column */
    real R[COLUMN(CABLES)];
} active_set;

/* Rotate columns c and c + 1 of J. */
static void rotate(active_set *set, int c, real cosine, real sine) {
    real *x = set->J + c * set->width, *y = x + set->width;
    for (int e = 0; e < set->width; e++) {
        const real before = x[e];
        x[e] = cosine * before + sine * y[e];
        y[e] = cosine * y[e] - sine * before;
    }
}

/*
 * Add slab p with J^T n_p = d and |d_2|^2 = beyond. A reflector turns d_2 to a multiple of its first entry; J_2 d_2,
 * which it needs, is `step`.
 */
static void add(active_set *set, int k, int p, real side, real multiplier, const real *d, real beyond,
                const real *step) {
    const int q = set->count;
    const real length = root(beyond), pivot = d[q] > 0 ? -length : length, head = d[q] - pivot;
    const real tau = -1 / (pivot * head);
    real turned[FILLED(CABLES)]; /* J_2 times the reflector */
    for (int e = 0; e < set->width; e++) {
        turned[e] = tau * (step[e] - pivot * set->J[q * set->width + e]);
    }
    for (int c = q; c < k; c++) {
        add_to(set->J + c * set->width, c == q ? -head : -d[c], turned, set->width);
    }
    for (int e = 0; e < q; e++) {
        set->R[COLUMN(q) + e] = d[e];
    }
    set->R[COLUMN(q) + q] = pivot;
    set->active[q] = p;
    set->multiplier[q] = multiplier;
    set->side[p] = side;
    set->count++;
}

/* Remove the slab at position `leaving`; return 0 if rounding has made R singular. */
static int drop(active_set *set, int leaving) {
    set->side[set->active[leaving]] = 0;
    set->count--;
    for (int j = leaving; j < set->count; j++) {
        set->active[j] = set->active[j + 1];
        set->multiplier[j] = set->multiplier[j + 1];
        for (int e = 0; e < j + 2; e++) {
            set->R[COLUMN(j) + e] = set->R[COLUMN(j + 1) + e];
        }
    }
    for (int j = leaving; j < set->count; j++) { /* rotate the entries below the diagonal away */
        const real top = set->R[COLUMN(j) + j], below = set->R[COLUMN(j) + j + 1];
        const real length = root(top * top + below * below);
        if (length == 0) {
            return 0;
        }
        const real cosine = top / length, sine = below / length;
        for (int c = j; c < set->count; c++) {
            real *column = set->R + COLUMN(c);
            const real before = column[j];
            column[j] = cosine * before + sine * column[j + 1];
            column[j + 1] = cosine * column[j + 1] - sine * before;
        }
        rotate(set, j, cosine, sine);
    }
    return 1;
}

/* Return the slab that s violates most, beyond the slack, and at which limit; -1 if none. */
static int most_violated(const form *f, const active_set *set, real *side) {
    int worst = -1;
    real most = f->slack;
    for (int i = 0; i < f->columns; i++) {
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
    const int k = f->k;
    real normal[FILLED(CABLES)], own = 0;
    for (int e = 0; e < set->width; e++) {
        normal[e] = e < k ? f->basis[e * f->width + p] : 0;
    }
    for (;;) {
        real d[CABLES], r[CABLES], step[FILLED(CABLES)], beyond = 0;
        f->inner++;
        for (int c = 0; c < k; c++) {
            d[c] = side * dot(set->J + c * set->width, normal, set->width);
            beyond += c >= set->count ? d[c] * d[c] : 0;
        }
        for (int j = set->count - 1; j >= 0; j--) {
            real total = d[j];
            for (int e = j + 1; e < set->count; e++) {
                total -= set->R[COLUMN(e) + j] * r[e];
            }
            r[j] = total / set->R[COLUMN(j) + j];
        }
        real length = (real)INFINITY;
        int leaving = -1;
        for (int j = 0; j < set->count; j++) {
            if (r[j] > 0 && set->multiplier[j] < length * r[j]) {
                length = set->multiplier[j] / r[j];
                leaving = j;
            }
        }
        const int independent = set->count < k && beyond > PARALLEL * PARALLEL;
        if (!independent && leaving < 0) {
            f->push[p] = -side;
            for (int j = 0; j < set->count; j++) {
                f->push[set->active[j]] = set->side[set->active[j]] * r[j];
            }
            return EXCLUDED;
        }
        int full = 0;
        if (independent) {
            const real missing = side > 0 ? f->low[p] - f->s[p] : f->s[p] - f->high[p];
            if (missing / beyond <= length) {
                length = missing / beyond;
                full = 1;
            }
            for (int e = 0; e < set->width; e++) {
                step[e] = 0;
            }
            for (int c = set->count; c < k; c++) {
                add_to(step, d[c], set->J + c * set->width, set->width);
            }
            for (int e = 0; e < k; e++) {
                add_to(f->s, length * step[e], f->basis + e * f->width, f->width);
            }
        }
        for (int j = 0; j < set->count; j++) {
            set->multiplier[j] -= length * r[j];
        }
        own += length;
        if (full) {
            add(set, k, p, side, own, d, beyond, step);
            return REACHED;
        }
        if (!drop(set, leaving)) {
            return DOUBTFUL;
        }
    }
}

outcome towline_dual_active_set(form *f) {
    active_set set;
    set.count = 0;
    set.width = FILLED(f->k);
    for (int i = 0; i < f->columns; i++) {
        set.side[i] = 0;
    }
    for (int c = 0; c < f->k * set.width; c++) {
        set.J[c] = 0;
    }
    for (int c = 0; c < f->k; c++) {
        set.J[c * set.width + c] = 1;
    }
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
        if (entered != REACHED) {
            return entered;
        }
    }
    return DOUBTFUL;
}
