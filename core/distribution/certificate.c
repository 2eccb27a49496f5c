/* The direction along which a wrench is out of reach, and whether limits or the range of A make it so. */
#include "internal.h"

/*
 * Solve B^T d = push, which is in the row space of B, and write d to the rows it belongs to. For a row `worst` of the
 * wrench outside the range, d is orthogonal to the range instead, with an entry of one there.
 */
static void write_direction(form *f, int worst, real side, real *d) {
    const int rank = f->rank;
    for (int j = 0; j < rank && worst < 0; j++) { reflect(f, j, f->push); }
    for (int i = 0; i < f->n; i++) { d[i] = 0; }
    for (int j = rank - 1; j >= 0; j--) {
        real x = worst < 0 ? f->push[j] : -side * f->L[worst * ROWS + j];
        for (int i = j + 1; i < rank; i++) { x -= f->L[i * ROWS + j] * d[f->order[i]]; }
        d[f->order[j]] = x / f->L[j * ROWS + j];
    }
    if (worst >= 0) { d[f->order[worst]] = side; }
}

/* Return the largest singular value of B, that of L, to a percent or so, by 20 steps of the power method. */
static real largest_singular_value(const form *f) {
    real x[ROWS], y[ROWS], size = 0;
    for (int j = 0; j < f->rank; j++) { x[j] = 1; }
    for (int t = 0; t < 20; t++) {
        real square = 0;
        for (int j = 0; j < f->n; j++) { /* y = L x */
            y[j] = 0;
            for (int i = 0; i <= j && i < f->rank; i++) { y[j] += f->L[j * ROWS + i] * x[i]; }
        }
        for (int i = 0; i < f->rank; i++) { /* x = L^T y */
            x[i] = 0;
            for (int j = i; j < f->n; j++) { x[i] += f->L[j * ROWS + i] * y[j]; }
            square += x[i] * x[i];
        }
        size = root(square);
        for (int i = 0; i < f->rank; i++) { x[i] /= size; }
    }
    return root(size);
}

/*
 * Return whether the singular value of `direction`, along which row `worst` of the wrench is outside the range of B, is
 * small but not zero: then B does not lack that row, and limits may be what forbids w.
 */
static int is_small_but_not_zero(const form *f, int worst, const real *direction) {
    const real *left = f->B + worst * f->width;
    const real pull = dot(left, left, f->width);
    real square = 0;
    for (int i = 0; i < f->n; i++) { square += direction[i] * direction[i]; }
    return f->rank > 0 && root(pull / square) > RANK * largest_singular_value(f);
}

/*
 * Prove that the part of w that the moving cables do not reach, `missing` in row `worst`, is out of reach. The limit of
 * a fixed cable may be what forbids it: the problem is singular only if w is outside the range of all columns too.
 */
static towline_status prove_outside(form *f, const towline_problem *problem, const measure *known, int worst,
                                    real missing, towline_answer *answer) {
    write_direction(f, worst, missing > 0 ? (real)1 : (real)-1, answer->direction);
    const towline_status proven = towline_proves_infeasible(f, problem, known, answer);
    if (proven != TOWLINE_INFEASIBLE || f->columns == problem->m) { return proven; }
    const real support = answer->support, shortfall = answer->shortfall;
    real direction[ROWS];
    for (int i = 0; i < f->n; i++) { direction[i] = answer->direction[i]; }
    towline_standard_form(f, problem, 0, 1);
    f->rank = towline_reduce(f, 1);
    if (f->rank < 0) { return TOWLINE_INACCURATE; }
    towline_least_norm(f, &worst, &missing);
    if (magnitude(missing) > OUTSIDE * known->required) {
        write_direction(f, worst, missing > 0 ? (real)1 : (real)-1, answer->direction);
        return towline_proves_infeasible(f, problem, known, answer) == TOWLINE_SINGULAR ? TOWLINE_SINGULAR
                                                                                        : TOWLINE_INACCURATE;
    }
    answer->support = support;
    answer->shortfall = shortfall;
    for (int i = 0; i < f->n; i++) { answer->direction[i] = direction[i]; }
    return TOWLINE_INFEASIBLE;
}

/* Prove that limits which exclude each other exclude w. */
static towline_status prove_excluded(form *f, const towline_problem *problem, const measure *known,
                                     towline_answer *answer) {
    write_direction(f, -1, 0, answer->direction);
    const towline_status proven = towline_proves_infeasible(f, problem, known, answer);
    return proven == TOWLINE_INFEASIBLE ? proven : TOWLINE_INACCURATE;
}

towline_status towline_certify(form *f, const towline_problem *problem, const measure *known, outcome met, int worst,
                               real missing, towline_answer *answer) {
    if (!(magnitude(missing) > OUTSIDE * known->required)) {
        return met == EXCLUDED ? prove_excluded(f, problem, known, answer) : TOWLINE_INACCURATE;
    }
    const real side = missing > 0 ? (real)1 : (real)-1;
    write_direction(f, worst, side, answer->direction);
    if (!is_small_but_not_zero(f, worst, answer->direction)) {
        return prove_outside(f, problem, known, worst, missing, answer);
    }
    if (met == EXCLUDED && prove_excluded(f, problem, known, answer) == TOWLINE_INFEASIBLE) {
        return TOWLINE_INFEASIBLE;
    }
    write_direction(f, worst, side, answer->direction);
    return towline_proves_infeasible(f, problem, known, answer);
}
