"""Carriers whose bodies enter keep-out regions or overlap: `into_places`, `into_each_other`."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from ...base.text import quantity
from ..limits.limit import Limit
from ..limits.places import CarriersOutside
from .instants import Instants

LEAST = 1e-4  # [m]: less is within the tolerances of a program
Meeting = tuple[float, str]  # by how much [m], and the sentence


def into_places(seen: Instants, limits: Sequence[Limit], limited: Sequence[np.ndarray]) -> list[str]:
    """Return a sentence if a carrier enters a region, because the task states less than the radius of its body.

    Parameters
    ----------
    limits, limited
        Those of the task, and what they bound at the instants, (n, k) each.
    """
    robot, meetings = seen.robot, []
    for limit, values in zip(limits, limited, strict=True):
        if not isinstance(limit, CarriersOutside):
            continue
        for column, index in enumerate(limit.which):
            radius, row = robot.carrier_radius[index], int(values[:, column].argmin())
            if limit.low < radius - LEAST and values[row, column] < radius - LEAST:
                name, distance = robot.carriers[index].name, quantity(abs(values[row, column]), "m", 3)
                comes = f"comes to {distance} from" if values[row, column] >= 0 else f"is {distance} inside"
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
            sentence = f"the centres of {names} come to {quantity(apart[row], 'm', 3)} at t = {seen.times[row]:.3f} s"
            wide = f", less than the radii of their bodies together, {quantity(least, 'm', 3)}"
            meetings.append((float(least - apart[row]), sentence + wide))
    return _worst(meetings, "limits.carrier_separation: radius keeps them apart")


def _worst(meetings: list[Meeting], mend: str) -> list[str]:
    """Return the sentence of the deepest meeting, with the number of others and what prevents it."""
    if not meetings:
        return []
    others = f" (and {len(meetings) - 1} more)" * (len(meetings) > 1)
    return [f"{max(meetings)[1]}{others}; {mend}"]
