/*
 * What is left of the conditions of optimality at an iterate, each relative to the largest of its terms.
 *
 * A state, a control or a row has one unit at all stages, so that a residual is the largest over the stages of an error,
 * divided by the largest over the stages of the terms that it is the sum of. No unit changes it.
 */
#include "horizon/internal.h"

static const double FLOOR = 1e-10;  /* added to scales, for problems whose solution is zero */
static const double ROUNDED = 1e-6; /* of the gradient by which one variable alone would cost as much as all together */

static double larger3(double x, double y, double z) { return larger(larger(x, y), z); }

/*
 * Write what is left of the Lagrangian's gradient at a stage: H z + h + G' y of the next + E' f - y + forces of bounds.
 * Return z' H z.
 */
static double measure_gradient(const towline_horizon *h, int k) {
    const int wp = h->wp, is_last = k == h->N, width = k > 0 ? h->w : h->m;
    const double *z = h->at.z + k * wp, *y = h->at.y + k * wp, *linear = h->h + k * wp;
    double total = 0, *left = h->gradient + k * wp, *cost = h->work, *dual = cost + wp, *penalty = dual + wp,
           *terms = penalty + wp;
    const matrix H = hessian_of(h, k, h->w);
    set(cost, 3 * wp, 0);
    if (is_last) {
        h->algebra->add_transposed_product(cost, block(H, h->m, 0, h->n, h->w), z + h->m);
    } else {
        h->algebra->add_transposed_product(cost, H, z);
        h->algebra->add_transposed_product(dual, dynamics_of(h, k, h->w), y + wp + h->m);
        if (h->p > 0) {
            h->algebra->add_transposed_product(penalty, soft_rows_of(h, k, h->w), h->at.multiplier.row + k * h->pp);
        }
    }
    for (int i = 0; i < wp; i++) {
        total += z[i] * cost[i];
        left[i] = cost[i] + dual[i] + penalty[i] + linear[i] - y[i];
        terms[i] = larger3(larger3(fabs(cost[i]), fabs(dual[i]), fabs(penalty[i])), fabs(linear[i]), fabs(y[i]));
    }
    for (int i = 0, at = k * h->mp; i < h->m && !is_last; i++, at++) {
        const double below = h->exists.lower[at] * h->at.multiplier.lower[at];
        const double above = h->exists.upper[at] * h->at.multiplier.upper[at];
        left[i] += above - below;
        terms[i] = larger3(terms[i], below, above);
        h->holding[at] = left[i];
        left[i] *= h->moves[at];
    }
    set(left + width, wp - width, 0);
    for (int i = 0; i < width; i++) {
        h->worst.gradient[i] = larger(fabs(left[i]), h->worst.gradient[i]);
        h->scale.gradient[i] = larger(terms[i], h->scale.gradient[i]);
    }
    return total;
}

/* Write the products of distances to bounds and multipliers, and how large controls are. */
static void measure_controls(const towline_horizon *h, int k) {
    const double *u = h->at.z + k * h->wp;
    for (int i = 0, at = k * h->mp; i < h->m; i++, at++) {
        const double below = fabs((u[i] - h->low[at]) * h->at.multiplier.lower[at]);
        const double above = fabs((h->high[at] - u[i]) * h->at.multiplier.upper[at]);
        const double pair = larger(h->exists.lower[at] > 0 ? below : 0, h->exists.upper[at] > 0 ? above : 0);
        h->worst.control[i] = larger(pair, h->worst.control[i]);
        h->scale.control[i] = larger(fabs(u[i]), h->scale.control[i]);
    }
}

/* Write the error of the dynamics that begin at a stage. */
static void measure_dynamics(const towline_horizon *h, int k) {
    const double *c = h->c + k * h->np, *x = h->at.z + (k + 1) * h->wp + h->m;
    double *moved = h->work, *gap = h->gap + (k + 1) * h->np;
    set(moved, h->n, 0);
    h->algebra->add_product(moved, dynamics_of(h, k, h->w), h->at.z + k * h->wp);
    for (int i = 0; i < h->n; i++) {
        gap[i] = moved[i] + c[i] - x[i];
        h->worst.gap[i] = larger(fabs(gap[i]), h->worst.gap[i]);
        h->scale.gap[i] = larger(larger3(fabs(moved[i]), fabs(c[i]), fabs(x[i])), h->scale.gap[i]);
    }
}

/* Write the values of the soft rows of a stage, and how far forces are from slopes of the penalty. */
static void measure_rows(const towline_horizon *h, int k) {
    double *value = h->value + k * h->pp;
    set(value, h->p, 0);
    h->algebra->add_product(value, soft_rows_of(h, k, h->w), h->at.z + k * h->wp);
    for (int i = 0, at = k * h->pp; i < h->p; i++, at++) {
        const double force = h->at.multiplier.row[at], size = larger(fabs(value[i]), fabs(h->d[at]));
        value[i] -= h->d[at];
        const double excess = larger(value[i], 0), slope = h->penalty[at] + h->square[at] * excess;
        const double rest = slope - force;
        /* Below 0 no force is allowed, at 0 any up to the penalty, above it the slope. */
        const double off = value[i] < 0 ? -force * value[i] : fabs(rest) * excess;
        const double outside = larger(value[i] <= 0 ? larger(-rest, 0) : 0, -force);
        h->worst.row[i] = larger3(off, size * outside, h->worst.row[i]);
        h->scale.row[i] = larger(size, h->scale.row[i]);
        h->scale.force[i] = larger3(slope, fabs(force), h->scale.force[i]);
    }
}

/* Return whether numbers, a multiple of four, are finite; comparisons ignore those that are none. */
static int are_finite(const double *numbers, int count) {
    double sum[4] = {0, 0, 0, 0};
    for (int i = 0; i < count; i += 4) {
        for (int j = 0; j < 4; j++) { sum[j] += 0 * numbers[i + j]; }
    }
    return sum[0] + sum[1] + sum[2] + sum[3] == 0;
}

/* The largest of errors over scales; infinite where one is no number. */
static double largest_ratio(const double *error, const double *scale, int count) {
    double so_far = 0;
    for (int i = 0; i < count; i++) {
        const double ratio = error[i] / scale[i];
        if (!(ratio <= so_far)) { so_far = ratio > so_far ? ratio : INFINITY; }
    }
    return so_far;
}

static void add_floor(double *scale, int count) {
    for (int i = 0; i < count; i++) { scale[i] += FLOOR; }
}

/*
 * Add to the scale of each variable's gradient what no digit is right of: where symmetry makes a variable zero, all of its
 * terms are rounding, and where the solution is zero, those of all. `cost` is z' H z of all stages, to which that of the
 * ranges of controls is added.
 */
static void add_rounding(const towline_horizon *h, double cost) {
    for (int i = 0; i < h->m; i++) {
        if (h->range[i] < INFINITY) { cost += h->curvature[i] * h->range[i] * h->range[i]; }
    }
    for (int i = 0; i < h->w; i++) {
        double curvature = 0;
        for (int k = i < h->m ? 0 : 1; k <= h->N - (i < h->m); k++) {
            curvature = larger(*entry(hessian_of(h, k, h->w), i, i), curvature);
        }
        h->scale.gradient[i] += ROUNDED * sqrt(curvature * larger(cost, 0));
    }
}

/* Finish the scales. That of a control has its range, but no more of it than an unlimited control would use. */
static void finish_scales(const towline_horizon *h) {
    const towline_extremes *scale = &h->scale;
    add_floor(scale->gradient, h->w);
    add_floor(scale->gap, h->n);
    add_floor(scale->row, h->p);
    add_floor(scale->force, h->p);
    for (int i = 0; i < h->m; i++) {
        const double curvature = h->curvature[i];
        const double used = curvature > 0 ? smaller(h->range[i], scale->gradient[i] / curvature) : 0;
        scale->control[i] += used + FLOOR;
        h->worst.control[i] /= scale->gradient[i];
    }
    for (int i = 0; i < h->p; i++) { h->worst.row[i] /= scale->force[i]; }
}

static void clear(const towline_horizon *h, const towline_extremes *extremes) {
    set(extremes->gradient, h->wp, 0);
    set(extremes->gap, h->np, 0);
    set(extremes->control, h->mp, 0);
    set(extremes->row, h->pp, 0);
    set(extremes->force, h->pp, 0);
}

double horizon_measure(const towline_horizon *h, towline_residuals *residuals) {
    const towline_extremes *worst = &h->worst, *scale = &h->scale;
    clear(h, worst);
    clear(h, scale);
    double cost = 0;
    for (int k = 0; k <= h->N; k++) { cost += measure_gradient(h, k); }
    for (int k = 0; k < h->N; k++) {
        measure_controls(h, k);
        measure_dynamics(h, k);
        if (h->p > 0) { measure_rows(h, k); }
    }
    if (!are_finite(h->gradient, (h->N + 1) * h->wp) || !are_finite(h->gap, (h->N + 1) * h->np) ||
        !are_finite(h->value, h->rows)) {
        const towline_residuals none = {INFINITY, INFINITY, INFINITY, INFINITY};
        *residuals = none;
        return INFINITY;
    }
    add_rounding(h, cost);
    finish_scales(h);
    residuals->stationarity = largest_ratio(worst->gradient, scale->gradient, h->w);
    residuals->dynamics = largest_ratio(worst->gap, scale->gap, h->n);
    residuals->complementarity = largest_ratio(worst->control, scale->control, h->m);
    residuals->soft = largest_ratio(worst->row, scale->row, h->p);
    return larger(larger(residuals->stationarity, residuals->dynamics),
                  larger(residuals->complementarity, residuals->soft));
}
