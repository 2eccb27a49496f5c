/*
 * Tension distribution for cable robots in C99: which tensions give a wrench inside their limits, or the proof that
 * none do.
 *
 * No allocation, no global state, bounded iterations. Real numbers are of type `towline_real`: double, or float if
 * TOWLINE_FLOAT is defined. TOWLINE_CABLES and TOWLINE_ROWS bound the size of a problem; a robot's own numbers save
 * stack. The method is explained at the head of towline_core.c.
 */
#ifndef TOWLINE_CORE_H
#define TOWLINE_CORE_H

#include "towline_types.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Within one file that has all of the core, as `towline export --step` writes, it is static, less what is not called. */
#ifdef TOWLINE_STEP
#define TOWLINE_LINKAGE static
#else
#define TOWLINE_LINKAGE
#endif

/* Weight of the squared wrench error in a soft answer, beside the squared tensions. */
#ifdef TOWLINE_FLOAT
#define TOWLINE_RHO 1e4F
#else
#define TOWLINE_RHO 1e8
#endif

/*
 * Minimise sum_i weights_i (t_i - t_ref_i)^2 subject to A t = w and t_min <= t <= t_max.
 *
 * With n == 6 rows, rows 3 to 5 are moments [N m]; they are divided by `length` [m] wherever newtons and newton metres
 * are compared. It never changes which tensions are optimal. Limits beyond 1e50 (1e15
 * in float) count as infinite. Any other number of that size is invalid, and so is a tension that must be that large.
 */
typedef struct {
    int n;                       /* rows of the wrench, 1 to TOWLINE_ROWS */
    int m;                       /* cables, 1 to TOWLINE_CABLES */
    const towline_real *A;       /* wrench matrix, n x m, row by row */
    const towline_real *w;       /* required wrench, n, [N] and [N m] */
    const towline_real *t_min;   /* m, [N]; -INFINITY is allowed */
    const towline_real *t_max;   /* m, [N]; INFINITY is allowed, equal limits fix a tension */
    const towline_real *t_ref;   /* m, [N]; NULL = 0 */
    const towline_real *weights; /* m; NULL = 1 */
    towline_real length;         /* characteristic length [m] */
    towline_real w_terms; /* size of terms that cancel in w and leave their rounding there [N]; 0 if w is exact */
} towline_problem;

#ifndef TOWLINE_STEP
/* Solve a problem. The tensions are there only if the status is optimal. */
towline_status towline_solve(const towline_problem *problem, towline_answer *answer);
#endif

/*
 * Solve a problem, and give tensions in any case but TOWLINE_INVALID: where the status is not optimal they minimise
 *
 *     sum_i weights_i / max(weights) (t_i - t_ref_i)^2 + rho |S (A t - w)|^2
 *
 * inside the limits. Status, direction and shortfall stay those of the problem itself. rho is from 1e-20 to 1e20, in
 * float from 1e-10 to 1e10; see TOWLINE_RHO.
 */
TOWLINE_LINKAGE towline_status towline_solve_always(const towline_problem *problem, towline_real rho,
                                                    towline_answer *answer);

#ifndef TOWLINE_STEP
/*
 * Minimise that cost whether or not there are tensions that give w. The status is optimal if they give it, infeasible
 * if direction and shortfall prove that none do, else inaccurate.
 */
towline_status towline_solve_soft(const towline_problem *problem, towline_real rho, towline_answer *answer);
#endif

#ifdef __cplusplus
}
#endif

#endif
