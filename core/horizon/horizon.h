/*
 * The quadratic program of predictive control, stage by stage; docs/horizon.md has the problem and the method.
 *
 * The variables of a stage are z = (u, x). With stages k = 0, ..., N - 1 and the state of stage 0 given,
 *
 *     minimise sum of 1/2 z_k' H_k z_k + h_k' z_k + penalty_k' s_k + 1/2 s_k' diag(square_k) s_k, and the same of x_N
 *     subject to x_(k+1) = G_k z_k + c_k,  u_min_k <= u_k <= u_max_k,  E_k z_k <= d_k + s_k,  s_k >= 0
 *
 * Rows of all arrays are padded to multiples of four numbers, which stay 0.
 */
#ifndef TOWLINE_HORIZON_H
#define TOWLINE_HORIZON_H

#include <stddef.h>
#include <stdint.h>

#include "horizon/matrices.h"

/* One number for each limit: of bounds of controls (N, mp) and of soft rows (N, pp). One piece of memory. */
typedef struct {
    double *lower, *upper;
    double *row, *excess; /* E z <= d + s, and s >= 0 */
} towline_limits;

/* A point, or a step. One piece of memory. */
typedef struct {
    double *z; /* (N + 1, wp): (u, x) */
    double *y; /* (N + 1, wp): (0, y), y the multiplier of the dynamics that end in x */
    towline_limits slack, multiplier;
} towline_iterate;

/* The largest error of each condition over the stages, or the largest of its terms. */
typedef struct {
    double *gradient; /* (wp) */
    double *gap;      /* (np) */
    double *control;  /* (mp): product of slack and multiplier, or size of the control */
    double *row;      /* (pp): the same of soft rows, or the size of their terms */
    double *force;    /* (pp): size of their multipliers, no error */
} towline_extremes;

typedef struct {
    int N, n, m, p, w;  /* stages, states, controls, soft rows of a stage; w = m + n */
    int np, mp, pp, wp; /* the same, padded */
    int bounds, rows;   /* N mp and N pp: numbers of an array of `towline_limits` */
    int pairs;          /* 2 (bounds + rows): of all four */
    int size;           /* of an iterate */
    const towline_algebra *algebra;
    /* The problem. */
    double *H;                    /* (N + 1, w, wp): [[R, S], [S', Q]], at the end Q alone; S' is written by a solve */
    double *h;                    /* (N + 1, wp): (r, q) */
    double *G;                    /* (N, n, wp): [B, A] */
    double *c;                    /* (N, np) */
    double *start;                /* (np): the state of stage 0 */
    double *u_min, *u_max;        /* (N, mp) */
    double *E;                    /* (N, p, wp): [D, C] */
    double *d, *penalty, *square; /* (N, pp) */
    towline_iterate at;           /* the iterate, and in the end the solution */
    towline_iterate step, best;   /* its change, and the best one so far */
    /* What does not change during a solve. */
    towline_limits exists;     /* 1 where there is such a limit, else 0 */
    double *low, *high;        /* (N, mp): u_min and u_max but for fixed controls, which have no limits */
    double *moves;             /* (N, mp): 0 for fixed controls, else 1 */
    double *range, *curvature; /* (mp): largest of u_max - u_min, and of the cost by a control and by what it moves */
    /* Conditions of optimality at the iterate. */
    double *gradient; /* (N + 1, wp): of the Lagrangian, for the variables that can change */
    double *holding;  /* (N, mp): the same for controls, fixed ones too */
    double *gap;      /* (N + 1, np): of the dynamics that end in x */
    double *value;    /* (N, pp): E z - d */
    towline_extremes worst, scale;
    /* The linear system. */
    double *off;                  /* (N, pp): value - excess + slack */
    towline_limits product;       /* what slack times multiplier is to change by */
    double *reduced;              /* (N + 1, wp): the gradient after slacks and multipliers are eliminated */
    double *steep, *shift;        /* (N, pp): weights of soft rows after that, and what is added to weight times row */
    double *U, *inverse;          /* (N, m, wp) and (N, mp): the first rows of the Cholesky factor, see matrices.h */
    double *P, *P_gap, *P_vector; /* cost to go: (N + 1, n, np), times the gap (N + 1, np), and linear (N + 1, np) */
    double *zeta;                 /* (N, mp): what is left for the controls to do */
    double *T, *M, *EW;           /* (n, wp), (w, wp), (p, wp) */
    double *work;                 /* (4 wp + pp) */
} towline_horizon;

enum { TOWLINE_HORIZON_MOST = 1000 }; /* stages, states, controls, rows */

/* How many numbers of memory a horizon needs; 0 if a size is out of range. */
ptrdiff_t towline_horizon_size(int N, int n, int m, int p);

/* A horizon in that memory, which is zero at first; `processor` is that of towline_processor. */
towline_horizon towline_horizon_in(int N, int n, int m, int p, int processor, double *memory);

/*
 * Write the same problem in differences from a reference, states (N + 1, n) and controls (N, m) without padding: start,
 * dynamics, bounds, soft rows and iterate change; costs are those of differences already.
 */
void towline_horizon_relative_to(const towline_horizon *h, const double *states, const double *controls);

/* What a solve begins with: nothing, the iterate in memory, or that iterate moved by one stage. */
typedef enum { TOWLINE_COLD, TOWLINE_WARM, TOWLINE_SHIFTED } towline_beginning;

/* Errors of the conditions of optimality, each relative to the largest of its terms. */
typedef struct {
    double stationarity, dynamics, complementarity, soft;
} towline_residuals;

typedef struct {
    towline_residuals residuals;
    int iterations; /* Newton matrices, without the one of a cold start */
    int converged;
} towline_horizon_result;

/*
 * Solve the problem in memory, for the largest residual of a solution and the largest number of iterations. Where it does
 * not converge, `at` is the best iterate; controls are always finite and in their bounds, and x is what they lead to.
 */
towline_horizon_result towline_solve_horizon(const towline_horizon *h, towline_beginning beginning, double tolerance,
                                             int iterations_max);

#endif
