/*
 * The numbers by which results are judged, all relative. Those of double that Python has too are in
 * base/tolerances.py: both languages give the same status.
 */
#ifndef TOWLINE_TOLERANCES_H
#define TOWLINE_TOLERANCES_H

#ifndef TOWLINE_FLOAT

#define LARGEST 1e50       /* of A, w and t_ref; limits beyond it count as infinite */
#define HEAVIEST 1e20      /* weights and length lie between 1 / HEAVIEST and HEAVIEST */
#define WEIGHTS_APART 1e14 /* the heaviest weight relative to the lightest */
#define FEASIBILITY 1e-9   /* wrench error that is accepted, relative to what the problem requires */
#define ROUNDING 1e-13     /* rounding of a matrix-vector product, relative to the sum of the absolute terms */
#define CANCELLED 1e10     /* terms of A t count up to this many times what the problem requires */
#define NEGLIGIBLE 1e-11   /* a cable pulls along d only beyond this part of its column norm; else w is off the range */
#define ORTHOGONAL 1e-13   /* a cable without a limit may pull by this part of its column norm: rounding */
#define DEPENDENT 1e-14    /* part of a column's norm outside the span of others that is rounding */
#define ROUNDED_PULL 1e-15 /* it counts beyond this part of its terms, with tensions up to CANCELLED */
#define CLEAR 4.0          /* a shortfall is beyond doubt from this many tolerances */
#define RANK 1e-12         /* singular values below this part of the largest make a problem singular */
#define OUTSIDE 1e-10      /* part of w outside the range of A that makes a problem singular */
#define SURE_PIVOT 1e-9    /* a pivot above this part of the largest counts; */
#define SMALL_PIVOT 4e-11  /* one below this part only if w needs it; between them the rank is in doubt */
#define RECOUNT 1e-12      /* square of a pivot, relative to the first, below which rows are measured anew */
#define SLACK 1e-12        /* how far s may pass a limit, relative to the size of s */
#define PARALLEL 1e-11     /* length of a normal that is rounding, and */
#define PARALLEL_PIVOT 2e-15  /* its part of the largest pivot, over the least: the null space is known to that */
#define STATIONARY 1e-10      /* part of the gradient that the multipliers may leave, relative to the size of s */
#define DECISIVE 1e-5         /* relative change of the cost if limits move by the slack: above it rounding chooses */
#define REACH_OF_PULL 1e2     /* of the reach of a cable along d this many ROUNDINGs are in doubt, */
#define REACH_OF_TERMS 1e-2   /* and this many of its limit times the terms that its pull is the sum of */
#define UNIT_ROUNDOFF 1.2e-16 /* of one operation */
#define MARGINS 0             /* 1 if s keeps a margin to its limits, by which tensions are proven feasible */
#define ACCURACY 0.0          /* error that margins and rounding may make, relative to the largest tension */

#else

/*
 * With u = 2^-24 = 6e-8 none of the numbers above can hold. These follow from u, n <= 6 rows and m <= 16 cables:
 *
 * - A product of n or m terms is rounded by at most (m + 2) u = 18 u of the sum of its absolute terms: ROUNDING = 32 u.
 * - A reduction of n rows is rounded by about n (m + 2) u = 108 u of the largest row, by experience a tenth of it at
 *   most. SMALL_PIVOT is 100 u, and SURE_PIVOT so far above it that a pivot has two digits at least.
 * - Lengths and sines of normals come from the same reduction: PARALLEL is 160 u.
 * - d has a rounded pull of (n + 1) u from each column of norm one, before that of solving for it: NEGLIGIBLE = 64 u.
 *   It tells singular from infeasible only: each pull counts, and its rounding and that of their sum, (n + m + 2) u =
 *   24 u of its terms times the limit, are below CLEAR times half a ROUNDING = 64 u. A cable without a limit along d
 *   leaves all in doubt unless its pull is exactly zero. DEPENDENT is 16 u: the rounding of a difference of columns.
 * - FEASIBILITY bounds the wrench error of what is called optimal, as for double, and it is no proof: an infeasible
 *   problem may be missed by less. The proof is a margin; see `towline_proves_feasible`.
 * - ACCURACY keeps the error below what a user may expect, 1e-4 of the largest tension. SLACK and STATIONARY, and with
 *   them what the multipliers leave, are far below it. DECISIVE is nearly the root of that of double: the cost is
 *   quadratic.
 */
#define LARGEST 1e15F
#define HEAVIEST 1e10F
#define WEIGHTS_APART 1e5F
#define FEASIBILITY 1e-5F
#define ROUNDING 2e-6F
#define CANCELLED 5e2F
#define NEGLIGIBLE 4e-6F
#define ORTHOGONAL 0.0F
#define DEPENDENT 1e-6F
#define ROUNDED_PULL 0.0F
#define CLEAR 4.0F
#define RANK 6e-6F
#define OUTSIDE 1e-5F
#define SURE_PIVOT 1e-3F
#define SMALL_PIVOT 6e-6F
#define RECOUNT 1e-4F
#define SLACK 2e-6F
#define PARALLEL 1e-5F
#define PARALLEL_PIVOT 1e-6F
#define STATIONARY 2e-5F
#define DECISIVE 1e-2F
#define REACH_OF_PULL 0.0F
#define REACH_OF_TERMS 0.5F
#define UNIT_ROUNDOFF 6e-8F
#define MARGINS 1
#define ACCURACY 8e-5F

#endif

#endif
