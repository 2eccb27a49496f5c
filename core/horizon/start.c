/* The iterate that a solve begins with, and what of the problem does not change during it. */
#include "horizon/internal.h"

static const double FIXED = 1e-13;       /* relative width of bounds below which a control is fixed */
static const double DAMPING = 1.0;       /* of the first step, as a part of each control's curvature */
static const double FIRST_CENTRE = 10.0; /* of the first products of slack and multiplier, times what they are off */
static const double NEARLY_NOTHING = 1e-200;

/* Write which bounds a control has; return how many, nan if they cross or are no numbers. */
static double set_bounds(const towline_horizon *h, int at, double *range) {
    const double low = h->u_min[at], high = h->u_max[at], width = high - low;
    int below = low > -INFINITY, above = high < INFINITY;
    const int moves = !(below && above) || width > FIXED * larger(fabs(low), fabs(high));
    below = below && moves;
    above = above && moves;
    h->moves[at] = moves;
    h->low[at] = moves && !below ? -INFINITY : low;
    h->high[at] = moves ? (above ? high : INFINITY) : low;
    h->exists.lower[at] = below;
    h->exists.upper[at] = above;
    *range = larger(width, *range);
    return width >= 0 ? (double)(below + above) : (double)NAN;
}

/* Limits that do not exist have slack and multiplier one. */
static void fill_missing(const towline_horizon *h) {
    const double *exists = h->exists.lower;
    double *slack = h->at.slack.lower, *multiplier = h->at.multiplier.lower;
    for (int i = 0; i < h->pairs; i++) {
        if (exists[i] == 0) { slack[i] = multiplier[i] = 1; }
    }
}

/* Write S' below S, of which R and the end have none. */
static void mirror(const towline_horizon *h, int k) {
    const matrix H = hessian_of(h, k, h->w);
    for (int i = 0; i < h->m; i++) {
        for (int j = h->m; j < h->w; j++) { *entry(H, j, i) = *entry(H, i, j); }
    }
}

/* Write the largest of each control's cost, by itself and by the states that it moves. */
static void set_curvature(const towline_horizon *h) {
    const int m = h->m;
    double *sum = h->work;
    set(h->curvature, m, 0);
    for (int k = 0; k < h->N; k++) {
        const matrix H = hessian_of(h, k, h->w), following = hessian_of(h, k + 1, h->w), B = dynamics_of(h, k, m);
        for (int i = 0; i < m; i++) { sum[i] = *entry(H, i, i); }
        for (int j = 0; j < h->n; j++) {
            const double *b = row_of(B, j), Q = *entry(following, m + j, m + j);
            for (int i = 0; i < m; i++) { sum[i] += Q * (b[i] * b[i]); }
        }
        for (int i = 0; i < m; i++) { h->curvature[i] = larger(sum[i], h->curvature[i]); }
    }
}

double horizon_set_limits(const towline_horizon *h) {
    double count = 2.0 * h->p * h->N;
    set(h->range, h->m, 0);
    for (int k = 0; k < h->N; k++) {
        for (int i = 0; i < h->m; i++) { count += set_bounds(h, k * h->mp + i, h->range + i); }
        for (int i = 0; i < h->p; i++) { h->exists.row[k * h->pp + i] = h->exists.excess[k * h->pp + i] = 1; }
        mirror(h, k);
    }
    set_curvature(h);
    return count;
}

/* Move the rows of an array, one for each stage, to the front; the last one stays. */
static void move_up(double *rows, int count, int step) {
    memmove(rows, rows + step, (size_t)(count - 1) * (size_t)step * sizeof *rows);
}

void horizon_shift(const towline_horizon *h) {
    const towline_iterate *at = &h->at;
    double *last = at->z + (h->N - 1) * h->wp, *x = last + h->m, *x_end = x + h->wp;
    move_up(at->z, h->N, h->wp);
    move_up(at->y + h->wp, h->N, h->wp);
    move_up(at->multiplier.lower, h->N, h->mp);
    move_up(at->multiplier.upper, h->N, h->mp);
    move_up(at->multiplier.row, h->N, h->pp);
    copy(x, x_end, h->n);
    copy(x_end, h->c + (h->N - 1) * h->np, h->n);
    h->algebra->add_product(x_end, dynamics_of(h, h->N - 1, h->w), last);
}

/* Put controls between their bounds, at least this part of the range inside. */
static void push_inside(const towline_horizon *h, double margin) {
    for (int k = 0; k < h->N; k++) {
        double *u = h->at.z + k * h->wp;
        for (int i = 0; i < h->m; i++) {
            const double low = h->low[k * h->mp + i], high = h->high[k * h->mp + i];
            double distance = margin > 0 ? margin * (high - low) : 0;
            if (distance == INFINITY) { distance = margin * larger(fabs(u[i]), 1); }
            u[i] = larger(smaller(u[i], high - distance), low + distance);
        }
    }
}

void horizon_begin(const towline_horizon *h, int warm) {
    if (!warm) {
        set(h->at.z, 2 * (h->N + 1) * h->wp, 0);
        set(h->at.slack.lower, 2 * h->pairs, 1);
    }
    fill_missing(h);
    set(h->step.z, h->size, 0); /* whatever the last problem left there */
    copy(h->at.z + h->m, h->start, h->n);
    push_inside(h, warm ? 0 : 0.5);
}

/* Write slacks and multipliers of a first step that is damped, and has no limits. */
static void begin_damped(const towline_horizon *h) {
    const towline_limits *slack = &h->at.slack, *multiplier = &h->at.multiplier;
    for (int i = 0; i < h->bounds; i++) {
        const int control = i % h->mp;
        slack->lower[i] = slack->upper[i] = 1;
        multiplier->lower[i] = multiplier->upper[i] = control < h->m ? DAMPING * h->curvature[control] : 1;
    }
    for (int i = 0; i < h->rows; i++) {
        h->steep[i] = h->shift[i] = h->off[i] = 0;
        slack->row[i] = slack->excess[i] = 1;
        multiplier->row[i] = NEARLY_NOTHING;
        multiplier->excess[i] = 1;
    }
    set(h->product.lower, h->pairs, 0);
}

/* Return the mean product of slack and multiplier that a start begins with, for the gradient without bounds. */
static double first_centre(const towline_horizon *h) {
    double total = 0, pairs = 0;
    for (int k = 0; k < h->N; k++) {
        const double *u = h->at.z + k * h->wp, *force = h->gradient + k * h->wp;
        for (int i = 0, at = k * h->mp; i < h->m; i++, at++) {
            if (h->exists.lower[at] > 0) {
                total += larger(force[i], 0) * (u[i] - h->low[at]);
                pairs++;
            }
            if (h->exists.upper[at] > 0) {
                total += larger(-force[i], 0) * (h->high[at] - u[i]);
                pairs++;
            }
        }
        for (int i = 0, at = k * h->pp; i < h->p; i++, at++) {
            total += h->penalty[at] * fabs(h->value[at]) * 0.1;
            pairs++;
        }
    }
    return FIRST_CENTRE * total / larger(pairs, 1) + 1e-12;
}

/* Write slack, excess and multipliers of a soft row on the central path, or near it with a quadratic penalty. */
static void begin_row(const towline_horizon *h, int at, double centre) {
    const double v = h->value[at], penalty = h->penalty[at], square = h->square[at];
    const double steep = penalty + square * larger(v, 0) + sqrt(square * centre), along = v * steep;
    const double hypotenuse = sqrt(along * along + 4 * centre * centre);
    const double least = 4 * centre / (penalty + sqrt(penalty * penalty + 8 * square * centre));
    const double excess = larger((hypotenuse + along + 2 * centre) / (2 * steep), least);
    h->at.slack.row[at] = excess - v;
    h->at.slack.excess[at] = excess;
    h->at.multiplier.row[at] = penalty + square * excess - centre / excess;
    h->at.multiplier.excess[at] = centre / excess;
    h->off[at] = 0;
}

/* Write slacks and multipliers near the central path, for the gradient without multipliers of bounds. */
static void begin_pairs(const towline_horizon *h) {
    const towline_limits *slack = &h->at.slack, *multiplier = &h->at.multiplier;
    const double centre = first_centre(h);
    for (int k = 0; k < h->N; k++) {
        const double *u = h->at.z + k * h->wp, *force = h->gradient + k * h->wp;
        for (int i = 0, at = k * h->mp; i < h->m; i++, at++) {
            slack->lower[at] = h->exists.lower[at] > 0 ? u[i] - h->low[at] : 1;
            slack->upper[at] = h->exists.upper[at] > 0 ? h->high[at] - u[i] : 1;
            multiplier->lower[at] = larger(force[i], 0) + centre / slack->lower[at];
            multiplier->upper[at] = larger(-force[i], 0) + centre / slack->upper[at];
        }
        for (int i = 0; i < h->p; i++) { begin_row(h, k * h->pp + i, centre); }
    }
}

void horizon_begin_cold(const towline_horizon *h) {
    towline_residuals unused;
    horizon_begin(h, 0);
    begin_damped(h);
    horizon_measure(h, &unused);
    horizon_factorise(h);
    horizon_reduce(h);
    horizon_substitute(h, 0);
    horizon_write_costates(h);
    for (int i = 0; i < 2 * (h->N + 1) * h->wp; i++) { h->at.z[i] += h->step.z[i]; }
    push_inside(h, 0.1);
    set(h->at.multiplier.lower, 2 * h->bounds, 0);
    horizon_measure(h, &unused);
    begin_pairs(h);
}

/* Push a control, and slacks and multipliers of its bounds, inside. */
static void push_control(const towline_horizon *h, double *u, int i, int at, double part) {
    const towline_limits *slack = &h->at.slack, *multiplier = &h->at.multiplier;
    const double low = h->low[at], high = h->high[at], size = part * h->scale.control[i];
    const double distance = smaller(size, 0.4 * (high - low)), least = size * h->scale.gradient[i];
    *u = larger(smaller(*u, high - distance), low + distance);
    slack->lower[at] = h->exists.lower[at] > 0 ? *u - low : 1;
    slack->upper[at] = h->exists.upper[at] > 0 ? high - *u : 1;
    multiplier->lower[at] = larger(multiplier->lower[at], least / slack->lower[at]);
    multiplier->upper[at] = larger(multiplier->upper[at], least / slack->upper[at]);
}

/* Push slack, excess and multipliers of a soft row of this value inside. */
static void push_row(const towline_horizon *h, double value, int i, int at, double part) {
    const towline_limits *slack = &h->at.slack, *multiplier = &h->at.multiplier;
    const double scale = h->scale.force[i], centre = part * scale * h->scale.row[i];
    const double excess = larger(value, part * h->scale.row[i]), most = h->penalty[at] + h->square[at] * excess;
    const double least = part * smaller(scale, most);
    const double force = smaller(larger(multiplier->row[at], least), (1 - 0.5 * part) * most);
    multiplier->row[at] = force;
    multiplier->excess[at] = most - force;
    slack->row[at] = larger(-value, centre / force);
    slack->excess[at] = excess;
    h->off[at] = value - excess + slack->row[at];
}

void horizon_begin_warm(const towline_horizon *h, double part) {
    for (int k = 0; k < h->N; k++) {
        double *z = h->at.z + k * h->wp, *value = h->work;
        for (int i = 0; i < h->m; i++) { push_control(h, z + i, i, k * h->mp + i, part); }
        for (int i = 0; i < h->p; i++) { value[i] = -h->d[k * h->pp + i]; }
        h->algebra->add_product(value, soft_rows_of(h, k, h->w), z);
        for (int i = 0; i < h->p; i++) { push_row(h, value[i], i, k * h->pp + i, part); }
    }
}
