/*
 * The elimination of slacks, excesses and multipliers from a Newton step, whose only unknowns are then dz.
 *
 * A bound has the slack t and the multiplier f, and dt is du or -du: the linear equation f dt + t df = product gives
 * df. A soft row has in addition the excess s, whose own multiplier is rest = penalty + square s - f. The equations
 * f dt + t df = product of the row and rest ds + s drest = product of the excess give df = steep E dz + shift.
 */
#include "horizon/internal.h"

void horizon_weigh_rows(const towline_horizon *h) {
    const towline_iterate *at = &h->at;
    for (int i = 0; i < h->rows; i++) {
        const double t = at->slack.row[i], s = at->slack.excess[i];
        const double force = at->multiplier.row[i], rest = at->multiplier.excess[i];
        h->steep[i] = h->exists.row[i] / (s / (h->square[i] * s + rest) + t / force);
    }
}

/* What soft rows add to the gradient. */
static void reduce_rows(const towline_horizon *h) {
    const towline_iterate *at = &h->at;
    for (int i = 0; i < h->rows; i++) {
        const double s = at->slack.excess[i], force = at->multiplier.row[i], rest = at->multiplier.excess[i];
        const double off = h->off[i] - h->product.excess[i] / (h->square[i] * s + rest) + h->product.row[i] / force;
        h->shift[i] = h->steep[i] * off;
    }
    for (int k = 0; k < h->N; k++) {
        h->algebra->add_transposed_product(h->reduced + k * h->wp, soft_rows_of(h, k, h->w), h->shift + k * h->pp);
    }
}

void horizon_reduce(const towline_horizon *h) {
    const towline_limits *t = &h->at.slack, *product = &h->product;
    copy(h->reduced, h->gradient, (h->N + 1) * h->wp);
    for (int k = 0; k < h->N; k++) {
        double *reduced = h->reduced + k * h->wp;
        for (int i = 0, at = k * h->mp; i < h->m; i++, at++) {
            reduced[i] += product->upper[at] / t->upper[at] - product->lower[at] / t->lower[at];
        }
    }
    if (h->p > 0) { reduce_rows(h); }
}

static void expand_bounds(const towline_horizon *h) {
    const towline_limits *t = &h->at.slack, *force = &h->at.multiplier, *product = &h->product, *exists = &h->exists;
    const towline_limits *dt = &h->step.slack, *d_force = &h->step.multiplier;
    for (int k = 0; k < h->N; k++) {
        const double *du = h->step.z + k * h->wp;
        for (int i = 0, at = k * h->mp; i < h->m; i++, at++) {
            dt->lower[at] = du[i] * exists->lower[at];
            dt->upper[at] = -du[i] * exists->upper[at];
            d_force->lower[at] = (product->lower[at] - force->lower[at] * du[i]) / t->lower[at] * exists->lower[at];
            d_force->upper[at] = (product->upper[at] + force->upper[at] * du[i]) / t->upper[at] * exists->upper[at];
        }
    }
}

static void expand_rows(const towline_horizon *h) {
    const towline_limits *t = &h->at.slack, *multiplier = &h->at.multiplier, *exists = &h->exists;
    const towline_limits *dt = &h->step.slack, *d_multiplier = &h->step.multiplier;
    for (int k = 0; k < h->N; k++) {
        double *change = d_multiplier->row + k * h->pp;
        set(change, h->p, 0);
        h->algebra->add_product(change, soft_rows_of(h, k, h->w), h->step.z + k * h->wp);
    }
    for (int i = 0; i < h->rows; i++) {
        const double force = multiplier->row[i], rest = multiplier->excess[i], s = t->excess[i];
        const double d_force = (h->steep[i] * d_multiplier->row[i] + h->shift[i]) * exists->row[i];
        const double ds = (s * d_force + h->product.excess[i]) / (h->square[i] * s + rest) * exists->row[i];
        d_multiplier->row[i] = d_force;
        d_multiplier->excess[i] = (h->square[i] * ds - d_force) * exists->row[i];
        dt->row[i] = (h->product.row[i] - t->row[i] * d_force) / force * exists->row[i];
        dt->excess[i] = ds;
    }
}

void horizon_expand(const towline_horizon *h) {
    expand_bounds(h);
    if (h->p > 0) { expand_rows(h); }
}
