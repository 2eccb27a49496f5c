"""The audit: a planned motion evaluated again, densely, by code that is not the nonlinear program.

Inverse dynamics in {G} and the exact tension solver judge every instant on its own. What counts as violation is the
distance, in newtons (moments over `Robot.length`), from the wrench that the motion needs to those that the cables can
give inside their limits less the task's margin.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..solvers import Certificate, TensionProblem, solve
from .path import Motion
from .scenario import Deviation, Scenario

RATE = 1000.0  # [1/s]
TOLERANCE = 1e-6  # [N]
UNDERACTUATED_TOLERANCE = 1e-3  # of the weight, for robots with fewer cables than degrees of freedom
LIMIT_TOLERANCE = 1e-6  # relative, of the carriers' own limits


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
    carrier_excess
        The carriers' own limits that were exceeded: sentences, empty if none.
    certificate
        At the time of the worst violation, if there is one.
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
    carrier_excess: list[str] = field(default_factory=list)
    certificate: Certificate | None = None

    @property
    def passed(self) -> bool:
        """Whether nothing is violated anywhere."""
        return bool(self.violation.max() <= self.tolerance) and not self.carrier_excess

    @property
    def worst(self) -> int:
        """Index of the time with the largest violation, or else with the smallest margin."""
        return int(self.violation.argmax())

    def summary(self) -> dict[str, Any]:
        """{"rate_hz", "worst_violation" [N], "at_s", "tolerance" [N], "carrier_excess"}, ready for JSON."""
        return {
            "rate_hz": self.rate,
            "worst_violation": float(self.violation.max()),
            "at_s": float(self.times[self.worst]),
            "tolerance": self.tolerance,
            "carrier_excess": self.carrier_excess,
        }


def audit(scenario: Scenario, deviation: Deviation | None, rate: float = RATE) -> Audit:
    """Audit the motion that `deviation` (None: the references alone) stands for, at `rate` [1/s]."""
    count = max(int(np.ceil(scenario.duration * rate)), 1)
    return examine(scenario, deviation, np.linspace(0.0, scenario.duration, count + 1), rate)


def examine(scenario: Scenario, deviation: Deviation | None, times: np.ndarray, rate: float) -> Audit:
    """Audit the motion at the given times."""
    robot = scenario.robot
    motion, carriers = scenario.motion(times, deviation)
    A = scenario.dynamics.wrench_matrix(motion.pose, carriers.pose)
    w = scenario.dynamics.required_wrench(*motion, *carriers, wind=scenario.task.wind)
    wished = _wished_tensions(deviation, times, robot.m)
    low, high = scenario.bounds()
    tensions = np.full((len(times), robot.m), np.nan)
    violation = np.zeros(len(times))
    worst: Certificate | None = None
    for k in range(len(times)):
        t_ref = None if wished is None else wished[k]
        solution = solve(TensionProblem(A[k], w[k], low, high, t_ref=t_ref, length=robot.length))
        if solution.tensions is not None:
            tensions[k] = solution.tensions
            violation[k] = solution.residual
        elif solution.certificate is not None:
            violation[k] = solution.certificate.shortfall
            if solution.certificate.singular and robot.m < 6:
                tensions[k] = solution.certificate.closest
            if worst is None or solution.certificate.shortfall > worst.shortfall:
                worst = solution.certificate
        else:
            violation[k] = np.inf
    return Audit(
        rate=rate,
        times=times,
        motion=motion,
        carriers=carriers,
        tensions=tensions,
        tensions_unlimited=(np.linalg.pinv(A, rcond=1e-9) @ w[..., None])[..., 0],
        violation=violation,
        tolerance=TOLERANCE if robot.m >= 6 else UNDERACTUATED_TOLERANCE * robot.weight,
        tracking_error=scenario.tracking_error(times, deviation),
        carrier_excess=_carrier_excess(scenario, carriers),
        certificate=worst,
    )


def _wished_tensions(deviation: Deviation | None, times: np.ndarray, m: int) -> np.ndarray | None:
    """The plan's tensions between its nodes, so that a redundant robot keeps the distribution that was planned."""
    if deviation is None:
        return None
    return np.stack([np.interp(times, deviation.nodes, deviation.tensions[:, i]) for i in range(m)], axis=1)


def _carrier_excess(scenario: Scenario, carriers: Motion) -> list[str]:
    """Which limits of free carriers do not hold on the dense grid, one sentence each."""
    found = []
    for index, limit in scenario.limits.items():
        name = scenario.robot.carriers[index].name
        pose, velocity, acceleration = (part[:, index] for part in carriers)
        largest = {
            "acceleration": (np.linalg.norm(acceleration[:, :3], axis=1).max(), limit.acceleration, "m/s^2"),
            "speed": (np.linalg.norm(velocity[:, :3], axis=1).max(), limit.speed, "m/s"),
        }
        if limit.tilt > 0:
            tilt = np.arccos(np.clip(np.cos(pose[:, 3]) * np.cos(pose[:, 4]), -1, 1)).max()
            largest["tilt"] = (tilt, limit.tilt, "rad")
            largest["turn acceleration"] = (np.abs(acceleration[:, 3:5]).max(), limit.turn_acceleration, "rad/s^2")
        for quantity, (value, bound, unit) in largest.items():
            if bound is not None and value > bound * (1 + LIMIT_TOLERANCE):
                found.append(f"{name}: {quantity} {value:.6g} {unit} exceeds {bound:g} {unit}")
        outside = np.maximum(limit.low - pose[:, :3], pose[:, :3] - limit.high).max()
        if outside > LIMIT_TOLERANCE:
            found.append(f"{name}: {outside:.3g} m outside its reach box")
    return found
