/* Proofs: nothing is called optimal, infeasible or singular that these do not confirm from the problem's data. */
#include "internal.h"

/* Return the least change of s that changes a tension by as much as the largest one, less its reference, is. */
static real scale_of_tensions(const form *f) {
    real tension = 0, unit = 0;
    for (int c = 0; c < f->columns; c++) {
        tension = larger(tension, f->unit[c] * magnitude(f->s[c]));
        unit = larger(unit, f->unit[c]);
    }
    return tension / unit;
}

/*
 * Return how far s moves when the active limits move inwards by one: |z| with n_j . z = side_j for each of them. Their
 * normals are orthogonalised one after the other, N_q = Q R, and R^T x = side is solved.
 */
static real sensitivity(const form *f, const int *active, const real *side, int count) {
    const int k = f->k, width = FILLED(k);
    real Q[CABLES * FILLED(CABLES)], x[CABLES], square = 0;
    for (int j = 0; j < count; j++) {
        real *own = Q + j * width;
        x[j] = side[active[j]];
        for (int e = 0; e < width; e++) { own[e] = e < k ? f->basis[e * f->width + active[j]] : 0; }
        for (int i = 0; i < j; i++) {
            const real along = dot(Q + i * width, own, width);
            add_to(own, -along, Q + i * width, width);
            x[j] -= along * x[i];
        }
        const real length = root(dot(own, own, width));
        for (int e = 0; e < k; e++) { own[e] /= length; }
        x[j] /= length;
        square += x[j] * x[j];
    }
    return root(square);
}

/*
 * Return whether the multipliers of the active limits prove that s is the point of least norm: all push inwards,
 * together they are its gradient in the null space, and none is so large that a limit moved by rounding would change
 * the cost.
 */
int towline_proves_optimum(const form *f, const int *active, const real *side, const real *multiplier, int count) {
    const real square = dot(f->s, f->s, f->width), size = root(square);
    for (int j = 0; j < count; j++) {
        const int i = active[j];
        if (!(multiplier[j] >= -STATIONARY * size)) { return 0; }
        /* Rounding moves a limit relative to the limit itself, at most by the slack. */
        const real moved = smaller(f->slack, SLACK * larger(magnitude(f->low[i]), magnitude(f->high[i])));
        if (multiplier[j] * moved > DECISIVE * square) { return 0; }
    }
    if (MARGINS && f->margin > 0 &&
        !(f->margin * sensitivity(f, active, side, count) <= ACCURACY * scale_of_tensions(f))) {
        return 0;
    }
    for (int e = 0; e < f->k; e++) {
        const real *row = f->basis + e * f->width;
        real rest = dot(row, f->s, f->width);
        for (int j = 0; j < count; j++) { rest -= multiplier[j] * side[active[j]] * row[active[j]]; }
        if (!(magnitude(rest) <= STATIONARY * size)) { return 0; }
    }
    return 1;
}

measure towline_measure(const form *f, const towline_problem *problem, const real *t) {
    measure known = {0, problem->w_terms};
    real terms = 0;
    for (int i = 0; i < problem->n; i++) {
        const real x = problem->w[i] * f->scale[i];
        known.required += x * x;
    }
    known.required = root(known.required);
    real squares[CABLES]; /* of the columns of S A */
    for (int c = 0; c < problem->m; c++) { squares[c] = 0; }
    for (int i = 0; i < problem->n; i++) {
        for (int c = 0; c < problem->m; c++) {
            const real x = problem->A[i * problem->m + c] * f->scale[i];
            squares[c] += x * x;
        }
    }
    for (int c = 0; c < problem->m; c++) {
        const real norm = root(squares[c]);
        known.required += norm * magnitude(between(problem->t_min[c], 0, problem->t_max[c]));
        known.rounding += norm * magnitude(reference(problem, c));
        terms += norm * magnitude(t[c]);
    }
    known.rounding += smaller(terms, CANCELLED * known.required + known.rounding);
    return known;
}

/*
 * Bound the change of s that makes t give w exactly; infinite if there may be none. Unless `exact`, t gives w but for
 * rounding.
 *
 * The least change that takes away a wrench error r has the norm of y, L y = P r. r is known up to its rounding, which
 * a running error analysis bounds (Higham, Accuracy and Stability, 3.3); the same substitution with all signs positive
 * bounds |y|. L itself is rounded, by far less than its pivots: hence twice that. Rows beyond the rank cannot be
 * corrected, and have to be zero.
 */
real towline_correction(const form *f, const towline_problem *problem, const real *t, int exact) {
    const int m = problem->m;
    real y[ROWS], square = 0;
    for (int j = 0; j < f->n; j++) {
        const real *row = f->L + j * ROWS, *own = problem->A + f->order[j] * m;
        real error = -problem->w[f->order[j]], rounded = 0;
        for (int c = 0; c < m; c++) {
            const real term = own[c] * t[c];
            error += term;
            rounded += magnitude(term) + magnitude(error);
        }
        real bound = ((exact ? magnitude(error) : 0) + UNIT_ROUNDOFF * rounded) * f->scale[f->order[j]];
        if (j >= f->rank) {
            for (int i = 0; i < f->rank; i++) { bound += magnitude(row[i]); }
            for (int i = 0; i < f->columns; i++) { bound += magnitude(f->B[j * f->width + i]); }
            if (bound > 0) { return (real)INFINITY; }
            continue;
        }
        for (int i = 0; i < j; i++) { bound += magnitude(row[i]) * y[i]; }
        y[j] = bound / magnitude(row[j]);
        square += y[j] * y[j];
    }
    return 2 * root(square);
}

/*
 * Return whether tensions that give w exactly are within the limits and near t: all s can change by the correction, and
 * it is small.
 */
int towline_proves_feasible(const form *f, const towline_problem *problem, const real *t) {
    const real change = towline_correction(f, problem, t, 1);
    for (int c = 0; c < f->columns; c++) {
        const int i = f->moving[c];
        if (!(smaller(t[i] - problem->t_min[i], problem->t_max[i] - t[i]) >= change * f->unit[c])) { return 0; }
    }
    return change <= ACCURACY * scale_of_tensions(f);
}

/* x -= (v . x) v */
static void take_away(real *x, const real *v, int n) {
    real along = 0;
    for (int i = 0; i < n; i++) { along += v[i] * x[i]; }
    for (int i = 0; i < n; i++) { x[i] -= along * v[i]; }
}

/*
 * Take from a unit direction, in the rows of S A, what rounding has left of the pulls of cables without a limit: it was
 * solved for with columns divided by the roots of their weights, and is off by as much as these differ. A column of
 * which the ones before it leave rounding only is left out. Where columns are nearly dependent the direction stays as it
 * is: what is left of them would be rounding too.
 */
static void turn_away(const form *f, const towline_problem *problem, real *d) {
    const int n = problem->n, m = problem->m;
    real basis[ROWS][ROWS]; /* orthonormal, of these cables' columns */
    int count = 0;
    for (int c = 0; c < m && count < n; c++) {
        real *v = basis[count], pull = 0, square = 0, left = 0;
        for (int i = 0; i < n; i++) {
            v[i] = f->scale[i] * problem->A[i * m + c];
            pull += v[i] * d[i];
            square += v[i] * v[i];
        }
        const int limited = magnitude(problem->t_min[c]) <= LARGEST && magnitude(problem->t_max[c]) <= LARGEST;
        if (limited || !(magnitude(pull) <= NEGLIGIBLE * root(square))) { continue; }
        for (int j = 0; j < count; j++) { take_away(v, basis[j], n); }
        for (int i = 0; i < n; i++) { left += v[i] * v[i]; }
        if (left <= DEPENDENT * DEPENDENT * square) { continue; }
        if (!(left > RANK * square)) { return; }
        for (int i = 0; i < n; i++) { v[i] /= root(left); }
        count++;
    }
    for (int j = 0; j < count; j++) { take_away(d, basis[j], n); }
}

/*
 * Check whether the scaled direction in `answer`, made unit and unscaled here, proves w out of reach: by how much d . w
 * exceeds the most that tensions inside the limits can give along d. Fill support and shortfall.
 *
 * The doubt has in it the rounding of each pull, times the limit. Of a cable without a limit a pull is accepted that is
 * smaller than ROUNDING: it gives no more along d than A t is rounded by. If it is more than the rounding of its terms,
 * the doubt has in it what it gives with the largest tension that counts.
 */
towline_status towline_proves_infeasible(const form *f, const towline_problem *problem, const measure *known,
                                         towline_answer *answer) {
    const int n = problem->n, m = problem->m;
    real *d = answer->direction;
    real demand = 0, support = 0, rounding = known->rounding;
    towline_status status = TOWLINE_SINGULAR;
    real square = 0;
    for (int i = 0; i < n; i++) { square += d[i] * d[i]; }
    if (!(0 < square && square < (real)INFINITY)) { return TOWLINE_INACCURATE; }
    const real per_length = 1 / root(square);
    for (int i = 0; i < n; i++) { d[i] *= per_length; }
    turn_away(f, problem, d);
    for (int i = 0; i < n; i++) {
        d[i] *= f->scale[i];
        demand += d[i] * problem->w[i];
    }
    for (int c = 0; c < m; c++) {
        real pull = 0, terms = 0, norm = 0;
        for (int i = 0; i < n; i++) {
            const real entry = problem->A[i * m + c], x = d[i] * entry, scaled = f->scale[i] * entry;
            pull += x;
            terms += magnitude(x);
            norm += scaled * scaled;
        }
        norm = root(norm);
        const real limit = pull > 0 ? problem->t_max[c] : problem->t_min[c];
        if (magnitude(pull) > NEGLIGIBLE * norm) { status = TOWLINE_INFEASIBLE; }
        if (magnitude(limit) <= LARGEST) { /* what it gives is known, and counts at any size */
            support += pull * limit;
            rounding += REACH_OF_PULL * magnitude(pull * limit) + REACH_OF_TERMS * terms * magnitude(limit);
        } else if (magnitude(pull) > ORTHOGONAL * norm) {
            return TOWLINE_INACCURATE; /* it gives any amount */
        } else if (magnitude(pull) > ROUNDED_PULL * terms) {
            rounding += magnitude(pull) / norm * (CANCELLED / ROUNDING) * known->required;
        }
    }
    answer->support = support;
    answer->shortfall = demand - support;
    return answer->shortfall > CLEAR * (FEASIBILITY * known->required + ROUNDING * rounding) ? status
                                                                                             : TOWLINE_INACCURATE;
}
