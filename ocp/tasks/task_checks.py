"""Check that a task fits a robot: `check_task` before it is laid out, `check_scenario` after."""

from math import remainder

import casadi as ca
import numpy as np

from ...base.errors import InputError
from ...models import Robot
from ...models.part import COORDINATES, PositiveRange
from ...models.points import shortest_way
from ...models.shapes import Shape
from ..limits.clearance import point_outside
from ..limits.limits import Limits
from .ends import carrier_ends, platform_ends
from .initial import Final, Initial, check_ends
from .limit_list import bodies
from .paths import FeedPath, SequencePath, WaypointPath
from .scenario import ATTITUDE, MOST_SAMPLES, Scenario, least_audit_rate
from .task import FreeBase, Task
from .task_limits import OF_CARRIERS
from .wind_set import WindBox, WindDisc

ENDING = ("waypoints", "samples", "feed", "sequence", "return")  # kinds of paths that end at a time of their own
TOLERANCE = 1e-9  # [m, rad, and per second], of exact waypoints and starts on their path


def check_task(robot: Robot, task: Task) -> None:
    """Check frame, tensions, wind and times of a task.

    Raises `InputError` naming the field of the task that does not fit, its value and what would.
    """
    where = f"task {task.name!r}"
    _check_frame(robot, task, where)
    check_margin(robot, task)
    _check_wind(robot, task, where)
    _check_robust(robot, task, where)
    _check_times(task, where)
    _check_waypoints(task, where)
    _check_cycle(task, where)
    _check_stops(robot, task, where)
    _check_feed(robot, task, where)
    if task.final is not None and task.final.carrier_pose is not None and carrier_ends(task) == "periodic":
        raise InputError(f"{where}: base.ends must not be periodic with final.carrier_pose, got periodic")


def check_scenario(scenario: Scenario) -> None:
    """Check ends and bounds of a task after it is laid out.

    Raises `InputError` naming the field of the task that does not fit, its value and what would.
    """
    robot, task = scenario.robot, scenario.task
    where = f"task {task.name!r}"
    check_ends(robot, task.initial, task.final, task.path.frame, where)
    _check_limits(robot, task, scenario.limits, where)
    for end, key, state in ((0, "initial", task.initial), (-1, "final", task.final)):
        if state is not None:
            _check_state(scenario, where, end, key, state)
    _check_ends_of_range(scenario, where)


def _check_frame(robot: Robot, task: Task, where: str) -> None:
    """Refuse a frame of the path that is none of the robot's."""
    frame = task.path.frame
    only = robot.carriers[0].name if len(robot.carriers) == 1 else None
    if frame != "world" and frame != only:
        accepted = "world" if only is None else f"world, {only}"
        key = "path.frame" if task.phases is None else "phases[0].path.frame"
        raise InputError(f"{where}: {key} must be one of {accepted}, got {frame!r}")


def check_margin(robot: Robot, task: Task) -> None:
    """Refuse a margin that exceeds half the tension range of a cable.

    Raises `InputError` naming the largest margin and the cable.
    """
    for index, (low, high) in enumerate(zip(robot.t_min, robot.t_max, strict=True)):
        if low + task.margin > high - task.margin:
            raise InputError(
                f"task {task.name!r}: margin must be at most {(high - low) / 2:g} N, half the range of cable "
                f"{index + 1} ({low:g} N to {high:g} N), got {task.margin:g} N"
            )


def _check_wind(robot: Robot, task: Task, where: str) -> None:
    """Refuse wind for a robot without `aero`, and a box of winds if the motion depends on the tensions."""
    if task.wind is not None and robot.platform.aero is None:
        raise InputError(f"{where}: wind must be left out, because robot {robot.name!r} has no platform.aero")
    if not isinstance(task.wind, WindBox | WindDisc):
        return
    for carrier in robot.carriers:
        if carrier.efforts:
            raise InputError(
                f"{where}: wind must be one velocity (x, y, z) [m/s], got a range: the cables pull on carrier "
                f"{carrier.name!r} of kind {carrier.kind}, so its motion depends on the wind"
            )


def _check_robust(robot: Robot, task: Task, where: str) -> None:
    """Refuse what the differences between robots are not known for."""
    if task.robust is None:
        return
    if robot.uncertainty is None or robot.uncertainty.geometry is None:
        missing = f"because the file of robot {robot.name!r} has no uncertainty"
        raise InputError(f"{where}: robust must be left out, {missing}, got {task.robust:g}")
    if robot.m < len(robot.platform.dof):
        raise InputError(
            f"{where}: robust must be left out for a robot with fewer cables than degrees of freedom, because its "
            f"motion depends on its geometry, got {task.robust:g} for {robot.name!r}"
        )
    if isinstance(task.wind, WindBox | WindDisc):
        raise InputError(f"{where}: wind must be one velocity (x, y, z) [m/s] with robust, got a range")
    for phase in task.phases or ():
        if phase.ground is not None:
            raise InputError(f"{where}: robust must be left out with phases on the ground, got phase {phase.name!r}")


def _check_stops(robot: Robot, task: Task, where: str) -> None:
    """Refuse what stops are not known for."""
    if task.stop_within is None:
        return
    flying = [carrier.name for carrier in robot.carriers if carrier.efforts]
    for others, what in ((flying, "flying carriers"), (task.robust, "robust")):
        if others:
            raise InputError(f"{where}: stop_within must be left out with {what}, got {task.stop_within:g} s")


def _check_feed(robot: Robot, task: Task, where: str) -> None:
    """Refuse paths whose acceleration jumps where flying carriers would have to jump in attitude with it."""
    flying = any(carrier.efforts for carrier in robot.carriers) and task.base.kind == "free"
    parts = [part.path for part in task.path.parts] if isinstance(task.path, SequencePath) else [task.path]
    if flying and any(isinstance(part, FeedPath) for part in parts):
        raise InputError(
            f"{where}: path.kind must be waypoints or samples if the planner moves flying carriers, since they cannot "
            "turn their thrust as suddenly as a steady speed begins and ends, got feed"
        )


def _check_times(task: Task, where: str) -> None:
    """Refuse a task longer or shorter than its waypoints: beyond their times a spline is arbitrary."""
    longest = task.duration.max if isinstance(task.duration, PositiveRange) else task.seconds
    rate = least_audit_rate(task)
    if longest * rate > MOST_SAMPLES:
        with_phases = " with phases" if task.phases else ""
        raise InputError(
            f"{where}: duration must be at most {MOST_SAMPLES / rate:g} s{with_phases}, since the audit evaluates "
            f"{rate:g} instants per second, got {longest:g} s"
        )
    if longest * task.output_rate > MOST_SAMPLES:
        raise InputError(
            f"{where}: output_rate must be at most {MOST_SAMPLES / longest:g} 1/s, {MOST_SAMPLES} samples in "
            f"{longest:g} s, got {task.output_rate:g} 1/s"
        )
    paths = {"path": task.path, **getattr(task.base, "paths", {}), **getattr(task.base, "around", {})}
    for name, path in paths.items():
        if longest <= path.resting:
            raise InputError(
                f"{where}: duration must be more than the {path.resting:g} s for which {name} dwells, got {longest:g} s"
            )
    if isinstance(task.duration, PositiveRange):
        for name, path in paths.items():
            if path.natural_duration is not None or (path.resting and path is not task.path):
                raise InputError(
                    f"{where}: duration must be a number [s], because {name} of kind {path.kind} has its own "
                    "times, got a range; paths of kind rest, line, and waypoints without times take a range"
                )
            if path.resting and (task.tube.radius or task.tube.turn or isinstance(task.base, FreeBase)):
                raise InputError(
                    f"{where}: duration must be a number [s], because path has a dwell and tube or base leave the "
                    "motion free, got a range"
                )
    for name, path in paths.items():
        end = path.natural_duration if path.kind in ENDING else None
        if end is not None and task.seconds > end * (1 + 1e-9):
            raise InputError(
                f"{where}: duration must be at most {end:g} s, where the times of {name} end, got {task.seconds:g} s"
            )
    end = task.path.natural_duration if task.path.kind in (*ENDING, "timed") else None  # which may rest after it
    if end is not None and task.seconds < end * (1 - 1e-9):
        raise InputError(
            f"{where}: duration must be at least {end:g} s, where the times of path end, got {task.seconds:g} s"
        )


def _check_cycle(task: Task, where: str) -> None:
    """Refuse a cycle whose path does not end as it starts, or whose ends are given."""
    if platform_ends(task) != "periodic":
        return
    for name in ("initial", "final"):
        if getattr(task, name) is not None:
            raise InputError(f"{where}: {name} must be left out with tube.ends periodic")
    if task.path.frame != "world":
        raise InputError(f"{where}: path.frame must be world with tube.ends periodic, got {task.path.frame!r}")
    ends = task.path.at(np.array([0.0, task.seconds]), task.seconds)
    pose, *rates = (part[1] - part[0] for part in ends)
    for off, what in zip((shortest_way(pose), *rates), ("pose", "velocity", "acceleration"), strict=True):
        if (worst := float(np.abs(off).max())) > TOLERANCE:
            must = f"must end with the {what} with which it starts, since tube.ends is periodic"
            raise InputError(f"{where}: path {must}, got a difference of {worst:.3g}")


def _check_waypoints(task: Task, where: str) -> None:
    """Refuse exact waypoints that are farther from the path than the tube reaches."""
    path, tube = task.path, task.tube
    if tube.waypoints != "exact" or not isinstance(path, WaypointPath):
        return
    missed = np.abs(path.missed(task.seconds))
    for index, (off, turned) in enumerate(
        zip(np.linalg.norm(missed[:, :3], axis=1), missed[:, 3:].max(axis=1), strict=True)
    ):
        for name, value, most, unit in (("position", off, tube.radius, "m"), ("attitude", turned, tube.turn, "rad")):
            if value > most + TOLERANCE:
                raise InputError(
                    f"{where}: tube.{name} must be at least {value:.3g} {unit}, the distance at which the legs pass "
                    f"points[{index}], because tube.waypoints is exact, got {most:g} {unit}; with path.blend 0 the "
                    "motion stops at the points"
                )


def _check_limits(robot: Robot, task: Task, limits: Limits, where: str) -> None:
    """Refuse soft limits of carriers that the robot does not have, and a body nearer to cables than they may be."""
    names = {limit.name for limit in limits}
    still = not any(carrier.moves for carrier in robot.carriers)
    for name in task.limits.soft:
        for its, owner, missing in (
            (("thrust", "torque"), "quadrotors", name not in names),
            (("carrier_reach",), "mobile carriers", name not in names),
            (OF_CARRIERS, "moving carriers", still),
        ):
            if name in its and missing:
                raise InputError(
                    f"{where}: limits.soft must not name {name!r}, a limit of {owner}: {robot.name!r} has none"
                )
    if task.limits.natural_frequency is not None:
        if task.phases is not None:
            raise InputError(f"{where}: limits.natural_frequency must be left out with phases, whose loads change it")
        for index, cable in enumerate(robot.cables):
            for key, value in (("stiffness", cable.stiffness), ("t_min", cable.t_min)):
                if not value:
                    raise InputError(
                        f"{where}: limits.natural_frequency needs cables with a stiffness and a t_min above 0 N, got "
                        f"{'none' if value is None else '0'} for cables[{index}].{key} of robot {robot.name!r}"
                    )
    for place in task.limits.keep_out:
        if place.frame == "platform" and place.cables is not None:
            _check_attachments(robot, place, place.cables, f"{where}: limits.keep_out {place.name!r}", "cables")
    carrier, cable = task.limits.carrier_platform_clearance, task.limits.cable_platform_clearance
    its = list(bodies(robot, task))
    if not its and not (carrier is None and cable is None):
        key = ("cable" if carrier is None else "carrier") + "_platform_clearance"
        missing = f"a body: robot {robot.name!r} has no platform.body, and no load has a body"
        raise InputError(f"{where}: limits.{key} must be left out without {missing}")
    if cable is not None:
        for body, whose, _ in its:
            _check_attachments(robot, body, cable, f"{where}: {whose}", "limits.cable_platform_clearance")


def _check_attachments(robot: Robot, body: Shape, least: float, which: str, key: str) -> None:
    """Refuse a body in the platform's frame with an attachment inside, or nearer than its cables may be."""
    for index, attachment in enumerate(robot.attachments):
        outside = float(point_outside(body, ca.DM(attachment)))
        if outside < least:
            raise InputError(
                f"{which} must leave all attachments outside by at least {key}, {least:g} m, got {outside:.3g} m "
                f"for cable {index + 1}"
            )


def _check_ends_of_range(scenario: Scenario, where: str) -> None:
    """Refuse a free duration where the path moves, as fast as that allows, at an end with a given velocity."""
    task = scenario.task
    if scenario.duration_range is None or not scenario.platform_free:
        return
    velocity = scenario.references(np.array([0.0, scenario.duration]))[0].velocity
    rests = platform_ends(task) == "rest"
    for end, name, state in ((0, "start", task.initial), (-1, "end", task.final)):
        given = rests if state is None else any(order for order, _ in state.of(None))
        if given and np.abs(velocity[end]).max() > TOLERANCE:
            raise InputError(
                f"{where}: duration must be a number, because a velocity is given at the {name} and the path does not "
                "rest there, got a range; a line with path.timing smooth rests there, a circle never does"
            )


def _check_state(scenario: Scenario, where: str, end: int, key: str, state: Initial | Final) -> None:
    platform, carriers = scenario.references(np.array([0.0, scenario.duration]))
    bodies = [(None, "platform", platform), *((i, c.name, carriers[i]) for i, c in enumerate(scenario.robot.carriers))]
    for owner, name, reference in bodies:
        for order, value in state.of(owner):
            for i, coordinate in enumerate(COORDINATES):
                off = value[i] - float(reference[order][end, i])
                if order == 0 and i in ATTITUDE:
                    off = remainder(off, 2 * np.pi)
                if (owner, i) not in scenario.owners() and abs(off) > TOLERANCE:
                    what = ("", "speed of ", "acceleration of ")[order]
                    hint = "only a tube or a free base permits another value"
                    if owner is None and not scenario.robot.dof_mask[i]:
                        hint = f"{coordinate} is not one of the platform's degrees of freedom"
                    raise InputError(
                        f"{where}: {key}: {what}{coordinate} of the {name} must be {value[i] - off:g}, as the task "
                        f"prescribes at its {'end' if end else 'start'}, got {value[i]:g}; {hint}"
                    )
