"""Describe a robot along paths of platform and carriers that share one parameter s: its wrenches and its limits.

The wrench of a motion s(t) along the path is

    w = a(s) d2s/dt2 + b(s) (ds/dt)^2 + c(s)

since the dynamics are linear in accelerations and quadratic in velocities: c is the wrench at rest, a the wrench of
an acceleration of p'(s), b the wrench of a velocity of p'(s) and an acceleration of p''(s). In {G} the carriers act on
the platform only through the wrench matrix, so their motion along s enters A(s) and, if the path is given in a
carrier's frame, p.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...base.errors import InputError
from ...models import Robot
from ...models.dynamics import dynamics_of
from ...models.part import COORDINATES
from ..audits.checks import LENGTH_TOLERANCE
from ..limits.cables import CableAcceleration, CableSpeed
from ..limits.limit import Magnitude
from ..limits.limits import Limits
from ..limits.platform import ZoneSpeed
from ..tasks.paths import CirclePath, Curve, Motion, RestPath
from ..tasks.scenario import in_world

STILL = 1e-6  # of the largest speed along s: slower than this the path rests
SAME = 1e-7  # [m, rad]
SIDES = 64  # of the polygon inside the circle of accelerations: it gives away 0.12 %
LEAST = 40  # intervals between two rests, or between a rest and a bend
SHARE_OF_BEND = 0.5  # of all intervals, that each bend has: there the limits of speed change at once
MOST_IN_BENDS = 6400  # in all together, if that is more than FEWEST in each
FEWEST = 16  # intervals in a bend, or between two bends, of a path with hundreds of them
CLOSE = 1e-9  # of s
LEAST_RATE = 1e-12  # [m] per s, of a cable's length: with less it needs no power
LOOKS = 2001  # points at which the geometry is checked
HALVES = 40  # of the s between two of them
FINE = 10  # times as many points at which the bound of a zone is computed


class PathLimits(NamedTuple):
    """The limits besides those of the tensions: of values proportional to speeds or to accelerations, and of powers."""

    speeds: Limits
    accelerations: Limits
    power: float = np.inf  # of each winch [W]


class Wrench(NamedTuple):
    """w = a d2s/dt2 + b (ds/dt)^2 + c, (n, 6) each, in {G}."""

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray


class ParametrisedPath:
    """A robot, the path of its platform and those of its carriers, parametrised by one s from 0 to 1.

    - `robot`: its carriers require no effort of their own: kinds ground, prescribed and mobile.
    - `path`: of the platform, in {G} or in the frame of the only carrier.
    - `carriers`: paths in {G} by the index of the carrier; the others stay at home.
    - `until`: when circles end by their own time [s]; default: after one turn.
    - `wind`: zeros for still air; default: no air.

    Raises `InputError` if robot and paths do not fit one another.
    """

    def __init__(
        self,
        robot: Robot,
        path: Curve,
        carriers: dict[int, Curve],
        until: float | None = None,
        wind: np.ndarray | None = None,
    ):
        self.robot, self.path, self.carriers, self.wind, self._until = robot, path, carriers, wind, until
        self.dynamics = dynamics_of(robot)
        self.relative = self._frame()
        for carrier in robot.carriers:
            if carrier.efforts:
                raise InputError(
                    "robot must have carriers of kind ground, prescribed or mobile to time a path, got "
                    f"{robot.name!r} with {carrier.name!r} of kind {carrier.kind}, whose {carrier.efforts[0]} a path "
                    "does not determine"
                )
        self._check_geometry()

    @property
    def moving(self) -> list[int]:
        """Return the indices of the carriers that move along s."""
        return [index for index, path in self.carriers.items() if not isinstance(path, RestPath)]

    @property
    def motor_force(self) -> np.ndarray:
        """Return the largest force of the motor of each winch less friction, (m,) [N]; infinite without a motor."""
        winches = [cable.winch if self.robot.fixed_lengths is None else None for cable in self.robot.cables]
        return np.array([winch.tension_max if winch else np.inf for winch in winches])

    @property
    def dwell(self) -> dict[float, float]:
        """Return s of the points at which platform or carriers must rest, and how long they dwell there [s]."""
        longest: dict[float, float] = {}
        for path in (self.path, *self.carriers.values()):
            for s, seconds in path.rests():
                longest[s] = max(seconds, longest.get(s, 0.0))
        return longest

    def pieces(self, intervals: int) -> list[np.ndarray]:
        """Return the grids of s between the points of rest: about so many intervals together, more in sharp bends."""
        bends = np.vstack([path.bends() for path in (self.path, *self.carriers.values())])
        rests = np.array(sorted(self.dwell))
        edges = np.concatenate([[0.0], rests[(rests > 0) & (rests < 1)], [1.0]])
        each = MOST_IN_BENDS // max(len(bends), 1)
        usual = min(LEAST, max(each, FEWEST))
        in_bend = max(usual, min(round(SHARE_OF_BEND * intervals), each))
        grids = []
        for start, end in pairwise(edges):
            inner = np.unique(bends[(bends > start + CLOSE) & (bends < end - CLOSE)])
            inner = inner[np.diff(inner, prepend=start) > CLOSE]  # one bend may begin where another ends
            parts = np.concatenate([[start], inner, [end]])
            middle = (parts[1:] + parts[:-1]) / 2
            bent = np.any((bends[:, :1] < middle) & (middle < bends[:, 1:]), axis=0)
            least = np.where(bent, in_bend, usual if len(edges) > 2 or inner.size else 1)
            counts = np.maximum(np.ceil(intervals * np.diff(parts) - 1e-9).astype(int), least)
            points = [_grid(*its)[:-1] for its in zip(parts[:-1], parts[1:], counts, bent, strict=True)]
            grids.append(np.append(np.concatenate(points), end))
        return grids

    def crossings(self, zone: ZoneSpeed) -> np.ndarray:
        """Return where the path enters or leaves a zone, (k,) of s: there the bound of the speed has a corner."""
        s = np.linspace(0.0, 1.0, LOOKS)
        inside = self._bound(zone, s) <= zone.high
        before = np.flatnonzero(inside[1:] != inside[:-1])
        low, high = s[before], s[before + 1]
        for _ in range(HALVES if before.size else 0):
            middle = (low + high) / 2
            same = (self._bound(zone, middle) <= zone.high) == inside[before]
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        return high

    def rises(self, zone: ZoneSpeed, share: float) -> np.ndarray:
        """Return points, (k,) of s, between which the bound of a zone changes by `share` each time.

        Between two points of a grid the square of the speed is linear in s, and may exceed a bound that is not.
        """
        s = np.linspace(0.0, 1.0, FINE * LOOKS)
        changed = np.cumsum(np.abs(np.diff(np.log(self._bound(zone, s)))) / share)
        return np.interp(np.arange(1.0, changed[-1]), changed, s[1:])

    def _bound(self, zone: ZoneSpeed, s: np.ndarray) -> np.ndarray:
        return zone.bound(self.at(s)[0].pose[:, :3])

    def until(self, path: Curve) -> float | None:
        """Return when a circle ends by its own time [s]; None for other paths, whose end is their own."""
        return self._until if isinstance(path, CirclePath) else None

    def at(self, s: np.ndarray) -> tuple[Motion, Motion]:
        """Return the poses of platform (n, 6) and carriers (n, c, 6) in {G} and their derivatives by s."""
        platform = self.path.by_fraction(s, self.until(self.path))
        each = []
        for index, home in enumerate(self.robot.carrier_home):
            path = self.carriers.get(index, RestPath(kind="rest", pose=tuple(home)))
            each.append(path.by_fraction(s, self.until(path)))
        return in_world(self.dynamics, self.relative, platform, each)

    def wrench(self, platform: Motion) -> Wrench:
        """Return the wrench that the motion needs, from derivatives by s."""
        pose, first, second = platform
        still = np.zeros_like(pose)

        def needed(velocity: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
            return self.dynamics.required_wrench(pose, velocity, acceleration, wind=self.wind)

        c = needed(still, still)
        return Wrench(needed(still, first) - c, needed(first, second) - c, c)

    def speed_limit(self, platform: Motion, carriers: Motion, limits: PathLimits) -> np.ndarray:
        """Return the largest ds/dt that the limits of speed allow, (n,) [1/s]."""
        with np.errstate(divide="ignore"):
            return 1.0 / relative(limits.speeds, platform, carriers).max(axis=1, initial=0.0)

    def acceleration_rows(
        self, platform: Motion, carriers: Motion, limits: PathLimits, shrink: float
    ) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Return the limits of accelerations, less the share `shrink`, as a u + b x + c <= 0, (n, K) each, relative.

        Their values are P u + Q x + R, with R those at rest, Q what velocities add and P what accelerations do. Of a
        vector, a polygon inside the circle of its bound stands for its length: in the plane of P and Q, if R is zero.
        """
        angle = np.arange(SIDES) * 2 * np.pi / SIDES
        around = np.stack([np.cos(angle), np.sin(angle)])  # (2, SIDES)
        rows = []
        for limit, (P, Q, R) in zip(
            limits.accelerations, _parts(limits.accelerations, platform, carriers), strict=True
        ):
            if not isinstance(limit, Magnitude):  # each value between two bounds
                a, b, c = (np.hstack([part, -part]) / limit.high for part in (P, Q, R))
                rows.append((a, b, c - (1 - shrink)))
                continue
            if P.shape[1] > 2:
                P, Q = np.moveaxis(np.asarray(np.linalg.qr(np.stack([P, Q], axis=2), mode="r")), 2, 0)  # (n, 2) each
                R = np.zeros_like(P)
            a, b, c = (part @ around / limit.high for part in (P, Q, R))
            rows.append((a, b, c - (1 - shrink) * np.cos(np.pi / SIDES)))
        return rows

    def reflected(self, platform: Motion, carriers: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Return P and Q of the forces P u + Q x that accelerate the winches to pay out cables, (n, m) each [N]."""
        every = Limits(self.robot, (CableAcceleration(self.robot, 1.0),))
        P, Q, _ = next(_parts(every, platform, carriers))
        inertia = np.array([cable.winch.inertia if cable.winch else 0.0 for cable in self.robot.cables])
        return P * inertia, Q * inertia

    def pull_per_speed(self, platform: Motion, carriers: Motion, power: float) -> np.ndarray:
        """Return the largest tension of each cable, times ds/dt, that a power [W] of its winch allows, (n, m) [N/s]."""
        if power == np.inf:
            return np.full((len(platform.pose), self.robot.m), np.inf)
        (rates,) = Limits(self.robot, (CableSpeed(self.robot, 1.0),)).along(platform, carriers)
        return power / np.maximum(np.abs(rates), LEAST_RATE)

    def _frame(self) -> bool:
        only = self.robot.carriers[0].name if len(self.robot.carriers) == 1 else None
        if self.path.frame not in ("world", only):
            accepted = "world" if only is None else f"world or {only}"
            raise InputError(f"path.frame must be {accepted}, got {self.path.frame!r}")
        return self.path.frame != "world"

    def _check_geometry(self) -> None:
        robot, s = self.robot, np.linspace(0, 1, LOOKS)
        platform, carriers = self.at(s)
        self._check_that_it_moves(s, platform, carriers)
        lengths = self.dynamics.cable_lengths(platform.pose, carriers.pose)
        must = "path must give every cable a length"
        _refuse(s, ~(lengths.min(axis=1) > 1e-9), must, "coincident anchor and attachment")
        off = np.abs(platform.pose - robot.home) > SAME
        for i in np.flatnonzero(robot.dof_mask == 0):
            must = f"path must keep {COORDINATES[i]} at its home value, since platform.dof is without it"
            _refuse(s, off[:, i], must, "another value")
        if robot.fixed_lengths is not None:
            longer = np.abs(lengths - robot.fixed_lengths).max(axis=1) > LENGTH_TOLERANCE
            _refuse(s, longer, "path must keep the cable lengths that the drive fixes", "another length")
        for index, carrier in enumerate(robot.carriers):
            pose, name, reach = carriers.pose[:, index], carrier.name, carrier.motion_limits.reach
            if reach is not None:
                low, high = np.array(reach.min), np.array(reach.max)
                outside = np.maximum(low - pose[:, :3], pose[:, :3] - high).max(axis=1) > SAME
                _refuse(s, outside, f"base must keep carrier {name!r} inside its reach box", "a position outside")
            if carrier.keeps_attitude:
                turned = np.abs(pose[:, 3:] - carrier.home[3:]).max(axis=1) > SAME
                _refuse(s, turned, f"base must keep carrier {name!r} in its home attitude", "another attitude")
            if not carrier.free_coordinates(robot.drive):
                moved = np.abs(pose[:, :3] - pose[0, :3]).max(axis=1) > SAME
                must = f"base must keep carrier {name!r} at rest, since the robot's drive is {robot.drive}"
                _refuse(s, moved, must, "a motion")

    def _check_that_it_moves(self, s: np.ndarray, platform: Motion, carriers: Motion) -> None:
        """Refuse a path along which platform and carriers rest somewhere: no time law could make them move there."""
        in_metres = 1.0 / self.robot.wrench_scale
        speed = np.sqrt(
            np.square(platform.velocity * in_metres).sum(axis=1)
            + np.square(carriers.velocity * in_metres).sum(axis=(1, 2))
        )
        still = speed <= max(STILL * speed.max(), SAME)
        _refuse(s, still, "path must move platform or carriers everywhere, as lines, circles and waypoints do", "rest")


def _parts(limits: Limits, platform: Motion, carriers: Motion) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield the values of each limit of accelerations as P u + Q x + R, (n, k) each, from derivatives by s."""
    still = [np.zeros_like(body.pose) for body in (platform, carriers)]
    rest = limits.along(Motion(platform.pose, still[0], still[0]), Motion(carriers.pose, still[1], still[1]))
    first = limits.along(
        Motion(platform.pose, still[0], platform.velocity), Motion(carriers.pose, still[1], carriers.velocity)
    )
    for R, P, Q in zip(rest, first, limits.along(platform, carriers), strict=True):
        yield P - R, Q - R, R


def _grid(start: float, end: float, intervals: int, bent: bool) -> np.ndarray:
    """Return a grid from start to end: uniform, or in a bend densest at its ends, where its curvature changes most."""
    at = np.linspace(0.0, 1.0, intervals + 1)
    return start + (end - start) * ((1 - np.cos(np.pi * at)) / 2 if bent else at)


def _refuse(s: np.ndarray, bad: np.ndarray, must: str, got: str) -> None:
    """Raise InputError of what must be and what is at the first `bad` s, if there is one."""
    if bad.any():
        raise InputError(f"{must}, got {got} at s = {s[np.argmax(bad)]:.4g}")


def relative(limits: Limits, platform: Motion, carriers: Motion) -> np.ndarray:
    """Return the sizes of all values along a motion, by s or by time, in parts of their bounds, (n, k)."""
    values = limits.along(platform, carriers)
    # A motion by s has no times; no limit that a time law keeps is a limit of a rate.
    sizes = (
        np.abs(limit.over(np.arange(len(platform.pose)), its)) / limit.high
        for limit, its in zip(limits, values, strict=True)
    )
    return np.hstack([np.zeros((len(platform.pose), 0)), *sizes])
