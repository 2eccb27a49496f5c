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

#ifdef __cplusplus
extern "C" {
#endif

#ifdef TOWLINE_FLOAT
typedef float towline_real;
#else
typedef double towline_real;
#endif

#ifndef TOWLINE_CABLES
#define TOWLINE_CABLES 16
#endif
#ifndef TOWLINE_ROWS
#define TOWLINE_ROWS 6
#endif

/* Weight of the squared wrench error in a soft answer, beside the squared tensions. */
#ifdef TOWLINE_FLOAT
#define TOWLINE_RHO 1e4F
#else
#define TOWLINE_RHO 1e8
#endif

typedef enum {
    TOWLINE_OPTIMAL = 0,    /* the tensions give w inside the limits, and multipliers prove them optimal */
    TOWLINE_INFEASIBLE = 1, /* the limits forbid w: see direction and shortfall */
    TOWLINE_SINGULAR = 2,   /* no tensions of either sign, however large, give w: see direction and shortfall */
    TOWLINE_INACCURATE = 3, /* rounding keeps the core from proving any of these */
    TOWLINE_INVALID = 4     /* the numbers are no problem: NaN, crossed limits, a weight or a size out of range */
} towline_status;

/*
 * Minimise sum_i weights_i (t_i - t_ref_i)^2 subject to A t = w and t_min <= t <= t_max.
 *
 * With n == 6 rows, rows 3 to 5 are moments [N m]; they are divided by `length` [m] wherever newtons and newton metres
 * are compared. It never changes which tensions are optimal.
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
} towline_problem;

typedef struct {
    towline_status status;
    int soft;           /* 1 if the tensions are a soft answer, which need not give w */
    int soft_is_proven; /* by `towline_solve_soft`: 1 if multipliers prove the minimum */
    int steps;          /* limits that the method added to its set, in both solves of a soft answer */
    int inner;          /* cuts of an edge (m - rank <= 2), else projections on the null space */
    towline_real tensions[TOWLINE_CABLES]; /* [N], inside the limits; only if optimal or soft */
    towline_real residual;                 /* wrench error |S (A t - w)| of those tensions [N], S dividing moments */
    towline_real direction[TOWLINE_ROWS];  /* only if infeasible or singular: d with d . A t <= support < d . w */
    towline_real support;                  /* for all t inside the limits; d . w and support are in [N] */
    towline_real shortfall;                /* d . w - support [N] */
} towline_answer;

/* Solve a problem. The tensions are there only if the status is optimal. */
towline_status towline_solve(const towline_problem *problem, towline_answer *answer);

/*
 * Solve a problem, and give tensions in any case but TOWLINE_INVALID: where the status is not optimal they minimise
 *
 *     sum_i weights_i / max(weights) (t_i - t_ref_i)^2 + rho |S (A t - w)|^2
 *
 * inside the limits. Status, direction and shortfall stay those of the problem itself. rho is from 1e-20 to 1e20, in
 * float from 1e-10 to 1e10; see TOWLINE_RHO.
 */
towline_status towline_solve_always(const towline_problem *problem, towline_real rho, towline_answer *answer);

/*
 * Minimise that cost whether or not there are tensions that give w. The status is optimal if they give it, infeasible
 * if direction and shortfall prove that none do, else inaccurate.
 */
towline_status towline_solve_soft(const towline_problem *problem, towline_real rho, towline_answer *answer);

#ifdef __cplusplus
}
#endif

#endif
