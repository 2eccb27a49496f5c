/* The words of the core's answers: the type of numbers, the sizes of arrays, status and answer. */
#ifndef TOWLINE_TYPES_H
#define TOWLINE_TYPES_H

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

typedef enum {
    TOWLINE_OPTIMAL = 0,    /* the tensions give w inside the limits, and multipliers prove them optimal */
    TOWLINE_INFEASIBLE = 1, /* the limits forbid w: see direction and shortfall */
    TOWLINE_SINGULAR = 2,   /* no tensions of either sign, however large, give w: see direction and shortfall */
    TOWLINE_INACCURATE = 3, /* rounding keeps the core from proving any of these */
    TOWLINE_INVALID = 4     /* the numbers are no problem: NaN, crossed limits, a weight or a size out of range */
} towline_status;

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

#endif
