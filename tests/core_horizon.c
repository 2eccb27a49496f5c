/*
 * Horizons of random sizes, some of them with numbers that are none, infinite or huge: controls must be finite and in
 * their bounds, and regular problems must converge. Memory is exactly as large as the core asks for, so that sanitizers
 * see every step beside it.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "horizon/horizon.h"

/* A number between -1 and 1. */
static double any(unsigned *seed) {
    *seed = *seed * 1664525u + 1013904223u;
    return (double)(*seed >> 8) / 8388608.0 - 1.0;
}

static void fill(const towline_horizon *h, unsigned *seed) {
    for (int k = 0; k <= h->N; k++) {
        for (int i = 0; i < h->w; i++) {
            h->h[k * h->wp + i] = k < h->N || i >= h->m ? any(seed) : 0;
            h->H[(k * h->w + i) * h->wp + i] = k < h->N || i >= h->m ? 1.5 + any(seed) : 0;
        }
    }
    for (int k = 0; k < h->N; k++) {
        for (int i = 0; i < h->n; i++) {
            h->c[k * h->np + i] = any(seed);
            for (int j = 0; j < h->w; j++) {
                h->G[(k * h->n + i) * h->wp + j] = any(seed) / h->n;
            }
        }
        for (int i = 0; i < h->m; i++) {
            h->u_min[k * h->mp + i] = i % 3 == 2 ? -INFINITY : -0.5;
            h->u_max[k * h->mp + i] = i % 4 == 3 ? -0.5 : 0.2;
        }
        for (int i = 0; i < h->p; i++) {
            h->d[k * h->pp + i] = any(seed);
            h->penalty[k * h->pp + i] = 1 + any(seed);
            h->square[k * h->pp + i] = i % 2;
            for (int j = 0; j < h->w; j++) {
                h->E[(k * h->p + i) * h->wp + j] = any(seed);
            }
        }
    }
    for (int i = 0; i < h->n; i++) {
        h->start[i] = any(seed);
    }
}

static int are_in_bounds(const towline_horizon *h) {
    for (int k = 0; k < h->N; k++) {
        for (int i = 0; i < h->m; i++) {
            const double u = h->at.z[k * h->wp + i];
            if (!isfinite(u) || u < h->u_min[k * h->mp + i] || u > h->u_max[k * h->mp + i]) {
                return 0;
            }
        }
    }
    return 1;
}

int main(void) {
    const double nonsense[] = {NAN, INFINITY, -INFINITY, 1e300, -1e300};
    unsigned seed = 1;
    for (int round = 0; round < 200; round++) {
        const int N = 1 + round % 7, n = 1 + round % 11, m = 1 + round % 9, p = round % 4;
        const ptrdiff_t size = towline_horizon_size(N, n, m, p);
        double *memory = calloc((size_t)size, sizeof *memory);
        if (!memory) {
            return 1;
        }
        const towline_horizon h = towline_horizon_in(N, n, m, p, round / 4 % 2 ? PROCESSOR : 0, memory);
        fill(&h, &seed);
        for (int turn = 0; turn < 3; turn++) {
            const towline_horizon_result result = towline_solve_horizon(&h, (towline_beginning)turn, 1e-8, 50);
            if (!result.converged || !are_in_bounds(&h)) {
                printf("round %d, turn %d: converged %d\n", round, turn, result.converged);
                return 1;
            }
        }
        double *const wrong[] = {h.H, h.h, h.G, h.c, h.start, p ? h.E : h.G, p ? h.d : h.c, h.at.z, h.at.multiplier.lower};
        wrong[round % 9][0] = nonsense[round % 5];
        for (int turn = 0; turn < 3; turn++) {
            towline_solve_horizon(&h, (towline_beginning)turn, 1e-8, 50);
            if (!are_in_bounds(&h)) {
                printf("round %d, turn %d: out of bounds\n", round, turn);
                return 1;
            }
        }
        free(memory);
    }
    return towline_horizon_size(0, 1, 1, 0) || towline_horizon_size(1, 1, 1001, 0) || towline_horizon_size(1, 1, 1, -1);
}
