"""The audit: a planned motion, evaluated again on a dense grid.

Inverse dynamics in {G} and the exact tension solver evaluate each instant separately, by code that the nonlinear
program does not use. `tensions` computes tensions and violation, `checks` all other limits.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np

from ...base.display import Displayed
from ...base.tolerances import INDEPENDENT
from ...solvers import Certificate
from ..tasks.deviation import Deviation
from ..tasks.paths import Motion
from ..tasks.scenario import AUDIT_RATE, LEAST_INTERVALS, MANY_SAMPLES, MOST_SAMPLES, Scenario, least_audit_rate
from .checks import START_TENSIONS, excesses
from .clearances import came_too_near
from .drift import Drift, drift
from .excess import TENSIONS, Excess
from .instants import instants, limited
from .peaks import with_peaks
from .tensions import scaled, tolerance_of


@dataclass(frozen=True)
class Audit(Displayed):
    """The dense evaluation of a motion."""

    rate: float  # instants per second [Hz]
    times: np.ndarray  # the dense grid, (n,)
    motion: Motion  # of the platform in {G}, at `times`
    carriers: Motion  # likewise
    tensions: np.ndarray  # the audited ones, (n, m) [N]; where none exist nan, or near singular poses the closest
    tensions_unlimited: np.ndarray  # of least norm without limits, (n, m) [N]; negative: the cable would push
    # Distance of the required wrench from the available wrench set, (n,) [N], the largest from each time to the next;
    # rounding errors where tensions exist.
    violation: np.ndarray
    tolerance: float  # the largest violation that passes [N]
    tracking_error: np.ndarray  # distance from the path at each time, (n,) [m]
    excess: list[Excess] = field(default_factory=list)  # other hard limits that are exceeded (`limits`, ends, ...)
    soft_excess: list[Excess] = field(default_factory=list)  # soft limits that are exceeded
    # The one with the largest shortfall, with its time, and its wind if the task has a box of winds; None if all exist.
    certificate: Certificate | None = None
    supports: np.ndarray | None = None  # forces of the ground, (n, s) [N], zero while it hangs; None without ground
    limiting: Callable[..., list[np.ndarray]] = field(default=list, repr=False, compare=False)  # `limited`, of rows too
    drifting: Callable[[], Drift] | None = field(default=None, repr=False, compare=False)  # computes `drift`

    @cached_property
    def limited(self) -> list[np.ndarray]:
        """Return the limited quantities of each limit, (n, k) in its unit; nan where it is not in force."""
        return self.limiting()

    @cached_property
    def drift(self) -> Drift | None:
        """Return the error of an open-loop simulation with the planned tensions, which takes as long as the audit.

        None for robots that can follow any motion exactly, for motions with loads or on the ground, and where no
        tensions exist.
        """
        return None if self.drifting is None else self.drifting()

    @property
    def passed(self) -> bool:
        """Return whether the motion keeps all limits."""
        return bool(self.violation.max() <= self.tolerance) and not self.excess

    @property
    def worst(self) -> int:
        """Return the index of the time with the largest violation, or with the largest rounding error."""
        return int(self.violation.argmax())

    def to_dict(self) -> dict[str, Any]:
        """Return "rate_hz", "worst_violation" [N], "at_s", "tolerance" [N], "excess", "soft_excess" and "drift"."""
        drift = None
        if self.drift is not None:  # infinity becomes None: JSON has no number for it
            drift = {name: value if np.isfinite(value) else None for name, value in self.drift._asdict().items()}
        return {
            "rate_hz": self.rate,
            "worst_violation": float(self.violation.max()),
            "at_s": float(self.times[self.worst]),
            "tolerance": self.tolerance,
            "excess": [excess.to_dict() for excess in self.excess],
            "soft_excess": [excess.to_dict() for excess in self.soft_excess],
            "drift": drift,
        }


def audit(scenario: Scenario, deviation: Deviation | None, to_show: bool = False) -> Audit:
    """Audit the motion of `deviation`, or the references alone.

    One that is known to be infeasible and only `to_show` is audited at the output times, without its drift. Raises
    `InputError` if a cable has zero length somewhere.
    """
    intervals = scenario.output_samples
    if not to_show:  # a multiple: saved instants are audited ones
        many = max(least_audit_rate(scenario.task) * scenario.duration, MANY_SAMPLES)
        wanted = min(max(AUDIT_RATE * scenario.duration, LEAST_INTERVALS), many, MOST_SAMPLES)
        intervals *= max(int(np.ceil(wanted / intervals - 1e-9)), 1)
    times = np.linspace(0.0, scenario.duration, intervals + 1)
    regular = instants(scenario, deviation, times)
    seen = regular if to_show else with_peaks(regular)
    exceeded = excesses(seen) + came_too_near(seen)
    beyond, at = seen.beyond
    if beyond > tolerance_of(scenario.robot):
        exceeded.append(Excess(TENSIONS, "platform", at, beyond, 0.0, "N", "exactly"))
    soft = {limit.name for limit in scenario.limits if limit.soft is not None}
    hangs = not (scenario.phases.carry or scenario.phases.rest)
    motion, carriers, tensions = regular.motion, regular.carriers, regular.tensions
    followed = not to_show and regular.few and hangs and np.isfinite(tensions).all()
    violation = np.zeros(len(times))
    np.maximum.at(violation, np.searchsorted(times, seen.times, side="right") - 1, seen.violation)
    return Audit(
        rate=(len(times) - 1) / scenario.duration,
        times=times,
        motion=motion,
        carriers=carriers,
        tensions=tensions,
        tensions_unlimited=regular.tensions_unlimited,
        violation=violation,
        tolerance=regular.tolerance,
        supports=regular.supports if scenario.phases.rest else None,
        tracking_error=np.linalg.norm(regular.off_path[:, :3], axis=1),
        excess=[excess for excess in exceeded if excess.limit not in soft],
        soft_excess=[excess for excess in exceeded if excess.limit in soft],
        limiting=partial(limited, scenario, times, motion, carriers, regular.values),
        certificate=seen.certificate,
        drifting=partial(drift, scenario, times, motion, carriers, tensions) if followed else None,
    )


def other_tensions_may_pass(scenario: Scenario, audit: Audit) -> bool:
    """Return whether the same motion with other tensions may pass, if this audit did not."""
    exceeded = {excess.limit for excess in audit.excess}
    if audit.violation.max() > audit.tolerance or not exceeded <= scenario.limits.of_tensions | {START_TENSIONS}:
        return False
    return other_tensions_exist(scenario, audit)


def other_tensions_exist(scenario: Scenario, audit: Audit) -> bool:
    """Return whether the cables can give a motion's wrenches by tensions other than the audited ones."""
    if scenario.phases.jumps:
        return False  # none that a program has: they jump where the load changes
    A = scenario.dynamics.wrench_matrix(audit.motion.pose, audit.carriers.pose)
    values = np.linalg.svd(scaled(scenario, A), compute_uv=False)
    return scenario.robot.m > values.shape[1] or bool((values[:, -1] < INDEPENDENT * values[:, 0]).any())
