"""`AtRest`: by how much a robot at rest keeps its task's limits, for many poses in one call."""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...models.batch import in_blocks
from ...solvers import solve_batch
from ..audits.tensions import few_and_inverse, scaled
from ..limits import Limit, Rate
from ..nlp.guess import with_tilts
from ..tasks.paths import Motion
from ..tasks.scenario import Scenario

UNKNOWN = 2.0  # metres by which a limit may change while what moves moves by one, if the limit does not state it
SPARE = 0.01  # of the weight, from the limits of tensions: a motion needs more than rest does
BALANCED = 1e-9  # of the weight
FINEST = 1e-3  # [m]
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
    def _checked(self) -> list[tuple[int, Limit, slice, float]]:
        """Return the limits that rest can exceed: index, limit, place among the values, and metres per unit of it."""
        limits, checked = self.scenario.limits, []
        for k, (limit, place) in enumerate(zip(limits, limits.places, strict=True)):
            if limit.soft is not None or limit.is_equation or isinstance(limit, Rate):
                continue
            known = limit.per_metre if np.isfinite(limit.per_metre) else UNKNOWN
            unit = 1.0 / known if limit.unit == "m" else self.size / limit.scale
            checked.append((k, limit, place, unit))
        return checked

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
        n, checked = len(platform), self._checked
        if not checked:
            return np.full(n, np.inf), np.zeros(n, int)
        bodies = [np.hstack([pose, np.zeros((n, 12))]) for pose in (platform, *carriers.swapaxes(0, 1))]
        off_path = np.zeros((n, 6)) if off_path is None else off_path
        (table,) = in_blocks(self.scenario.limits.function, [*bodies, tensions, off_path], 1)
        at = np.zeros(n)
        for _, limit, place, _ in checked:
            if type(limit).over is not Limit.over:
                table[:, place] = limit.over(at, table[:, place])
        columns, owner, low, high, unit = self._columns
        table = table[:, columns]
        slack = np.minimum(table - low, high - table) * unit
        slack[np.isnan(slack)] = -np.inf
        least = slack.argmin(axis=1)
        return slack[np.arange(n), least], owner[least]

    @cached_property
    def _columns(self) -> tuple[np.ndarray, ...]:
        """Return which values are checked, the limit of each, its bounds, and metres per unit of it, (k,) each."""
        columns = [np.arange(place.start, place.stop) for _, _, place, _ in self._checked]
        each = [(k, limit.low, limit.high, unit) for k, limit, _, unit in self._checked]
        counts = [len(its) for its in columns]
        owner, low, high, unit = (np.repeat(part, counts) for part in zip(*each, strict=True))
        return np.concatenate(columns), owner, low, high, unit


def unsure(slack: np.ndarray, points: np.ndarray, slope: float = 1.0) -> np.ndarray:
    """Return the indices k of poses between which and the next a limit may be exceeded, though both keep it.

    `slack` (n,) [m] changes by at most `slope` times what any of `points` (n, k, 3) moves. Where they move less than
    a millimetre nothing is unsure.
    """
    moved = np.linalg.norm(np.diff(points, axis=0), axis=2).max(axis=1, initial=0.0)
    return np.flatnonzero((slack[1:] + slack[:-1] < slope * moved) & (moved > FINEST))
