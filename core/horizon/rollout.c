/* The trajectory of the controls that a solve returns. */
#include "horizon/internal.h"

/*
 * A control makes up, by the gains of the last step, for the distance `off` that its rounding and that of the dynamics put
 * between trajectory and iterate: an unstable system would multiply it from stage to stage.
 */
static void write_controls(const towline_horizon *h, int k, double *off) {
    double *v = h->work, *u = h->at.z + k * h->wp;
    set(v, h->m, 0);
    set(off, h->m, 0);
    if (k > 0) { h->algebra->add_product(v, factor_of(h, k, h->w), off); }
    horizon_solve_upper(h, k, v, off);
    for (int i = 0; i < h->m; i++) {
        const double low = h->u_min[k * h->mp + i], high = h->u_max[k * h->mp + i];
        double wanted = u[i] + off[i];
        if (!(fabs(wanted) < TOWLINE_HUGE)) { /* no gains, after an iteration that failed */
            wanted = u[i];
        }
        if (!(fabs(wanted) < TOWLINE_HUGE)) { wanted = 0; }
        wanted = wanted < low ? low : wanted;
        u[i] = wanted > high ? high : wanted;
    }
}

void horizon_roll_out(const towline_horizon *h) {
    double *v = h->work;
    set(h->step.z + h->m, h->n, 0);
    for (int k = 0; k < h->N; k++) {
        double *x = h->at.z + (k + 1) * h->wp + h->m, *off = h->step.z + k * h->wp;
        write_controls(h, k, off);
        copy(v, h->c + k * h->np, h->n);
        h->algebra->add_product(v, dynamics_of(h, k, h->w), h->at.z + k * h->wp);
        for (int i = 0; i < h->n; i++) {
            off[h->wp + h->m + i] = v[i] - x[i];
            x[i] = v[i];
        }
    }
}
