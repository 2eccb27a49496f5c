"""A robot along given paths of platform and carriers that share one parameter s: what the motion needs and may do.

The wrench of a motion s(t) along the path is

    w = a(s) d2s/dt2 + b(s) (ds/dt)^2 + c(s)

since the dynamics are linear in accelerations and quadratic in velocities: c is the wrench of rest, a that of p'(s) as
an acceleration, b that of p'(s) as a velocity and p''(s) as an acceleration. In {G} the carriers act on the platform
only through the wrench matrix, so their motion along s enters A(s) and, if the path is given in a carrier's frame, p.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np

from ...errors import InputError
from ...models import Dynamics, Robot
from ...models.batch import call
from ...models.robot import COORDINATES, MobileCarrier
from ..tasks.carrier_paths import by_index
from ..tasks.path import CirclePath, Curve, Motion, RestPath

STILL = 1e-6  # of the largest speed along s: slower than this the path rests
SAME = 1e-7  # [m, rad]
LENGTH_TOLERANCE = 1e-4  # [m], of lengths that the drive keeps
SIDES = 64  # of the polygon inside the circle of accelerations: it gives away 0.12 %
LOOKS = 2001  # points at which the geometry is checked


@dataclass(frozen=True)
class PathLimits:
    """What beside the tensions is limited; infinite: not."""

    speed: float  # of the platform [m/s]
    cable_speed: np.ndarray  # (m,) [m/s]
    carrier_speed: dict[int, float]  # of those that move [m/s]
    carrier_acceleration: dict[int, float]  # [m/s^2]


class Paces(NamedTuple):
    """How fast the parts of a motion go beside their limits of speed: names, and (n, k) in parts of each limit."""

    names: list[str]
    values: np.ndarray


class Wrench(NamedTuple):
    """w = a d2s/dt2 + b (ds/dt)^2 + c, (n, 6) each, in {G}."""

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray


class ParametrisedPath:
    """A robot, the path of its platform, and those of its carriers, by one s from 0 to 1.

    Parameters
    ----------
    robot
        Its carriers are of kind ground, prescribed or mobile.
    path
        Of the platform, in {G} or in the frame of the only carrier.
    carriers
        Paths in {G} by name; the others stay at home.
    until
        When circles end by their own time [s]; None: after one turn.
    wind
        None: no air; zeros: still air.

    Raises
    ------
    InputError
        If they do not fit one another.
    """

    def __init__(
        self,
        robot: Robot,
        path: Curve,
        carriers: Mapping[str, Curve],
        until: float | None = None,
        wind: np.ndarray | None = None,
    ):
        self.robot, self.path, self.wind, self._until = robot, path, wind, until
        self.dynamics = Dynamics(robot)
        self.relative = self._frame()
        self.carriers = by_index(robot, carriers, "time_along: carriers")
        for carrier in robot.carriers:
            if carrier.kind == "quadrotor":
                raise InputError(
                    f"time_along: robot {robot.name!r} hangs from {carrier.name!r} of kind quadrotor, whose thrust no "
                    "given path tells; accepted: carriers of kind ground, prescribed, mobile"
                )
        self._check_geometry()

    @property
    def moving(self) -> list[int]:
        """Indices of the carriers that move along s."""
        return [index for index, path in self.carriers.items() if not isinstance(path, RestPath)]

    def until(self, path: Curve) -> float | None:
        """When `path` ends by its own time, if that is not for itself to say [s]."""
        return self._until if isinstance(path, CirclePath) else None

    def at(self, s: np.ndarray) -> tuple[Motion, Motion]:
        """Platform (n, 6) and carriers (n, c, 6) in {G} and their derivatives by s."""
        platform = self.path.by_fraction(s, self.until(self.path))
        each = []
        for index, home in enumerate(self.robot.carrier_home):
            path = self.carriers.get(index, RestPath(kind="rest", pose=tuple(home)))
            each.append(path.by_fraction(s, self.until(path)))
        if self.relative:
            # By the chain rule, derivatives by s turn into each other as those by time do.
            pose, first, second = self.dynamics.relative.motion_in_world(*platform, *each[0])
            pose[:, 3:] = np.unwrap(pose[:, 3:], axis=0)
            platform = Motion(pose, first, second)
        return platform, Motion(*(np.stack(parts, axis=1) for parts in zip(*each, strict=True)))

    def wrench(self, platform: Motion) -> Wrench:
        """What the motion needs, from derivatives by s."""
        pose, first, second = platform
        still = np.zeros_like(pose)

        def needed(velocity: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
            return self.dynamics.required_wrench(pose, velocity, acceleration, wind=self.wind)

        c = needed(still, still)
        return Wrench(needed(still, first) - c, needed(first, second) - c, c)

    def speed_limit(self, platform: Motion, carriers: Motion, limits: PathLimits) -> np.ndarray:
        """The largest ds/dt that the limits of speed leave, (n,) [1/s]."""
        with np.errstate(divide="ignore"):
            return 1.0 / self.paces(platform, carriers, limits).values.max(axis=1)

    def paces(self, platform: Motion, carriers: Motion, limits: PathLimits) -> Paces:
        """The speeds of a motion, by s or by time, beside their limits."""
        found = {"platform speed": np.linalg.norm(platform.velocity[:, :3], axis=1) / limits.speed}
        if np.isfinite(limits.cable_speed).any():
            of_cables = np.abs(self.cable_pace(platform, carriers)) / limits.cable_speed
            found |= {f"speed of cable {i + 1}": pace for i, pace in enumerate(of_cables.T)}
        for index, speed in limits.carrier_speed.items():
            pace = np.linalg.norm(carriers.velocity[:, index, :3], axis=1) / speed
            found[f"speed of {self.robot.carriers[index].name}"] = pace
        return Paces(list(found), np.stack(list(found.values()), axis=1))

    def carrier_rows(self, carriers: Motion, limits: PathLimits) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Limits of the carriers' accelerations as a u + b x + c <= 0, (n, SIDES) each, in parts of the limit.

        |P' u + P'' x| lies in the plane of P' and P''; a polygon inside the circle there stands for it.
        """
        found = []
        angle = np.arange(SIDES) * 2 * np.pi / SIDES
        around = np.stack([np.cos(angle), np.sin(angle)])  # (2, SIDES)
        for index, most in limits.carrier_acceleration.items():
            if not np.isfinite(most):
                continue
            pair = np.stack([carriers.velocity[:, index, :3], carriers.acceleration[:, index, :3]], axis=2)
            R = np.asarray(np.linalg.qr(pair, mode="r"))  # (n, 2, 2)
            a, b = (R[:, :, k] @ around / most for k in (0, 1))
            found.append((a, b, np.full_like(a, -np.cos(np.pi / SIDES))))
        return found

    def cable_pace(self, platform: Motion, carriers: Motion) -> np.ndarray:
        """Derivative of the cable lengths by s, (n, m) [m]; with derivatives by time, their speed [m/s]."""
        arguments = {
            "pose": platform.pose,
            "carrier_pose": carriers.pose,
            "velocity": platform.velocity,
            "carrier_velocity": carriers.velocity,
        }
        pace = call(self._length_rate, arguments)["rate"]
        return pace.reshape(len(platform.pose), self.robot.m)

    @cached_property
    def _length_rate(self) -> ca.Function:
        lengths = self.dynamics.functions["cable_lengths"]
        at = [ca.SX.sym(name, *lengths.size_in(name)) for name in lengths.name_in()]
        by = [ca.SX.sym(name, *lengths.size_in(name)) for name in lengths.name_in()]
        names = [*lengths.name_in(), "velocity", "carrier_velocity"]
        rate = ca.jtimes(lengths(*at), ca.veccat(*at), ca.veccat(*by))
        return ca.Function("length_rate", [*at, *by], [rate], names, ["rate"])

    def _frame(self) -> bool:
        only = self.robot.carriers[0].name if len(self.robot.carriers) == 1 else None
        if self.path.frame not in ("world", only):
            accepted = "world" if only is None else f"world, {only}"
            raise InputError(f"time_along: path.frame: {self.path.frame!r} is unknown; accepted: {accepted}")
        return self.path.frame != "world"

    def _check_geometry(self) -> None:
        robot, s = self.robot, np.linspace(0, 1, LOOKS)
        platform, carriers = self.at(s)
        self._check_pace(s, platform, carriers)
        lengths = self.dynamics.cable_lengths(platform.pose, carriers.pose)
        _refuse(s, ~(lengths > 1e-9).all(axis=1), "anchor and attachment of a cable coincide", "paths that keep apart")
        off = np.abs(platform.pose - robot.home) > SAME
        for i in np.flatnonzero(robot.dof_mask == 0):
            _refuse(s, off[:, i], f"{COORDINATES[i]} leaves home, but the platform cannot move so", "paths at home")
        if robot.fixed_lengths is not None:
            longer = np.abs(lengths - robot.fixed_lengths).max(axis=1) > LENGTH_TOLERANCE
            _refuse(s, longer, "a cable leaves the length that the drive keeps", "paths that keep it")
        for index, carrier in enumerate(robot.carriers):
            if not isinstance(carrier, MobileCarrier):
                continue
            pose = carriers.pose[:, index]
            low, high = np.array(carrier.reach.min), np.array(carrier.reach.max)
            outside = np.maximum(low - pose[:, :3], pose[:, :3] - high).max(axis=1) > SAME
            _refuse(s, outside, f"carrier {carrier.name!r} leaves its reach box", "paths inside")
            turned = np.abs(pose[:, 3:] - carrier.home[3:]).max(axis=1) > SAME
            _refuse(s, turned, f"carrier {carrier.name!r} turns, but a mobile one keeps its attitude", "its attitude")
            moved = np.abs(pose[:, :3] - pose[0, :3]).max(axis=1) > SAME
            if robot.drive == "variable-length":
                _refuse(
                    s, moved, f"carrier {carrier.name!r} moves, but the drive is variable-length", "carriers at rest"
                )

    def _check_pace(self, s: np.ndarray, platform: Motion, carriers: Motion) -> None:
        """Where nothing moves with s, no time law can make it move."""
        in_metres = 1.0 / self.robot.wrench_scale
        pace = np.sqrt(
            np.square(platform.velocity * in_metres).sum(axis=1)
            + np.square(carriers.velocity * in_metres).sum(axis=(1, 2))
        )
        still = pace <= max(STILL * pace.max(), SAME)
        _refuse(s, still, "nothing moves there", "paths that rest nowhere, as uniform lines, circles and waypoints")


def _refuse(s: np.ndarray, bad: np.ndarray, what: str, accepted: str) -> None:
    if bad.any():
        raise InputError(f"time_along: path: at s = {s[np.argmax(bad)]:.4g} {what}; accepted: {accepted}")
