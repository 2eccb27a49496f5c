/*
 * The point of least norm in slabs of a line or a plane: m - rank of at most two.
 *
 * With s = s_0 + N z, cable i is the slab low_i <= s_0i + n_i . z <= high_i. Slabs are taken one by one. Without slabs,
 * the optimum z is the origin. If it violates slabs, the most violated one is taken, and the new optimum lies on the
 * edge that was violated (Seidel 1991):
 *
 *     z = base + x along,   base = edge n_i / |n_i|^2,   along . n_i = 0,   |along| = 1
 *
 * Each slab taken before cuts that edge to an interval of x, and x is the point of the interval nearest to zero. If
 * nothing is left, the slab itself and the two that cut most exclude each other. In a line, along = 0: a slab contains
 * the edge or excludes it. A slab that was taken is not violated again, so that there are at most m steps and
 * m (m - 1) / 2 cuts.
 */
#include "internal.h"

typedef struct {
    real x;     /* the end of the interval */
    int slab;   /* which slab cuts there, -1 if none */
    real along; /* the component of its normal along the edge */
    real side;  /* 1 at its lower limit, -1 at its upper one */
} cut;

/* Set the multipliers of slab `own` and of one or two others such that their sum vanishes: no z satisfies them all. */
static outcome exclude(form *f, int own, const real a[2], real square, const cut *first, const cut *second) {
    const real *normal[2] = {f->basis, f->basis + f->width};
    real x = 0, y = 0;
    const cut *cuts[2] = {first, second};
    for (int i = 0; i < 2; i++) {
        if (cuts[i] && cuts[i]->slab >= 0) {
            const int j = cuts[i]->slab;
            const cut *other = cuts[1 - i];
            const real push = -cuts[i]->side * (other ? magnitude(other->along) : 1);
            f->push[j] += push;
            x += push * normal[0][j];
            y += push * normal[1][j];
        }
    }
    f->push[own] -= (x * a[0] + y * a[1]) / square;
    return EXCLUDED;
}

outcome towline_slabs(form *f) {
    const int cables = f->cables;                            /* only they have limits */
    const real *normal[2] = {f->basis, f->basis + f->width}; /* both components of all; zero beyond k */
    real z[2] = {0, 0};
    real side[CABLES]; /* 0 until the slab is taken, then 1 below the lower limit, -1 above the upper one */
    int taken[CABLES];
    int active[2] = {0, 0}; /* the slabs that z rests on, */
    real multiplier[2] = {0, 0};
    real rests[2] = {0, 0}; /* and at which limit */
    int count = 0;
    for (int i = 0; i < cables; i++) { side[i] = 0; }
    for (int i = f->k * f->width; i < 2 * f->width; i++) { f->basis[i] = 0; }
    for (int t = 0; t <= cables; t++) {
        int worst = -1;
        real most = f->slack;
        for (int i = 0; i < cables; i++) {
            const real s = f->s[i] + normal[0][i] * z[0] + normal[1][i] * z[1];
            const real violation = side[i] == 0 ? larger(f->low[i] - s, s - f->high[i]) : 0;
            worst = violation > most ? i : worst; /* nothing branches, as in `largest` of reduction.c */
            most = larger(violation, most);
        }
        if (worst < 0) { break; }
        f->steps++;
        const real a[2] = {normal[0][worst], normal[1][worst]};
        const real square = a[0] * a[0] + a[1] * a[1];
        side[worst] = f->s[worst] + a[0] * z[0] + a[1] * z[1] < f->low[worst] ? (real)1 : (real)-1;
        if (square <= f->parallel * f->parallel) { /* nothing moves this s, and it is beyond its limit */
            f->push[worst] = -side[worst];
            return EXCLUDED;
        }
        const real edge = ((side[worst] > 0 ? f->low[worst] : f->high[worst]) - f->s[worst]) / square;
        const real per_length = 1 / root(square);
        const real base[2] = {a[0] * edge, a[1] * edge};
        const real along[2] = {f->k > 1 ? -a[1] * per_length : 0, f->k > 1 ? a[0] * per_length : 0};
        cut start = {-(real)INFINITY, -1, 1, 0}, stop = {(real)INFINITY, -1, 1, 0};
        for (int l = 0; l < t; l++) {
            const int j = taken[l];
            const real b[2] = {normal[0][j], normal[1][j]};
            const real here = f->s[j] + b[0] * base[0] + b[1] * base[1];
            const real slope = b[0] * along[0] + b[1] * along[1];
            const real low = f->low[j] - here, high = f->high[j] - here;
            f->inner++;
            if (magnitude(slope) < f->parallel) {
                if (larger(low, -high) > f->slack) {
                    const cut alone = {0, j, 1, low > 0 ? (real)1 : (real)-1};
                    return exclude(f, worst, a, square, &alone, 0);
                }
                continue;
            }
            const cut lower = {low / slope, j, slope, 1}, upper = {high / slope, j, slope, -1};
            const cut from = slope > 0 ? lower : upper, to = slope > 0 ? upper : lower;
            start = from.x > start.x ? from : start;
            stop = to.x < stop.x ? to : stop;
        }
        if (start.x - stop.x > f->slack) { return exclude(f, worst, a, square, &start, &stop); }
        const real x = start.x > stop.x ? (start.x + stop.x) / 2 : between(start.x, 0, stop.x);
        z[0] = base[0] + x * along[0];
        z[1] = base[1] + x * along[1];
        taken[t] = worst;

        /* z is the sum of the active normals, each times its multiplier. */
        const cut *other = x > 0 ? &start : &stop;
        real pull = edge;
        count = 1;
        if (x != 0) {
            const int j = other->slab;
            const real share = x / other->along;
            pull -= share * (normal[0][j] * a[0] + normal[1][j] * a[1]) / square;
            active[1] = j;
            multiplier[1] = share * other->side;
            rests[1] = other->side;
            count = 2;
        }
        active[0] = worst;
        multiplier[0] = pull * side[worst];
        rests[0] = side[worst];
    }
    for (int i = 0; i < f->columns; i++) { f->s[i] += normal[0][i] * z[0] + normal[1][i] * z[1]; }
    for (int j = 0; j < count; j++) {
        const int i = active[j];
        side[i] = rests[j];
        f->s[i] = side[i] > 0 ? f->low[i] : f->high[i];
    }
    return towline_proves_optimum(f, active, side, multiplier, count) ? REACHED : DOUBTFUL;
}
