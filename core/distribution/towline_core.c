/*
 * How it works.
 *
 * 1. Standard form. S divides moments by the length. With s_i = sqrt(omega_i / max omega) (t_i - t_ref_i) for each
 *    cable whose limits differ, the problem
 *
 *        minimise sum_i omega_i (t_i - t_ref_i)^2   subject to   A t = w,   t_min <= t <= t_max
 *
 *    becomes: the s of least norm with B s = b, low <= s <= high. The columns of B are those of S A, scaled; b is S w
 *    less the wrench of t_ref and of the fixed cables.
 *
 * 2. Reduction (reduction.c). B = P^T [L 0] Q with Q orthonormal, largest row first. The pivots decide the rank; if one
 *    lies where rounding cannot be told from data, the answer is TOWLINE_INACCURATE. L y = P b and s_0 = Q^T [y; 0] is
 *    the least norm without limits. Columns rank, rank + 1, ... of Q^T are an orthonormal basis N of the null space:
 *    all s = s_0 + N z give b, |s|^2 = |s_0|^2 + |z|^2, and each cable is a slab low_i <= s_0i + n_i . z <= high_i.
 *
 * 3. The point of least norm in these slabs. If s_0 is in all of them it is s_0. Else with m - rank of 0, 1 or 2
 *    slabs.c takes one slab after the other: at most m steps and m (m - 1) / 2 cuts. Above, a dual active-set method
 *    (dual_active_set.c) takes at most 10 m + 20 steps. Either ends at a point with multipliers, or at limits that
 *    exclude each other.
 *
 * 4. Proof (proof.c). Tensions are optimal if, inside their limits, their wrench error is below
 *
 *        1e-9 (|S w| + sum_i |S a_i| |u_i|) + 1e-13 sum_i |S a_i| (|t_i| + |t_ref_i|)
 *
 *    with u_i the tension inside the limits that is nearest to zero, the terms of t up to 1e10 times the first sum and
 *    those of t_ref, and if the multipliers are their gradient in the null space. Limits that exclude each other give
 *    a direction: their multipliers x satisfy N^T x = 0, so that x = B^T d has a solution d, and the shortfall
 *
 *        d . w - max { d . A t : t_min <= t <= t_max } > 0
 *
 *    is computed from A, w and the limits alone (certificate.c). What neither proves is TOWLINE_INACCURATE.
 *
 * 5. Soft answer. The missing wrench is S^-1 e with e as n more columns, without limits and of weight rho. That problem
 *    always has a solution, which steps 2 and 3 compute. [A S^-1] has rank n, also in floating point: no reflector
 *    touches a row's own column of S^-1 before the row is a pivot itself. The tensions are inside the limits to the
 *    last bit, whatever rounding did.
 *
 * In float the limits are first moved inwards by a few roundings, and the tensions count as optimal only if
 * `towline_proves_feasible` confirms that exact ones are near: a problem that is infeasible by less than rounding is
 * TOWLINE_INACCURATE, never optimal.
 */
#include "internal.h"

/* Return whether all numbers are below LARGEST: the sum of their squares answers that for most problems, at once. */
static int are_below_largest(const real *x, int count) {
    real a = 0, b = 0, c = 0, d = 0;
    int i = 0;
    for (; i + 3 < count; i += 4) { /* as in `dot` */
        a += x[i] * x[i];
        b += x[i + 1] * x[i + 1];
        c += x[i + 2] * x[i + 2];
        d += x[i + 3] * x[i + 3];
    }
    for (; i < count; i++) { a += x[i] * x[i]; }
    if ((a + b) + (c + d) < LARGEST * LARGEST) { return 1; }
    for (i = 0; i < count && magnitude(x[i]) < LARGEST; i++) {}
    return i == count;
}

static int is_valid(const towline_problem *problem) {
    const int n = problem->n, m = problem->m;
    if (n < 1 || n > TOWLINE_ROWS || m < 1 || m > TOWLINE_CABLES) { return 0; }
    if (!(problem->length >= 1 / HEAVIEST && problem->length <= HEAVIEST)) { return 0; }
    real heaviest = 0, lightest = HEAVIEST;
    int wrong = 0;
    for (int c = 0; c < m; c++) {
        const real low = problem->t_min[c], high = problem->t_max[c], omega = weight(problem, c);
        wrong |= !((low <= LARGEST) & (high >= -LARGEST) & (low <= high));
        wrong |= !((omega >= 1 / HEAVIEST) & (omega <= HEAVIEST));
        heaviest = larger(heaviest, omega);
        lightest = smaller(lightest, omega);
    }
    return !wrong && heaviest <= WEIGHTS_APART * lightest && are_below_largest(problem->A, n * m) &&
           are_below_largest(problem->w, n) && (!problem->t_ref || are_below_largest(problem->t_ref, m));
}

static int is_in_range(real weight) { return weight >= 1 / HEAVIEST && weight <= HEAVIEST; }

/* Write the tensions of s, moved inside the limits if rounding put them outside. */
static void write_tensions(const form *f, const towline_problem *problem, real *t) {
    for (int c = 0; c < problem->m; c++) {
        t[c] = between(problem->t_min[c], reference(problem, c), problem->t_max[c]);
    }
    for (int c = 0; c < f->cables; c++) {
        const int i = f->moving[c];
        t[i] = between(problem->t_min[i], reference(problem, i) + f->unit[c] * f->s[c], problem->t_max[i]);
    }
}

/*
 * Leave space between s and its limits for the correction that exact tensions need; return 0 if a cable has no such
 * space. The correction is estimated at the least norm, moved inside the limits; `t` is overwritten.
 */
static int move_limits_inwards(form *f, const towline_problem *problem, real *t) {
    write_tensions(f, problem, t);
    const real change = towline_correction(f, problem, t, 0);
    f->margin = f->slack + (change < (real)INFINITY ? 3 * change : 0);
    for (int c = 0; c < f->cables; c++) {
        f->low[c] += f->margin;
        f->high[c] -= f->margin;
        if (!(f->low[c] <= f->high[c])) { return 0; }
    }
    return 1;
}

/* Return |S (A t - w)|. */
static real wrench_error(const form *f, const towline_problem *problem, const real *t) {
    real square = 0;
    for (int i = 0; i < problem->n; i++) {
        real error = -problem->w[i];
        for (int c = 0; c < problem->m; c++) { error += problem->A[i * problem->m + c] * t[c]; }
        error *= f->scale[i];
        square += error * error;
    }
    return root(square);
}

/*
 * Take from tensions the wrench error that rounding has left where weights differ much: s is known to the rounding of
 * its largest entry, and a cable of small weight has many newtons in a unit of s. So that they stay the optimum, cables
 * as near to a limit as that are put there and stay there, and a large change is not made. f->s and f->b are lost.
 */
static void refine(form *f, const towline_problem *problem, real *t) {
    const real size = root(dot(f->s, f->s, f->width));
    int worst;
    real missing;
    for (int i = 0; i < f->cables; i++) {
        const int c = f->moving[i];
        const real near = f->slack * f->unit[i];
        t[c] = t[c] - problem->t_min[c] <= near   ? problem->t_min[c]
               : problem->t_max[c] - t[c] <= near ? problem->t_max[c]
                                                  : t[c];
    }
    for (int i = 0; i < problem->n; i++) {
        real rest = problem->w[i];
        for (int c = 0; c < problem->m; c++) { rest -= problem->A[i * problem->m + c] * t[c]; }
        f->b[i] = rest * f->scale[i];
    }
    if (!(towline_least_norm(f, &worst, &missing) <= STATIONARY * size)) { return; }
    for (int i = 0; i < f->cables; i++) {
        const int c = f->moving[i];
        if (problem->t_min[c] < t[c] && t[c] < problem->t_max[c]) {
            t[c] = between(problem->t_min[c], t[c] + f->unit[i] * f->s[i], problem->t_max[c]);
        }
    }
}

/* Solve a problem, all of `answer` but the status. */
static towline_status solve_exactly(form *f, const towline_problem *problem, towline_answer *answer) {
    int worst;
    real missing, *t = answer->tensions;
    answer->soft = answer->soft_is_proven = answer->steps = answer->inner = 0;
    answer->residual = answer->support = answer->shortfall = 0;
    if (!is_valid(problem)) { return TOWLINE_INVALID; }
    const real size = towline_standard_form(f, problem, 0, 0);
    f->rank = towline_reduce(f, 1);
    if (f->rank < 0) { return TOWLINE_INACCURATE; }
    f->k = f->columns - f->rank;
    f->slack = SLACK * larger(size, towline_least_norm(f, &worst, &missing));
    if (MARGINS && !move_limits_inwards(f, problem, t)) { return TOWLINE_INACCURATE; }
    const outcome met = towline_enter_limits(f);
    answer->steps = f->steps;
    answer->inner = f->inner;
    write_tensions(f, problem, t);
    const measure known = towline_measure(f, problem, t);
    if (met == REACHED) {
        const real allowed = FEASIBILITY * known.required + ROUNDING * known.rounding;
        answer->residual = wrench_error(f, problem, t);
        if (!MARGINS && !(answer->residual <= allowed)) {
            refine(f, problem, t);
            answer->residual = wrench_error(f, problem, t);
        }
        if (answer->residual <= allowed) {
            return !MARGINS || towline_proves_feasible(f, problem, t) ? TOWLINE_OPTIMAL : TOWLINE_INACCURATE;
        }
    }
    return towline_certify(f, problem, &known, met, worst, missing, answer);
}

#ifndef TOWLINE_STEP
towline_status towline_solve(const towline_problem *problem, towline_answer *answer) {
    form f;
    return answer->status = solve_exactly(&f, problem, answer);
}
#endif

/* Fill tensions and residual of a soft answer. */
static outcome solve_softly(form *f, const towline_problem *problem, real rho, towline_answer *answer) {
    int worst;
    real missing;
    const real size = towline_standard_form(f, problem, rho, 0);
    f->rank = towline_reduce(f, 0);
    f->k = f->columns - f->rank;
    f->slack = SLACK * larger(size, towline_least_norm(f, &worst, &missing));
    const outcome met = towline_enter_limits(f);
    answer->soft = 1;
    answer->steps += f->steps;
    answer->inner += f->inner;
    write_tensions(f, problem, answer->tensions);
    answer->residual = wrench_error(f, problem, answer->tensions);
    return met;
}

towline_status towline_solve_always(const towline_problem *problem, towline_real rho, towline_answer *answer) {
    form f;
    answer->status = solve_exactly(&f, problem, answer);
    if (!is_in_range(rho)) { answer->status = TOWLINE_INVALID; }
    if (answer->status != TOWLINE_OPTIMAL && answer->status != TOWLINE_INVALID) {
        solve_softly(&f, problem, rho, answer); /* without proof: these tensions are what there is */
    }
    return answer->status;
}

#ifndef TOWLINE_STEP
towline_status towline_solve_soft(const towline_problem *problem, towline_real rho, towline_answer *answer) {
    form f;
    answer->soft = answer->soft_is_proven = answer->steps = answer->inner = 0;
    answer->residual = answer->support = answer->shortfall = 0;
    if (!is_valid(problem) || !is_in_range(rho)) { return answer->status = TOWLINE_INVALID; }
    answer->soft_is_proven = solve_softly(&f, problem, rho, answer) == REACHED;
    const measure known = towline_measure(&f, problem, answer->tensions);
    if (answer->residual <= FEASIBILITY * known.required + ROUNDING * known.rounding) {
        return answer->status = TOWLINE_OPTIMAL;
    }
    for (int i = 0; i < problem->n; i++) { /* what is missing is the direction */
        answer->direction[i] = f.s[f.cables + i];
    }
    answer->status = towline_proves_infeasible(&f, problem, &known, answer);
    if (answer->status == TOWLINE_SINGULAR) { answer->status = TOWLINE_INACCURATE; }
    return answer->status;
}
#endif
