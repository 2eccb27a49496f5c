"""Compute the durations in which a path can be followed exactly and by its own time law: `durations`.

If all paths stretch, velocities go with 1/T and accelerations with 1/T^2, so at each point of the path the wrench is

    w(T) = c + d X,    X = (T_0 / T)^2,

with the wrench c at rest and c + d for a duration T_0: the dynamics are linear in accelerations and quadratic in
velocities. The X for which tensions inside their limits exist are then an interval, whose ends two linear programs in
(t, X) give; a duration must lie in the intervals of all points. Most points do not restrict the interval of those
before, which tensions at its ends show.
"""

from typing import NamedTuple

import numpy as np

from ...base.text import quantity
from ...base.tolerances import INDEPENDENT
from ...solvers import solve_batch
from ..tasks.paths import Motion
from ..tasks.scenario import Scenario

PLACES = 41
FASTEST = 1e4  # of X: a hundredth of T_0
SLACK = 1e-6  # relative: by so much the linear programs may be off


class Durations(NamedTuple):
    """A necessary condition on a duration T: shortest <= T <= longest."""

    # [s]; longest is infinite if rest is possible everywhere. If no duration is possible, shortest is infinite and
    # longest zero.
    shortest: float
    longest: float
    at: float  # the decisive point, as a fraction of the duration: that of `shortest`, or where no duration is possible

    @property
    def exist(self) -> bool:
        """Return whether any duration is possible."""
        return self.shortest <= self.longest

    def describe(self) -> str:
        """Return the shortest and the longest duration as text."""
        if not self.exist:
            part = f"first {quantity(100 * self.at, '%', 3)} of the motion alone" if self.at else "start alone"
            return f"no duration is feasible with the task's time law (proven by the {part if self.at < 1 else 'end'})"
        upper = "" if self.longest == float("inf") else f", at most {quantity(self.longest, 's')}"
        return f"tensions require at least {quantity(self.shortest, 's')}{upper} with the task's time law"

    def leave(self, low: float, high: float) -> bool:
        """Return whether a duration from `low` to `high` [s] may be possible; doubtful ones may."""
        return max(self.shortest * (1 - SLACK), low) <= min(self.longest * (1 + SLACK), high)


def durations(scenario: Scenario, shares: np.ndarray | None = None) -> Durations | None:
    """Return the durations that are possible at points of the path; None if this method does not apply.

    `shares` of the duration, (k,), are where the motion is at these points; default: `PLACES` from 0 to 1.

    It does not if anything but the duration is free, a path has times of its own, the drag depends on the speed
    in another way, the ground bears something, or the cables have fewer independent columns than the platform has
    degrees of freedom.
    """
    if scenario.count or scenario.task.wind is not None or scenario.phases.rest or not scenario.stretches:
        return None
    robot, dynamics = scenario.robot, scenario.dynamics
    rows = np.flatnonzero(robot.dof_mask)
    scale = robot.wrench_scale[rows]
    loads = [None, *range(scenario.phases.extremes)]
    shares = np.linspace(0.0, 1.0, PLACES) if shares is None else shares
    platform, carriers = scenario.motion(shares * scenario.duration, None)
    A = dynamics.wrench_matrix(platform.pose, carriers.pose)[:, rows] * scale[:, None]
    values = np.linalg.svd(A, compute_uv=False)
    if robot.m < len(rows) or (values[:, -1] < INDEPENDENT * values[:, 0]).any():
        return None

    def wrenches(platform: Motion, carriers: Motion) -> np.ndarray:
        """Return the wrenches that platform and each load need, place after place, (k, r) [force scale]."""
        each = [scenario.required_wrench(shares, platform, carriers, None, load) for load in loads]
        return np.stack(each, axis=1).reshape(-1, 6)[:, rows] * scale / robot.force_scale

    A, places = (np.repeat(values, len(loads), axis=0) for values in (A, shares))
    c = wrenches(Motion.still(platform.pose), Motion.still(carriers.pose))
    # T_0 is the duration with wrenches of the size of the robot's forces: others lose the digits of X or of d.
    d, whole = np.zeros_like(c), scenario.duration
    for _ in range(2):
        whole *= np.sqrt(float(np.abs(d).max()) or 1.0)
        d = wrenches(*scenario.lasting(whole).motion(shares * whole, None)) - c
    bounds = [bound / robot.force_scale for bound in scenario.bounds()]
    least, most, decisive, k = 0.0, FASTEST, 0, 0
    while True:
        # Where tensions exist at both ends, they do in between: the set of all (t, X) is convex.
        here = [solve_batch(A[k:], c[k:] + d[k:] * X, *bounds).feasible for X in (least, most)]
        restricted = np.flatnonzero(~np.logical_and(*here))
        if not restricted.size:
            break
        first = restricted[0]
        k += int(first)
        interval = _interval(A[k], c[k], d[k], bounds, (least, most), (here[0][first], here[1][first]))
        if interval is None:
            return Durations(np.inf, 0.0, float(places[k]))
        decisive = k if interval[1] < most else decisive
        least, most = interval
        k += 1
    shortest = 0.0 if most == FASTEST else whole / np.sqrt(most)
    longest = np.inf if least <= SLACK else whole / np.sqrt(least)
    return Durations(float(shortest), float(longest), float(places[decisive]))


def _interval(
    A: np.ndarray,
    c: np.ndarray,
    d: np.ndarray,
    bounds: list[np.ndarray],
    within: tuple[float, float],
    possible: tuple[bool, bool],
) -> tuple[float, float] | None:
    """Return the least and largest X of an interval with A t = c + d X, t inside its bounds; None if there is none.

    `possible` says which ends of the interval are such X themselves.
    """
    from scipy.optimize import linprog

    ends = list(within)
    for i in np.flatnonzero(np.logical_not(possible)):
        cost = np.append(np.zeros(A.shape[1]), (1.0, -1.0)[i])
        box = [*zip(*bounds, strict=True), within]
        result = linprog(cost, A_eq=np.column_stack([A, -d]), b_eq=c, bounds=box, method="highs")
        if result.status == 2:  # infeasible
            return None
        if result.success:  # any other message of HiGHS proves nothing
            ends[i] = float(result.x[-1])
    return ends[0], ends[1]
