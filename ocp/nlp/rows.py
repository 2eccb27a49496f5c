"""Define what the parts of a program share: its mesh, its rows, and the motions that its unknowns stand for."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ...base.display import Displayed
from ..limits import Limit
from ..limits.places import BodyOutside, CablesOutside
from ..tasks.bernstein import Values
from ..tasks.scenario import POSITION, Scenario
from .held import Spans, held_spans
from .layout import DURATION, MARGIN, Layout

OTHER_COSTS = 1e-6  # of all but the missing wrench, in the elastic program: which is then the least there is
MANY = 12  # free coordinates: robots with more are teams
CABLES = "cables"  # in `Mesh.between`
STEPS = 4  # a motion is rarely that many times as fast as its reference


class Row(NamedTuple):
    """A row of a program: its bounds, and the limit that tightens them, if it is one's."""

    name: str
    low: float
    high: float
    limit: Limit | None = None
    side: float = 0.0  # of a soft limit, whose bounds are rows with only a lower bound: the lower (1) or the upper (-1)


class Tightening(NamedTuple):
    """Shifts by which the bounds of a limit's rows move inwards, and when the task fixes what it bounds."""

    lower: float = 0.0
    upper: float = 0.0
    held: Spans = ()

    def of(self, row: Row) -> tuple[float, float]:
        """Return by how much the lower and the upper bound of a row move inwards."""
        return (self.lower if row.side > 0 else self.upper, 0.0) if row.side else (self.lower, self.upper)


@dataclass(frozen=True)
class Mesh(Displayed):
    """The number of intervals of a program, and its distance from the limits."""

    steps: int  # intervals
    reserve: float = 0.0  # further distance from the tension limits [N], for what happens between the nodes
    # Share by which the limits of the task and of the carriers are reduced, for the same reason (`Limit.rows`).
    shrink: float = 0.0
    # Name of a limit, what it is about, and the share by which it is reduced beside, as an audit missed it.
    further: tuple[tuple[str, str, float], ...] = ()
    # Names of limits that rows between the points keep too, since an audit missed them there: of the platform's speed,
    # and of tensions. `CABLES`: of distances of cables from regions too, since a motion jumped over one.
    between: tuple[str, ...] = ()
    elastic: bool = False  # whether A t = w + s with a high cost on the slack s, so that there is always a solution

    @property
    def rows(self) -> tuple[object, ...]:
        """Return what of the mesh a program's rows depend on, besides their bounds."""
        return self.steps, self.elastic, self.between

    def shrink_of(self, limit: Limit) -> float:
        """Return the share by which a limit is reduced."""
        of_it = [share for name, about, share in self.further if limit.name == name and limit.is_about(about)]
        return self.shrink + max(of_it, default=0.0)

    def tightening(self, scenario: Scenario, limits: Iterable[Limit]) -> dict[Limit, Tightening]:
        """Return by how much the rows of some limits are tightened, if any are."""
        if not (self.shrink or self.further):
            return {}
        held = held_spans(scenario, self.shrink_of)
        places = dict(zip(scenario.limits, scenario.limits.places, strict=True))
        counts = {limit: places[limit].stop - places[limit].start for limit in limits}
        return {limit: Tightening(*self._inwards(limit, counts[limit]), held.get(limit, ())) for limit in limits}

    def _inwards(self, limit: Limit, count: int) -> tuple[float, float]:
        """Return by how much the bounds of the rows of a limit of so many values move inwards."""
        nothing = ca.SX.zeros(count)
        _, low, high = limit.rows(nothing)
        _, lowest, highest = limit.rows(nothing, self.shrink_of(limit))
        return (lowest - low if np.isfinite(low) else 0.0), (high - highest if np.isfinite(high) else 0.0)


def bounded(limit: Limit, values: ca.SX, slack: ca.SX | None) -> tuple[list[ca.SX], list[Row]]:
    """Return values and rows of a limit; if it is soft with its slack, in units of its scale."""
    value, low, high = limit.rows(values)
    if slack is None:
        return [value], [Row(limit.name, low, high, limit)] * value.numel()
    sides = [(sign, bound) for sign, bound in ((1.0, low), (-1.0, -high)) if np.isfinite(bound)]
    rows = [Row(limit.name, bound, np.inf, limit, sign) for sign, bound in sides for _ in range(value.numel())]
    return [sign * value + slack for sign, _ in sides], rows


def stretch(layout: Layout, x: Values) -> Values:
    """Return the duration of column x, relative to the references' duration."""
    place = layout.at(DURATION)
    return 1.0 if place is None else x[place]


def reference_symbols(name: str, references: np.ndarray) -> tuple[ca.SX, ca.SX]:
    """Return symbols for one column of `references` (k, points), and the same with what is constant as numbers.

    A node's rotation at a constant angle is then no rotation: on a level path the derivatives are three times cheaper.
    """
    symbols = ca.SX.sym(name, len(references))
    constant = np.ptp(references, axis=1) == 0.0
    values = [
        ca.SX(float(row[0])) if fixed else symbols[i]
        for i, (row, fixed) in enumerate(zip(references, constant, strict=True))
    ]
    return symbols, ca.vertcat(*values)


def spread(scenario: Scenario, owner: int | None) -> ca.DM:
    """Return the matrix (6, n) from free coordinates to the six of the platform (None) or of a carrier."""
    return ca.sparsify(ca.DM(scenario.spread(owner)))


def motions(scenario: Scenario, layout: Layout, x: ca.SX, parameters: ca.SX) -> list[list[ca.SX]]:
    """Return platform and carriers as symbols, [pose, velocity, acceleration] each: reference plus deviation."""
    scale, each = stretch(layout, x), []
    for reference, offset in zip(ca.vertsplit(parameters, 18), offsets(scenario, layout, x), strict=True):
        parts = zip(ca.vertsplit(reference, 6), ca.vertsplit(offset, 6), strict=True)
        each.append([at / scale**k + off for k, (at, off) in enumerate(parts)])
    return each


def offsets(scenario: Scenario, layout: Layout, x: ca.SX) -> list[ca.SX]:
    """Return the deviations of platform and carriers from their references, (18, 1) each, as `motions` has them."""
    owners: list[int | None] = [None, *range(len(scenario.robot.carriers))]
    deviation = ca.horzcat(x[layout.q], x[layout.v], x[layout.a])
    return [ca.vec(spread(scenario, owner) @ deviation) for owner in owners]


def costs_at(
    scenario: Scenario, layout: Layout, duration: ca.SX, x: ca.SX, bodies: Sequence[ca.SX]
) -> tuple[ca.SX, ca.SX]:
    """Return what costs in column x, and the values whose rates cost, in amounts (`Costs.function`).

    `duration` is the references' [s], `bodies` are the motions of the platform in {G} and of the carriers,
    (18, 1) each.
    """
    force, place = scenario.robot.force_scale, layout.at(MARGIN)
    margin = 0.0 if place is None else force * x[place]
    times = [duration * stretch(layout, x), margin]
    inputs = [*bodies, *offsets(scenario, layout, x), force * x[layout.tensions], *times]
    outputs: Any = scenario.costs.function.call(inputs)
    return tuple(outputs)


def in_world(scenario: Scenario, platform: list[ca.SX], carriers: list[list[ca.SX]]) -> list[ca.SX]:
    """Return the platform's pose, velocity and acceleration in {G}."""
    if not scenario.relative:
        return platform
    return list(scenario.dynamics.relative.motion_in_world(*platform, *carriers[0]))


def swept(scenario: Scenario, mesh: Mesh) -> dict[Limit, ca.Function]:
    """Return the limits that the program keeps between nodes, and their functions.

    They are distances from regions that are thinner than a few steps of the reference motion: for teams only distances
    of bodies, since a beam under quadrotors jumped over a post on every mesh, but four quadrotors with a point load
    took four times as long through a slot; for other robots distances of points, since a finer mesh finds what a body
    jumps over, and of cables where the mesh has them `between`.
    """
    platform, carriers = scenario.references(scenario.scheme.shares(mesh.steps) * scenario.duration)
    ways = [np.diff(motion.pose[:, POSITION], axis=0) for motion in (platform, *carriers)]
    longest = max(float(np.linalg.norm(way, axis=1).max()) for way in ways)  # from node to node
    thin = [limit for limit in scenario.limits if limit.thickness < STEPS * longest]
    thin = [limit for limit in thin if isinstance(limit, BodyOutside) == (scenario.count > MANY)]
    thin = [limit for limit in thin if CABLES in mesh.between or not isinstance(limit, CablesOutside)]
    functions = {limit: scenario.limits.on_the_way(limit) for limit in thin}
    return {limit: function for limit, function in functions.items() if function is not None}
