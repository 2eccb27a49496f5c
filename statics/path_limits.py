"""How fast the rate at which a robot follows a path may change, from the limits of tensions and carriers: `PathLimits`.

A motion q(tau) that is followed at a rate r(t), with dtau/dt = r, stays on its path. It needs the wrench

    w = a u + b r^2 + c,   u = dr/dt

with c the wrench at rest, a the wrench of an acceleration of dq/dtau, and b what velocities and accelerations of the
plan need in addition to c: r = 1 and u = 0 are the plan itself. Each facet of the available wrench set
(`solvers.available_wrench`) therefore bounds u at each tau and r.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np

from ..models.dynamics import dynamics_of
from ..models.robot import Robot
from ..models.trajectory import Trajectory
from ..solvers.available_wrench import facets
from .winch_forces import has_winches, shares_of_winches

STEP = 0.008  # [s] between two instants of a stop, in which u is linear
FASTEST = 0.5 / STEP  # [1/s], of u
WINDOW, INSTANTS = 0.8, 80  # [s] of the plan that limits are computed for at once, and at how many instants
LEVELS = np.linspace(0.0, 1.0, 65)  # of r^2, for which the range of u shows how slow a stop may become
ROOM = 1.0  # [1/s], between the least and the largest u
STILL = 1e-9  # of the rate
FLAT = 1e-12  # of the robot's forces: a facet along which u changes less does not bound it

_BoundsAt: TypeAlias = Callable[[int, float], "_Bounds"]  # in a window, from its number and the reserve


class PathLimits:
    """The range of u at times of a plan, from the limits of tensions and of the accelerations of carriers."""

    def __init__(self, bounds: _BoundsAt, begins: float, end: float, reserve: float, goes_on: bool):
        self.begins, self._apart, self._goes_on, self._end = begins, WINDOW / INSTANTS, goes_on, end
        self._bounds, self._reserve, self._first = bounds, reserve, int(begins / WINDOW)
        self._next, self._rows = self._first + 1, bounds(self._first, reserve)
        self._extend(0)

    def _extend(self, windows: int) -> None:
        """Compute the limits of more windows, up to an instant at which the robot can rest, or the end of the plan."""
        while windows > 0 or (self._goes_on and not self._rows.can_rest[-1] and WINDOW * self._next < self._end):
            more = self._bounds(self._next, self._reserve)
            self._rows = _Bounds(*(np.concatenate(parts) for parts in zip(self._rows, more, strict=True)))
            self._next, windows = self._next + 1, windows - 1
        self._lowest = self._floor()

    def _floor(self) -> np.ndarray:
        """Return the least x = r^2 from which the motion can go on inside the limits, at each instant, (n,)."""
        floor, after = np.zeros(len(self._rows.falls)), 0.0
        if not self._goes_on or self._rows.can_rest.all():
            return floor
        least, most = self._rows.range_of(LEVELS[:, None, None])
        free = most - least
        needed = np.clip(free[-1], 0.0, ROOM)  # where u has no room, no step ends
        for at in range(len(floor) - 1, -1, -1):
            good = (free[:, at] >= needed[at]) & (LEVELS + 2 * self._apart * most[:, at] >= after)
            floor[at] = after = float(LEVELS[np.argmax(good)])  # the lowest, where not even the plan is possible
        return floor

    def at(self, tau: float, rate: float) -> tuple[float, float]:
        """Return the least and the largest u at a time of the plan and a rate."""
        place = (tau - WINDOW * self._first) / self._apart
        while place > len(self._lowest) - 3:
            self._extend(1)
        k = int(place)
        # Three instants, so that where the plan's acceleration jumps, u keeps the limits after it a step before it.
        least, most = _Bounds(*(part[k : k + 3] for part in self._rows)).range_of(rate * rate)
        low, high = float(least.max()), float(most.min())
        if low > high:  # none is possible: of those between, the one nearest to the rate of now
            return (min(max(0.0, high), low),) * 2
        floor = float(self._lowest[k + 2])
        if floor > 0:  # reached in time, from one to two instants before
            low = min(max(low, (floor - rate * rate) / (2 * self._apart * (k + 2 - place))), high)
        return low, high


class _Bounds(NamedTuple):
    """Bounds of u at n instants, with x = r^2, of k facets and c carriers.

    least <= u + falls x <= most, and |u - middle x| <= sqrt(free - falling x^2) by |v u + g x| <= 1; infinite where
    nothing is bounded.
    """

    least: np.ndarray  # (n, k)
    most: np.ndarray
    falls: np.ndarray
    middle: np.ndarray  # (n, c)
    free: np.ndarray
    falling: np.ndarray

    @property
    def can_rest(self) -> np.ndarray:
        """Return at which instants the robot can rest, (n,)."""
        least, most = self.range_of(0.0)
        return (least <= 0) & (most >= 0)

    def range_of(self, x: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the least and the largest u for x = r^2, a number or (..., 1, 1), at each instant, (..., n)."""
        fallen = self.falls * x
        least = (self.least - fallen).max(axis=-1, initial=-FASTEST)
        most = (self.most - fallen).min(axis=-1, initial=FASTEST)
        if self.free.shape[1]:
            middle, root = self.middle * x, np.sqrt(np.maximum(self.free - self.falling * (x * x), 0.0))
            least, most = np.maximum(least, (middle - root).max(-1)), np.minimum(most, (middle + root).min(-1))
        return least, most


class Instants(NamedTuple):
    """Coefficients of n instants for any reserve: wrenches a u + b x + c along the normals of k facets, (n, k)."""

    a: np.ndarray  # nan where a facet bounds nothing
    b: np.ndarray
    c: np.ndarray
    low: np.ndarray  # of what the cables can give
    high: np.ndarray
    carriers: tuple[np.ndarray, np.ndarray, np.ndarray]  # the last three of `_Bounds`

    def bounds(self, reserve: float) -> _Bounds:
        """Return the bounds of u; tensions keep the share `reserve` of their range."""
        inside, now = reserve * (self.high - self.low), self.b + self.c
        # At most half of what the plan itself keeps, so that it stays possible and can be left.
        low = self.low + np.clip((now - self.low) / 2, 0.0, inside)
        high = self.high - np.clip((self.high - now) / 2, 0.0, inside)
        low, high = np.minimum(low, now) - self.c, np.maximum(high, now) - self.c
        least, most = np.sort([low / self.a, high / self.a], axis=0)
        bounds = np.nan_to_num(least, nan=-np.inf), np.nan_to_num(most, nan=np.inf), np.nan_to_num(self.b / self.a)
        return _Bounds(*bounds, *self.carriers)


def instants_of(robot: Robot, trajectory: Trajectory, first: float) -> Instants:
    """Return the instants of a window of a plan that begins at `first` [s]."""
    platform, carriers = trajectory.at(first + WINDOW / INSTANTS * np.arange(INSTANTS))
    dynamics, rows = dynamics_of(robot), np.flatnonzero(robot.dof_mask)
    scale, still = robot.wrench_scale[rows], np.zeros_like(platform[0])
    c, a, b = (
        dynamics.required_wrench(platform[0], *motion, wind=trajectory.wind)
        for motion in ((still, still), (still, platform[1]), platform[1:])
    )
    a, b = a - c, b - c
    A = dynamics.wrench_matrix(platform[0], carriers[0])[:, rows]
    available = facets(A * scale[:, None], robot.t_min, robot.t_max)
    a, b, c = (np.einsum("nki,ni->nk", available.normals, part[:, rows] * scale) for part in (a, b, c))
    a[np.abs(a) < FLAT * robot.force_scale] = np.nan
    limited = [k for k, carrier in enumerate(robot.carriers) if carrier.motion_limits.acceleration is not None]
    largest = np.array([robot.carriers[k].motion_limits.acceleration for k in limited], dtype=float)
    v, g = (part[:, limited, :3] / largest[:, None] for part in carriers[1:])
    vv, vg, gg = (np.einsum("nci,nci->nc", *two) for two in ((v, v), (v, g), (g, g)))
    if has_winches(robot):
        v, g = shares_of_winches(robot, trajectory, first + WINDOW / INSTANTS * np.arange(INSTANTS))
        vv, vg, gg = (np.hstack(pair) for pair in ((vv, v * v), (vg, v * g), (gg, g * g)))
    moves = vv > STILL
    vv = np.where(moves, vv, 1.0)
    bounds = -vg / vv * moves, np.where(moves, 1.0 / vv, np.inf), (vv * gg - vg**2) / vv**2 * moves
    return Instants(a, b, c, available.low, available.high, bounds)
