/* The same problem in differences from a reference. */
#include "horizon/internal.h"

/* numbers += sign X z, with h->work as memory. */
static void add(const towline_horizon *h, double *numbers, matrix x, const double *z, double sign) {
    double *moved = h->work + h->wp;
    set(moved, x.rows, 0);
    h->algebra->add_product(moved, x, z);
    for (int i = 0; i < x.rows; i++) { numbers[i] += sign * moved[i]; }
}

static void subtract(double *numbers, const double *others, int count) {
    for (int i = 0; i < count; i++) { numbers[i] -= others[i]; }
}

void towline_horizon_relative_to(const towline_horizon *h, const double *states, const double *controls) {
    const int n = h->n, m = h->m;
    double *z = h->work;
    set(z, h->wp, 0);
    subtract(h->start, states, n);
    for (int k = 0; k < h->N; k++) {
        const double *u = controls + k * m, *x = states + k * n;
        double *c = h->c + k * h->np;
        copy(z, u, m);
        copy(z + m, x, n);
        add(h, c, dynamics_of(h, k, h->w), z, 1);
        subtract(c, x + n, n);
        add(h, h->d + k * h->pp, soft_rows_of(h, k, h->w), z, -1);
        subtract(h->u_min + k * h->mp, u, m);
        subtract(h->u_max + k * h->mp, u, m);
        subtract(h->at.z + k * h->wp, z, h->w);
    }
    subtract(h->at.z + h->N * h->wp + m, states + h->N * n, n);
}
