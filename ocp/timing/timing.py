"""Find the fastest time law along a given path that keeps every tension inside its limits: `time_along`.

Along a path only s(t) is left to choose. The available wrench set at each s (`solvers.available_wrench`) and the wrench
that the motion needs (`parametrised_path`) make half-planes in d2s/dt2 and (ds/dt)^2 (`phase_plane`), and toppra finds
the fastest law inside all of them (`toppra_law`). It is called feasible only after an audit every millisecond with the
exact tension solver; violations between the grid points are removed by a finer grid and by a little distance from the
limits.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ...distribution import wrench_problem
from ...errors import InputError, SolverError
from ...inputs import file_path, real_array, required, shown, whole_number
from ...models import Robot
from ...models.files import as_robot
from ...models.parsing import to_yaml
from ...solvers import Certificate, TensionProblem, certify, solve_batch
from ...text import quantity
from ...writing import whole_file
from ..status import MotionStatus
from ..tasks.carrier_paths import by_index
from ..tasks.path import (
    AnyPath,
    CirclePath,
    Curve,
    LinePath,
    Motion,
    PathBase,
    RestPath,
    SamplePath,
    TimedPath,
    WaypointPath,
)
from ..tasks.scenario import AUDIT_RATE, LEAST_INTERVALS, MOST_SAMPLES
from ..tasks.task import FreeBase, GivenBase, HoldBase, Task, read_task
from ..tasks.task_limits import TaskLimits
from ..tasks.wind_set import WindBox
from .bottlenecks import Bottleneck, bottlenecks
from .parametrised_path import ParametrisedPath, PathLimits
from .phase_plane import phase_plane, proofs

KNOWN_LIMITS = ("platform_speed", "cable_speed", "carrier_speed", "carrier_acceleration")
TOLERANCE = 1e-6  # [N], as the audit of plans has it
LIMIT_TOLERANCE = 1e-6  # relative, of the other limits, as the audit of plans has it
ATTEMPTS = 8
MOST_INTERVALS = 6400
FINER_TRIES = 2  # after a grid on which the search ended without a law
RESERVE = 1e-7  # of the weight, kept from the tension limits against rounding
COARSE = 1e-4  # of the weight or of a limit: a larger violation needs a finer grid, a smaller one some distance


@dataclass(frozen=True, eq=False)
class Timing:
    """The fastest time law along a path, or where along the path there is none.

    Attributes
    ----------
    status
        See `MotionStatus`. If infeasible, at `at` no tensions inside their limits give the wrench that the path needs,
        whatever the speed and acceleration; at the ends, for the platform to rest there. If not-found, every place of
        the grid allows some speed, but no law joins them, or none that passes the audit.
    parametrised
        The robot and the geometry that was timed.
    limits
        The limits beside those of the tensions.
    margin
        How far every tension stays inside its limits [N].
    s
        Grid, (n,), the fraction of the path's own time, from 0 to 1.
    sd
        ds/dt on the grid, (n,) [1/s]; nan if not feasible.
    sdd
        d2s/dt2, constant on each interval of the grid, (n - 1,) [1/s^2]; nan if not feasible.
    violation
        The largest missing wrench in the audit [N], moments over `Robot.length`; nan without a law.
    at
        If not feasible: s of the certificate, or where the search ended.
    certificate
        If infeasible: proof along a wrench direction on which no allowed speed and acceleration helps. It is that of
        `problem`, and the one with the largest shortfall along the grid.
    problem
        The tension problem at `at` for the speed and acceleration that come nearest; at the ends, for rest.
    blocked
        All grid points s at which there is such a proof.
    name
        Name of the task.
    """

    status: MotionStatus
    parametrised: ParametrisedPath = field(repr=False)
    limits: PathLimits = field(repr=False)
    margin: float
    s: np.ndarray = field(repr=False)
    sd: np.ndarray = field(repr=False)
    sdd: np.ndarray = field(repr=False)
    violation: float = float("nan")
    at: float | None = None
    certificate: Certificate | None = field(default=None, repr=False)
    problem: TensionProblem | None = field(default=None, repr=False)
    blocked: np.ndarray = field(default_factory=lambda: np.zeros(0), repr=False)
    name: str = "task"

    @property
    def feasible(self) -> bool:
        """Return whether there is a law whose audit reports no violation."""
        return self.status is MotionStatus.FEASIBLE

    @property
    def duration(self) -> float | None:
        """Return how long the motion takes [s]; None if there is none."""
        return self.path.natural_duration if self.feasible else None

    @property
    def path(self) -> TimedPath:
        """Return the platform's path with its time law, for a task.

        Raises
        ------
        InputError
            If there is no law.
        """
        return self.timed(self.parametrised.path)

    def task(self, name: str = "timed") -> Task:
        """Return a task with this `name` that fixes this motion of platform and carriers, for `plan` to audit.

        Raises
        ------
        InputError
            If there is no law.
        """
        parametrised, carriers = self.parametrised, self.parametrised.robot.carriers
        base: HoldBase | GivenBase = HoldBase(kind="hold")
        if parametrised.carriers:
            paths: dict[str, AnyPath] = {
                carriers[index].name: self.timed(path) if index in parametrised.moving else path
                for index, path in parametrised.carriers.items()
            }
            base = GivenBase(kind="given", paths=paths)
        wind = None if parametrised.wind is None else (0.0, 0.0, 0.0)
        return Task(name=name, path=self.path, base=base, margin=self.margin, wind=wind)

    def motion(self, times: np.ndarray) -> tuple[Motion, Motion]:
        """Return the motion of platform, (n, 6) each, and carriers, (n, c, 6) each, in {G} at `times` [s] (n,).

        Raises
        ------
        InputError
            If there is no law.
        """
        instants = real_array("times", times).astype(float, copy=False)
        if instants.ndim != 1 or not np.isfinite(instants).all():
            raise InputError(f"times must be finite numbers of shape (n,) [s], got {shown(times)}")
        s, sd, sdd = self.path.law(instants)
        platform, carriers = self.parametrised.at(s)
        return platform.timed(sd, sdd), carriers.timed(sd, sdd)

    @cached_property
    def bottlenecks(self) -> list[Bottleneck]:
        """Return the stretches of the path on each of which one limit keeps the motion from being faster, in order.

        The list is empty without a law.
        """
        return bottlenecks(self.parametrised, self.limits, self.margin, self.path) if self.feasible else []

    def to_dict(self) -> dict[str, Any]:
        """Return what `towline time --json` prints, ready for JSON; what does not exist is None."""
        return {
            "feasible": self.feasible,
            "status": self.status.value,
            "duration": self.duration,
            "margin": self.margin,
            "violation": self.violation,
            "bottlenecks": [each.to_dict() for each in self.bottlenecks],
            "at": self.at,
            "blocked": self.blocked.tolist(),
            "certificate": None if self.certificate is None else self.certificate.to_dict(),
        }

    def save_task(self, file: str | os.PathLike[str], name: str = "timed") -> Path:
        """Save `task`, with this `name`, as a task file (YAML), whole or not at all: `towline plan` and `plan` read it.

        Raises
        ------
        InputError
            If there is no law, or the place cannot be written to.
        """
        path, text = file_path("file", file), to_yaml(self.task(name))
        with whole_file(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
        return path

    def report(self) -> str:
        """Return status, duration and bottlenecks, or the certificate, as text."""
        head = f"{self.parametrised.robot.name}, {self.name}: {self.status.value.upper()}"
        ends = "0 at its start, 1 at its end"
        if self.feasible:
            lines = [f"{head}, shortest duration {quantity(self.duration, 's', 6)}"]
            lines += [f"  audit: worst violation {quantity(self.violation, 'N', 3)}"]
            lines += [f"  What is at its limit along the path (s = {ends})"]
            return "\n".join(lines + [f"    {each.describe()}" for each in self.bottlenecks])
        place = f"s = {self.at:.4g}"
        if self.certificate is None:
            return f"{head}, the search ended at {place}\n  s is the fraction of the path, {ends}"
        lines = [f"{head}, short by {quantity(self.certificate.shortfall, 'N')} at {place}"]
        lines += [f"  {place} is the worst place of the path (s = {ends}); no time law is feasible there:"]
        return "\n".join(lines + [f"    {line}" for line in self.certificate.describe().splitlines()])

    def timed(self, path: Curve) -> TimedPath:
        """Return a path of the platform or of a carrier with the time law.

        Raises
        ------
        InputError
            If there is no law.
        """
        if np.isnan(self.sd).any():
            raise InputError(f"timing must be feasible to have a motion, got status {self.status.value!r}")
        required("path", path, PathBase)
        law = {"s": tuple(self.s.tolist()), "speeds": tuple(self.sd.tolist())}
        return TimedPath(kind="timed", frame=path.frame, along=path, until=self.parametrised.until(path), **law)


def time_along(
    robot: Robot | str | os.PathLike[str],
    task: Task | dict[str, Any] | str | os.PathLike[str],
    *,
    grid: int = 200,
) -> Timing:
    """Find the fastest motion along a task's path, from rest to lasting rest, with every tension inside its limits.

    Only the geometry of the path matters: lines and waypoints are taken as uniform, so that they rest nowhere; samples
    are waypoints unless carriers move with them. Circles end after the task's duration by their own rate, or after one
    turn; any other duration is ignored. Carriers rest or follow given paths, walked with the same s as the platform's.

    Of the task's limits those named in `KNOWN_LIMITS` hold, and the robot file's of mobile carriers that move. The
    tension limits, less the task's margin, are the facets of the available wrench set. The time law is that of TOPP-RA
    (H. Pham, Q.-C. Pham, "A new approach to time-optimal path parameterization based on reachability analysis", IEEE
    T-RO 34(3), 2018): d2s/dt2 is constant between grid points, so tensions jump there. The extra `timing` installs it.

    Parameters
    ----------
    robot
        A `Robot`, the name of one in the library, or the path of a robot file.
    task
        A `Task`, a mapping with its keys, or the path of a YAML file, as for `plan`.
    grid
        Intervals to start with, from 10 to `MOST_INTERVALS`; the audit may double them.

    Returns
    -------
    Timing
        Feasible only if in the audit at 1 kHz no tension exceeds its limits by more than 1e-6 N, and no other limit is
        exceeded.

    Raises
    ------
    InputError
        If an argument is not valid, the task does not fit the robot or requires what a time law along a path cannot
        do, or nothing limits the speed; in one line.
    SolverError
        If toppra is not installed; the message contains the command that installs it.
    """
    robot, task = as_robot(robot), read_task(task)
    grid = whole_number("grid", grid, 10, MOST_INTERVALS)
    _check(robot, task)
    paths = _carrier_paths(robot, task)
    moving = {index: _curve(its, alone=False) for index, its in paths.items()}
    until = task.duration if isinstance(task.path, CirclePath) and isinstance(task.duration, float) else None
    still_air = None if task.wind is None else np.zeros(3)
    parametrised = ParametrisedPath(robot, _curve(task.path, alone=not moving), moving, until, still_air)
    return replace(_search(parametrised, _limits(parametrised, task.limits), task.margin, grid), name=task.name)


def _check(robot: Robot, task: Task) -> None:
    """Refuse a task that does not fit the robot, or that requires more than a time law along its path.

    Raises
    ------
    InputError
        Naming the field and what is accepted.
    """
    where = f"task {task.name!r}"
    if isinstance(task.base, FreeBase):
        raise InputError(f"{where}: base.kind must be hold or given to time a path, got 'free'")
    if task.tube.radius or task.tube.turn:
        raise InputError(f"{where}: tube must be left out to time a path, which is then followed exactly")
    for name in type(task.limits).model_fields:
        if name not in (*KNOWN_LIMITS, "soft") and getattr(task.limits, name):
            raise InputError(
                f"{where}: limits.{name} must be left out to time a path; a time law keeps {', '.join(KNOWN_LIMITS)}"
            )
    if task.limits.soft:
        raise InputError(f"{where}: limits.soft must be left out to time a path, whose limits are all hard")
    if isinstance(task.wind, WindBox) or (task.wind is not None and any(task.wind)):
        raise InputError(f"{where}: wind must be [0, 0, 0], still air, or left out to time a path")
    if task.wind is not None and robot.platform.aero is None:
        raise InputError(f"{where}: wind must be left out, since robot {robot.name!r} has no platform.aero")
    for index, (low, high) in enumerate(zip(robot.t_min, robot.t_max, strict=True)):
        if low + task.margin > high - task.margin:
            raise InputError(
                f"{where}: margin must be at most {(high - low) / 2:g} N, half the range of cable {index + 1} "
                f"({low:g} N to {high:g} N), got {task.margin:g} N"
            )


def _carrier_paths(robot: Robot, task: Task) -> dict[int, AnyPath]:
    """Return the paths of the carriers by index; the others stay at home."""
    base, where = task.base, f"task {task.name!r}"
    if isinstance(base, FreeBase):
        return {}
    if isinstance(base, GivenBase):
        return by_index(robot, base.paths, f"{where}: base.paths")
    poses: dict[str, AnyPath] = {name: RestPath(kind="rest", pose=pose) for name, pose in base.poses.items()}
    return by_index(robot, poses, f"{where}: base.poses")


def _curve(path: AnyPath, *, alone: bool) -> Curve:
    """Return the geometry of a path, which rests nowhere unless the path itself does."""
    if isinstance(path, TimedPath):
        return path.along
    if isinstance(path, LinePath | WaypointPath):
        return path.model_copy(update={"timing": "uniform"})
    if isinstance(path, SamplePath) and alone:
        return WaypointPath(kind="waypoints", frame=path.frame, points=path.poses, timing="uniform")
    return path


def _limits(parametrised: ParametrisedPath, limits: TaskLimits) -> PathLimits:
    """Return the limits of the task and those of the carriers that move."""
    speed = dict.fromkeys(parametrised.moving, limits.carrier_speed or np.inf)
    acceleration = dict.fromkeys(parametrised.moving, limits.carrier_acceleration or np.inf)
    for index in parametrised.moving:
        own = parametrised.robot.carriers[index].motion_limits
        speed[index] = min(speed[index], own.speed or np.inf)
        acceleration[index] = min(acceleration[index], own.acceleration or np.inf)
    of_cables = np.full(parametrised.robot.m, limits.cable_speed or np.inf)
    return PathLimits(limits.platform_speed or np.inf, of_cables, speed, acceleration)


def _search(parametrised: ParametrisedPath, limits: PathLimits, margin: float, intervals: int) -> Timing:
    """Solve and audit; after a violation again, on a finer grid or with more distance from the limits."""
    fastest, Rows = _toppra()
    weight = parametrised.robot.force_scale
    reserve, shrink, failures = RESERVE * weight, 0.0, 0
    grid = np.linspace(0, 1, intervals + 1)
    timing = _without_law(MotionStatus.NOT_FOUND, parametrised, limits, margin, grid, at=0.0)
    for _ in range(ATTEMPTS):
        s = np.linspace(0, 1, intervals + 1)
        plane = phase_plane(parametrised, limits, s, margin + reserve, shrink)
        law = fastest(s, Rows(*plane.rows(weight), plane.x_max))
        if failures == 0 and (law.x is None or not plane.rests_at_ends(weight)):
            proven = proofs(parametrised, limits, s, margin)
            if proven:
                worst = max(proven, key=lambda each: each.certificate.shortfall)
                proof = {"at": worst.s, "certificate": worst.certificate, "problem": worst.problem}
                blocked = np.array([each.s for each in proven])
                return _without_law(MotionStatus.INFEASIBLE, parametrised, limits, margin, s, blocked=blocked, **proof)
        if law.unlimited:
            raise InputError(
                f"limits must bound the speed along this path, by one of {', '.join(KNOWN_LIMITS)}, since its tensions "
                "do not, got none that does"
            )
        if law.x is None:
            timing = _without_law(MotionStatus.NOT_FOUND, parametrised, limits, margin, s, at=float(s[law.stuck or 0]))
            failures += 1
            if failures > FINER_TRIES:
                return timing
            intervals = min(2 * intervals, MOST_INTERVALS)
            continue
        sd, sdd = np.sqrt(law.x), np.diff(law.x) / (2 * np.diff(s))
        timing = Timing(MotionStatus.FEASIBLE, parametrised, limits, margin, s, sd, sdd)
        missing, excess, at = _audit(timing, limits)
        if missing <= TOLERANCE and excess <= LIMIT_TOLERANCE:
            return replace(timing, violation=missing)
        timing = replace(timing, status=MotionStatus.NOT_FOUND, violation=missing, at=at)
        if missing > COARSE * weight or excess > COARSE:
            intervals = min(2 * intervals, MOST_INTERVALS)
        reserve += 2 * missing if missing > TOLERANCE else 0.0
        shrink += 2 * excess if excess > LIMIT_TOLERANCE else 0.0
    return timing


def _without_law(
    status: MotionStatus,
    parametrised: ParametrisedPath,
    limits: PathLimits,
    margin: float,
    s: np.ndarray,
    **details: Any,
) -> Timing:
    return Timing(
        status, parametrised, limits, margin, s, np.full(len(s), np.nan), np.full(len(s) - 1, np.nan), **details
    )


def _audit(timing: Timing, limits: PathLimits) -> tuple[float, float, float]:
    """Return the largest missing wrench [N], the largest relative excess of another limit, and s of the worse one."""
    parametrised, robot, path = timing.parametrised, timing.parametrised.robot, timing.path
    duration = float(path.times[-1])
    if duration * AUDIT_RATE > MOST_SAMPLES:
        raise InputError(
            f"limits must allow a motion of at most {MOST_SAMPLES / AUDIT_RATE:g} s, since the audit evaluates "
            f"{AUDIT_RATE:g} instants per second, got one of {duration:g} s"
        )
    times = np.linspace(0, duration, max(int(np.ceil(duration * AUDIT_RATE)), LEAST_INTERVALS) + 1)
    s, sd, sdd = path.law(times)
    by_s = parametrised.at(s)
    platform, carriers = (motion.timed(sd, sdd) for motion in by_s)
    mask = robot.dof_mask
    A = parametrised.dynamics.wrench_matrix(platform.pose, carriers.pose) * mask[:, None]
    w = parametrised.dynamics.required_wrench(*platform, wind=parametrised.wind) * mask
    low, high = robot.t_min + timing.margin, robot.t_max - timing.margin
    batch = solve_batch(A, w, low, high, length=robot.length)
    missing = np.where(batch.feasible, batch.residual, np.inf)
    for k in np.flatnonzero(~batch.feasible):
        proof = certify(wrench_problem(parametrised.robot, A[k], w[k], low, high))
        # Neither available nor proven not to be: so near to the boundary that rounding decides.
        missing[k] = 0.0 if proof is None else proof.shortfall
    excesses = [np.abs(sd) / parametrised.speed_limit(*by_s, limits) - 1.0]
    for index, most in limits.carrier_acceleration.items():
        excesses.append(np.linalg.norm(carriers.acceleration[:, index, :3], axis=1) / most - 1.0)
    excess = np.max(excesses, axis=0)
    worst = int(missing.argmax() if missing.max() > TOLERANCE else excess.argmax())
    return float(missing.max()), float(excess.max()), float(s[worst])


def _toppra() -> tuple[Any, Any]:
    try:
        from .toppra_law import Rows, fastest
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "toppra":
            raise
        raise SolverError(
            "time_along: toppra is not installed; install the extra timing: pip install 'towline[timing]'"
        ) from None
    return fastest, Rows
