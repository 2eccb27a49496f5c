/* Mehrotra's predictor and corrector for the program of all stages; see docs/horizon.md. */
#include "horizon/internal.h"

/* A warm start is pushed inside by the part of the scales by which its residuals are off, within these limits. */
static const double LEAST_PUSH = 1e-3, MOST_PUSH = 0.1;
static const double APART = 1e-3; /* smallest product of slack and multiplier, in units of their mean */
static const double SHORT = 0.2;  /* a step that is shorter is replaced */
/* After so many iterations without progress, or in all, the correction of second order may lead in circles: then steps go
 * without it, to products of this part of their mean. */
enum { CYCLE = 7, LATE = 32 };
static const double CENTRAL = 0.3;
enum { PATIENCE = 20 }; /* iterations after which a warm start is given up */
enum { STUCK = 4 };     /* iterations without progress, and residual in tolerances, at which rounding permits no */
static const double NEAR = 1e3; /* more */

/* Slack times multiplier of a limit, a part of the step ahead. */
static double product_ahead(const towline_horizon *h, int i, double length) {
    const double slack = h->at.slack.lower[i] + length * h->step.slack.lower[i];
    const double multiplier = h->at.multiplier.lower[i] + length * h->step.multiplier.lower[i];
    return slack * multiplier;
}

/* The sum of all products of slack and multiplier, a part of the step ahead. */
static double total_ahead(const towline_horizon *h, double length) {
    double sum[4] = {0, 0, 0, 0};
    for (int i = 0; i < h->pairs; i += 4) {
        for (int j = 0; j < 4; j++) { sum[j] += h->exists.lower[i + j] * product_ahead(h, i + j, length); }
    }
    return (sum[0] + sum[2]) + (sum[1] + sum[3]);
}

/* Let products change to `centre`, less `second_order` times the product of the steps. */
static void aim_at(const towline_horizon *h, double centre, double second_order) {
    const double *slack = h->at.slack.lower, *multiplier = h->at.multiplier.lower, *exists = h->exists.lower;
    const double *d_slack = h->step.slack.lower, *d_multiplier = h->step.multiplier.lower;
    double *restrict product = h->product.lower;
    for (int i = 0; i < h->pairs; i++) {
        const double second = second_order * d_slack[i] * d_multiplier[i];
        product[i] = (centre - slack[i] * multiplier[i] - second) * exists[i];
    }
}

/* Write the step for `product`. */
static void direct(const towline_horizon *h, int same_gap) {
    horizon_reduce(h);
    horizon_substitute(h, same_gap);
    horizon_expand(h);
}

/* The largest step at which no slack and no multiplier is negative, at most 1e3. */
static double step_length(const towline_horizon *h) {
    const double *value = h->at.slack.lower, *change = h->step.slack.lower; /* multipliers follow slacks */
    double worst[4] = {1e-3, 1e-3, 1e-3, 1e-3};
    for (int i = 0; i < 2 * h->pairs; i += 4) {
        for (int j = 0; j < 4; j++) { worst[j] = larger(-change[i + j] / value[i + j], worst[j]); }
    }
    return 1 / larger(larger(worst[0], worst[1]), larger(worst[2], worst[3]));
}

/* Shorten a step until no product is much smaller than their mean, for which later steps would be short. */
static double central_step(const towline_horizon *h, double length, double pairs) {
    for (int attempt = 0; attempt < 20; attempt++) {
        double smallest[4] = {INFINITY, INFINITY, INFINITY, INFINITY};
        for (int i = 0; i < h->pairs; i += 4) {
            for (int j = 0; j < 4; j++) {
                const double product = product_ahead(h, i + j, length);
                smallest[j] = smaller(h->exists.lower[i + j] > 0 ? product : INFINITY, smallest[j]);
            }
        }
        const double least = smaller(smaller(smallest[0], smallest[1]), smaller(smallest[2], smallest[3]));
        if (least >= APART * total_ahead(h, length) / pairs) { break; }
        length *= 0.9;
    }
    return length;
}

static void move(const towline_horizon *h, double length) {
    horizon_write_costates(h);
    double *restrict at = h->at.z;
    const double *step = h->step.z;
    for (int i = 0; i < h->size; i++) { at[i] += length * step[i]; }
    for (int i = 0; i < h->rows; i++) { h->off[i] *= 1 - length; }
}

/* Replace the iterate by the next, by a step along the central path if `central`. */
static void iterate(const towline_horizon *h, double pairs, int central) {
    horizon_weigh_rows(h);
    horizon_factorise(h);
    aim_at(h, 0, 0);
    direct(h, 0);
    if (pairs == 0) {
        move(h, 1);
        return;
    }
    const double gap = total_ahead(h, 0), ratio = total_ahead(h, smaller(1, step_length(h))) / gap;
    const double cube = ratio * ratio * ratio;
    aim_at(h, larger(cube, central ? CENTRAL : 0) * gap / pairs, central ? 0 : 1);
    direct(h, 1);
    double length = smaller(1, (1 - smaller(0.005, 0.5 * ratio)) * step_length(h));
    length = central_step(h, length, pairs);
    if (length < SHORT) {
        /* Products are too far from the central path: go there first. */
        aim_at(h, 0.5 * gap / pairs, 0);
        direct(h, 1);
        length = central_step(h, smaller(1, 0.95 * step_length(h)), pairs);
    }
    move(h, length);
}

/* Begin, warm if the iterate in memory has residuals. */
static void begin(const towline_horizon *h, towline_beginning beginning) {
    towline_residuals unused;
    double error = INFINITY;
    if (beginning == TOWLINE_SHIFTED) { horizon_shift(h); }
    if (beginning != TOWLINE_COLD) {
        horizon_begin(h, 1);
        error = horizon_measure(h, &unused);
    }
    if (error < INFINITY) {
        horizon_begin_warm(h, smaller(larger(error, LEAST_PUSH), MOST_PUSH));
    } else {
        horizon_begin_cold(h);
    }
}

/* Write the multipliers of bounds that do not exist, 0, and of those that fix a control. */
static void finish_multipliers(const towline_horizon *h) {
    const towline_limits *multiplier = &h->at.multiplier;
    for (int i = 0; i < h->bounds; i++) {
        const double force = h->holding[i], moves = h->moves[i];
        multiplier->lower[i] = moves == 0 ? larger(force, 0) : multiplier->lower[i] * h->exists.lower[i];
        multiplier->upper[i] = moves == 0 ? larger(-force, 0) : multiplier->upper[i] * h->exists.upper[i];
    }
}

/* Return whether the trajectory of the controls, which is what matters, is as good; else restore the iterate. */
static int rounds_off(const towline_horizon *h, double tolerance, towline_residuals *residuals) {
    horizon_roll_out(h);
    if (horizon_measure(h, residuals) <= tolerance) { return 1; }
    copy(h->at.z, h->best.z, h->size);
    horizon_measure(h, residuals);
    return 0;
}

/* Take the best iterate, with its gains: those of a later one may be spoilt by rounding. */
static void restore_best(const towline_horizon *h) {
    copy(h->at.z, h->best.z, h->size);
    horizon_weigh_rows(h);
    horizon_factorise(h);
}

towline_horizon_result towline_solve_horizon(const towline_horizon *h, towline_beginning beginning, double tolerance,
                                             int iterations_max) {
    const double pairs = horizon_set_limits(h);
    towline_horizon_result result = {{INFINITY, INFINITY, INFINITY, INFINITY}, 0, 0};
    double best = INFINITY;
    int better = 0, count = 0; /* the iteration in which the best was found */
    begin(h, beginning);
    for (;; count++) {
        const double error = horizon_measure(h, &result.residuals);
        if (error < best) {
            best = error;
            better = count;
            copy(h->best.z, h->at.z, h->size);
        }
        if (pairs >= 0 && error <= tolerance && rounds_off(h, tolerance, &result.residuals)) {
            result.converged = 1;
            break;
        }
        if (!(error < INFINITY) || count >= iterations_max || (count - better >= STUCK && best <= NEAR * tolerance)) {
            break;
        }
        if (beginning != TOWLINE_COLD && count == PATIENCE) {
            horizon_begin_cold(h);
            horizon_measure(h, &result.residuals);
        }
        iterate(h, pairs, count - better >= CYCLE || count >= LATE);
    }
    result.iterations = count;
    if (!result.converged) {
        if (best < INFINITY) { restore_best(h); }
        horizon_roll_out(h);
        horizon_measure(h, &result.residuals);
    }
    finish_multipliers(h);
    return result;
}
