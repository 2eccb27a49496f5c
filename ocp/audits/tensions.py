"""Tensions of every instant of a motion, and its distance from possible wrenches where there are none.

The violation is the distance, in newtons (moments over `Robot.length`), from the wrench that the motion
requires to those that the cables can give inside their limits less the task's margin. For a box of winds it is the
largest such distance of the winds that decide (`wind_set`), and if that is none, of winds inside their set too.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ...base.tolerances import INDEPENDENT
from ...models import Robot
from ...solvers import Certificate, TensionProblem, certify, solve, solve_batch
from ...statics.distribution import wrench_problem
from ..limits.cables import WinchForce, WinchPower
from ..tasks.paths import Motion
from ..tasks.scenario import Scenario
from ..tasks.wind_set import WindBox, WindSet, as_wind, decisive_winds_at, possible_winds_at

TOLERANCE = 1e-6  # [N], and of the characteristic force of robots below 1 N
UNDERACTUATED_TOLERANCE = 1e-3  # of the weight, for robots with fewer independent cables than degrees of freedom
RANK = 1e-9  # of the largest singular value: along less nothing is given
INVERTED = 1e-3  # of the identity, in the Frobenius norm: what a product with an inverse may lack before Newton's step
EXACT = 1e-12  # relative, of the wrench: tensions by pseudo-inverse that miss more are solved for again
NEAREST = 1e10  # weight of the wrench error beside the tensions: so large that these do not shift it
INNER_WINDS = 8  # of a box, at each instant others
SPARES = 0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2  # of the weight: what exceeds motors where that is necessary, in order


class AuditedTensions(NamedTuple):
    """The tensions of every instant, and the reason where none exist."""

    tensions: np.ndarray  # (n, m) [N], nan where there are none
    violation: np.ndarray  # (n,) [N]
    certificate: Certificate | None  # that with the largest shortfall; without time
    row: int | None  # of the certificate
    beyond: float  # [N] beyond the limits within the range of few cables, whose other errors are tolerated
    supports: np.ndarray  # (n, s) [N], forces of the ground
    others: tuple[tuple[np.ndarray, np.ndarray], ...] = ()  # wrenches and tensions of other winds and loads that decide


def tolerance_of(robot: Robot) -> float:
    """Return the force that audits of a robot tolerate [N]."""
    return TOLERANCE * min(robot.force_scale, 1.0)


def scaled(scenario: Scenario, wrenches: np.ndarray) -> np.ndarray:
    """Return wrenches (n, 6, ...) with moments over `Robot.length`, and zero where the platform has no freedom."""
    robot = scenario.robot
    scale = robot.dof_mask * robot.wrench_scale
    return wrenches * scale.reshape(6, *[1] * (wrenches.ndim - 2))


class Distribution:
    """Distribute the tensions of all instants of a motion with wrench matrices A (n, 6, m), for any wrenches.

    Where the tensions nearest to the preferred ones, without limits, happen to lie inside the limits they are the
    result: a batch of pseudo-inverses gives those. The exact solver solves the other instants. Where no tensions exist
    the distance of the wrench from the possible ones is computed for all instants at once, and the certificate only
    for the farthest.

    Of few cables, whose columns do not span all wrenches, a wrench outside their span is expected to be missed by a
    little. Inside the span nothing may be missed: there the limits count as for any robot.
    """

    def __init__(self, scenario: Scenario, A: np.ndarray, bounds: tuple[np.ndarray, np.ndarray] | None = None):
        robot = scenario.robot
        self.scenario, self.A = scenario, A
        self._bounds = scenario.bounds() if bounds is None else bounds
        self.scaled_A = scaled(scenario, A)  # moments over `Robot.length`, (n, 6, m)
        self.few, self._inverse = few_and_inverse(self.scaled_A, np.flatnonzero(robot.dof_mask))  # (n, m, 6)
        underactuated = self.few and scenario.count
        self.tolerance = UNDERACTUATED_TOLERANCE * robot.force_scale if underactuated else tolerance_of(robot)

    def unlimited(self, w: np.ndarray) -> np.ndarray:
        """Return the tensions of least norm for the wrenches w (n, 6), whatever the limits, (n, m) [N]."""
        return (self._inverse @ scaled(self.scenario, w)[..., None])[..., 0]

    @property
    def gains(self) -> np.ndarray:
        """Return by how much tensions of least norm change at most for a wrench of 1 N, (n, m)."""
        return np.sqrt(np.einsum("nij,nij->ni", self._inverse, self._inverse))

    def __call__(self, w: np.ndarray, preferred: np.ndarray | None) -> AuditedTensions:
        """Return the tensions for the required wrenches w (n, 6), near the preferred ones (n, m) or near zero."""
        scenario, A, few, tolerance = self.scenario, self.A, self.few, self.tolerance
        robot, (low, high) = scenario.robot, self._bounds
        scaled_A, scaled_w = self.scaled_A, scaled(scenario, w)
        near = np.zeros((len(w), A.shape[2])) if preferred is None else preferred
        open_wrench = scaled_w - np.einsum("nij,nj->ni", scaled_A, near)
        tensions = near + (self._inverse @ open_wrench[..., None])[..., 0]
        violation = np.linalg.norm(scaled_w - np.einsum("nij,nj->ni", scaled_A, tensions), axis=1)
        inside = ((tensions >= low) & (tensions <= high)).all(axis=1)
        good = violation <= (tolerance if few else EXACT * (robot.force_scale + np.linalg.norm(scaled_w, axis=1)))
        beyond, worst = 0.0, None
        singly: list[int] = []
        rows = np.flatnonzero(~(inside & good))
        if rows.size:
            batch = solve_batch(scaled_A[rows], scaled_w[rows], low, high, near[rows])
            solved, proven = batch.feasible, np.isfinite(batch.shortfall)
            tensions[rows[solved]], violation[rows[solved]] = batch.tensions[solved], batch.residual[solved]
            singly += rows[~solved & ~proven].tolist()
            if proven.any():
                impossible = rows[proven]
                closest, away = nearest(scaled_A[impossible], scaled_w[impossible], low, high)
                violation[impossible] = np.fmax(away, batch.shortfall[proven])
                tensions[impossible] = np.where((few | (away <= tolerance))[:, None], closest, np.nan)
                short = violation[impossible]
                if few:
                    in_range = _short_in_range(scaled_A[impossible], scaled_w[impossible], low, high)
                    beyond = float(in_range.max())
                    if beyond > 0:  # what is tolerated outside the span is no failure
                        short = np.where(short > tolerance, short, in_range)
                singly.append(int(impossible[np.argmax(short)]))
        worst_row: int | None = None
        for k in singly:
            problem = wrench_problem(robot, A[k], w[k], low, high, near[k])
            tensions[k], violation[k], certificate = self._single(problem)
            if certificate is not None and (worst is None or certificate.shortfall > worst.shortfall):
                worst, worst_row = certificate, k
        return AuditedTensions(tensions, violation, worst, worst_row, beyond, supports=np.zeros((len(w), 0)))

    def _single(self, problem: TensionProblem) -> tuple[np.ndarray, float, Certificate | None]:
        """Return tensions, violation and, if there is one, the certificate of one instant, by the exact solver."""
        solution = solve(problem)
        if solution.tensions is not None:
            return solution.tensions, solution.residual, None
        certificate = solution.certificate
        if certificate is None:
            return np.full(problem.m, np.nan), np.inf, None
        closest = certificate.closest
        violation = float(np.linalg.norm(problem.scaled_A @ closest - problem.scaled_w))
        if not self.few:
            return closest if violation <= self.tolerance else np.full(problem.m, np.nan), violation, certificate
        within = _in_span(problem.scaled_A[None], problem.scaled_w[None])[0] / problem.row_scale
        in_range = TensionProblem(problem.A, within, problem.t_min, problem.t_max, length=problem.length)
        inside = certify(in_range)
        if inside is None or certificate.shortfall > max(inside.shortfall, self.tolerance):
            inside = certificate
        return closest, violation, inside


def few_and_inverse(A: np.ndarray, moving: np.ndarray) -> tuple[bool, np.ndarray]:
    """Return whether some matrix of A (n, 6, m) has fewer independent columns than freedoms, and the inverses.

    The inverses are (n, m, 6). The rows of A that are `moving` are those of the freedoms; the others are zero.
    Nothing else in an audit takes as long as a decomposition of each matrix. Those that are far from losing a row by
    their condition in the Frobenius norm, which is never less than that of the singular values, need none. The inverse
    by A A^T has lost the square of the condition, and one step of Newton's method (Schulz 1933) brings that back. What
    it left before that proves that no row is lost: of a singular matrix, rounding makes an inverse of any size.
    """
    n, _, m = A.shape
    if (dof := len(moving)) <= m:
        own = A if dof == 6 else A[:, moving]
        transposed = own.swapaxes(1, 2)
        with suppress(np.linalg.LinAlgError):
            inverse = transposed @ np.linalg.inv(own @ transposed)
            missing = np.eye(dof) - own @ inverse
            inverse += inverse @ missing
            # The squares of the Frobenius norms, in a sixth of the time of `numpy.linalg.norm`.
            size, own_size, inverse_size = (np.einsum("nij,nij->n", each, each) for each in (missing, own, inverse))
            if ((size < INVERTED**2) & (own_size * inverse_size * INDEPENDENT**2 < 1.0)).all():
                if dof == 6:
                    return False, inverse
                whole = np.zeros((n, m, 6))
                whole[:, :, moving] = inverse
                return False, whole
    U, sigma, Vt = np.linalg.svd(A, full_matrices=False)
    few = m < dof or bool((sigma[:, dof - 1] < INDEPENDENT * sigma[:, 0]).any())
    kept = sigma > (INDEPENDENT if few else RANK) * sigma[:, :1]
    reciprocal = np.divide(1.0, sigma, out=np.zeros_like(sigma), where=kept)
    return few, (Vt.swapaxes(1, 2) * reciprocal[:, None]) @ U.swapaxes(1, 2)


def in_all_winds(
    distribute: Distribution, every: WindSet, motion: Motion, w: np.ndarray, middle: AuditedTensions
) -> AuditedTensions:
    """Return the result of the worst wind of a set at each instant, whose certificate has its wind.

    `middle` is the result of the planned tensions for w (n, 6), the wrench in the set's middle. At no wind is the
    wrench farther from the available ones than at those that decide: if these pass, others are tried only to check
    that. A certificate is one of a wind of the set, which those that decide need not be.
    """
    scenario = distribute.scenario
    without_air = w + scenario.dynamics.aerodynamic_wrench(motion.pose, motion.velocity, np.array(every.middle))
    planned, n = np.nan_to_num(middle.tensions), len(motion.pose)
    worst = middle._replace(certificate=middle.certificate and replace(middle.certificate, wind=every.middle))

    def include(winds: np.ndarray, proves: bool = True, decides: bool = False) -> None:
        nonlocal worst
        push = scenario.dynamics.aerodynamic_wrench(motion.pose, motion.velocity, winds)
        result = distribute(without_air - push, planned)
        others = ((without_air - push, result.tensions),) if decides else ()
        result = result._replace(certificate=result.certificate if proves else None, others=others)
        worst = _worse(worst, result, lambda row: {"wind": as_wind(winds[row])})

    exact = isinstance(every, WindBox)
    for winds in decisive_winds_at(every, scenario.robot, motion.pose, motion.velocity):
        include(winds, proves=exact, decides=True)
    if worst.violation.max() <= distribute.tolerance:
        for winds in every.inner(INNER_WINDS * n).reshape(n, INNER_WINDS, 3).swapaxes(0, 1):
            include(winds)
    elif not exact:
        for winds in possible_winds_at(every, scenario.robot, motion.pose, motion.velocity):
            include(winds)
    return worst


def with_all_loads(
    distribute: Distribution, times: np.ndarray, motion: Motion, carriers: Motion, given: AuditedTensions
) -> AuditedTensions:
    """Return the result of the worst load within the tolerances at each of `times` (n,), whose certificate has it.

    `given` is the result of the planned tensions, for the load as given. If tensions exist with the extreme loads, they
    do with all (`Load.extremes`).
    """
    scenario, worst = distribute.scenario, given
    for extreme in range(scenario.phases.extremes):
        w = scenario.required_wrench(times, motion, carriers, scenario.wind, extreme)
        result = distribute(w, np.nan_to_num(given.tensions))
        result = result._replace(others=((w, result.tensions),))
        worst = _worse(worst, result, lambda row, k=extreme: {"load": scenario.load_of(float(times[row]), k)})
    return worst


def _worse(some: AuditedTensions, other: AuditedTensions, about: Callable[[int], dict[str, Any]]) -> AuditedTensions:
    """Return the worse of two results at each instant; a certificate of the other is `about` something at its row."""
    worst, proof = some, other.certificate
    least = 0.0 if some.certificate is None else some.certificate.shortfall
    if proof is not None and other.row is not None and proof.shortfall > least:
        worst = some._replace(certificate=replace(proof, **about(other.row)), row=other.row)
    violation, beyond = np.maximum(some.violation, other.violation), max(some.beyond, other.beyond)
    return worst._replace(violation=violation, beyond=beyond, others=some.others + other.others)


def nearest(A: np.ndarray, w: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return tensions inside the limits whose wrenches are nearest to w, (n, m), and their distances, (n,) [N]."""
    nearest = solve_batch(A, w, low, high, rho=NEAREST)
    return nearest.tensions, nearest.residual


def _short_in_range(A: np.ndarray, w: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return how far the part of w in the span of A's columns is from what they give inside the limits, (n,) [N]."""
    within = _in_span(A, w)
    short = ~solve_batch(A, within, low, high).feasible
    return np.where(short, nearest(A, within, low, high)[1], 0.0)


def _in_span(A: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return the parts of wrenches w (n, 6) that lie in the span of the columns of A (n, 6, m), (n, 6)."""
    U, values, _ = np.linalg.svd(A, full_matrices=False)
    U = np.where(values[:, None] > INDEPENDENT * values[:, None, :1], U, 0.0)
    return (U @ (U.swapaxes(1, 2) @ w[..., None]))[..., 0]


def within_motors(
    scenario: Scenario, times: np.ndarray, A: np.ndarray, case: tuple[np.ndarray, np.ndarray], values: list[np.ndarray]
) -> np.ndarray:
    """Return the tensions (n, m) [N] of a motion, within the force and power of motors wherever such exist.

    At each instant of a motion a motor's limit is one of the tension: its force is the tension and what accelerates the
    winch, its power the tension times a speed. Where none exist, they exceed what motors can by little, if such exist;
    at all other instants the tensions are the given ones.

    - `A`: Wrench matrices with moments over `Robot.length`, (n, 6, m).
    - `case`: Wrenches with the same moments, (n, 6) [N], and their tensions so far, (n, m) [N].
    - `values`: What each limit bounds for these tensions, (n, k) each.
    """
    w, tensions = case
    low, high = scenario.bounds_at(times)
    least, most = np.full_like(low, -np.inf), np.full_like(high, np.inf)  # that motors permit
    for limit, its in zip(scenario.limits, values, strict=True):
        if isinstance(limit, WinchForce):
            reflected = its - tensions[:, limit.cables]
            most[:, limit.cables] = limit.high - reflected
            least[:, limit.cables] = -limit.high - reflected
        elif isinstance(limit, WinchPower) and limit.soft is None:
            held = scenario.in_force(limit, times)[:, None] & (its != 0)
            own = np.divide(limit.high * tensions, np.abs(its), np.full_like(most, np.inf), where=held)
            most = np.minimum(most, own)
    exceeded = np.any((tensions > np.minimum(high, most)) | (tensions < np.maximum(low, least)), axis=1)
    if not exceeded.any():
        return tensions
    chosen = tensions.copy()
    for spare in SPARES:
        by = spare * scenario.robot.force_scale
        lowest, highest = np.maximum(low, least - by), np.minimum(high, most + by)
        rows = np.flatnonzero(exceeded & (lowest <= highest).all(axis=1))
        if rows.size:
            found = solve_batch(A[rows], w[rows], lowest[rows], highest[rows], tensions[rows])
            chosen[rows[found.feasible]] = found.tensions[found.feasible]
            exceeded[rows[found.feasible]] = False
    return chosen
