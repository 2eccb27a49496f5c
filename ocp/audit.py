"""The audit: a planned motion evaluated again, densely, by code that is not the nonlinear program.

Inverse dynamics in {G} and the exact tension solver judge every instant on its own. What counts as violation is the
distance, in newtons (moments over `Robot.length`), from the wrench that the motion needs to those that the cables can
give inside their limits less the task's margin.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..models.robot import COORDINATES
from ..solvers import Certificate, TensionProblem, certify, solve
from ..workspace.pose import masked_problem
from .drift import Drift, drift
from .limits import limits
from .path import Motion
from .scenario import AUDIT_RATE, Deviation, Scenario
from .task import FreeBase

TOLERANCE = 1e-6  # [N]
UNDERACTUATED_TOLERANCE = 1e-3  # of the weight, for robots with fewer independent cables than degrees of freedom
INDEPENDENT = 1e-3  # of the largest singular value: along less the cables give nothing worth counting on
LIMIT_TOLERANCE = 1e-6  # relative, of the carriers' own limits
PATH_TOLERANCE = 1e-7  # [m, rad], of the tube
END_TOLERANCE = 1e-6  # [m, m/s, m/s^2], of where carriers start and end
EXACT = 1e-12  # relative, of the wrench: tensions by pseudo-inverse that miss more are solved for again
RATE_TOLERANCE = 1e-3  # relative, of tension rates: the audited tensions are the planned ones but for the wrench's rest
LENGTH_TOLERANCE = 1e-4  # [m], of lengths that the drive keeps


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
        Other limits that do not hold (carriers, tube, ends, lengths, those of `limits`): sentences, empty if none.
    soft_excess
        Soft limits that are passed, likewise.
    certificate, certificate_time
        The certificate with the largest shortfall and its time [s]; None if there is none.
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
    excess: list[str] = field(default_factory=list)
    soft_excess: list[str] = field(default_factory=list)
    certificate: Certificate | None = None
    certificate_time: float | None = None
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
            "excess": self.excess,
            "soft_excess": self.soft_excess,
            "drift": None if self.drift is None else {k: _number(v) for k, v in self.drift._asdict().items()},
        }


def _number(value: float) -> float | None:
    """JSON has no infinity."""
    return value if np.isfinite(value) else None


def audit(scenario: Scenario, deviation: Deviation | None) -> Audit:
    """Audit the motion that `deviation` (None: the references alone) stands for, at `AUDIT_RATE` or a little more."""
    times = np.linspace(0.0, scenario.duration, scenario.output_samples * _audits_per_output(scenario) + 1)
    robot = scenario.robot
    motion, carriers = scenario.motion(times, deviation)
    _refuse_zero_lengths(scenario, times, motion, carriers)
    A = scenario.dynamics.wrench_matrix(motion.pose, carriers.pose)
    w = scenario.dynamics.required_wrench(*motion, *carriers, wind=scenario.task.wind)
    few = _few_cables(scenario, A)
    tolerance = UNDERACTUATED_TOLERANCE * robot.force_scale if few and scenario.count else TOLERANCE
    verdict = _distribute(scenario, A, w, _wished_tensions(deviation, times, robot.m), few, tolerance)
    off_path = scenario.off_path(times, motion, carriers)
    excess = [
        *_carrier_excess(scenario, carriers),
        *_length_excess(scenario, motion, carriers),
        *_path_excess(scenario, off_path),
        *_end_excess(scenario, carriers),
        *_locked_excess(scenario, motion),
        *verdict.excess,
    ]
    hard, soft = _limit_excess(scenario, times, motion, carriers, verdict.tensions)
    excess += hard
    followed = few and np.isfinite(verdict.tensions).all()
    return Audit(
        rate=(len(times) - 1) / scenario.duration,
        times=times,
        motion=motion,
        carriers=carriers,
        tensions=verdict.tensions,
        tensions_unlimited=(np.linalg.pinv(A, rcond=1e-9) @ w[..., None])[..., 0],
        violation=verdict.violation,
        tolerance=tolerance,
        tracking_error=np.linalg.norm(off_path[:, :3], axis=1),
        excess=excess,
        soft_excess=soft,
        certificate=verdict.certificate,
        certificate_time=None if verdict.at is None else float(times[verdict.at]),
        drift=drift(scenario, times, motion, carriers, verdict.tensions) if followed else None,
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
    scale = robot.dof_mask / np.array([1.0, 1, 1, robot.length, robot.length, robot.length])
    return wrenches * scale.reshape(6, *[1] * (wrenches.ndim - 2))


def _audits_per_output(scenario: Scenario) -> int:
    """How many audited instants each sample of the output stands for: the saved instants are audited ones."""
    return max(int(np.ceil(AUDIT_RATE * scenario.duration / scenario.output_samples - 1e-9)), 1)


class _Verdict(NamedTuple):
    tensions: np.ndarray  # (n, m)
    violation: np.ndarray  # (n,)
    certificate: Certificate | None
    at: int | None  # row of the certificate
    excess: list[str]  # limits that are missed though what few cables cannot follow is tolerated


def _distribute(
    scenario: Scenario, A: np.ndarray, w: np.ndarray, wished: np.ndarray | None, few: bool, tolerance: float
) -> _Verdict:
    """Tensions of every instant, or how much is missing; the certificate of the worst.

    Where the tensions nearest to the wished ones, without limits, happen to lie inside the limits they are the answer:
    a batch of pseudo-inverses finds those. The exact solver judges the others one by one.

    Of few cables, whose columns do not span all wrenches, a wrench outside of what they span is expected to miss a
    little. Inside of it nothing may: there the limits count as for any robot.
    """
    robot, (low, high) = scenario.robot, scenario.bounds()
    scaled_A, scaled_w = _scaled(scenario, A), _scaled(scenario, w)
    wish = np.zeros((len(w), robot.m)) if wished is None else wished
    missing = scaled_w - np.einsum("nij,nj->ni", scaled_A, wish)
    tensions = wish + (np.linalg.pinv(scaled_A, rcond=INDEPENDENT if few else 1e-9) @ missing[..., None])[..., 0]
    violation = np.linalg.norm(scaled_w - np.einsum("nij,nj->ni", scaled_A, tensions), axis=1)
    inside = ((tensions >= low) & (tensions <= high)).all(axis=1)
    good = violation <= (tolerance if few else EXACT * (robot.force_scale + np.linalg.norm(scaled_w, axis=1)))
    worst: Certificate | None = None
    at: int | None = None
    beyond = 0.0
    for k in np.flatnonzero(~(inside & good)):
        problem = masked_problem(scenario.dynamics, A[k], w[k], low, high, wish[k])
        solution = solve(problem)
        certificate = solution.certificate
        tensions[k] = np.nan if solution.tensions is None else solution.tensions
        if solution.tensions is not None:
            violation[k] = solution.residual
        elif certificate is None:
            violation[k] = np.inf
        else:
            closest = certificate.closest
            violation[k] = np.linalg.norm(problem.scaled_A @ closest - problem.scaled_w)
            if few:
                tensions[k] = closest
                inside_range = certify(_inside_range(problem))
                if inside_range is not None:
                    certificate, beyond = inside_range, max(beyond, inside_range.shortfall)
            if worst is None or certificate.shortfall > worst.shortfall:
                worst, at = certificate, int(k)
    limits = [f"tensions: {beyond:.3g} N beyond their limits or margin"] if beyond > TOLERANCE else []
    return _Verdict(tensions, violation, worst, at, limits)


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
        w = scenario.dynamics.required_wrench(*motions, wind=scenario.task.wind)
        certificate = certify(masked_problem(scenario.dynamics, A, w, low, high))
        if certificate is not None:
            return replace(seen, certificate=certificate, certificate_time=float(seen.times[row]))
    return None


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


def _locked_excess(scenario: Scenario, motion: Motion) -> list[str]:
    """Which coordinates move that the platform does not have: they stay as at home."""
    off = np.abs(motion.pose - scenario.robot.home).max(axis=0)
    return [
        f"platform: {name} moves by {off[i]:.3g}, but it is none of the platform's degrees of freedom"
        for i, name in enumerate(COORDINATES)
        if not scenario.robot.dof_mask[i] and off[i] > PATH_TOLERANCE
    ]


def _path_excess(scenario: Scenario, off_path: np.ndarray) -> list[str]:
    """Whether the platform leaves its tube, one sentence each for position and attitude."""
    tube, found = scenario.task.tube, []
    away = float(np.linalg.norm(off_path[:, :3], axis=1).max())
    if away > tube.radius + PATH_TOLERANCE:
        found.append(f"platform: {away:.6g} m off its path exceeds the tube's {tube.radius:g} m")
    turned = float(np.abs(off_path[:, 3:]).max())
    if turned > tube.turn + PATH_TOLERANCE:
        found.append(f"platform: {turned:.6g} rad off its path exceeds the tube's {tube.turn:g} rad")
    return found


def _end_excess(scenario: Scenario, carriers: Motion) -> list[str]:
    """Whether free carriers start and end as the task says."""
    base = scenario.task.base
    if not isinstance(base, FreeBase):
        return []
    found = []
    moving = sorted({index for index, _ in scenario.carrier_free})
    speed = np.abs(carriers.velocity[[0, -1]][:, moving]).max()
    if base.ends == "rest" and speed > END_TOLERANCE:
        found.append(f"carriers: {speed:.3g} m/s at an end, which should be at rest")
    gap = max(np.abs(part[0, moving] - part[-1, moving]).max() for part in carriers)
    if base.ends == "periodic" and gap > END_TOLERANCE:
        found.append(f"carriers: end {gap:.3g} away from where they started, in m, m/s or m/s^2")
    return found


def _length_excess(scenario: Scenario, motion: Motion, carriers: Motion) -> list[str]:
    """Which cables leave the length that the drive keeps, one sentence each."""
    kept = scenario.robot.fixed_lengths
    if kept is None:
        return []
    off = np.abs(scenario.dynamics.cable_lengths(motion.pose, carriers.pose) - kept).max(axis=0)
    return [
        f"cable {i + 1}: its length is up to {off[i]:.3g} m off the fixed {kept[i]:g} m"
        for i in np.flatnonzero(off > LENGTH_TOLERANCE)
    ]


def _limit_excess(
    scenario: Scenario, times: np.ndarray, motion: Motion, carriers: Motion, tensions: np.ndarray
) -> tuple[list[str], list[str]]:
    """Which of `limits` do not hold, the worst instant of each in a sentence: hard ones and soft ones."""
    hard: list[str] = []
    soft: list[str] = []
    most = scenario.task.limits.tension_rate
    rates = np.abs(np.diff(tensions, axis=0)) / np.diff(times)[:, None]
    if most is not None and np.nanmax(rates, initial=0.0) > most * (1 + RATE_TOLERANCE):
        row, cable = np.unravel_index(np.nanargmax(rates), rates.shape)
        rate = rates[row, cable]
        hard.append(f"tension_rate: cable {cable + 1} at t = {times[row]:.3f} s: {rate:.6g} N/s exceeds {most:g} N/s")
    found = limits(scenario)
    if not found.all:
        return hard, soft
    bodies = [np.hstack(motion), *(np.hstack([part[:, i] for part in carriers]) for i in range(carriers.pose.shape[1]))]
    values = found.function.map(len(times))(*(body.T for body in bodies), tensions.T).full().T
    there = np.isfinite(tensions).all(axis=1, keepdims=True)
    at = 0
    for limit in found.all:
        mine = values[:, at : at + len(limit.labels)]
        at += len(limit.labels)
        beyond = np.maximum(limit.low - mine, mine - limit.high)
        # Without tensions nothing is said of what depends on them; any other nan keeps no limit.
        beyond = np.where(np.isnan(beyond), np.where(there, np.inf, -np.inf), beyond)
        tolerance = UNDERACTUATED_TOLERANCE if limit.equation else LIMIT_TOLERANCE
        if beyond.max() <= tolerance * limit.scale:
            continue
        row, which = np.unravel_index(beyond.argmax(), beyond.shape)
        value, bound = mine[row, which], limit.low if mine[row, which] < limit.low else limit.high
        sentence = (
            f"{limit.name}: {limit.labels[which]} at t = {times[row]:.3f} s: {value:.6g} {limit.unit}, "
            f"accepted: {'at least' if bound == limit.low else 'at most'} {bound:g} {limit.unit}"
        )
        (hard if limit.soft is None else soft).append(sentence)
    return hard, soft


def _wished_tensions(deviation: Deviation | None, times: np.ndarray, m: int) -> np.ndarray | None:
    """The plan's tensions between its nodes, so that a redundant robot keeps the distribution that was planned."""
    if deviation is None:
        return None
    return np.stack([np.interp(times, deviation.nodes, deviation.tensions[:, i]) for i in range(m)], axis=1)


def _carrier_excess(scenario: Scenario, carriers: Motion) -> list[str]:
    """Which limits of carriers do not hold on the dense grid, one sentence each."""
    found = []
    for index, limit in scenario.limits.items():
        name = scenario.robot.carriers[index].name
        pose, velocity, acceleration = (part[:, index] for part in carriers)
        tilt = np.arccos(np.clip(np.cos(pose[:, 3]) * np.cos(pose[:, 4]), -1, 1))
        checks = {
            "acceleration": (np.linalg.norm(acceleration[:, :3], axis=1), limit.acceleration, "m/s^2"),
            "speed": (np.linalg.norm(velocity[:, :3], axis=1), limit.speed, "m/s"),
            "tilt": (tilt, limit.tilt, "rad"),
            "turn acceleration": (np.abs(acceleration[:, 3:5]).max(axis=1), limit.turn_acceleration, "rad/s^2"),
        }
        for quantity, (values, bound, unit) in checks.items():
            if bound is not None and values.max() > bound * (1 + LIMIT_TOLERANCE):
                found.append(f"{name}: {quantity} {values.max():.6g} {unit} exceeds {bound:g} {unit}")
        outside = np.maximum(limit.low - pose[:, :3], pose[:, :3] - limit.high).max()
        if outside > LIMIT_TOLERANCE:
            found.append(f"{name}: {outside:.3g} m outside its reach box")
        stays = scenario.robot.drive == "variable-length" and limit.attitude is not None
        if stays and max(np.abs(velocity).max(), np.abs(acceleration).max()) > LIMIT_TOLERANCE:
            found.append(f"{name}: moves, but with the drive variable-length only winches do")
        if limit.attitude is not None and np.abs(pose[:, 3:] - limit.attitude).max() > LIMIT_TOLERANCE:
            found.append(f"{name}: turns, but a mobile carrier keeps its attitude")
    return found
