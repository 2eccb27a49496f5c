/*
 * The Newton step of all stages by a Riccati recursion.
 *
 *     minimise sum of 1/2 dz' H dz + f' dz over the stages,  dx+ = G dz + e,  dx = 0 at the start
 *
 * Backward, with P and p of the cost to go 1/2 dx' P dx + p' dx of the next stage:
 *
 *     M = H + G' P G,    M = [U_uu U_ux]' [U_uu U_ux] + [0, P of this stage]    (Cholesky's method, stopped after u)
 *
 * Forward, du = -inv(U_uu) (U_ux dx + zeta) and dy = P dx + p.
 */
#include "horizon/internal.h"

static const matrix NONE = {NULL, 0, 0, 0};

/* Only the controls of stage 0 change. */
static int width_of(const towline_horizon *h, int k) { return k > 0 ? h->w : h->m; }

static void copy_lower_from_upper(matrix a) {
    for (int i = 1; i < a.rows; i++) {
        for (int j = 0; j < i; j++) { *entry(a, i, j) = *entry(a, j, i); }
    }
}

/* M += E' W E with the weights W of the soft rows. */
static void add_soft_rows(const towline_horizon *h, int k, matrix M) {
    const matrix E = soft_rows_of(h, k, M.columns), EW = {h->EW, h->p, M.columns, h->wp};
    for (int j = 0; j < h->p; j++) {
        for (int i = 0; i < h->wp; i++) { *entry(EW, j, i) = h->steep[k * h->pp + j] * *entry(E, j, i); }
    }
    const product weighted = {M, M, E, EW, 1.0, 1};
    h->algebra->multiply(&weighted);
}

/* Bounds, after slacks and multipliers are eliminated, are weights of controls; those of fixed controls are infinite. */
static void add_bounds(const towline_horizon *h, int k, matrix M) {
    const towline_limits *exists = &h->exists, *t = &h->at.slack, *force = &h->at.multiplier;
    for (int i = 0; i < h->m; i++) {
        const int at = k * h->mp + i;
        const double lower = exists->lower[at] * force->lower[at] / t->lower[at];
        const double upper = exists->upper[at] * force->upper[at] / t->upper[at];
        *entry(M, i, i) += h->moves[at] == 0 ? TOWLINE_HUGE : lower + upper;
    }
}

void horizon_factorise(const towline_horizon *h) {
    const int n = h->n, m = h->m;
    const matrix last = block(hessian_of(h, h->N, h->w), m, m, n, n), P_end = cost_to_go(h, h->N);
    for (int i = 0; i < n; i++) { copy(row_of(P_end, i), row_of(last, i), n); }
    copy_lower_from_upper(P_end);
    for (int k = h->N - 1; k >= 0; k--) {
        const int width = width_of(h, k);
        const matrix H = hessian_of(h, k, width), G = dynamics_of(h, k, width), U = factor_of(h, k, width);
        const matrix T = {h->T, n, width, h->wp}, M = {h->M, width, width, h->wp};
        const product PG = {T, NONE, cost_to_go(h, k + 1), G, 1.0, 0}, H_and_GPG = {M, H, G, T, 1.0, 1};
        h->algebra->multiply(&PG);
        h->algebra->multiply(&H_and_GPG);
        if (h->p > 0) { add_soft_rows(h, k, M); }
        add_bounds(h, k, M);
        h->algebra->factorise(U, h->inverse + k * h->mp, M);
        if (k > 0) {
            const matrix P = cost_to_go(h, k), U_ux = block(U, 0, m, m, n);
            const product rest = {P, block(M, m, m, n, n), U_ux, U_ux, -1.0, 1};
            h->algebra->multiply(&rest);
            copy_lower_from_upper(P);
        }
    }
}

void horizon_solve_upper(const towline_horizon *h, int k, double *v, double *out) {
    const matrix U = factor_of(h, k, h->m);
    for (int i = h->m - 1; i >= 0; i--) {
        out[i] = -v[i] * h->inverse[k * h->mp + i];
        for (int j = 0; j < i; j++) { v[j] += *entry(U, j, i) * out[i]; }
    }
}

/* Write what is left for the controls of each stage to do, and the vectors of the cost to go. */
static void backward(const towline_horizon *h, int same_gap) {
    const int n = h->n, m = h->m;
    double *v = h->work;
    copy(h->P_vector + h->N * h->np, h->reduced + h->N * h->wp + m, n);
    for (int k = h->N - 1; k >= 0; k--) {
        const int width = width_of(h, k);
        const matrix U = factor_of(h, k, width);
        double *P_gap = h->P_gap + (k + 1) * h->np, *gradient = h->reduced + k * h->wp;
        if (!same_gap) {
            set(P_gap, h->np, 0);
            h->algebra->add_transposed_product(P_gap, cost_to_go(h, k + 1), h->gap + (k + 1) * h->np);
        }
        for (int i = 0; i < n; i++) { v[i] = P_gap[i] + h->P_vector[(k + 1) * h->np + i]; }
        h->algebra->add_transposed_product(gradient, dynamics_of(h, k, width), v);
        h->algebra->solve_lower(gradient, h->zeta + k * h->mp, U, h->inverse + k * h->mp);
        copy(h->P_vector + k * h->np, gradient + m, n);
    }
}

/* Write the step from stage to stage. */
static void forward(const towline_horizon *h) {
    const int n = h->n, m = h->m;
    double *v = h->work;
    set(h->step.z, h->w, 0);
    for (int k = 0; k < h->N; k++) {
        double *z = h->step.z + k * h->wp, *x = z + h->wp + m;
        copy(v, h->zeta + k * h->mp, m);
        set(z, m, 0);
        if (k > 0) { h->algebra->add_product(v, factor_of(h, k, h->w), z); }
        horizon_solve_upper(h, k, v, z);
        copy(x, h->gap + (k + 1) * h->np, n);
        h->algebra->add_product(x, dynamics_of(h, k, h->w), z);
    }
}

void horizon_substitute(const towline_horizon *h, int same_gap) {
    backward(h, same_gap);
    forward(h);
}

void horizon_write_costates(const towline_horizon *h) {
    double *v = h->work;
    set(v + h->n, h->np - h->n, 0);
    for (int k = 1; k <= h->N; k++) {
        double *y = h->step.y + k * h->wp + h->m;
        copy(v, h->step.z + k * h->wp + h->m, h->n);
        copy(y, h->P_vector + k * h->np, h->n);
        h->algebra->add_product(y, cost_to_go(h, k), v);
    }
}
