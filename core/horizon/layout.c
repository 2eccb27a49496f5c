/* Where the arrays of a horizon are in its memory. */
#include "horizon/internal.h"

enum { FOUR = 4 };

/* Memory that is given away piece by piece; NULL if it is only counted. */
typedef struct {
    double *memory;
    ptrdiff_t used;
} supply;

static double *take(supply *of, ptrdiff_t count) {
    double *piece = of->memory ? of->memory + of->used : NULL;
    of->used += (count + FOUR - 1) / FOUR * FOUR;
    return piece;
}

static int padded(int count) { return (count + FOUR - 1) / FOUR * FOUR; }

static towline_limits take_limits(supply *of, const towline_horizon *h) {
    towline_limits limits;
    limits.lower = take(of, h->bounds);
    limits.upper = take(of, h->bounds);
    limits.row = take(of, h->rows);
    limits.excess = take(of, h->rows);
    return limits;
}

static towline_iterate take_iterate(supply *of, const towline_horizon *h) {
    towline_iterate iterate;
    iterate.z = take(of, (ptrdiff_t)(h->N + 1) * h->wp);
    iterate.y = take(of, (ptrdiff_t)(h->N + 1) * h->wp);
    iterate.slack = take_limits(of, h);
    iterate.multiplier = take_limits(of, h);
    return iterate;
}

static towline_extremes take_extremes(supply *of, const towline_horizon *h) {
    towline_extremes extremes;
    extremes.gradient = take(of, h->wp);
    extremes.gap = take(of, h->np);
    extremes.control = take(of, h->mp);
    extremes.row = take(of, h->pp);
    extremes.force = take(of, h->pp);
    return extremes;
}

static void take_problem(supply *of, towline_horizon *h) {
    const ptrdiff_t N = h->N;
    h->H = take(of, (N + 1) * h->w * h->wp);
    h->h = take(of, (N + 1) * h->wp);
    h->G = take(of, N * h->n * h->wp);
    h->c = take(of, N * h->np);
    h->start = take(of, h->np);
    h->u_min = take(of, h->bounds);
    h->u_max = take(of, h->bounds);
    h->E = take(of, N * h->p * h->wp);
    h->d = take(of, h->rows);
    h->penalty = take(of, h->rows);
    h->square = take(of, h->rows);
}

static void take_work(supply *of, towline_horizon *h) {
    const ptrdiff_t N = h->N;
    h->exists = take_limits(of, h);
    h->low = take(of, h->bounds);
    h->high = take(of, h->bounds);
    h->moves = take(of, h->bounds);
    h->range = take(of, h->mp);
    h->curvature = take(of, h->mp);
    h->gradient = take(of, (N + 1) * h->wp);
    h->holding = take(of, h->bounds);
    h->gap = take(of, (N + 1) * h->np);
    h->value = take(of, h->rows);
    h->worst = take_extremes(of, h);
    h->scale = take_extremes(of, h);
    h->off = take(of, h->rows);
    h->product = take_limits(of, h);
    h->reduced = take(of, (N + 1) * h->wp);
    h->steep = take(of, h->rows);
    h->shift = take(of, h->rows);
    h->U = take(of, N * h->m * h->wp);
    h->inverse = take(of, h->bounds);
    h->P = take(of, (N + 1) * h->n * h->np);
    h->P_gap = take(of, (N + 1) * h->np);
    h->P_vector = take(of, (N + 1) * h->np);
    h->zeta = take(of, h->bounds);
    h->T = take(of, (ptrdiff_t)h->n * h->wp);
    h->M = take(of, (ptrdiff_t)h->w * h->wp);
    h->EW = take(of, (ptrdiff_t)h->p * h->wp);
    h->work = take(of, 4 * h->wp + h->pp);
    take(of, FOUR); /* blocks that do not begin at a multiple of four are read that far beyond their end */
}

static ptrdiff_t lay_out(towline_horizon *h, int N, int n, int m, int p, double *memory) {
    supply of = {memory, 0};
    h->N = N;
    h->n = n;
    h->m = m;
    h->p = p;
    h->w = m + n;
    h->np = padded(n);
    h->mp = padded(m);
    h->pp = padded(p);
    h->wp = padded(h->w);
    h->bounds = N * h->mp;
    h->rows = N * h->pp;
    h->pairs = 2 * (h->bounds + h->rows);
    h->size = 2 * (N + 1) * h->wp + 2 * h->pairs;
    take_problem(&of, h);
    h->at = take_iterate(&of, h);
    h->step = take_iterate(&of, h);
    h->best = take_iterate(&of, h);
    take_work(&of, h);
    return of.used;
}

ptrdiff_t towline_horizon_size(int N, int n, int m, int p) {
    towline_horizon h;
    if (N < 1 || n < 1 || m < 1 || p < 0 || N > TOWLINE_HORIZON_MOST || n > TOWLINE_HORIZON_MOST ||
        m > TOWLINE_HORIZON_MOST || p > TOWLINE_HORIZON_MOST) {
        return 0;
    }
    return lay_out(&h, N, n, m, p, NULL);
}

towline_horizon towline_horizon_in(int N, int n, int m, int p, int processor, double *memory) {
    towline_horizon h;
    lay_out(&h, N, n, m, p, memory);
    h.algebra = towline_algebra_for(processor);
    return h;
}
