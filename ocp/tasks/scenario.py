"""A task laid out for one robot: reference motions at any time, and which coordinates are free to deviate from them.

Every motion is a reference plus a deviation: the platform follows its path inside a tube, a free carrier moves about
its home. The deviations are the unknowns of the planner, piecewise polynomials of the time (`scheme`).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np

from ...errors import InputError
from ...models import Dynamics, Robot
from ...models.carriers import MotionLimits
from ...models.part import Vector3
from ...models.ranges import PositiveRange
from .carrier_paths import by_index
from .clearance import point_outside
from .path import AnyPath, Motion, RestPath
from .scheme import LINEAR, SCHEMES, Scheme
from .task import FreeBase, GivenBase, HoldBase, Task
from .task_limits import OF_CARRIERS
from .wind_set import WindBox, as_wind, choices, decisive_winds_at

POSITION, ATTITUDE = range(3), range(3, 6)
AUDIT_RATE = 1000.0  # [1/s]
LEAST_INTERVALS = 200  # of the audit: short motions are audited between their ends too
MOST_SAMPLES = 1_000_000  # of the audit: a thousand seconds


@dataclass(frozen=True)
class CarrierLimits:
    """The limits of one carrier; None or infinite: no limit."""

    acceleration: float | None  # [m/s^2]
    speed: float | None  # [m/s]
    low: np.ndarray  # (3,) corner of the reach box in {G} [m]
    high: np.ndarray  # (3,)
    tilt: float | None  # [rad]
    turn_acceleration: float | None  # [rad/s^2]
    attitude: np.ndarray | None  # (3,) that it keeps [rad]

    def without(self, soft: Collection[str]) -> CarrierLimits:
        """Return the limits without those that are soft."""
        dropped: dict[str, Any] = {
            name: None for name in ("acceleration", "speed", "tilt", "turn_acceleration") if f"carrier_{name}" in soft
        }
        if "carrier_reach" in soft:
            dropped |= {"low": np.full(3, -np.inf), "high": np.full(3, np.inf)}
        return replace(self, **dropped)

    def shrunk(self, share: float) -> CarrierLimits:
        """Return the limits with acceleration and speed reduced by a share, for what happens between the nodes."""
        keep = 1.0 - share
        acceleration = self.acceleration and self.acceleration * keep
        turn = self.turn_acceleration and self.turn_acceleration * keep
        return replace(self, acceleration=acceleration, speed=self.speed and self.speed * keep, turn_acceleration=turn)


@dataclass(frozen=True)
class Deviation:
    """Values of the free coordinates at the points of a transcription, and by its scheme at all times between.

    The inner points of a scheme are among the nodes.
    """

    nodes: np.ndarray  # (k,) [s]
    q: np.ndarray  # (k, n)
    v: np.ndarray  # (k, n)
    a: np.ndarray  # (k, n)
    tensions: np.ndarray  # (k, m) [N]
    scheme: Scheme = LINEAR
    jerk: np.ndarray | None = None  # (k, n), where the scheme is smooth

    def evaluate(self, times: np.ndarray) -> list[np.ndarray]:
        """Return q, v, a and jerk at `times` (k,), (k, n) each."""
        return self.scheme.evaluate(self.nodes, (self.q, self.v, self.a), self.jerk, times)

    def at(self, nodes: np.ndarray) -> Deviation:
        """Return the same motion at other nodes as an initial guess: tensions are interpolated."""
        q, v, a, jerk = self.evaluate(nodes)
        tensions = [np.interp(nodes, self.nodes, column) for column in self.tensions.T]
        return Deviation(nodes, q, v, a, np.stack(tensions, axis=1), jerk=jerk)

    def stretched(self, factor: float) -> Deviation:
        """Return the same path in `factor` times the time."""
        jerk = None if self.jerk is None else self.jerk / factor**3
        return replace(self, nodes=self.nodes * factor, v=self.v / factor, a=self.a / factor**2, jerk=jerk)


@dataclass(frozen=True)
class Scenario:
    """A robot and its task, with what follows from both.

    Attributes
    ----------
    path
        That of the platform: the task's, or the same places by a time law that the planner chose.
    relative
        Whether the platform's path is given in the frame of the robot's only carrier.
    platform_free
        Coordinates of the platform that may leave the path.
    carrier_free
        (carrier, coordinate) pairs that the planner chooses.
    """

    robot: Robot
    task: Task
    path: AnyPath
    dynamics: Dynamics
    relative: bool
    platform_free: list[int]
    carrier_free: list[tuple[int, int]]
    limits: dict[int, CarrierLimits]
    carrier_paths: dict[int, AnyPath] = field(repr=False)
    duration: float  # [s]; of a task that leaves it open: where the planner starts, then what it chose

    @property
    def scheme(self) -> Scheme:
        """Return the scheme of the acceleration between the nodes."""
        return SCHEMES[self.task.scheme]

    @property
    def duration_range(self) -> PositiveRange | None:
        """Return the range from which the planner chooses the duration; None if it is given."""
        return self.task.duration if isinstance(self.task.duration, PositiveRange) else None

    @property
    def wind(self) -> Vector3 | None:
        """Return the wind of the planned tensions in {G} [m/s], of a box its middle, or None without air."""
        return self.task.wind.middle if isinstance(self.task.wind, WindBox) else self.task.wind

    @property
    def wind_box(self) -> WindBox | None:
        """Return the box of winds in which tensions must exist; None if the task has one wind or none."""
        return self.task.wind if isinstance(self.task.wind, WindBox) else None

    def winds_at(self, pose: np.ndarray, velocity: np.ndarray) -> list[Vector3 | None]:
        """Return the winds in which tensions must exist at a motion (6,) in {G}; of a box those that decide.

        [None]: no air.
        """
        if self.wind_box is None:
            return [self.wind]
        winds = decisive_winds_at(self.wind_box, self.robot, pose[None], velocity[None])
        return [as_wind(values[0]) for values in winds]

    @property
    def decisive_winds(self) -> int:
        """Return how many winds of the box decide whether tensions exist in all."""
        aero, box = self.robot.platform.aero, self.wind_box
        return 0 if aero is None or box is None else len(choices(box, aero))

    def lasting(self, seconds: float) -> Scenario:
        """Return the scenario with another duration [s]."""
        return replace(self, duration=seconds)

    def along(self, path: AnyPath, seconds: float) -> Scenario:
        """Return the scenario with another path of the platform, in the same frame, and its duration [s]."""
        return replace(self, path=path, duration=seconds)

    @property
    def count(self) -> int:
        """Return the number n of free coordinates."""
        return len(self.platform_free) + len(self.carrier_free)

    @property
    def is_fixed(self) -> bool:
        """Return whether the task leaves nothing to choose but tensions."""
        return self.count == 0 and self.duration_range is None

    @property
    def output_samples(self) -> int:
        """Return how many intervals the saved trajectory has."""
        return max(round(self.duration * self.task.output_rate), 1)

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the tension limits less the task's margin if that is hard, (m,) each [N]."""
        return self.robot.t_min + self.hard_margin, self.robot.t_max - self.hard_margin

    @property
    def hard_margin(self) -> float:
        """Return how far every tension must stay inside its limits [N]; a soft margin is among `named_limits`."""
        return 0.0 if "margin" in self.task.limits.soft else self.task.margin

    def references(self, times: np.ndarray) -> tuple[Motion, list[Motion]]:
        """Return the platform's path, in its own frame, and the carriers' reference motions in {G}."""
        platform = self.path.at(times, self.duration)
        carriers = []
        for index, home in enumerate(self.robot.carrier_home):
            path = self.carrier_paths.get(index)
            if path is None:
                path = RestPath(kind="rest", pose=tuple(home))
            carriers.append(path.at(times, self.duration))
        return platform, carriers

    def motion(self, times: np.ndarray, deviation: Deviation | None) -> tuple[Motion, Motion]:
        """Return the motion of platform, (n, 6) each, and carriers, (n, c, 6) each, in {G} with their deviations."""
        platform, carriers = self.references(times)
        if deviation is not None:
            values = deviation.evaluate(times)[:3]
            platform = platform.plus(self._spread(value, None) for value in values)
            carriers = [c.plus(self._spread(value, i) for value in values) for i, c in enumerate(carriers)]
        if self.relative:
            pose, velocity, acceleration = self.dynamics.relative.motion_in_world(*platform, *carriers[0])
            pose[:, 3:] = np.unwrap(pose[:, 3:], axis=0)
            platform = Motion(pose, velocity, acceleration)
        stacked = Motion(*(np.stack(parts, axis=1) for parts in zip(*carriers, strict=True)))
        return platform, stacked

    def off_path(self, times: np.ndarray, motion: Motion, carriers: Motion) -> np.ndarray:
        """Return the offset of the platform at `motion` in {G} from its path, (n, 6) [m, rad], in the path's axes."""
        on_path = self.path.at(times, self.duration).pose
        pose = _pose_in(carriers.pose[:, 0], motion.pose) if self.relative else motion.pose
        off = pose - on_path
        off[:, 3:] = np.arctan2(np.sin(off[:, 3:]), np.cos(off[:, 3:]))
        return off

    def _spread(self, value: np.ndarray, carrier: int | None) -> np.ndarray:
        """Return the free coordinates (n, count) as the six of the platform (None) or of a carrier."""
        spread = np.zeros((len(value), 6))
        for column, owner in enumerate(self.owners()):
            if owner[0] == carrier:
                spread[:, owner[1]] = value[:, column]
        return spread

    def free_limits(self, shrink: float = 0.0) -> dict[int, CarrierLimits]:
        """Return hard limits of the carriers that the planner moves, reduced by the share `shrink` where possible."""
        free = {index for index, _ in self.carrier_free}
        soft = self.task.limits.soft
        return {index: limit.without(soft).shrunk(shrink) for index, limit in self.limits.items() if index in free}

    def owners(self) -> list[tuple[int | None, int]]:
        """Return the owner of each free coordinate: (None for the platform or the carrier's index, coordinate)."""
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
                f"{where}: margin must be at most {(high - low) / 2:g} N, half the range of cable {index + 1} "
                f"({low:g} N to {high:g} N), got {task.margin:g} N"
            )
    if task.wind is not None and robot.platform.aero is None:
        raise InputError(f"{where}: wind must be left out for a robot without platform.aero, as {robot.name!r} is")
    if isinstance(task.wind, WindBox):
        _feels_no_tensions(robot, where)
    _fit_limits(robot, task, where)
    opened = [*POSITION] * (task.tube.radius > 0) + [*ATTITUDE] * (task.tube.turn > 0)
    platform_free = [coordinate for coordinate in opened if robot.dof_mask[coordinate]]
    scenario = Scenario(
        robot=robot,
        task=task,
        path=task.path,
        dynamics=Dynamics(robot),
        relative=relative,
        platform_free=platform_free,
        carrier_free=_free_carriers(robot, task.base, where),
        limits=_limits(robot, task),
        carrier_paths=_carrier_paths(robot, task.base, where),
        duration=task.seconds,
    )
    _check_times(task, where)
    _check_transcription(task, where)
    return scenario


def _feels_no_tensions(robot: Robot, where: str) -> None:
    """Refuse a box of winds where other tensions are another motion."""
    for carrier in robot.carriers:
        if carrier.efforts:
            raise InputError(
                f"{where}: wind must be one wind, (x, y, z) [m/s], got a box: carrier {carrier.name!r} of kind "
                f"{carrier.kind} moves with the pull of its cables, so that no motion is the same in every wind"
            )


def _fit_limits(robot: Robot, task: Task, where: str) -> None:
    """Refuse soft limits of carriers that the robot does not have, and a body nearer to cables than they may be."""
    for name in task.limits.soft:
        if name in ("thrust", "torque") and not any(name in carrier.efforts for carrier in robot.carriers):
            raise InputError(
                f"{where}: limits.soft must not name {name!r}, a limit of quadrotors: {robot.name!r} has none"
            )
        if name == "carrier_reach" and all(carrier.motion_limits.reach is None for carrier in robot.carriers):
            raise InputError(
                f"{where}: limits.soft must not name {name!r}, a limit of mobile carriers: {robot.name!r} has none"
            )
        if name.startswith("carrier_") and name in OF_CARRIERS and not any(carrier.moves for carrier in robot.carriers):
            raise InputError(
                f"{where}: limits.soft must not name {name!r}, a limit of moving carriers: {robot.name!r} has none"
            )
    for place in task.limits.keep_out:
        if place.frame == "platform" and place.cables is not None:
            for index, attachment in enumerate(robot.attachments):
                outside = float(point_outside(place, ca.DM(attachment)))
                if outside < place.cables:
                    raise InputError(
                        f"{where}: limits.keep_out {place.name!r} must leave all attachments outside by as much as "
                        f"cables, {place.cables:g} m, got {outside:.3g} m for cable {index + 1}"
                    )


def _frame(robot: Robot, task: Task, where: str) -> bool:
    frame = task.path.frame
    only = robot.carriers[0].name if len(robot.carriers) == 1 else None
    if frame != "world" and frame != only:
        accepted = "world" if only is None else f"world, {only}"
        raise InputError(f"{where}: path.frame must be one of {accepted}, got {frame!r}")
    return frame != "world"


def _check_transcription(task: Task, where: str) -> None:
    """Refuse what the scheme or the solver cannot do."""
    if task.solver == "fatrop" and getattr(task.base, "ends", None) == "periodic":
        raise InputError(
            f"{where}: solver must be ipopt if base.ends is periodic, got fatrop, which cannot couple the "
            "last stage to the first"
        )
    for name, value in (("limits", task.limits), ("objective", task.objective)):
        if value.tension_rate is not None and not SCHEMES[task.scheme].continuous:
            accepted = ", ".join(scheme.name for scheme in SCHEMES.values() if scheme.continuous)
            raise InputError(
                f"{where}: {name}.tension_rate must be left out with the scheme {task.scheme!r}, whose tensions jump "
                f"at the nodes, got {value.tension_rate:g} N/s; schemes without jumps: {accepted}"
            )


def _check_times(task: Task, where: str) -> None:
    """Refuse a task longer or shorter than its waypoints: beyond their times a spline is arbitrary."""
    longest = task.duration.max if isinstance(task.duration, PositiveRange) else task.seconds
    if longest * AUDIT_RATE > MOST_SAMPLES:
        raise InputError(
            f"{where}: duration must be at most {MOST_SAMPLES / AUDIT_RATE:g} s, since the audit evaluates "
            f"{AUDIT_RATE:g} instants per second, got {longest:g} s"
        )
    if longest * task.output_rate > MOST_SAMPLES:
        raise InputError(
            f"{where}: output_rate must be at most {MOST_SAMPLES / longest:g} 1/s, {MOST_SAMPLES} samples in "
            f"{longest:g} s, got {task.output_rate:g} 1/s"
        )
    paths = {"path": task.path, **getattr(task.base, "paths", {}), **getattr(task.base, "around", {})}
    if isinstance(task.duration, PositiveRange):
        for name, path in paths.items():
            if not path.stretches:
                raise InputError(
                    f"{where}: duration must be a number [s], got a range, while {name} of kind {path.kind} has "
                    "times of its own; paths of kind rest, line, and waypoints without times take a range"
                )
    for name, path in paths.items():
        end = path.natural_duration if path.kind in ("waypoints", "samples") else None
        if end is not None and task.seconds > end * (1 + 1e-9):
            raise InputError(
                f"{where}: duration must be at most {end:g} s, where the times of {name} end, got {task.seconds:g} s"
            )
    end = task.path.natural_duration if task.path.kind in ("waypoints", "samples") else None
    if end is not None and task.seconds < end * (1 - 1e-9):
        raise InputError(
            f"{where}: duration must be at least {end:g} s, where the times of path end, got {task.seconds:g} s"
        )


def _carrier_paths(robot: Robot, base: HoldBase | GivenBase | FreeBase, where: str) -> dict[int, AnyPath]:
    if isinstance(base, HoldBase):
        field_name = "poses"
        paths: dict[str, AnyPath] = {name: RestPath(kind="rest", pose=pose) for name, pose in base.poses.items()}
    elif isinstance(base, GivenBase):
        field_name, paths = "paths", base.paths
    else:
        field_name, paths = "around", base.around
    return by_index(robot, paths, f"{where}: base.{field_name}")


def _free_carriers(robot: Robot, base: HoldBase | GivenBase | FreeBase, where: str) -> list[tuple[int, int]]:
    """Return the (carrier, coordinate) pairs that the planner chooses."""
    if not isinstance(base, FreeBase):
        return []
    free = [
        (index, coordinate)
        for index, carrier in enumerate(robot.carriers)
        for coordinate in carrier.planned_coordinates(robot.drive, tilts=base.tilt_max > 0)
    ]
    if not any(carrier.moves for carrier in robot.carriers):
        raise InputError(
            f"{where}: base must be left out, got kind free: the carriers of robot {robot.name!r} are on the ground"
        )
    if not free:
        raise InputError(
            f"{where}: base.kind must be hold or given, got free: only winches move robot {robot.name!r}, its carriers "
            f"stay (drive: {robot.drive})"
        )
    return free


def _limits(robot: Robot, task: Task) -> dict[int, CarrierLimits]:
    """Return limits of carriers by index: those of the robot's file, and those of the task."""
    limits = {}
    free, speed, acceleration = None, task.limits.carrier_speed, task.limits.carrier_acceleration
    if isinstance(task.base, FreeBase):
        free = task.base
        speed, acceleration = _tighter(speed, free.speed_max), _tighter(acceleration, free.acceleration_max)
    limited = free is not None or speed is not None or acceleration is not None
    for index, carrier in enumerate(robot.carriers):
        own = carrier.motion_limits
        if not carrier.moves or (own == MotionLimits() and not limited):
            continue
        turns = free if not carrier.keeps_attitude else None
        limits[index] = CarrierLimits(
            acceleration=_tighter(acceleration, own.acceleration),
            speed=_tighter(speed, own.speed),
            low=np.full(3, -np.inf) if own.reach is None else np.array(own.reach.min),
            high=np.full(3, np.inf) if own.reach is None else np.array(own.reach.max),
            tilt=_tighter(turns.tilt_max or None if turns else None, own.tilt),
            turn_acceleration=turns.turn_acceleration_max if turns else None,
            attitude=np.array(carrier.home[3:]) if carrier.keeps_attitude else None,
        )
    return limits


def _tighter(*bounds: float | None) -> float | None:
    return min((bound for bound in bounds if bound is not None), default=None)


def _pose_in(frame: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Return poses (n, 6) given in {G} relative to frames at poses (n, 6), by scipy's rotations."""
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_euler("ZYX", frame[:, 5:2:-1])
    position = turned.inv().apply(pose[:, :3] - frame[:, :3])
    angles = (turned.inv() * Rotation.from_euler("ZYX", pose[:, 5:2:-1])).as_euler("ZYX")
    return np.hstack([position, angles[:, ::-1]])
