/*
 * The point of least norm in slabs of a line or a plane, in lanes: m - n of at most two.
 *
 * As slabs.c, but the slabs are taken in their order, each by those lanes whose z is outside it: the new optimum z lies
 * on the edge that was violated, cut to an interval by all slabs before (Seidel 1991).
 */
#ifndef TOWLINE_BATCH_SLABS_H
#define TOWLINE_BATCH_SLABS_H

#include "batch/proof.h"
#include "batch/reduction.h"

#define STEEP 1e-6 /* sine of the angle between two normals below which rounding may decide where their edges meet, */
#define NEAR 1e6   /* if a limit is as near as so many times what it may be passed by */

/* z, and the limits that it rests on. */
typedef struct {
    num z[2];
    num pull, square; /* multiplier of the slab taken last, and the square of its normal */
    num pull_of_other;
    num slack;
    mask good, excluded;
    num push[CABLES]; /* multipliers of limits that exclude each other */
} optimum;

/* The edge of a slab: z = base + x along. */
typedef struct {
    mask moves, below;
    num a[2];   /* the normal of the slab, */
    num square; /* and its square; one where nothing moves the slab's s */
    num base[2], along[2];
} edge;

/* Where a slab cuts an edge: the end of an interval of x. */
typedef struct {
    num x;
    num slab;  /* -1: none */
    num slope; /* of the slab's s along the edge */
    num dot;   /* of both normals */
} cut;

INLINE num times_normal(const matrices *M, int i, const num *z) {
    return M->normal[0][i] * z[0] + M->normal[1][i] * z[1];
}

INLINE void take_cut(cut *end, mask chosen, cut other) {
    end->x = where(chosen, other.x, end->x);
    end->slab = where(chosen, other.slab, end->slab);
    end->slope = where(chosen, other.slope, end->slope);
    end->dot = where(chosen, other.dot, end->dot);
}

/* Cut the edge of a slab in the plane by slab j. */
INLINE void cut_edge(optimum *o, const demands *p, const matrices *M, const edge *e, int j, cut *start, cut *stop) {
    const num b[2] = {M->normal[0][j], M->normal[1][j]}, doubt = o->slack * NEAR;
    const num here = p->s[j] + times_normal(M, j, e->base), low = p->low[j] - here, high = p->high[j] - here;
    const num slope = b[0] * e->along[0] + b[1] * e->along[1], inverse = 1.0 / slope;
    const num dot = b[0] * e->a[0] + b[1] * e->a[1];
    const mask parallel = magnitude(slope) < PARALLEL, turned = slope < 0.0, near = (low > -doubt) | (high < doubt);
    o->good &= ~(e->moves & near & (magnitude(slope) < STEEP));
    const num at_low = low * inverse, at_high = high * inverse;
    const cut first = {where(parallel, number(-INFINITY), where(turned, at_high, at_low)), number(j), slope, dot};
    const cut last = {where(parallel, number(INFINITY), where(turned, at_low, at_high)), number(j), slope, dot};
    take_cut(start, first.x > start->x, first);
    take_cut(stop, last.x < stop->x, last);
}

/* In a line the edge of a slab is a point: slab j contains it, or excludes it beyond doubt, or rounding decides. */
INLINE void cut_point(optimum *o, const demands *p, const matrices *M, const edge *e, int j, cut *start, cut *stop) {
    const num here = p->s[j] + times_normal(M, j, e->base), low = p->low[j] - here, high = p->high[j] - here;
    const num doubt = o->slack * NEAR;
    const mask under = low > doubt, over = high < -doubt, near = (low > -doubt) | (high < doubt);
    o->good &= ~(e->moves & near & ~(under | over));
    start->x = where(under, low, start->x);
    start->slab = where(under, number(j), start->slab);
    stop->x = where(over, high, stop->x);
    stop->slab = where(over, number(j), stop->slab);
}

/* Set the multipliers of slab i and the two that leave nothing of its edge such that their pulls cancel. */
INLINE void exclude(optimum *o, const matrices *M, const edge *e, int i, mask empty, const cut *start,
                    const cut *stop) {
    const num f = where(start->slope > 0.0, -magnitude(stop->slope), magnitude(stop->slope));
    const num g = where(stop->slope > 0.0, magnitude(start->slope), -magnitude(start->slope));
    num toward = number(0);
    for (int j = 0; j < i; j++) {
        const num own = number(j), none = number(0);
        const num push = where(start->slab == own, f, none) + where(stop->slab == own, g, none);
        const num counted = where(empty, push, none);
        o->push[j] += counted;
        toward += counted * times_normal(M, j, e->a);
    }
    o->push[i] -= toward / where(empty, e->square, number(1));
    o->good &= ~empty;
    o->excluded |= empty;
}

/* Move z along the edge of slab i to the point of the interval that is nearest to zero. */
INLINE void move(optimum *o, const edge *e, const cut *start, const cut *stop) {
    const num inside = between(start->x, number(0), stop->x);
    const num x = where(start->x > stop->x, 0.5 * (start->x + stop->x), inside);
    for (int i = 0; i < 2; i++) { o->z[i] = where(e->moves, e->base[i] + x * e->along[i], o->z[i]); }
    /* z is the sum of the two normals, each times its multiplier. */
    const mask up = x > 0.0, down = x < 0.0;
    const num other = where(up, x / start->slope, where(down, x / stop->slope, number(0)));
    const num dot = where(up, start->dot, stop->dot);
    const num own = ((e->a[0] * o->z[0] + e->a[1] * o->z[1]) - other * dot) / e->square;
    o->pull = where(e->moves, where(e->below, own, -own), o->pull);
    o->square = where(e->moves, e->square, o->square);
    o->pull_of_other = where(e->moves, magnitude(other), o->pull_of_other);
}

/* Take slab i in the lanes whose z is outside it. */
INLINE void take_slab(optimum *o, const demands *p, const matrices *M, int i) {
    const num a[2] = {M->normal[0][i], M->normal[1][i]}, s = p->s[i], low = p->low[i], high = p->high[i];
    const num value = s + times_normal(M, i, o->z);
    const mask below = value < low - o->slack, outside = (below | (value > high + o->slack)) & o->good;
    if (!any(outside)) { return; }
    const num square = a[0] * a[0] + a[1] * a[1];
    const mask cuts = square > PARALLEL * PARALLEL, fixed = outside & ~cuts;
    /* Nothing moves this s, and it is beyond its limit. */
    o->push[i] = where(fixed, where(below, number(-1), number(1)), o->push[i]);
    o->good &= ~fixed;
    o->excluded |= fixed;
    edge e = {outside & cuts, below, {a[0], a[1]}, where(cuts, square, number(1)), {a[0], a[1]}, {-a[1], a[0]}};
    const num inverse = 1.0 / e.square, per_length = square_root(inverse);
    const num to_edge = (where(below, low, high) - s) * inverse;
    for (int k = 0; k < 2; k++) {
        e.base[k] *= to_edge;
        e.along[k] *= per_length;
    }
    const int in_line = M->m - M->n == 1;
    cut start = {number(in_line ? 0 : -INFINITY), number(-1), number(1), number(0)};
    cut stop = {number(in_line ? 0 : INFINITY), number(-1), number(1), number(0)};
    for (int j = 0; j < i; j++) {
        if (in_line) {
            cut_point(o, p, M, &e, j, &start, &stop);
        } else {
            cut_edge(o, p, M, &e, j, &start, &stop);
        }
    }
    const mask empty = e.moves & o->good & (start.x - stop.x > o->slack);
    if (any(empty)) { exclude(o, M, &e, i, empty, &start, &stop); }
    move(o, &e, &start, &stop);
}

/* Find s, where the matrices are reduced. */
INLINE void solve_by_slabs(demands *p, const matrices *M) {
    optimum o = {.slack = SLACK * larger(least_norm(p, M), p->size), .good = p->good & M->good};
    for (int i = 0; i < M->m; i++) { take_slab(&o, p, M, i); }
    num total = number(0);
    for (int c = 0; c < M->m; c++) {
        p->s[c] += times_normal(M, c, o.z);
        total += p->s[c] * p->s[c];
    }
    o.good &= o.pull * square_root(o.square) >= -STATIONARY * square_root(total);
    o.good &= larger(o.pull, o.pull_of_other) * o.slack <= DECISIVE * total;
    p->good = o.good;
    if (any(o.excluded)) {
        num d[ROWS];
        direction_of(M, o.push, d);
        prove(p, M, o.excluded, d);
    }
}

#endif
