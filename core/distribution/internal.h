/* What the files of the core share; none of it is for users. */
#ifndef TOWLINE_INTERNAL_H
#define TOWLINE_INTERNAL_H

#include <math.h>

#include "tolerances.h"
#include "towline_core.h"

/* For functions with arrays of their own, which are to be on the stack only while they run. */
#ifdef __GNUC__
#define NOT_INLINE __attribute__((noinline))
#else
#define NOT_INLINE
#endif

typedef towline_real real;

enum {
    ROWS = TOWLINE_ROWS,
    CABLES = TOWLINE_CABLES,
    COLUMNS = TOWLINE_CABLES + TOWLINE_ROWS /* a soft answer has one more column for each row */
};

/* Rows of matrices are filled up with zeros to a multiple of four numbers, which `dot` and `add_to` take at a time. */
#define FILLED(count) (((count) + 3) / 4 * 4)

/* The problem in s, least norm: minimise |s|^2 subject to B s = b, low <= s <= high; see towline_core.c. */
typedef struct {
    int n;                          /* rows of B */
    int cables;                     /* cables whose limits differ */
    int columns;                    /* columns of B: those cables and the missing wrench of a soft answer */
    int width;                      /* FILLED(columns): numbers from one row of B, or of the basis, to the next */
    int rank;                       /* of B */
    int k;                          /* dimensions of the null space: columns - rank */
    int moving[CABLES];             /* the cable of each column, for the first `cables` */
    int order[ROWS];                /* row `order[j]` of the problem is row j of B */
    real scale[ROWS];               /* of the wrench rows: 1, or 1 / length for a moment */
    real B[ROWS * FILLED(COLUMNS)]; /* later the reflectors, and what is left of rows beyond the rank */
    real L[ROWS * ROWS];
    real tau[ROWS];
    real b[ROWS];
    real unit[COLUMNS]; /* newtons in one unit of s */
    real low[CABLES];   /* of the cables; the missing wrench has no limits */
    real high[CABLES];
    real s[FILLED(COLUMNS)];
    real push[FILLED(CABLES)]; /* multipliers of limits that exclude each other, in the row space of B */
    real basis[(CABLES > 1 ? CABLES : 2) *
               FILLED(COLUMNS)]; /* of the null space, by rows; its columns are normals of slabs */
    real slack;                  /* how far s may pass a limit */
    real parallel;               /* length of a normal, or of its part outside the span of others, that is rounding */
    real margin;                 /* how far the limits were moved inwards; 0 in double */
    int steps;
    int inner;
} form;

/* What a problem requires, and what rounding leaves of it; see `towline_measure`. */
typedef struct {
    real required; /* |S w| and the wrench of the tensions nearest to zero [N] */
    real rounding; /* sum of the terms that are rounded [N] */
} measure;

typedef enum { REACHED, EXCLUDED, DOUBTFUL } outcome;

static inline real magnitude(real x) { return x < 0 ? -x : x; }

static inline real smaller(real x, real y) { return x < y ? x : y; }

static inline real larger(real x, real y) { return x > y ? x : y; }

static inline real between(real low, real x, real high) { return smaller(larger(low, x), high); }

static inline real root(real x) {
#ifdef TOWLINE_FLOAT
    return sqrtf(x);
#else
    return sqrt(x);
#endif
}

/* In four sums: a processor adds two or four of them at once, and everywhere they are the same. */
static inline real dot(const real *x, const real *y, int count) {
    real a = 0, b = 0, c = 0, d = 0;
    for (int i = 0; i < count; i += 4) {
        a += x[i] * y[i];
        b += x[i + 1] * y[i + 1];
        c += x[i + 2] * y[i + 2];
        d += x[i + 3] * y[i + 3];
    }
    return (a + b) + (c + d);
}

/* y += factor x */
static inline void add_to(real *restrict y, real factor, const real *restrict x, int count) {
    for (int i = 0; i < count; i += 4) {
        y[i] += factor * x[i];
        y[i + 1] += factor * x[i + 1];
        y[i + 2] += factor * x[i + 2];
        y[i + 3] += factor * x[i + 3];
    }
}

/* Apply reflector j to x: subtract tau v v^T x, with v = B[j], which is zero before column j; see reduction.c. */
static inline void reflect(const form *f, int j, real *x) {
    const int from = j / 4 * 4, count = f->width - from;
    const real *v = f->B + j * f->width + from;
    add_to(x + from, -f->tau[j] * dot(v, x + from, count), v, count);
}

static inline real reference(const towline_problem *problem, int i) { return problem->t_ref ? problem->t_ref[i] : 0; }

static inline real weight(const towline_problem *problem, int i) { return problem->weights ? problem->weights[i] : 1; }

/* standard_form.c */
TOWLINE_LINKAGE real towline_standard_form(form *f, const towline_problem *problem, real rho, int all);
TOWLINE_LINKAGE real towline_least_norm(form *f, int *worst, real *missing);
TOWLINE_LINKAGE outcome towline_enter_limits(form *f);

/* reduction.c */
TOWLINE_LINKAGE int towline_reduce(form *f, int cut);
TOWLINE_LINKAGE void towline_turn_back(form *f, real *s, int dimensions);

/* slabs.c and dual_active_set.c: move s to the point of least norm inside the limits. */
NOT_INLINE TOWLINE_LINKAGE outcome towline_slabs(form *f);
NOT_INLINE TOWLINE_LINKAGE outcome towline_dual_active_set(form *f);

/* proof.c */
TOWLINE_LINKAGE int towline_proves_optimum(const form *f, const int *active, const real *side, const real *multiplier,
                                           int count);
TOWLINE_LINKAGE measure towline_measure(const form *f, const towline_problem *problem, const real *t);
TOWLINE_LINKAGE real towline_correction(const form *f, const towline_problem *problem, const real *t, int exact);
TOWLINE_LINKAGE int towline_proves_feasible(const form *f, const towline_problem *problem, const real *t);
TOWLINE_LINKAGE towline_status towline_proves_infeasible(const form *f, const towline_problem *problem,
                                                         const measure *known, towline_answer *answer);

/*
 * certificate.c: prove that w is out of reach, where the method `met` that outcome and `missing`, in row `worst`, is
 * the part of b outside the range of B.
 */
TOWLINE_LINKAGE towline_status towline_certify(form *f, const towline_problem *problem, const measure *known,
                                               outcome met, int worst, real missing, towline_answer *answer);

#endif
