"""Stop a robot on the path of its plan, as soon as its tensions permit: `stop_along`.

A motion q(tau) that is followed at a rate r(t), with dtau/dt = r, stays on its path. It needs the wrench

    w = a u + b r^2 + c,   u = dr/dt

with c the wrench of rest, a that of the velocity dq/dtau as an acceleration, and b what velocities and accelerations of
the plan need in addition to c: r = 1 and u = 0 are the plan itself. Each facet of the available wrench set
(`solvers.available_wrench`) therefore bounds u at each tau and r. A stop takes the least u, from r = 1 to r = 0.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import groupby
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from ..base.display import Displayed, Fact
from ..base.netcdf import Contents
from ..base.text import quantity
from ..models.dynamics import dynamics_of
from ..models.motion_file import dimensions, motion_variables, over
from ..models.parsing import to_yaml
from ..models.rigid_load import RigidLoad
from ..models.robot import Robot
from ..models.trajectory import Motion, Trajectory
from ..solvers import Certificate, TensionProblem, certify, solve_batch
from ..solvers.available_wrench import facets
from ..solvers.in_place import RHO
from .continuation import RESTS, continued
from .distribution import wrench_problem
from .team_stops import team_stop_along
from .winch_forces import has_winches, overloaded_winch, shares_of_winches

if TYPE_CHECKING:
    import xarray as xr

STEP = 0.008  # [s] between two instants of a stop, in which u is linear
FASTEST = 0.5 / STEP  # [1/s], of u
WINDOW, INSTANTS = 0.8, 80  # [s] of the plan that limits are computed for at once, and at how many instants
LEVELS = np.linspace(0.0, 1.0, 65)  # of r^2, at which is asked how slow a stop may become
ROOM = 1.0  # [1/s], between the least and the largest u
STILL = 1e-9  # of the rate
FLAT = 1e-12  # of the robot's forces: a facet along which u changes less does not bound it
PARTS = 8  # of a step, between which a stop is audited and given
# One after the other: the reserve, a share of what the cables can give along each normal, and whether a robot goes on
# through places in which it cannot rest.
ATTEMPTS = (0.002, True), (0.02, True), (0.1, True), (0.002, False)
LITTLE = 1e-3  # of the robot's forces: a wrench that is missed by less matters less than the time to stop
LONGEST = 60.0  # [s]
AT_ONCE = 16  # stops that are audited
MISSING = 1e-7  # of the robot's forces: a wrench that is missed by less is given


@dataclass(frozen=True, eq=False)
class Stop(Displayed):
    """A motion from an instant of a plan to rest, on the plan's path.

    Attributes:
        robot: The robot.
        begins, ends: Times in the plan [s]: where the stop begins, and where on the path it ends.
        times: From 0 to its duration, (n,) [s].
        platform, carriers: Pose, velocity and acceleration in {G} at these times: (n, 6) each, and (n, c, 6) each.
        tensions: (n, m) [N]; where none exist inside the limits, those with the closest wrench.
        certificate: Certificate of the instant with the largest shortfall; None if tensions inside their limits always
            exist.
        limit: The limit of flying carriers, or of the force of a winch, that is exceeded most, with value and time;
            empty if none is.
        load: Load of the platform from the beginning of the stop until the robot rests; default: no load.
    """

    robot: Robot
    begins: float
    ends: float
    times: np.ndarray
    platform: Motion
    carriers: Motion
    tensions: np.ndarray
    certificate: Certificate | None
    limit: str = ""
    load: RigidLoad | None = None

    @property
    def duration(self) -> float:
        """Return the time until the robot rests [s]."""
        return float(self.times[-1])

    @property
    def distance(self) -> float:
        """Return the length of the path of the platform until it rests [m]."""
        return float(np.linalg.norm(np.diff(self.platform[0][:, :3], axis=0), axis=1).sum())

    @property
    def feasible(self) -> bool:
        """Return whether tensions and carriers stay inside their limits from the beginning to the end."""
        return self.certificate is None and not self.limit

    def to_dict(self) -> dict[str, Any]:
        """Return "begins", "ends" and "duration" [s], "distance" [m] and "feasible", for JSON."""
        return {name: getattr(self, name) for name in ("begins", "ends", "duration", "distance", "feasible")}

    @property
    def trajectory(self) -> xr.Dataset:
        """Return the motion and its tensions over time, as `Plan.trajectory` does; `simulate` follows it."""
        return self._contents.dataset()

    @property
    def _contents(self) -> Contents:
        variables = motion_variables(self.platform, self.carriers)
        variables["tensions"] = over(("time", "cable"), self.tensions, "N", "cable tensions")
        status = "feasible" if self.feasible else "not-found"
        attributes = {"title": f"{self.robot.name}, stop", "status": status, "robot": to_yaml(self.robot)}
        if self.load is not None:  # as a plan of one phase has it
            variables["phase_load"] = over(("phase",), np.array([self.load.mass]), "kg", "mass of the load")
            variables["phase_start"] = over(("phase",), np.zeros(1), "s", "start of the phase")
            attributes["task"] = json.dumps({"phases": [{"load": self.load.model_dump()}]})
        return Contents(variables, dimensions(self.robot, self.times), attributes)

    def _headline(self) -> str:
        return f"{'stop' if self.feasible else 'stop beyond limits'} in {quantity(self.duration, 's')}"

    def _facts(self) -> list[Fact]:
        tensions = f"{quantity(self.tensions.min(), 'N')} to {quantity(self.tensions.max(), 'N')}"
        facts = [("begins", quantity(self.begins, "s")), ("path", quantity(self.distance, "m")), ("tensions", tensions)]
        broken = self.limit or (self.certificate and self.certificate.describe())
        return [*facts, ("limits", broken)] if broken else facts


def stop_along(robot: Robot, trajectory: Trajectory, time: float) -> Stop:
    """Stop as `control.stop` does, on a trajectory with a duration.

    Raises `InputError` if the robot has flying carriers with other cables than `control.stop` describes.
    """
    return next(_stops_along(robot, trajectory, np.array([min(time, trajectory.duration or 0.0)])))


def _stops_along(robot: Robot, trajectory: Trajectory, times: np.ndarray) -> Iterator[Stop]:
    """Yield the stops that begin at some times."""
    for load, begin in groupby(times.tolist(), trajectory.load_at):
        for found in _unloaded(robot if load is None else load.on(robot), trajectory, list(begin)):
            yield replace(found, robot=robot, load=load)


def _unloaded(robot: Robot, trajectory: Trajectory, times: list[float]) -> Iterator[Stop]:
    """Yield the stops of a robot that carries nothing else."""
    end = trajectory.duration or 0.0
    if any(carrier.efforts for carrier in robot.carriers):
        for begins in times:
            time, tau, platform, carriers, tensions, _, limit = team_stop_along(robot, trajectory, begins)
            yield Stop(robot, float(tau[0]), float(tau[-1]), time, platform, carriers, tensions, None, limit)
        return
    trajectory = continued(trajectory, together=False)
    instants = cache(lambda window: _instants(robot, trajectory, WINDOW * window))  # for all stops and attempts
    bounds = cache(lambda window, reserve: instants(window).bounds(reserve))
    for first in range(0, len(times), AT_ONCE):
        best = dict[float, _Tried]()
        for attempt in (*ATTEMPTS, None):
            laws = {
                each: _braking(_Limits(bounds, each, end, *attempt)) if attempt else _planned(trajectory, each, end)
                for each in times[first : first + AT_ONCE]
                if each not in best or best[each].rank[0]
            }
            laws = {each: _refined(law) for each, law in laws.items() if law is not None}
            for each, audited in zip(laws, _audited(robot, trajectory, [*laws.values()]) if laws else (), strict=True):
                best[each] = min([*([best[each]] if each in best else []), audited], key=lambda its: its.rank)
        for _, found, worst in best.values():
            yield found if worst is None else replace(found, certificate=certify(worst))


def beginnings(trajectory: Trajectory, period: float) -> np.ndarray:
    """Return the times, at most `period` apart, at which stops of a trajectory with a duration begin, (n,) [s]."""
    end = trajectory.duration or 0.0
    return np.linspace(0.0, end, int(np.ceil(end / period - 1e-9)) + 1)


def longest_stop_along(robot: Robot, trajectory: Trajectory, times: np.ndarray) -> Stop:
    """Return the longest of the stops that begin at some times, or the first infeasible one."""
    return max(_stops_along(robot, trajectory, times), key=lambda its: (not its.feasible, its.duration))


_BoundsAt: TypeAlias = Callable[[int, float], "_Bounds"]  # of the instants of a window, from its number and the reserve


class _Tried(NamedTuple):
    rank: tuple[bool, int, bool, float]  # of two that miss little, or nearly the same, the shorter one is better
    stop: Stop
    worst: TensionProblem | None  # of the instant whose wrench is missed most; None if none is


class _Law(NamedTuple):
    """The time in the plan [s], the rate and its derivative [1/s] over time, (n,) each."""

    times: np.ndarray
    tau: np.ndarray
    rate: np.ndarray
    slope: np.ndarray


class _Limits:
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
        least, most = np.array([self._rows.range_of(np.full_like(floor, x)) for x in LEVELS]).swapaxes(0, 1)
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
        least, most = _Bounds(*(part[k : k + 3] for part in self._rows)).range_of(np.full(3, rate * rate))
        low, high = float(least.max()), float(most.min())
        if low > high:  # none is possible: of those between, the one nearest to the rate of now
            return (min(max(0.0, high), low),) * 2
        floor = float(self._lowest[k + 2])
        if floor > 0:  # reached in time, from one to two instants before
            low = min(max(low, (floor - rate * rate) / (2 * self._apart * (k + 2 - place))), high)
        return low, high


class _Bounds(NamedTuple):
    """Bounds of u at n instants: least <= u + falls x <= most of k facets, |v u + g x| <= 1 of c carriers."""

    least: np.ndarray  # (n, k), nan where a facet bounds nothing
    most: np.ndarray
    falls: np.ndarray
    vv: np.ndarray  # (n, c), v . v, and so on; nan where the carrier rests
    vg: np.ndarray
    gg: np.ndarray

    @property
    def can_rest(self) -> np.ndarray:
        """Return at which instants the robot can rest, (n,)."""
        least, most = self.range_of(np.zeros(len(self.falls)))
        return (least <= 0) & (most >= 0)

    def range_of(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the least and the largest u for x = r^2 of each instant, (n,)."""
        fallen = self.falls * x[:, None]
        least, most = np.fmax.reduce(self.least - fallen, axis=1), np.fmin.reduce(self.most - fallen, axis=1)
        least, most = np.fmax(least, -FASTEST), np.fmin(most, FASTEST)
        if self.vv.shape[1]:
            middle = -self.vg * x[:, None]
            root = np.sqrt(np.maximum(middle**2 - self.vv * (self.gg * x[:, None] ** 2 - 1.0), 0.0))
            least = np.fmax(least, np.fmax.reduce((middle - root) / self.vv, axis=1))
            most = np.fmin(most, np.fmin.reduce((middle + root) / self.vv, axis=1))
        return least, most


class _Instants(NamedTuple):
    """Coefficients of n instants for any reserve: wrenches a u + b x + c along the normals of k facets, (n, k)."""

    a: np.ndarray  # nan where a facet bounds nothing
    b: np.ndarray
    c: np.ndarray
    low: np.ndarray  # of what the cables can give
    high: np.ndarray
    carriers: tuple[np.ndarray, np.ndarray, np.ndarray]  # vv, vg and gg of `_Bounds`

    def bounds(self, reserve: float) -> _Bounds:
        """Return the bounds of u; tensions keep the share `reserve` of their range."""
        inside, now = reserve * (self.high - self.low), self.b + self.c
        # At most half of what the plan itself keeps, so that it stays possible and can be left.
        low = self.low + np.clip((now - self.low) / 2, 0.0, inside)
        high = self.high - np.clip((self.high - now) / 2, 0.0, inside)
        low, high = np.minimum(low, now) - self.c, np.maximum(high, now) - self.c
        least, most = np.sort([low / self.a, high / self.a], axis=0)
        return _Bounds(least, most, self.b / self.a, *self.carriers)


def _instants(robot: Robot, trajectory: Trajectory, first: float) -> _Instants:
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
    return _Instants(a, b, c, available.low, available.high, (np.where(vv > STILL, vv, np.nan), vg, gg))


def _braking(limits: _Limits) -> _Law:
    """Return the law of the shortest stop."""
    t, tau, rate, u = 0.0, limits.begins, 1.0, 0.0
    rows = [(t, tau, rate, u)]
    while rate > STILL and t < LONGEST:
        landing = -2 * rate / u if u < 0 else np.inf
        if landing <= 1.5 * STEP:  # u becomes 0 as the rate does
            rows.append((t + landing, tau + landing * rate / 3, 0.0, 0.0))
            break
        end = max(rate + STEP * u, 0.0)
        least, most = limits.at(tau + STEP * (rate + end) / 2, end)
        least = max(least, -(rate + STEP * u / 2) / STEP)  # so that a step is left for landing
        after = min(max(least, -FASTEST), most, 2 * (1 - rate) / STEP - u)
        tau += STEP * rate + STEP**2 * (2 * u + after) / 6
        t, rate, u = t + STEP, rate + STEP * (u + after) / 2, after
        rows.append((t, tau, rate, u))
    return _Law(*np.array(rows).T)


def _planned(trajectory: Trajectory, begins: float, end: float) -> _Law | None:
    """Return the plan's own law until it rests, soon or at its end, which brakes hardest if it is fastest; or None."""
    early, late = begins, min(begins + WINDOW, end)
    for _ in range(3):  # at a corner the platform rests for an instant
        tau = np.append(np.linspace(early, late, 1000), end)
        speed = np.max([np.abs(motion[1]).reshape(len(tau), -1).max(axis=1) for motion in trajectory.at(tau)], axis=0)
        soon, near = int(speed[:-1].argmin()), tau[1] - tau[0]
        early, late = max(tau[soon] - near, begins), min(tau[soon] + near, end)
    rests = float(tau[soon if speed[soon] <= RESTS else -1])
    if min(speed[soon], speed[-1]) > RESTS or rests - begins < STEP:
        return None
    tau = np.linspace(begins, rests, int((rests - begins) / STEP) + 2)
    return _Law(tau - begins, tau, np.ones_like(tau), np.zeros_like(tau))


def _refined(law: _Law) -> _Law:
    """Return a law with more instants in each step, in which u is linear."""
    t, tau, rate, u = (part[:-1, None] for part in law)
    into = np.diff(law.times)[:, None] * np.arange(PARTS) / PARTS
    jerk = np.diff(law.slope)[:, None] / np.diff(law.times)[:, None]
    inside = (
        t + into,
        tau + into * (rate + into * (u / 2 + into * jerk / 6)),
        rate + into * (u + into * jerk / 2),
        u + into * jerk,
    )
    return _Law(*(np.append(its.ravel(), part[-1]) for part, its in zip(law, inside, strict=True)))


def _slowed(motion: Motion, law: _Law) -> Motion:
    """Return pose, velocity and acceleration of a motion that follows a law."""
    pose, velocity, acceleration = motion
    rate, slope = (part.reshape(-1, *[1] * (pose.ndim - 1)) for part in law[2:])
    return pose, rate * velocity, rate**2 * acceleration + slope * velocity


def _audited(robot: Robot, trajectory: Trajectory, laws: list[_Law]) -> Iterator[_Tried]:
    """Yield the stops of some laws, of which there is one at least."""
    law, dynamics = _Law(*(np.concatenate(parts) for parts in zip(*laws, strict=True))), dynamics_of(robot)
    platform, carriers = trajectory.at(law.tau)
    slowed, moved = _slowed(platform, law), _slowed(carriers, law)
    A = dynamics.wrench_matrix(platform[0], carriers[0]) * robot.dof_mask[:, None]
    w = dynamics.required_wrench(*slowed, wind=trajectory.wind) * robot.dof_mask
    near = None if trajectory.tensions is None else np.nan_to_num(trajectory.tensions(law.tau))
    tensions = solve_batch(A, w, robot.t_min, robot.t_max, t_ref=near, length=robot.length, rho=RHO).tensions
    missing = np.linalg.norm((w - (A @ tensions[:, :, None])[..., 0]) * robot.wrench_scale, axis=1) / robot.force_scale
    lengths, last = dynamics.cable_lengths(platform[0], carriers[0]), 0
    most = LITTLE if robot.m < len(robot.platform.dof) else MISSING  # few cables: as much as plans may miss
    for own in laws:
        some = slice(last, last := last + len(own.times))
        at = some.start + int(np.argmax(missing[some]))
        worst = wrench_problem(robot, A[at], w[at]) if missing[at] > most else None
        limit = overloaded_winch(robot, own.times, lengths[some], tensions[some])
        body, bases = ((x[some], v[some], a[some]) for x, v, a in (slowed, moved))
        found = Stop(robot, float(own.tau[0]), float(own.tau[-1]), own.times, body, bases, tensions[some], None, limit)
        rank = (worst is not None or bool(limit), round(missing[at] / LITTLE), bool(limit), found.duration)
        yield _Tried(rank, found, worst)
