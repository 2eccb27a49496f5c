"""What the solvers are held against: written from the definitions alone, sharing no code with the package."""

from itertools import product

import clarabel
import numpy as np
from scipy.optimize import linprog, lsq_linear, nnls
from scipy.sparse import csc_matrix

OPTIMAL = 1e-7  # error of the optimality conditions, relative to the gradient
PROVING = 1e10  # larger multipliers prove nothing: w moved by rounding changes the cost by a part in a million


def row_scale(n, length):
    """Return the diagonal of S as a list: what makes newton metres newtons."""
    return [1.0 / length if n == 6 and row >= 3 else 1.0 for row in range(n)]


def support_value(A, direction, t_min, t_max):
    """Return the most that tensions inside the limits can give along a direction, cable by cable.

    A cable without a limit gives nothing only if its pull is no more than the rounding of its own column.
    """
    total = 0.0
    for i in range(A.shape[1]):
        pull = sum(direction[row] * A[row, i] for row in range(A.shape[0]))
        limit = t_max[i] if pull > 0 else t_min[i]
        if np.isfinite(limit) or abs(pull) > 1e-12 * np.linalg.norm(A[:, i]) * np.linalg.norm(direction):
            total += pull * limit
    return total


def linear_program_status(A, w, t_min, t_max):
    """Return "optimal" if HiGHS finds a t inside the limits, "infeasible" if only without them, else "singular"."""
    size = max(np.linalg.norm(w), 1e-300)

    def available(bounds):
        return linprog(np.zeros(A.shape[1]), A_eq=A, b_eq=w / size, bounds=bounds, method="highs").status == 0

    if available([(low / size, high / size) for low, high in zip(t_min, t_max, strict=True)]):
        return "optimal"
    return "infeasible" if available((None, None)) else "singular"


def distance_to_available(A, w, t_min, t_max, length=1.0):
    """Return the distance [N] from w to the available wrench set: min tau with |S (w - A t)| <= tau, by clarabel.

    It is exact to about 1e-9 of the second number returned, the size [N] of the wrenches involved.
    """
    n, m = A.shape
    S = np.diag(row_scale(n, length))
    size = max(np.linalg.norm(S @ w), np.linalg.norm(S @ A @ np.clip(0.0, t_min, t_max)))
    t_rows = np.hstack([np.eye(m), np.zeros((m, 1))])
    tau_row = np.r_[np.zeros(m), -1.0]
    wrench_rows = np.hstack([S @ A, np.zeros((n, 1))])
    high, low = t_max < 1e9 * size, t_min > -1e9 * size  # an interior-point method cannot resolve both 1 and 1e12
    rows = np.vstack([t_rows[high], -t_rows[low], tau_row, wrench_rows])
    right = np.concatenate([t_max[high], -t_min[low], [0.0], S @ w]) / size
    cones = [clarabel.NonnegativeConeT(int(high.sum() + low.sum())), clarabel.SecondOrderConeT(n + 1)]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-12
    no_curvature = csc_matrix((m + 1, m + 1))
    answer = clarabel.DefaultSolver(no_curvature, -tau_row, csc_matrix(rows), right, cones, settings).solve()
    return answer.x[m] * size, size


def optimum_by_enumeration(A, w, t_min, t_max, t_ref=None, weights=None):
    """Return the best tensions or None, trying each cable at t_min, at t_max and free: 3^m least-squares problems."""
    m = A.shape[1]
    t_ref = np.zeros(m) if t_ref is None else t_ref
    weights = np.ones(m) if weights is None else weights
    size = max(np.linalg.norm(w), *(np.linalg.norm(A @ t) for t in (np.clip(0.0, t_min, t_max), t_ref)), 1e-300)
    best, best_cost = None, np.inf
    for free in np.array(list(product((False, True), repeat=m))):
        corners = np.array(list(product(*zip(t_min[~free], t_max[~free], strict=True))))  # (2^k, k) of k held cables
        t = np.tile(np.asarray(t_ref, float), (len(corners), 1))
        t[:, ~free] = corners
        t = t[np.isfinite(t).all(axis=1)]
        if free.any():
            root = 1.0 / np.sqrt(weights[free])
            t[:, free] += (root[:, None] * np.linalg.lstsq(A[:, free] * root, w[:, None] - A @ t.T, rcond=1e-11)[0]).T
        slack = 1e-9 * np.abs(t).max(axis=1, keepdims=True)
        inside = ((t >= t_min - slack) & (t <= t_max + slack)).all(axis=1)
        t = t[inside & (np.linalg.norm(t @ A.T - w, axis=1) <= 1e-9 * size)]
        costs = (t - t_ref) ** 2 @ weights
        if costs.min(initial=np.inf) < best_cost:
            best, best_cost = t[costs.argmin()], costs.min()
    return best


def optimality_error(problem, t):
    """Return by how much tensions miss the optimality conditions, relative to their gradient; inf if beyond a limit.

    The gradient omega (t - t_ref) is A^T y but for a part at the limits, of the sign that pushes against them.
    """
    if (t < problem.t_min).any() or (t > problem.t_max).any() or not np.isfinite(t).all():
        return np.inf
    if not np.linalg.norm(problem.scaled_A @ t - problem.scaled_w) <= problem.tolerance(t):
        return np.inf
    size = np.abs(t).max(initial=1e-300)
    low, high = t - problem.t_min <= 1e-9 * size, problem.t_max - t <= 1e-9 * size
    identity = np.eye(problem.m)
    rows = problem.scaled_A.T / np.maximum(np.linalg.norm(problem.scaled_A, axis=1), 1e-300)
    columns = np.hstack([rows, -rows, identity[:, low], -identity[:, high]])
    gradient = problem.weights * (t - problem.t_ref)
    largest = np.abs(gradient).max()
    if largest == 0.0:
        return 0.0
    multipliers = nnls(columns, gradient / largest)[0].astype(np.longdouble)
    if multipliers.max() > PROVING:
        multipliers = lsq_linear(columns, gradient / largest, (0.0, PROVING), method="bvls", tol=1e-15).x
    rest = gradient / largest - columns @ multipliers
    if multipliers.max() * np.finfo(np.float64).eps > 1e-2 * OPTIMAL:  # their own rounding is in the rest: refine them
        counts = multipliers > 0.0
        multipliers[counts] += np.linalg.lstsq(columns[:, counts], rest.astype(np.float64), rcond=None)[0]
        rest = gradient / largest - columns @ np.maximum(multipliers, 0.0)
    return float(np.linalg.norm(rest.astype(np.float64)))
