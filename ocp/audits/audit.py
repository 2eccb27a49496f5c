"""The audit: a planned motion evaluated again, densely, by code that is not the nonlinear program.

Inverse dynamics in {G} and the exact tension solver judge every instant on its own. What counts as violation is the
distance, in newtons (moments over `Robot.length`), from the wrench that the motion needs to those that the cables can
give inside their limits less the task's margin. For a box of winds it is the largest such distance of the winds that
decide (`wind_set`), and where there is none, of winds inside the box too. All other limits are in `checks`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from ...distribution import wrench_problem
from ...errors import InputError
from ...models.robot import Vector3
from ...solvers import Certificate, TensionProblem, certify, solve, solve_batch
from ..tasks.path import Motion
from ..tasks.scenario import AUDIT_RATE, LEAST_INTERVALS, Deviation, Scenario
from ..tasks.wind_set import WindBox, as_wind, decisive_winds_at, inner_winds
from .checks import END_TOLERANCE, OF_TENSIONS, UNDERACTUATED_TOLERANCE, Seen, excesses
from .drift import Drift, drift
from .excess import Excess

TOLERANCE = 1e-6  # [N]
INDEPENDENT = 1e-3  # of the largest singular value: along less the cables give nothing worth counting on
EXACT = 1e-12  # relative, of the wrench: tensions by pseudo-inverse that miss more are solved for again
NEAREST = 1e10  # weight of the wrench error beside the tensions: so large that these do not shift it
INNER_WINDS = 8  # of a box of winds, at each instant others


@dataclass(frozen=True)
class Audit:
    """What the audit saw.

    Attributes
    ----------
    times, motion, carriers, tensions
        The dense grid, the motion in {G} on it and the audited tensions (n, m) [N], nan where there are none.
    tensions_unlimited
        The tensions of least norm without limits, (n, m) [N]: what the motion would ask for. Negative: to push.
    violation
        Missing wrench at each time [N], rounding errors where the tensions exist.
    tolerance
        What still counts as none [N].
    tracking_error
        Distance from the path at each time [m].
    excess
        Other limits that do not hold (carriers, tube, ends, lengths, those of `limits`), empty if none.
    soft_excess
        Soft limits that are passed, likewise.
    certificate, certificate_time
        The certificate with the largest shortfall and its time [s]; None if there is none.
    certificate_wind
        The wind at which it holds [m/s], of a task with a box of winds; None of others.
    drift
        Where the planned tensions alone would take the platform; None for robots that can follow any motion exactly,
        and where there are no tensions.
    """

    rate: float
    times: np.ndarray  # (n,)
    motion: Motion
    carriers: Motion
    tensions: np.ndarray  # (n, m)
    tensions_unlimited: np.ndarray  # (n, m)
    violation: np.ndarray  # (n,)
    tolerance: float
    tracking_error: np.ndarray  # (n,)
    excess: list[Excess] = field(default_factory=list)
    soft_excess: list[Excess] = field(default_factory=list)
    certificate: Certificate | None = None
    certificate_time: float | None = None
    certificate_wind: Vector3 | None = None
    drift: Drift | None = None

    @property
    def passed(self) -> bool:
        """Whether nothing is violated anywhere."""
        return bool(self.violation.max() <= self.tolerance) and not self.excess

    @property
    def worst(self) -> int:
        """Index of the time with the largest violation; of a plan that passed, of its largest rounding error."""
        return int(self.violation.argmax())

    def summary(self) -> dict[str, Any]:
        """{"rate_hz", "worst_violation" [N], "at_s", "tolerance" [N], "excess", "soft_excess", "drift"} for JSON."""
        return {
            "rate_hz": self.rate,
            "worst_violation": float(self.violation.max()),
            "at_s": float(self.times[self.worst]),
            "tolerance": self.tolerance,
            "excess": [excess.to_dict() for excess in self.excess],
            "soft_excess": [excess.to_dict() for excess in self.soft_excess],
            "drift": None if self.drift is None else {k: _number(v) for k, v in self.drift._asdict().items()},
        }


def _number(value: float) -> float | None:
    """JSON has no infinity."""
    return value if np.isfinite(value) else None


def audit(scenario: Scenario, deviation: Deviation | None) -> Audit:
    """Audit the motion that `deviation` (None: the references alone) stands for, at `AUDIT_RATE` or more."""
    times = np.linspace(0.0, scenario.duration, scenario.output_samples * _audits_per_output(scenario) + 1)
    robot = scenario.robot
    motion, carriers = scenario.motion(times, deviation)
    _refuse_zero_lengths(scenario, times, motion, carriers)
    A = scenario.dynamics.wrench_matrix(motion.pose, carriers.pose)
    w = scenario.dynamics.required_wrench(*motion, *carriers, wind=scenario.wind)
    few = _few_cables(scenario, A)
    tolerance = UNDERACTUATED_TOLERANCE * robot.force_scale if few and scenario.count else TOLERANCE
    distribute = _Distribution(scenario, A, few, tolerance)
    verdict = distribute(w, _wished_tensions(deviation, times, robot.m))
    tensions, wind = verdict.tensions, None
    if (box := scenario.wind_box) is not None:
        verdict, wind = _in_all_winds(distribute, box, motion, verdict)
    off_path = scenario.off_path(times, motion, carriers)
    found = excesses(Seen(scenario, deviation, times, motion, carriers, tensions, off_path))
    if verdict.beyond > TOLERANCE and verdict.at is not None:
        why = "tensions inside their limits less the margin miss what the cables could give"
        told = (float(times[verdict.at]), verdict.beyond, 0.0, "N", "exactly", why)
        found.append(Excess("tensions", "missing wrench", *told))
    soft = scenario.task.limits.soft
    followed = few and np.isfinite(tensions).all()
    return Audit(
        rate=(len(times) - 1) / scenario.duration,
        times=times,
        motion=motion,
        carriers=carriers,
        tensions=tensions,
        tensions_unlimited=(np.linalg.pinv(A, rcond=1e-9) @ w[..., None])[..., 0],
        violation=verdict.violation,
        tolerance=tolerance,
        tracking_error=np.linalg.norm(off_path[:, :3], axis=1),
        excess=[excess for excess in found if excess.limit not in soft],
        soft_excess=[excess for excess in found if excess.limit in soft],
        certificate=verdict.certificate,
        certificate_time=None if verdict.at is None else float(times[verdict.at]),
        certificate_wind=wind,
        drift=drift(scenario, times, motion, carriers, tensions) if followed else None,
    )


def _few_cables(scenario: Scenario, A: np.ndarray) -> bool:
    """Whether somewhere the wrench matrices (n, 6, m) have fewer independent columns than the platform has freedoms."""
    robot = scenario.robot
    dof = len(robot.platform.dof)
    if robot.m < dof:
        return True
    values = np.linalg.svd(_scaled(scenario, A), compute_uv=False)
    return bool((values[:, dof - 1] < INDEPENDENT * values[:, 0]).any())


def _scaled(scenario: Scenario, wrenches: np.ndarray) -> np.ndarray:
    """Wrenches (n, 6, ...) with moments over `Robot.length` and without what the platform does not feel."""
    robot = scenario.robot
    scale = robot.dof_mask * robot.wrench_scale
    return wrenches * scale.reshape(6, *[1] * (wrenches.ndim - 2))


def _audits_per_output(scenario: Scenario) -> int:
    """How many audited instants each sample of the output stands for: the saved instants are audited ones."""
    intervals = max(AUDIT_RATE * scenario.duration, LEAST_INTERVALS)
    return max(int(np.ceil(intervals / scenario.output_samples - 1e-9)), 1)


class _Verdict(NamedTuple):
    tensions: np.ndarray  # (n, m)
    violation: np.ndarray  # (n,)
    certificate: Certificate | None
    at: int | None  # row of the certificate
    beyond: float  # [N] by which limits are missed where what few cables cannot follow is tolerated


class _Distribution:
    """Tensions of every instant of a motion with wrench matrices A (n, 6, m), for any wrenches that it may need.

    Where the tensions nearest to the wished ones, without limits, happen to lie inside the limits they are the answer:
    a batch of pseudo-inverses finds those. The exact solver judges the others. Where it proves that there are none, how
    far the wrench is from those available is told by a batch too, and the certificate is that of the farthest.

    Of few cables, whose columns do not span all wrenches, a wrench outside of what they span is expected to miss a
    little. Inside of it nothing may: there the limits count as for any robot.
    """

    def __init__(self, scenario: Scenario, A: np.ndarray, few: bool, tolerance: float):
        self.scenario, self.A, self.few, self.tolerance = scenario, A, few, tolerance
        self._scaled_A = _scaled(scenario, A)
        self._inverse = np.linalg.pinv(self._scaled_A, rcond=INDEPENDENT if few else 1e-9)

    def __call__(self, w: np.ndarray, wished: np.ndarray | None) -> _Verdict:
        """What becomes of the required wrenches w (n, 6), with tensions near the wished ones (n, m)."""
        scenario, A, few, tolerance = self.scenario, self.A, self.few, self.tolerance
        robot, (low, high) = scenario.robot, scenario.bounds()
        scaled_A, scaled_w = self._scaled_A, _scaled(scenario, w)
        wish = np.zeros((len(w), robot.m)) if wished is None else wished
        missing = scaled_w - np.einsum("nij,nj->ni", scaled_A, wish)
        tensions = wish + (self._inverse @ missing[..., None])[..., 0]
        violation = np.linalg.norm(scaled_w - np.einsum("nij,nj->ni", scaled_A, tensions), axis=1)
        inside = ((tensions >= low) & (tensions <= high)).all(axis=1)
        good = violation <= (tolerance if few else EXACT * (robot.force_scale + np.linalg.norm(scaled_w, axis=1)))
        worst: Certificate | None = None
        at: int | None = None
        beyond = 0.0
        rows = np.flatnonzero(~(inside & good))
        if rows.size:
            batch = solve_batch(scaled_A[rows], scaled_w[rows], low, high, wish[rows])
            solved, proven = batch.feasible, np.isfinite(batch.shortfall)
            tensions[rows[solved]], violation[rows[solved]] = batch.tensions[solved], batch.residual[solved]
            left = list(rows[~solved & ~proven])
            if proven.any():
                proofs = rows[proven]
                closest, away = _nearest(scaled_A[proofs], scaled_w[proofs], low, high)
                violation[proofs] = np.fmax(away, batch.shortfall[proven])
                tensions[proofs] = closest if few else np.nan
                short = violation[proofs]
                if few:
                    in_range = _short_in_range(scaled_A[proofs], scaled_w[proofs], low, high)
                    beyond, short = float(in_range.max()), np.where(in_range > 0, in_range, short)
                left.append(proofs[np.argmax(short)])
            for k in left:
                problem = wrench_problem(scenario.robot, A[k], w[k], low, high, wish[k])
                tensions[k], violation[k], certificate = self._alone(problem)
                if certificate is not None and (worst is None or certificate.shortfall > worst.shortfall):
                    worst, at = certificate, int(k)
        return _Verdict(tensions, violation, worst, at, beyond)

    def _alone(self, problem: TensionProblem) -> tuple[np.ndarray, float, Certificate | None]:
        """Tensions, violation and, if there is one, the certificate of one instant, by the exact solver."""
        solution = solve(problem)
        if solution.tensions is not None:
            return solution.tensions, solution.residual, None
        certificate = solution.certificate
        if certificate is None:
            return np.full(problem.m, np.nan), np.inf, None
        closest = certificate.closest
        violation = float(np.linalg.norm(problem.scaled_A @ closest - problem.scaled_w))
        if not self.few:
            return np.full(problem.m, np.nan), violation, certificate
        return closest, violation, certify(_inside_range(problem)) or certificate


def _nearest(A: np.ndarray, w: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tensions inside the limits whose wrenches are nearest to w, (n, m), and how far these are, (n,) [N]."""
    nearest = solve_batch(A, w, low, high, rho=NEAREST)
    return nearest.tensions, nearest.residual


def _short_in_range(A: np.ndarray, w: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """How far the part of w that the columns of A span is from what they give inside the limits, (n,) [N]."""
    U, values, _ = np.linalg.svd(A, full_matrices=False)
    U = np.where(values[:, None] > INDEPENDENT * values[:, None, :1], U, 0.0)
    within = (U @ (U.swapaxes(1, 2) @ w[..., None]))[..., 0]
    short = ~solve_batch(A, within, low, high).feasible
    return np.where(short, _nearest(A, within, low, high)[1], 0.0)


def _in_all_winds(
    distribute: _Distribution, box: WindBox, motion: Motion, middle: _Verdict
) -> tuple[_Verdict, Vector3 | None]:
    """The verdict of the worst wind of a box at each instant, and the wind of its certificate.

    `middle` is that of the planned tensions. Farther from the available wrenches than at the winds that decide the
    wrench is nowhere: where these pass, others in the box are tried only to check that.
    """
    scenario = distribute.scenario
    without_air = scenario.dynamics.required_wrench(*motion)
    wish, n = np.nan_to_num(middle.tensions), len(motion.pose)
    worst, wind = middle, None if middle.at is None else box.middle

    def judge(winds: np.ndarray) -> None:
        nonlocal worst, wind
        push = scenario.dynamics.aerodynamic_wrench(motion.pose, motion.velocity, winds)
        found = distribute(without_air - push, wish)
        worse = _shortfall(found) > _shortfall(worst)
        if worse and found.at is not None:
            wind = as_wind(winds[found.at])
        best = found if worse else worst
        violation = np.maximum(worst.violation, found.violation)
        worst = _Verdict(middle.tensions, violation, best.certificate, best.at, max(worst.beyond, found.beyond))

    for winds in decisive_winds_at(box, scenario.robot, motion.pose, motion.velocity):
        judge(winds)
    if worst.violation.max() <= distribute.tolerance:
        for winds in inner_winds(box, INNER_WINDS * n).reshape(n, INNER_WINDS, 3).swapaxes(0, 1):
            judge(winds)
    return worst, wind


def _shortfall(verdict: _Verdict) -> float:
    return 0.0 if verdict.certificate is None else verdict.certificate.shortfall


def at_rest(scenario: Scenario, seen: Audit) -> Audit | None:
    """The same with the certificate of an end where all is at rest, if no tensions hold the platform there.

    What is impossible at rest is so for every duration.
    """
    low, high = scenario.bounds()
    for row in (0, -1):
        motions = [part[row] for part in (*seen.motion, *seen.carriers)]
        if any(np.abs(motions[k]).max() > END_TOLERANCE for k in (1, 2, 4, 5)):
            continue
        A = scenario.dynamics.wrench_matrix(motions[0], motions[3])
        for wind in scenario.winds_at(*motions[:2]):
            w = scenario.dynamics.required_wrench(*motions, wind=wind)
            certificate = certify(wrench_problem(scenario.robot, A, w, low, high))
            if certificate is not None:
                at = None if scenario.wind_box is None else wind
                time = float(seen.times[row])
                return replace(seen, certificate=certificate, certificate_time=time, certificate_wind=at)
    return None


def tensions_may_mend(scenario: Scenario, seen: Audit) -> bool:
    """Whether the same motion with other tensions may pass an audit that this one did not."""
    if seen.violation.max() > seen.tolerance or not {excess.limit for excess in seen.excess} <= OF_TENSIONS:
        return False
    values = np.linalg.svd(
        _scaled(scenario, scenario.dynamics.wrench_matrix(seen.motion.pose, seen.carriers.pose)), compute_uv=False
    )
    return scenario.robot.m > values.shape[1] or bool((values[:, -1] < INDEPENDENT * values[:, 0]).any())


def _inside_range(problem: TensionProblem) -> TensionProblem:
    """The same problem with the part of w that lies in what the columns of A span."""
    U, values, _ = np.linalg.svd(problem.scaled_A, full_matrices=False)
    span = U[:, values > INDEPENDENT * values[0]]
    w = span @ (span.T @ problem.scaled_w) / problem.row_scale
    return TensionProblem(problem.A, w, problem.t_min, problem.t_max, length=problem.length)


def _refuse_zero_lengths(scenario: Scenario, times: np.ndarray, motion: Motion, carriers: Motion) -> None:
    lengths = scenario.dynamics.cable_lengths(motion.pose, carriers.pose)
    if (lengths > 1e-9).all():
        return
    row, cable = np.argwhere(~(lengths > 1e-9))[0]
    raise InputError(
        f"task {scenario.task.name!r}: path: at t = {times[row]:.3f} s anchor and attachment of cable {cable + 1} "
        "coincide; accepted: paths on which every cable has a length"
    )


def _wished_tensions(deviation: Deviation | None, times: np.ndarray, m: int) -> np.ndarray | None:
    """The plan's tensions between its nodes, so that a redundant robot keeps the distribution that was planned."""
    if deviation is None:
        return None
    return np.stack([np.interp(times, deviation.nodes, deviation.tensions[:, i]) for i in range(m)], axis=1)
