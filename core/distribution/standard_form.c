/* The problem in s, of least norm; see towline_core.c, 1 to 3. */
#include "internal.h"

/* Whether a cable adds to the wrench at all: one that does not stays at its reference, and is not chosen. */
static int pulls(const towline_problem *problem, int c) {
    for (int i = 0; i < problem->n; i++) {
        if (problem->A[i * problem->m + c] != 0) { return 1; }
    }
    return 0;
}

/*
 * Bring a problem to standard form: rho > 0 for a soft answer, else 0; with `all`, fixed cables count as free. Return
 * the size of the tensions needed.
 */
real towline_standard_form(form *f, const towline_problem *problem, real rho, int all) {
    const int n = problem->n, m = problem->m;
    real t[CABLES]; /* at s = 0 */
    real heaviest = 0, size = 0;
    for (int c = 0; c < m; c++) { heaviest = larger(heaviest, weight(problem, c)); }
    f->n = n;
    f->columns = 0;
    for (int c = 0; c < m; c++) {
        t[c] = between(problem->t_min[c], reference(problem, c), problem->t_max[c]);
        if (all || (problem->t_min[c] < problem->t_max[c] && pulls(problem, c))) {
            const int i = f->columns++;
            t[c] = reference(problem, c);
            f->moving[i] = c;
            f->unit[i] = 1;
            f->low[i] = problem->t_min[c] - t[c];
            f->high[i] = problem->t_max[c] - t[c];
            if (weight(problem, c) != heaviest) {
                f->unit[i] = root(heaviest / weight(problem, c));
                f->low[i] /= f->unit[i];
                f->high[i] /= f->unit[i];
            }
            size = larger(size, magnitude(between(f->low[i], 0, f->high[i])));
        }
    }
    f->cables = f->columns;
    for (int i = 0; rho > 0 && i < n; i++) {
        const int c = f->columns++;
        f->unit[c] = 1 / root(rho);
    }
    f->width = FILLED(f->columns);
    const real per_length = 1 / problem->length;
    for (int i = 0; i < n; i++) {
        const real scale = problem->n == 6 && i >= 3 ? per_length : 1;
        const real *own = problem->A + i * m;
        real rest = problem->w[i];
        for (int c = 0; c < m; c++) { rest -= own[c] * t[c]; }
        f->scale[i] = scale;
        f->b[i] = rest * scale;
        real *row = f->B + i * f->width;
        if (f->cables == m) { /* all cables, in their order: several entries at once */
            for (int c = 0; c < m; c++) { row[c] = own[c] * scale * f->unit[c]; }
        } else {
            for (int c = 0; c < f->cables; c++) { row[c] = own[f->moving[c]] * scale * f->unit[c]; }
        }
        for (int c = f->cables; c < f->width; c++) { row[c] = c == f->cables + i && c < f->columns ? f->unit[c] : 0; }
    }
    for (int c = 0; c < FILLED(f->cables); c++) { f->push[c] = 0; }
    f->steps = f->inner = 0;
    f->margin = 0;
    return size;
}

/*
 * Make s the least norm without limits, and a basis of the null space if it has at most two dimensions. Return the size
 * of s, and in `worst` and `missing` the row whose part of b is farthest outside the range of B; -1 and 0 if there is
 * none.
 */
real towline_least_norm(form *f, int *worst, real *missing) {
    real square = 0;
    *worst = -1;
    *missing = 0;
    for (int j = 0; j < f->n; j++) {
        const real *row = f->L + j * ROWS;
        real x = f->b[f->order[j]];
        for (int i = 0; i < j && i < f->rank; i++) { x -= row[i] * f->s[i]; }
        if (j < f->rank) {
            f->s[j] = x / row[j];
            square += f->s[j] * f->s[j];
        } else if (magnitude(x) > magnitude(*missing)) {
            *missing = x;
            *worst = j;
        }
    }
    for (int c = f->rank; c < f->width; c++) { f->s[c] = 0; }
    towline_turn_back(f, f->s, f->k <= 2 ? f->k : 0);
    return root(square);
}

/* Move s to the point of least norm inside the limits. */
outcome towline_enter_limits(form *f) {
    const int last = f->rank - 1;
    f->parallel =
        last < 0 ? PARALLEL : larger(PARALLEL, PARALLEL_PIVOT * magnitude(f->L[0] / f->L[last * ROWS + last]));
    int outside = 0;
    for (int c = 0; c < f->cables; c++) {
        outside |= (f->s[c] < f->low[c] - f->slack) | (f->s[c] > f->high[c] + f->slack);
    }
    if (!outside) { return REACHED; }
    if (f->k <= 2) { /* of so few dimensions there is a basis already */
        return towline_slabs(f);
    }
    towline_turn_back(f, 0, f->k);
    return towline_dual_active_set(f);
}
