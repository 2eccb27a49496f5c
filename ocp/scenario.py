"""A task laid out for one robot: reference motions at any time, and which coordinates are free to deviate from them.

Every motion is a reference plus a deviation: the platform follows its path inside a tube, a free carrier moves about
its home. The deviations are the unknowns of the planner, cubic splines of the time.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..errors import InputError
from ..models import Dynamics, Robot
from ..models.robot import MobileCarrier
from . import spline
from .path import AnyPath, Motion, RestPath
from .task import FreeBase, GivenBase, HoldBase, Task

POSITION, ATTITUDE = range(3), range(3, 6)


@dataclass(frozen=True)
class Limits:
    """What one free carrier may do; None or infinite: no limit."""

    acceleration: float | None  # [m/s^2]
    speed: float | None  # [m/s]
    low: np.ndarray  # (3,) corner of the reach box in {G} [m]
    high: np.ndarray  # (3,)
    tilt: float  # [rad]
    turn_acceleration: float | None  # [rad/s^2]


@dataclass(frozen=True)
class Deviation:
    """Values of the free coordinates at the nodes of a transcription."""

    nodes: np.ndarray  # (k,) [s]
    q: np.ndarray  # (k, n)
    v: np.ndarray  # (k, n)
    a: np.ndarray  # (k, n)
    tensions: np.ndarray  # (k, m) [N]


@dataclass(frozen=True)
class Scenario:
    """A robot and its task, with what follows from both.

    Attributes
    ----------
    relative
        Whether the platform's path is given in the frame of the robot's only carrier.
    platform_free
        Coordinates of the platform that may leave the path.
    carrier_free
        (carrier, coordinate) pairs that the planner chooses.
    """

    robot: Robot
    task: Task
    dynamics: Dynamics
    relative: bool
    platform_free: list[int]
    carrier_free: list[tuple[int, int]]
    limits: dict[int, Limits]
    carrier_paths: dict[int, AnyPath] = field(repr=False)

    @property
    def duration(self) -> float:
        """[s]."""
        return self.task.seconds

    @property
    def count(self) -> int:
        """Number n of free coordinates."""
        return len(self.platform_free) + len(self.carrier_free)

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Tension limits less the task's margin, (m,) each [N]."""
        return self.robot.t_min + self.task.margin, self.robot.t_max - self.task.margin

    def references(self, times: np.ndarray) -> tuple[Motion, list[Motion]]:
        """The platform's path, in its own frame, and the carriers' reference motions in {G}."""
        platform = self.task.path.at(times, self.duration)
        carriers = []
        for index, home in enumerate(self.robot.carrier_home):
            path = self.carrier_paths.get(index)
            if path is None:
                path = RestPath(kind="rest", pose=tuple(home))
            carriers.append(path.at(times, self.duration))
        return platform, carriers

    def motion(self, times: np.ndarray, deviation: Deviation | None) -> tuple[Motion, Motion]:
        """Platform, (n, 6) each, and carriers, (n, c, 6) each, in {G} with their deviations."""
        platform, carriers = self.references(times)
        if deviation is not None:
            values = spline.evaluate(deviation.nodes, deviation.q, deviation.v, deviation.a, times)
            platform = platform.plus(self._spread(value, None) for value in values)
            carriers = [c.plus(self._spread(value, i) for value in values) for i, c in enumerate(carriers)]
        if self.relative:
            pose, velocity, acceleration = self.dynamics.relative.motion_in_world(*platform, *carriers[0])
            pose[:, 3:] = np.unwrap(pose[:, 3:], axis=0)
            platform = Motion(pose, velocity, acceleration)
        stacked = Motion(*(np.stack(parts, axis=1) for parts in zip(*carriers, strict=True)))
        return platform, stacked

    def tracking_error(self, times: np.ndarray, deviation: Deviation | None) -> np.ndarray:
        """Distance of the platform from its path, (n,) [m]."""
        if deviation is None:
            return np.zeros(len(times))
        q = spline.evaluate(deviation.nodes, deviation.q, deviation.v, deviation.a, times)[0]
        return np.linalg.norm(self._spread(q, None)[:, :3], axis=1)

    def _spread(self, value: np.ndarray, carrier: int | None) -> np.ndarray:
        """Free coordinates (n, count) as the six of the platform (None) or of a carrier."""
        spread = np.zeros((len(value), 6))
        for column, owner in enumerate(self.owners()):
            if owner[0] == carrier:
                spread[:, owner[1]] = value[:, column]
        return spread

    def owners(self) -> list[tuple[int | None, int]]:
        """Whose coordinate each free one is: (None for the platform or the carrier's index, coordinate)."""
        return [*((None, coordinate) for coordinate in self.platform_free), *self.carrier_free]


def lay_out(robot: Robot, task: Task) -> Scenario:
    """Check that `task` fits `robot` and lay it out.

    Raises
    ------
    InputError
        Naming the field of the task that does not fit, its value and what would.
    """
    where = f"task {task.name!r}"
    relative = _frame(robot, task, where)
    for index, (low, high) in enumerate(zip(robot.t_min, robot.t_max, strict=True)):
        if low + task.margin > high - task.margin:
            raise InputError(
                f"{where}: margin: {task.margin:g} N leaves nothing of the limits of cable {index}, {low:g} N to "
                f"{high:g} N; accepted: at most {(high - low) / 2:g} N"
            )
    if task.wind is not None and robot.platform.aero is None:
        raise InputError(f"{where}: wind: robot {robot.name!r} has no platform.aero; accepted: none")
    platform_free = [*POSITION] * (task.tube.position > 0) + [*ATTITUDE] * (task.tube.attitude > 0)
    carrier_free, limits = _free_carriers(robot, task.base, where)
    scenario = Scenario(
        robot=robot,
        task=task,
        dynamics=Dynamics(robot),
        relative=relative,
        platform_free=platform_free,
        carrier_free=carrier_free,
        limits=limits,
        carrier_paths=_carrier_paths(robot, task.base, where),
    )
    _within_spline(task, where)
    return scenario


def _frame(robot: Robot, task: Task, where: str) -> bool:
    frame = task.path.frame
    only = robot.carriers[0].name if len(robot.carriers) == 1 else None
    if frame != "world" and frame != only:
        accepted = "world" if only is None else f"world, {only}"
        raise InputError(f"{where}: path.frame: {frame!r} is unknown; accepted: {accepted}")
    return frame != "world"


def _within_spline(task: Task, where: str) -> None:
    """Refuse a task that lasts longer than its waypoints or samples: beyond them a spline is anything."""
    paths = {"path": task.path, **getattr(task.base, "paths", {}), **getattr(task.base, "around", {})}
    for name, path in paths.items():
        end = path.natural_duration if path.kind in ("waypoints", "samples") else None
        if end is not None and task.seconds > end * (1 + 1e-9):
            raise InputError(
                f"{where}: duration: {task.seconds:g} s is longer than {name}, whose times end at {end:g} s"
            )


def _carrier_paths(robot: Robot, base: HoldBase | GivenBase | FreeBase, where: str) -> dict[int, AnyPath]:
    if isinstance(base, HoldBase):
        field_name = "poses"
        paths: dict[str, AnyPath] = {name: RestPath(kind="rest", pose=pose) for name, pose in base.poses.items()}
    elif isinstance(base, GivenBase):
        field_name, paths = "paths", base.paths
    else:
        field_name, paths = "around", base.around
    names = [carrier.name for carrier in robot.carriers]
    found = {}
    for name, path in paths.items():
        if name not in names:
            raise InputError(f"{where}: base.{field_name}: carrier {name!r} is unknown; accepted: {', '.join(names)}")
        if robot.carriers[names.index(name)].kind == "ground" and path.kind != "rest":
            raise InputError(f"{where}: base.{field_name}: carrier {name!r} is of kind ground and never moves")
        if path.frame != "world":
            raise InputError(f"{where}: base.{field_name}.{name}.frame: {path.frame!r}; accepted: world")
        found[names.index(name)] = path
    return found


def _free_carriers(
    robot: Robot, base: HoldBase | GivenBase | FreeBase, where: str
) -> tuple[list[tuple[int, int]], dict[int, Limits]]:
    if not isinstance(base, FreeBase):
        return [], {}
    free: list[tuple[int, int]] = []
    limits: dict[int, Limits] = {}
    for index, carrier in enumerate(robot.carriers):
        if carrier.kind == "ground":
            continue
        unbounded = np.full(3, np.inf)
        if isinstance(carrier, MobileCarrier):
            acceleration = _tighter(base.acceleration_max, carrier.acceleration_max)
            speed = _tighter(base.speed_max, carrier.speed_max)
            low, high, tilt = np.array(carrier.reach.min), np.array(carrier.reach.max), 0.0
        else:
            acceleration, speed, tilt = base.acceleration_max, base.speed_max, base.tilt_max
            low, high = -unbounded, unbounded
        free += [(index, coordinate) for coordinate in (*POSITION, *([3, 4] if tilt > 0 else []))]
        limits[index] = Limits(acceleration, speed, low, high, tilt, base.turn_acceleration_max)
    if not free:
        raise InputError(f"{where}: base.kind: 'free', but robot {robot.name!r} has no carrier that moves")
    return free, limits


def _tighter(first: float | None, second: float) -> float:
    return second if first is None else min(first, second)
