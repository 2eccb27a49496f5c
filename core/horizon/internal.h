/* What the files of a horizon have from each other. */
#ifndef TOWLINE_HORIZON_INTERNAL_H
#define TOWLINE_HORIZON_INTERNAL_H

#include <math.h>
#include <string.h>

#include "horizon/horizon.h"

/* The matrices of stage k; of H, G and E the first `width` columns: at stage 0, whose state is given, controls matter alone. */
static inline matrix hessian_of(const towline_horizon *h, int k, int width) {
    const matrix H = {h->H + (ptrdiff_t)k * h->w * h->wp, width, width, h->wp};
    return H;
}

static inline matrix dynamics_of(const towline_horizon *h, int k, int width) {
    const matrix G = {h->G + (ptrdiff_t)k * h->n * h->wp, h->n, width, h->wp};
    return G;
}

static inline matrix soft_rows_of(const towline_horizon *h, int k, int width) {
    const matrix E = {h->E + (ptrdiff_t)k * h->p * h->wp, h->p, width, h->wp};
    return E;
}

static inline matrix factor_of(const towline_horizon *h, int k, int width) {
    const matrix U = {h->U + (ptrdiff_t)k * h->m * h->wp, h->m, width, h->wp};
    return U;
}

static inline matrix cost_to_go(const towline_horizon *h, int k) {
    const matrix P = {h->P + (ptrdiff_t)k * h->n * h->np, h->n, h->n, h->np};
    return P;
}

static inline void set(double *numbers, int count, double value) {
    for (int i = 0; i < count; i++) { numbers[i] = value; }
}

static inline void copy(double *to, const double *from, int count) {
    for (int i = 0; i < count; i++) { to[i] = from[i]; }
}

/* The larger, or the second where one of them is no number. */
static inline double larger(double x, double y) { return x > y ? x : y; }

static inline double smaller(double x, double y) { return x < y ? x : y; }

/* start.c: the iterate that a solve begins with. */

/* Write what does not change; return how many limits there are, nan if bounds cross or are no numbers. */
double horizon_set_limits(const towline_horizon *h);

void horizon_shift(const towline_horizon *h);

/* Write the given state, and zeros and controls amid their bounds if the start is cold. */
void horizon_begin(const towline_horizon *h, int warm);

/* The optimum without limits, damped, pushed inside, with slacks and multipliers near the central path. */
void horizon_begin_cold(const towline_horizon *h);

/* Push controls, slacks and multipliers of a nearby solution inside, by this part of their scales. */
void horizon_begin_warm(const towline_horizon *h, double part);

/* residuals.c */

/* Write errors of all conditions and their residuals; return the largest residual, infinite where one is no number. */
double horizon_measure(const towline_horizon *h, towline_residuals *residuals);

/* elimination.c: slacks and multipliers of the linear system. */

/* Write the weight that each soft row has in the cost after its slack, excess and multipliers are eliminated. */
void horizon_weigh_rows(const towline_horizon *h);

/* Write the gradient that is left when `product` is what slacks times multipliers are to change by. */
void horizon_reduce(const towline_horizon *h);

/* Write the steps of slacks and multipliers from those of controls and states. */
void horizon_expand(const towline_horizon *h);

/* riccati.c */

/* Write matrices of the cost to go and factors of all stages; slacks and multipliers are weights of controls. */
void horizon_factorise(const towline_horizon *h);

/* Write the step of controls and states for `reduced` and `gap`, which is that of the last call if `same_gap`. */
void horizon_substitute(const towline_horizon *h, int same_gap);

/* Write the step of the multipliers of the dynamics that belongs to that of the states. */
void horizon_write_costates(const towline_horizon *h);

/* Write -inv(U_uu) v for a stage; the vector is overwritten. */
void horizon_solve_upper(const towline_horizon *h, int k, double *v, double *out);

/* rollout.c */

/* Put controls inside their bounds to the last bit, and states on the trajectory that they give. */
void horizon_roll_out(const towline_horizon *h);

#endif
