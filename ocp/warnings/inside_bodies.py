"""Carriers whose bodies enter keep-out regions or overlap: `into_places`, `into_each_other`."""

from collections.abc import Callable, Iterable, Sequence
from itertools import combinations

import numpy as np

from ...base.errors import InputError
from ...base.text import quantity
from ...models.body import BodyHull
from ..limits.bodies import body_outside
from ..limits.limit import Limit
from ..limits.limits import Limits
from ..limits.places import CarriersOutside, PlatformOutside
from .instants import Instants

LEAST = 1e-4  # [m]: less is within the tolerances of a program
Limited = Callable[[Sequence[Limit]], list[np.ndarray]]
Meeting = tuple[float, str]  # by how much [m], and the sentence
MOST = 200  # instants that are looked at, or less than twice as many
ENTERED = 1e-3  # [m]: less inside is not worth a sentence


def into_places(seen: Instants, limits: Iterable[Limit], limited: Limited) -> list[str]:
    """Return a sentence if a carrier enters a region, because the task states less than the radius of its body.

    `limited` returns what some of the task's `limits` bound at the instants, (n, k) each.
    """
    robot, radii, meetings = seen.robot, seen.robot.carrier_radius, []
    less = [limit for limit in limits if isinstance(limit, CarriersOutside) and limit.low < radii.max() - LEAST]
    for limit, values in zip(less, limited(less), strict=True):
        for column, index in enumerate(limit.which):
            radius, row = radii[index], int(values[:, column].argmin())
            if limit.low < radius - LEAST and values[row, column] < radius - LEAST:
                name, distance = robot.carriers[index].name, quantity(abs(values[row, column]), "m", 3)
                comes = f"comes within {distance} of" if values[row, column] >= 0 else f"is {distance} inside"
                sentence = f"the centre of {name} {comes} {limit.called!r} at t = {seen.times[row]:.3f} s"
                wide = f", inside the radius of its body, {quantity(radius, 'm', 3)}"
                meetings.append((float(radius - values[row, column]), sentence + wide))
    return _worst(meetings, "carriers: radius, the default, keeps the whole body outside")


def into_each_other(seen: Instants) -> list[str]:
    """Return a sentence if two carriers come nearer to each other than the radii of both bodies together."""
    robot, meetings = seen.robot, []
    radii = robot.carrier_radius
    for i, j in combinations(np.flatnonzero(radii).tolist(), 2):
        apart = np.linalg.norm(seen.carriers[:, i, :3] - seen.carriers[:, j, :3], axis=1)
        row, least = int(apart.argmin()), radii[i] + radii[j]
        if apart[row] < least - LEAST:
            names = f"{robot.carriers[i].name} and {robot.carriers[j].name}"
            sentence = f"the centres of {names} are {quantity(apart[row], 'm', 3)} apart at t = {seen.times[row]:.3f} s"
            wide = f", less than the sum of the radii of their bodies, {quantity(least, 'm', 3)}"
            meetings.append((float(least - apart[row]), sentence + wide))
    return _worst(meetings, "limits.carrier_separation: radius keeps them apart")


def _worst(meetings: list[Meeting], mend: str) -> list[str]:
    """Return the sentence of the deepest meeting, with the number of others and what prevents it."""
    if not meetings:
        return []
    others = f" (and {len(meetings) - 1} more)" * (len(meetings) > 1)
    return [f"{max(meetings)[1]}{others}; {mend}"]


def between_points(seen: Instants, limits: Iterable[Limit], limited: Limited) -> list[str]:
    """Return a sentence if a region enters the hull of centre of mass and attachments, all of which stay outside.

    `limited` returns what some of the task's `limits` bound at the instants, (n, k) each.
    """
    robot = seen.robot
    if robot.platform.body is not None:
        return []
    outside = [limit for limit in limits if isinstance(limit, PlatformOutside)]
    kept = [
        (limit, its.min(axis=1))
        for limit, its in zip(outside, limited(outside), strict=True)
        if (its >= limit.low - limit.tolerance).all()
    ]
    if not kept:
        return []
    points = np.vstack([robot.platform.com, robot.attachments])
    try:
        hull = BodyHull(kind="mesh", vertices=tuple(map(tuple, points.tolist())))
    except InputError:  # points of a plane have no hull that bodies could enter
        return []
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    near = np.flatnonzero(np.min([its for _, its in kept], axis=0) < size)
    if not near.size:
        return []
    near = near[:: max(len(near) // MOST, 1)]
    parts = [tuple(body_outside(hull, "", limit.place, limit.called, 0.0)) for limit, _ in kept]
    values = Limits(robot, sum(parts, ())).at_rest(seen.pose[near], seen.carriers[near])
    meetings = []
    for (limit, _), part in zip(kept, parts, strict=True):
        its = np.hstack([values.pop(0) for _ in part]).min(axis=1)
        if its.min() < -ENTERED:
            when, deep = seen.times[near[its.argmin()]], quantity(-its.min(), "m", 3)
            sentence = f"{limit.called!r} passes between the points of the platform: it is {deep} inside the hull of "
            meetings.append((-float(its.min()), f"{sentence}its centre of mass and attachments at t = {when:.3f} s"))
    return _worst(meetings, "a platform.body in the robot's file would keep it out")
