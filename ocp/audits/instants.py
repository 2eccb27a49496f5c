"""`Instants`: the results of an audit at some instants: motion, tensions, and values of limited quantities."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...base.display import Displayed
from ...base.errors import InputError
from ...solvers import Certificate
from ..limits import Limit, Rate
from ..limits.distance import Distance
from ..tasks.deviation import Deviation
from ..tasks.paths import Motion
from ..tasks.scenario import Scenario
from .by_phase import distribution, taken_up
from .tensions import in_all_winds, scaled, with_all_loads, within_motors

OF_INSTANTS = (
    *("times", "tensions", "off_path", "A", "w", "tensions_unlimited", "gains", "violation", "supports"),
    *("other_w", "other_tensions"),
)
MOTIONS = ("motion", "carriers")


@dataclass(frozen=True)
class Instants(Displayed):
    """A motion and its tensions at some instants, with all that an audit computes from them."""

    scenario: Scenario
    deviation: Deviation | None  # of the motion from the references of `scenario`
    times: np.ndarray  # (n,) [s]
    motion: Motion  # of the platform in {G}, (n, 6) each
    carriers: Motion  # in {G}, (n, c, 6) each
    tensions: np.ndarray  # (n, m) [N], nan where there are none
    off_path: np.ndarray  # offset of the platform from its path, along the path's axes, (n, 6) [m, rad]
    few: bool  # whether the cables are too few for some wrenches
    tolerance: float  # the largest violation that passes [N]
    A: np.ndarray  # wrench matrices with moments over `Robot.length`, (n, 6, m)
    w: np.ndarray  # required wrenches, with the same moments, (n, 6) [N]
    tensions_unlimited: np.ndarray  # of least norm without limits, (n, m) [N]
    gains: np.ndarray  # by how much tensions of least norm change at most for a wrench of 1 N, (n, m)
    other_w: np.ndarray  # as `w`, with the winds and loads that decide, (n, k, 6) [N]
    other_tensions: np.ndarray  # their tensions, (n, k, m) [N]
    violation: np.ndarray  # distance of the required wrench from the available ones, (n,) [N]
    supports: np.ndarray  # forces of the ground, (n, s) [N]; s = 0 for a task without ground
    values: list[np.ndarray]  # what each limit bounds, (n, k) each; of distances (n, 0)
    certificate: Certificate | None  # that with the largest shortfall, with its time
    beyond: tuple[float, float]  # beyond the limits within the range of few cables [N], and when [s]

    @property
    def cases(self) -> list[Instants]:
        """Return them with the given wind and load, then with each other that decides in place of these."""
        alone = replace(self, other_w=self.other_w[:, :0], other_tensions=self.other_tensions[:, :0])
        others = zip(self.other_w.swapaxes(0, 1), self.other_tensions.swapaxes(0, 1), strict=True)
        return [alone, *(replace(alone, w=w, tensions=tensions) for w, tensions in others)]

    def of(self, rows: np.ndarray) -> Instants:
        """Return some of them."""
        parts = {name: getattr(self, name)[rows] for name in OF_INSTANTS}
        motions = {name: getattr(self, name).at(rows) for name in MOTIONS}
        return replace(self, **parts, **motions, values=[each[rows] for each in self.values])


def instants(scenario: Scenario, deviation: Deviation | None, times: np.ndarray) -> Instants:
    """Evaluate a motion at `times` (n,).

    Raises `InputError` if somewhere a cable has no length.
    """
    motion, carriers = scenario.motion(times, deviation)
    _check_lengths(scenario, times, motion, carriers)
    A = scenario.dynamics.wrench_matrix(motion.pose, carriers.pose)
    w = scenario.required_wrench(times, motion, carriers, scenario.wind)
    distribute = distribution(scenario, times, A)
    # Near the plan's own tensions a redundant robot keeps the planned distribution.
    result = distribute(w, taken_up(scenario, times) if deviation is None else deviation.tensions_at(times))
    if (winds := scenario.wind_set) is not None:
        result = in_all_winds(distribute, winds, motion, w, result)
    result = with_all_loads(distribute, times, motion, carriers, result)
    certificate = result.certificate
    if certificate is not None and result.row is not None:
        certificate = replace(certificate, time=float(times[result.row]))
    off_path = scenario.off_path(times, motion, carriers)
    cases = [(scaled(scenario, its), tensions) for its, tensions in ((w, result.tensions), *result.others)]
    other_w, other_tensions = (np.stack(each, axis=1)[:, 1:] for each in zip(*cases, strict=True))
    bounded = scenario.limits.along(motion, carriers, result.tensions, off_path, distances=False)
    if not scenario.phases.rest:
        chosen = within_motors(scenario, times, distribute.scaled_A, cases[0], bounded)
        if chosen is not result.tensions:
            changed = (chosen != result.tensions).any(axis=1)
            result = result._replace(tensions=chosen)
            moved, bases = motion.at(changed), carriers.at(changed)
            again = scenario.limits.along(moved, bases, chosen[changed], off_path[changed], distances=False)
            for its, other in zip(bounded, again, strict=True):
                its[changed] = other
    return Instants(
        scenario=scenario,
        deviation=deviation,
        times=times,
        motion=motion,
        carriers=carriers,
        tensions=result.tensions,
        off_path=off_path,
        few=distribute.few,
        tolerance=distribute.tolerance,
        A=distribute.scaled_A,
        w=cases[0][0],
        tensions_unlimited=distribute.unlimited(w),
        gains=distribute.gains,
        other_w=other_w,
        other_tensions=other_tensions,
        violation=result.violation,
        supports=result.supports,
        values=[
            np.where(scenario.in_force(limit, times)[:, None], limit.over(times, its), np.nan)
            for limit, its in zip(scenario.limits, bounded, strict=True)
        ],
        certificate=certificate,
        beyond=(result.beyond, float(times[result.row or 0])),
    )


def limited(
    scenario: Scenario,
    times: np.ndarray,
    motion: Motion,
    carriers: Motion,
    values: list[np.ndarray],
    rows: np.ndarray | slice = slice(None),
    limits: Iterable[Limit] | None = None,
) -> list[np.ndarray]:
    """Return the values of some `rows` of `Instants`, distances included, of some `limits`; default: of all."""
    times = times[rows]
    motion, carriers = motion.at(rows), carriers.at(rows)
    return [
        np.where(scenario.in_force(limit, times)[:, None], scenario.limits.distances(limit, motion, carriers), np.nan)
        if isinstance(limit, Distance)
        else values[scenario.limits.all.index(limit)][rows]
        for limit in (scenario.limits if limits is None else limits)
    ]


def joined(some: Instants, others: Instants) -> Instants:
    """Return all instants of both in order; rates are those between the instants of `some`."""
    times = np.concatenate([some.times, others.times])
    order = np.argsort(times, kind="stable")
    before = np.searchsorted(some.times, times[order], side="right") - 1

    def both(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        return np.concatenate([first, second])[order]

    changed: dict[str, Any] = {name: both(getattr(some, name), getattr(others, name)) for name in OF_INSTANTS}
    for name in MOTIONS:
        pairs = zip(getattr(some, name), getattr(others, name), strict=True)
        changed[name] = Motion(*(both(*pair) for pair in pairs))
    changed["values"] = [
        mine[before] if isinstance(limit, Rate) else both(mine, its)
        for limit, mine, its in zip(some.scenario.limits, some.values, others.values, strict=True)
    ]
    worst = max((some, others), key=lambda each: 0.0 if each.certificate is None else each.certificate.shortfall)
    changed |= {"certificate": worst.certificate, "beyond": max(some.beyond, others.beyond)}
    return replace(some, **changed)


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
