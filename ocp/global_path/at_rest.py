"""`AtRest`: by how much a robot at rest keeps its task's limits, for many poses in one call."""

from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ...models.batch import in_blocks
from ...solvers import solve_batch
from ..audits.tensions import few_and_inverse, scaled
from ..limits import Limit, Rate
from ..nlp.guess import with_tilts
from ..tasks.paths import Motion
from ..tasks.scenario import Scenario
from .body_bounds import BodyBounds

UNKNOWN = 2.0  # metres by which a limit may change while what moves moves by one, if the limit does not state it
SPARE = 0.01  # of the weight, from the limits of tensions: a motion needs more than rest does
BALANCED = 1e-9  # of the weight
FINEST = 1e-3  # [m]
ENOUGH = 0.05  # of the size of a body: a distance of which a lower bound is larger is not evaluated
MISSED = 0.1  # of the weight, which few cables cannot balance to the last bit; the program can


class Kept(NamedTuple):
    """Distances of n poses at rest from limits."""

    # (n,) [m]: by how much everything that moves may move before a limit is exceeded; negative where one is.
    slack: np.ndarray
    points: np.ndarray  # (n, k, 3) [m]: what moves
    worst: np.ndarray  # (n,) index of the limit that is kept by least; -1 where there are no tensions


class AtRest:
    """Evaluate the hard limits of a scenario, and whether there are tensions, for platform and carriers at rest.

    Limits of other units than metres are kept or not: their slack is in parts of the robot's size. Without `balance`
    it does not matter whether there are tensions.
    """

    def __init__(self, scenario: Scenario, size: float, spare: float = SPARE, balance: bool = True):
        self.scenario, self.size, self.spare, self.balance = scenario, size, spare, balance

    @cached_property
    def _checked(self) -> list[tuple[int, Limit, float]]:
        """Return the limits that rest can exceed: index, limit, and metres per unit of it."""
        checked = []
        for k, limit in enumerate(self.scenario.limits):
            if limit.soft is not None or limit.is_equation or isinstance(limit, Rate):
                continue
            known = limit.per_metre if np.isfinite(limit.per_metre) else UNKNOWN
            checked.append((k, limit, 1.0 / known if limit.unit == "m" else self.size / limit.scale))
        return checked

    @cached_property
    def _bodies(self) -> BodyBounds:
        return BodyBounds([limit for _, limit, _ in self._checked])

    @cached_property
    def _others(self) -> list[tuple[int, Limit, float]]:
        """Return the checked limits that are evaluated for all poses."""
        of_bodies = {limit for pair in self._bodies.pairs for limit in pair}
        return [each for each in self._checked if each[1] not in of_bodies]

    def _values(self, limits: tuple[Limit, ...], arguments: list[np.ndarray]) -> np.ndarray:
        """Return the values of some limits, (n, k)."""
        if limits not in self._functions:
            self._functions[limits] = self.scenario.limits.function_of(limits)
        return in_blocks(self._functions[limits], arguments, 1)[0]

    @cached_property
    def _functions(self) -> dict[tuple[Limit, ...], ca.Function]:
        return {}

    def __call__(self, platform: np.ndarray, carriers: np.ndarray, off_path: np.ndarray | None = None) -> Kept:
        """Return by how much limits are kept by platform (n, 6) and carriers (n, c, 6)."""
        points = self.scenario.moving_points(platform, carriers)
        A, w, tensions, exist, inverse = self._balance(platform, carriers)
        tilted = with_tilts(self.scenario, A, tensions, carriers, np.zeros_like(carriers))
        slack, worst = self._slack(platform, tilted, tensions, off_path)
        # The exact solver decides only where nothing else does: it takes longer than all limits.
        exist |= not self.balance
        open_ones = np.flatnonzero((slack >= 0.0) & ~exist)
        if open_ones.size and inverse is not None:
            low, high = self._bounds
            _, missed = self._nearest(A[open_ones], w[open_ones], inverse[open_ones], (low + high) / 2)
            exist[open_ones] = missed <= BALANCED * self.scenario.robot.force_scale
            open_ones = open_ones[~exist[open_ones]]
            if open_ones.size:
                exist[open_ones] = solve_batch(A[open_ones], w[open_ones], *self._bounds).feasible
        return Kept(np.where(exist, slack, np.minimum(slack, -self.size)), points, np.where(exist, worst, -1))

    @cached_property
    def _bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the limits of the tensions less what a motion needs, (m,) each [N]."""
        low, high = self.scenario.bounds()
        spare = np.minimum(self.spare * self.scenario.robot.force_scale, (high - low) / 4)
        return low + spare, high - spare

    @cached_property
    def _weight(self) -> np.ndarray | None:
        """Return the wrench at rest (6,) in newtons, which no pose changes; None where it turns with it."""
        scenario, home = self.scenario, self.scenario.robot.home
        if scenario.phases.carry or (scenario.wind is not None and any(scenario.wind)):
            return None
        return scaled(scenario, scenario.dynamics.required_wrench(home, *np.zeros((2, 6)))[None])[0]

    def _balance(
        self, platform: np.ndarray, carriers: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray | None]:
        """Return A (n, 6, m) and w (n, 6) in newtons, and the tensions of least norm, cut to their limits, (n, m).

        Then at which of the poses they balance what there is at rest, and the inverse of A (n, m, 6), None where A does
        not span all wrenches.
        """
        scenario, robot = self.scenario, self.scenario.robot
        A = scaled(scenario, scenario.dynamics.wrench_matrix(platform, carriers))
        known = np.isfinite(A).all(axis=(1, 2))  # false where an attachment lies on the axis of a pulley or inside it
        A[~known] = 0.0
        if self._weight is not None:
            w = np.broadcast_to(self._weight, platform.shape)
        else:
            times, still = np.zeros(len(platform)), Motion.still(platform)
            w = scaled(scenario, scenario.required_wrench(times, still, wind=scenario.wind))
        few, inverse = few_and_inverse(A, np.flatnonzero(robot.dof_mask))
        tensions, missed = self._nearest(A, w, inverse, np.zeros(robot.m))
        exist = known & (missed <= (MISSED if few else BALANCED) * robot.force_scale)
        return A, w, tensions, exist, None if few else inverse

    def _nearest(
        self, A: np.ndarray, w: np.ndarray, inverse: np.ndarray, to: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the tensions nearest to others (m,) that balance w, cut to their limits, (n, m), and what they miss.

        Tensions nearest to the middle of the limits are often inside them where tensions of least norm are not.

        Source: Pott, Bruckmann and Mikelsons, Closed-form force distribution for parallel wire robots, 2009.
        """
        tensions = np.clip(to + (inverse @ (w - A @ to)[..., None])[..., 0], *self._bounds)
        return tensions, np.linalg.norm((A @ tensions[..., None])[..., 0] - w, axis=1)

    def _slack(
        self, platform: np.ndarray, carriers: np.ndarray, tensions: np.ndarray, off_path: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the smallest slack of all limits (n,) [m], and the index of its limit."""
        n = len(platform)
        moving = [np.hstack([pose, np.zeros((n, 12))]) for pose in (platform, *carriers.swapaxes(0, 1))]
        arguments = [*moving, tensions, np.zeros((n, 6)) if off_path is None else off_path]
        slack, worst = np.full(n, np.inf), np.zeros(n, int)
        if self._others:
            table = self._values(tuple(limit for _, limit, _ in self._others), arguments)
            columns, owner, low, high, unit = self._columns
            at = np.zeros(n)
            for _, limit, place in columns:
                if type(limit).over is not Limit.over:
                    table[:, place] = limit.over(at, table[:, place])
            kept = np.minimum(table - low, high - table) * unit
            kept[np.isnan(kept)] = -np.inf
            least = kept.argmin(axis=1)
            slack, worst = kept[np.arange(n), least], owner[least]
        return self._past_bodies(arguments, slack, worst) if self._bodies.pairs else (slack, worst)

    def _past_bodies(
        self, arguments: list[np.ndarray], slack: np.ndarray, worst: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the smallest slack and its limit where distances of bodies from regions count too.

        A distance is evaluated only where its bound permits that it is small, and smaller than all others.
        """
        bodies = self._bodies
        bounds, enough = bodies(arguments[0][:, :6]), ENOUGH * bodies.size
        for row in np.flatnonzero(bounds.min(axis=1) < np.minimum(slack, enough)):
            here = [each[row : row + 1] for each in arguments]
            least = min(float(slack[row]), enough)
            for pair in np.argsort(bounds[row]):
                if bounds[row, pair] >= least:
                    break
                its = bodies.pairs[pair]
                bounds[row, pair] = self._values(its, here).min() - its[0].low
                least = min(least, bounds[row, pair])
        nearest = bounds.argmin(axis=1)
        of_bodies = bounds[np.arange(len(bounds)), nearest]
        index = {limit: k for k, limit, _ in self._checked}
        owner = np.array([index[pair[0]] for pair in bodies.pairs])
        return np.minimum(slack, of_bodies), np.where(of_bodies < slack, owner[nearest], worst)

    @cached_property
    def _columns(self) -> tuple[Any, ...]:
        """Return index, limit and values of each, then the limit of each value, its bounds, and metres per unit."""
        every = self.scenario.limits.places
        counts = [every[k].stop - every[k].start for k, *_ in self._others]
        ends = np.cumsum([0, *counts])
        places = [slice(*pair) for pair in pairwise(ends.tolist())]
        each = [(k, limit.low, limit.high, unit) for k, limit, unit in self._others]
        columns = [(k, limit, place) for (k, limit, _), place in zip(self._others, places, strict=True)]
        return columns, *(np.repeat(part, counts) for part in zip(*each, strict=True))


def unsure(slack: np.ndarray, points: np.ndarray, slope: float = 1.0) -> np.ndarray:
    """Return the indices k of poses between which and the next a limit may be exceeded, though both keep it.

    `slack` (n,) [m] changes by at most `slope` times what any of `points` (n, k, 3) moves. Where they move less than
    a millimetre nothing is unsure.
    """
    moved = np.linalg.norm(np.diff(points, axis=0), axis=2).max(axis=1, initial=0.0)
    return np.flatnonzero((slack[1:] + slack[:-1] < slope * moved) & (moved > FINEST))
