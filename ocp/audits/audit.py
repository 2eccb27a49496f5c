"""The audit: a planned motion evaluated again, densely.

Inverse dynamics in {G} and the exact tension solver evaluate every instant on its own, by code that the nonlinear
program does not use. `tensions` has the tensions and the violation, `checks` all other limits.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...errors import InputError
from ...solvers import Certificate
from ..tasks.deviation import Deviation
from ..tasks.paths import Motion
from ..tasks.scenario import AUDIT_RATE, LEAST_INTERVALS, Scenario
from .by_phase import distribution, taken_up
from .checks import START_TENSIONS, AuditedMotion, excesses
from .drift import Drift, drift
from .excess import Excess
from .jumps import jumped_over
from .tensions import INDEPENDENT, TOLERANCE, in_all_winds, scaled

__all__ = ["Audit", "audit", "other_tensions_exist", "other_tensions_may_pass"]


@dataclass(frozen=True)
class Audit:
    """The dense evaluation of a motion.

    Attributes
    ----------
    rate
        Instants per second [Hz].
    times, motion, carriers, tensions
        The dense grid, the motion in {G} on it and the audited tensions (n, m) [N], nan where there are none.
    tensions_unlimited
        The tensions of least norm without limits, (n, m) [N]. Negative: the cable would have to push.
    violation
        Distance of the required wrench from those that the cables can give at each time [N]; rounding errors where
        the tensions exist.
    tolerance
        The largest violation that passes [N].
    tracking_error
        Distance from the path at each time [m].
    excess
        Other limits that are exceeded (those of `limits`, ends, fixed lengths, ...), empty if none.
    soft_excess
        Soft limits that are exceeded, empty if none.
    limited
        What each of the scenario's limits bounds, (n, k) in its unit, in their order.
    certificate
        The certificate with the largest shortfall, with its time, and its wind if the task has a box of winds; None if
        there is none.
    drift
        Where the planned tensions alone would take the platform; None for robots that can follow any motion exactly,
        for motions with loads or on the ground, and where there are no tensions.
    supports
        The forces of the ground on each support point, (n, s) [N], zero where the platform hangs; None for a task
        without ground.
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
    limited: list[np.ndarray] = field(default_factory=list)
    certificate: Certificate | None = None
    drift: Drift | None = None
    supports: np.ndarray | None = None  # (n, s)

    @property
    def passed(self) -> bool:
        """Return whether nothing is violated anywhere."""
        return bool(self.violation.max() <= self.tolerance) and not self.excess

    @property
    def worst(self) -> int:
        """Return the index of the time with the largest violation; of a plan that passed, with the largest rounding."""
        return int(self.violation.argmax())

    def to_dict(self) -> dict[str, Any]:
        """Return "rate_hz", "worst_violation" [N], "at_s", "tolerance" [N], "excess", "soft_excess" and "drift"."""
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
    """Return a number that JSON has: infinity becomes None."""
    return value if np.isfinite(value) else None


def audit(scenario: Scenario, deviation: Deviation | None, to_show: bool = False) -> Audit:
    """Audit the motion of `deviation`, or that of the references alone.

    Parameters
    ----------
    to_show
        Whether the motion is known to be impossible, and only shown: at the samples of the output, without its drift.

    Raises
    ------
    InputError
        If somewhere a cable has no length.
    """
    intervals = scenario.output_samples * (1 if to_show else _audits_per_output(scenario))
    times = np.linspace(0.0, scenario.duration, intervals + 1)
    robot = scenario.robot
    motion, carriers = scenario.motion(times, deviation)
    _check_lengths(scenario, times, motion, carriers)
    A = scenario.dynamics.wrench_matrix(motion.pose, carriers.pose)
    w = scenario.required_wrench(times, motion, carriers, scenario.wind)
    distribute = distribution(scenario, times, A)
    few, tolerance = distribute.few, distribute.tolerance
    planned = _planned_tensions(deviation, times, robot.m)
    result = distribute(w, taken_up(scenario, times) if planned is None else planned)
    tensions, supports, certificate = result.tensions, result.supports, result.certificate
    if (box := scenario.wind_box) is not None:
        result, certificate = in_all_winds(distribute, box, motion, w, result)
    if certificate is not None and result.row is not None:
        certificate = replace(certificate, time=float(times[result.row]))
    off_path = scenario.off_path(times, motion, carriers)
    audited = AuditedMotion(scenario, deviation, times, motion, carriers, tensions, off_path)
    limited = audited.limited()
    exceeded = excesses(audited, limited) + jumped_over(audited, limited)
    if result.beyond > TOLERANCE and result.row is not None:
        why = "wrench error of tensions inside their limits less the margin"
        at = float(times[result.row])
        exceeded.append(Excess("tensions", "platform", at, result.beyond, 0.0, "N", "exactly", why))
    soft = {limit.name for limit in scenario.limits if limit.soft is not None}
    hangs = not (scenario.phases.carry or scenario.phases.rest)
    followed = not to_show and few and hangs and np.isfinite(tensions).all()
    return Audit(
        rate=(len(times) - 1) / scenario.duration,
        times=times,
        motion=motion,
        carriers=carriers,
        tensions=tensions,
        tensions_unlimited=distribute.unlimited(w),
        violation=result.violation,
        tolerance=tolerance,
        supports=supports,
        tracking_error=np.linalg.norm(off_path[:, :3], axis=1),
        excess=[excess for excess in exceeded if excess.limit not in soft],
        soft_excess=[excess for excess in exceeded if excess.limit in soft],
        limited=limited,
        certificate=certificate,
        drift=drift(scenario, times, motion, carriers, tensions) if followed else None,
    )


def other_tensions_may_pass(scenario: Scenario, audit: Audit) -> bool:
    """Return whether the same motion with other tensions may pass, if this audit did not."""
    exceeded = {excess.limit for excess in audit.excess}
    if audit.violation.max() > audit.tolerance or not exceeded <= scenario.limits.of_tensions | {START_TENSIONS}:
        return False
    return other_tensions_exist(scenario, audit)


def other_tensions_exist(scenario: Scenario, audit: Audit) -> bool:
    """Return whether the cables can give a motion's wrenches by tensions other than the audited ones."""
    if scenario.phases.jumps and scenario.scheme.continuous:
        return False  # none that a program with this scheme has: they jump where the load changes
    A = scenario.dynamics.wrench_matrix(audit.motion.pose, audit.carriers.pose)
    values = np.linalg.svd(scaled(scenario, A), compute_uv=False)
    return scenario.robot.m > values.shape[1] or bool((values[:, -1] < INDEPENDENT * values[:, 0]).any())


def _audits_per_output(scenario: Scenario) -> int:
    """Return how many audited instants each sample of the output stands for: the saved instants are audited ones."""
    intervals = max(AUDIT_RATE * scenario.duration, LEAST_INTERVALS)
    return max(int(np.ceil(intervals / scenario.output_samples - 1e-9)), 1)


def _check_lengths(scenario: Scenario, times: np.ndarray, motion: Motion, carriers: Motion) -> None:
    """Raise InputError if somewhere a cable has no length."""
    lengths = scenario.dynamics.cable_lengths(motion.pose, carriers.pose)
    if (lengths > 1e-9).all():
        return
    row, cable = np.argwhere(~(lengths > 1e-9))[0]
    raise InputError(
        f"task {scenario.task.name!r}: path must be one on which every cable has a length, got one on which anchor and "
        f"attachment of cable {cable + 1} coincide at t = {times[row]:.3f} s"
    )


def _planned_tensions(deviation: Deviation | None, times: np.ndarray, m: int) -> np.ndarray | None:
    """Return the plan's tensions between its nodes, so that a redundant robot keeps the planned distribution."""
    if deviation is None:
        return None
    return np.stack([np.interp(times, deviation.nodes, deviation.tensions[:, i]) for i in range(m)], axis=1)
