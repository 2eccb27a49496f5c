"""`limit_list`: all limits of a task and of the robot that it is laid out for."""

from collections.abc import Iterator
from itertools import combinations
from typing import Literal

import numpy as np

from ...models import Robot
from ...models.shapes import AnyBody, Shape, skeleton
from ..limits import cables, carriers, platform
from ..limits.limit import Limit
from ..limits.limits import Limits
from ..limits.places import LOAD, PLATFORM, CablesOutside, CarriersOutside, PlatformOutside, body_outside, inside_room
from .task import FreeBase, Task
from .task_limits import AnyKeepOut, TaskLimits


def limit_list(robot: Robot, task: Task) -> Limits:
    """Return the limits of `task` and those of the file of `robot`, each hard unless the task makes it soft."""
    given = task.limits
    parts = (
        _of_cables(robot, task),
        _of_platform(given),
        _of_carriers(robot, task),
        (limit for place in given.keep_out for limit in _of_place(robot, place)),
        _of_bodies(robot, task),
        (effort for index in range(len(robot.carriers)) for effort in carriers.efforts(robot, index)),
        _of_tube(task),
        given.own,
    )
    return Limits(robot, tuple(limit.softened(given.soft.get(limit.name)) for part in parts for limit in part))


def _of_cables(robot: Robot, task: Task) -> Iterator[Limit]:
    """Return the limits of the task, and those of the winches of the robot's file; of two speeds the smaller one."""
    given = task.limits
    winches = [cable.winch if robot.fixed_lengths is None else None for cable in robot.cables]
    speeds = [winch.speed_max if winch else None for winch in winches]
    yield from cables.CableSpeed.each(robot, [_tighter(given.cable_speed, speed) for speed in speeds])
    yield from cables.WinchForce.each(robot, [winch.tension_max if winch else None for winch in winches])
    for kind in (cables.CableAcceleration, cables.CableJerk, cables.WinchPower):
        if (most := getattr(given, kind.name)) is not None:
            yield kind(robot, most)
    if given.cable_length is not None:
        yield cables.CableLength(robot, given.cable_length.min, given.cable_length.max)
    if given.cable_clearance is not None and (clearance := cables.CableClearance(robot, given.cable_clearance)).labels:
        yield clearance
    if given.natural_frequency is not None:
        yield cables.NaturalFrequency(robot, given.natural_frequency)
    if "margin" in given.soft:
        yield cables.Margin(robot, task.margin)
    if given.tension_rate is not None:
        yield cables.TensionRate(robot, given.tension_rate)


def _of_platform(given: TaskLimits) -> Iterator[Limit]:
    for zone in given.zone_speed:
        yield platform.ZoneSpeed(zone.name, zone.centre, zone.radius, zone.speed)
    kinds = (
        platform.PlatformSpeed,
        platform.PlatformAcceleration,
        platform.PlatformLateralAcceleration,
        platform.PlatformTurn,
        platform.PlatformTilt,
    )
    for kind in kinds:
        if (most := getattr(given, kind.name)) is not None:
            yield kind(most)
    if given.platform_box is not None:
        for axis, low, high in zip(range(3), given.platform_box.min, given.platform_box.max, strict=True):
            yield platform.PlatformBox(axis, low, high)


def _of_carriers(robot: Robot, task: Task) -> Iterator[Limit]:
    """Return the limits of the robot's file together with the task's, whichever is tighter."""
    given, free = task.limits, task.base if isinstance(task.base, FreeBase) else None
    speed, acceleration = given.carrier_speed, given.carrier_acceleration
    if free is not None:
        speed, acceleration = _tighter(speed, free.speed_max), _tighter(acceleration, free.acceleration_max)
    if given.carrier_separation == "radius":
        yield from _apart(robot)
    elif given.carrier_separation is not None and len(robot.carriers) > 1:
        yield carriers.CarrierSeparation(robot, given.carrier_separation)
    for index, carrier in enumerate(robot.carriers):
        if not carrier.moves:
            continue
        own, turns = carrier.motion_limits, None if carrier.keeps_attitude else free
        if (most := _tighter(acceleration, own.acceleration)) is not None:
            yield carriers.CarrierAcceleration(robot, index, most)
        if (most := _tighter(speed, own.speed)) is not None:
            yield carriers.CarrierSpeed(robot, index, most)
        if (most := _tighter((turns.tilt_max or None) if turns is not None else None, own.tilt)) is not None:
            yield carriers.CarrierTilt(robot, index, most)
        if turns is not None and turns.turn_acceleration_max is not None:
            yield carriers.CarrierTurnAcceleration(robot, index, turns.turn_acceleration_max)
        if own.reach is not None:
            for axis, low, high in zip(range(3), own.reach.min, own.reach.max, strict=True):
                yield carriers.CarrierReach(robot, index, axis, low, high)


def _apart(robot: Robot) -> Iterator[Limit]:
    """Return the limits that keep the bodies of carriers out of each other."""
    radii = robot.carrier_radius.tolist()
    pairs = list(combinations([index for index, radius in enumerate(radii) if radius > 0], 2))
    least = [radii[i] + radii[j] for i, j in pairs]
    for distance in dict.fromkeys(least):
        yield carriers.CarrierSeparation(
            robot, distance, [pair for pair, its in zip(pairs, least, strict=True) if its == distance]
        )


def _tighter(*bounds: float | None) -> float | None:
    return min((bound for bound in bounds if bound is not None), default=None)


def _of_place(robot: Robot, place: AnyKeepOut) -> Iterator[Limit]:
    riding = place.frame == "platform"
    if place.platform is not None and not riding:
        points = PlatformOutside(robot, place, place.name, place.platform)
        yield from [points] * bool(points.labels)
    yield from _around(robot, place, place.name, riding, place.carriers, place.cables)


def _around(
    robot: Robot,
    place: Shape,
    called: str,
    riding: bool,
    carriers: float | Literal["radius"] | None,
    cables: float | None,
) -> Iterator[Limit]:
    """Return the limits that keep carriers and cables away from a region, or one `riding` on the platform."""
    if carriers is not None:
        moving = [index for index, carrier in enumerate(robot.carriers) if carrier.moves]
        radii = robot.carrier_radius.tolist()
        least = {index: radii[index] if carriers == "radius" else carriers for index in moving}
        for distance in dict.fromkeys(least.values()):
            which = [index for index in moving if least[index] == distance]
            yield CarriersOutside(robot, which, place, called, riding, distance)
    if cables is not None:
        yield CablesOutside(robot, place, called, riding, cables)


def bodies(robot: Robot, task: Task) -> Iterator[tuple[AnyBody, str, frozenset[int] | None]]:
    """Yield the bodies in the platform's frame, what texts call them, and the phases in which they are there."""
    if robot.platform.body is not None:
        yield robot.platform.body, PLATFORM, None
    loads = [phase.load.body if phase.load else None for phase in task.phases or ()]
    for index, body in enumerate(loads):
        if body is not None and body not in loads[:index]:
            yield body, LOAD, frozenset(other for other, its in enumerate(loads) if its == body)


def _of_bodies(robot: Robot, task: Task) -> Iterator[Limit]:
    """Return the limits of all bodies; without a platform body, floor and room limit the platform's points."""
    given = task.limits
    for body, whose, phases in bodies(robot, task):
        its = list[Limit](inside_room(skeleton(body).corners, body.rounding, whose, robot.floor, robot.workspace_box))
        for place in given.keep_out:
            if place.platform is not None and place.frame == "world":
                its += body_outside(body, whose, place, place.name, place.platform)
        its += _around(robot, body, whose, True, given.carrier_platform_clearance, given.cable_platform_clearance)
        yield from (limit.during(phases) for limit in its)
    if robot.platform.body is None:
        points = np.vstack([robot.platform.com, robot.attachments])
        yield from inside_room(points, 0.0, "platform", robot.floor, robot.workspace_box)


def _of_tube(task: Task) -> Iterator[Limit]:
    if np.isfinite(task.tube.radius):
        yield platform.TubePosition(task.tube.radius)
    yield from (platform.TubeAttitude(axis, task.tube.turn) for axis in range(3))
