"""Places of numbers in the one array on which the kernels of `horizon` work: constants alone, copied into machine code.

A stage's variables are one vector z = (u, x) of w = m + n numbers. Rows of matrices are padded to a multiple of eight.
"""

# Entries of `at`, the array of whole numbers that the kernels get: sizes first. Padded sizes: MP of m, NP of n, PP of
# p, WP of w. PAIRS: how many pairs of slack and multiplier there are: lower bounds (STAGES, MP), upper bounds, rows
# (STAGES, PP) with their slack, rows with their excess.
STAGES, N, M, P, W, NP, MP, PP, WP, PAIRS = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9

# The problem, as the user writes it: where the blocks begin.
HESSIAN = 10  # (STAGES + 1, W, WP): [[R, S], [S', Q]], of which the last has Q alone
GRADIENT = 11  # (STAGES + 1, WP): (r, q)
DYNAMICS = 12  # (STAGES, N, WP): [B, A]
OFFSET = 13  # (STAGES, NP): c
START = 14  # (NP,): the state at stage 0
LOWEST, HIGHEST = 15, 16  # (STAGES, MP): bounds of controls
ROWS = 17  # (STAGES, P, WP): [D, C]
LIMIT, WEIGHT, SQUARE = 18, 19, 20  # (STAGES, PP): d, and the linear and quadratic penalty of the excess
# The iterate.
POINT = 21  # (STAGES + 1, WP): (u, x)
COSTATE = 22  # (STAGES + 1, WP): (0, y), y the multiplier of the dynamics that end in x
SLACK, MULTIPLIER = 23, 24  # (PAIRS,)
BEST = 25  # copies of the four
# What an iteration computes.
D_POINT, D_COSTATE, D_SLACK, D_MULTIPLIER = 26, 27, 28, 29
MASK = 30  # (PAIRS,): 1 where there is such a pair, else 0
LOW, HIGH = 31, 32  # (STAGES, MP): the bounds, 0 where there is none
PRODUCT = 33  # (PAIRS,): what slack times multiplier is to change by
LEFT = 34  # (STAGES + 1, WP): what is left of the Lagrangian's gradient
MODIFIED = 35  # (STAGES + 1, WP): the same after slacks and multipliers are eliminated
GAP = 36  # (STAGES + 1, NP): error of the dynamics that end in x
VALUE = 37  # (STAGES, PP): C x + D u - d
FACTOR = 38  # (STAGES, M, WP): the first m rows of the Cholesky factor
INVERSE = 39  # (STAGES, MP): inverses of its diagonal
COST = 40  # (STAGES + 1, rows, NP): matrices of the cost to go
COST_GAP, COST_GRADIENT = 41, 42  # (STAGES + 1, NP): its matrix times GAP, and its vector
REDUCED = 43  # (STAGES, MP): what is left for the controls to do
STEEP = 44  # (STAGES, PP): weights of rows after elimination
SHIFT = 45  # (STAGES, PP)
T_WORK, M_WORK, R_WORK, V_WORK = 46, 47, 48, 49  # (rows, WP) twice, (P, WP), (WP)
FREE = 50  # (WP,): 1 for controls, 0 for states: at stage 0 the state is given
WORST, SCALE = 51, 52  # (WP,): of the Lagrangian's gradient, over all stages
WORST_GAP, SCALE_GAP = 53, 54  # (NP,)
WORST_PAIR, SCALE_CONTROL, CURVATURE, RANGE = 55, 56, 57, 58  # (MP,)
WORST_ROW, SCALE_ROW, SCALE_FORCE = 59, 60, 61  # (PP,)
OFF_ROW = 62  # (STAGES, PP): value - excess + slack, what the first iterate's slacks were off
S_WORK = 63  # like M_WORK
CHANGES = 64  # (STAGES, MP): 0 for controls that are fixed, else 1
BLOCKS = 65

TILE = 6  # rows of a product that are computed together, in eight columns
HUGE = 1e200  # curvature of controls that cannot change: they are fixed, or nothing depends on them
FLAT = 1e-14  # a pivot below this part of what it was before elimination has no digits left
FIXED = 1e-13  # relative width of bounds below which a control counts as fixed
FLOOR = 1e-10  # added to the scales of residuals, for problems whose solution is zero

COLD, AS_IT_IS, SHIFTED = 0.0, 1.0, 2.0  # values of WARM: what the iterate in the array is good for

# `settings` and, from 4 on, results.
TOLERANCE, ITERATIONS, WARM, REACHED = 0, 1, 2, 3
STATIONARITY, DYNAMIC, COMPLEMENTARITY, SOFT, COUNT, CONVERGED, SETTINGS = 4, 5, 6, 7, 8, 9, 10
