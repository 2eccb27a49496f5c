"""Names of the numbers that place a robot's cables, as `cables[2].anchor.x`: read, checked and changed by name.

    cables[i].anchor.x  .y  .z            of the anchor in the frame of its carrier [m]
    cables[i].attachment.x  .y  .z        of the attachment in the platform frame [m]
    cables[i].pulley.radius               of the sheave [m]

Cables count from 0, as in error messages about robot files.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..inputs import number, required, shown
from .part import LARGEST

if TYPE_CHECKING:
    from .robot import Cable, Robot

__all__ = ["Parameter", "changed", "locate", "values"]

FORMS = "cables[i].anchor.x, cables[i].attachment.x (or .y, .z) or cables[i].pulley.radius"
_NAME = re.compile(r"cables\[(0|[1-9][0-9]{0,5})\]\.(?:(anchor|attachment)\.([xyz])|pulley\.radius)")


class Parameter(NamedTuple):
    """A number of one cable: of its anchor or attachment, (3,), or the radius of its pulley."""

    cable: int
    part: str  # anchor, attachment or radius
    axis: int  # 0 of a radius


def locate(name: object, cables: tuple[Cable, ...] | None = None) -> Parameter:
    """Return which number a name stands for.

    Raises
    ------
    ValueError
        If it is not such a name or, if `cables` are given, they have no such number: "must be ..., got ...".
    """
    match = _NAME.fullmatch(name) if isinstance(name, str) else None
    if match is None:
        raise ValueError(f"must be like {FORMS}, got {shown(name)}")
    cable, part, axis = int(match[1]), match[2] or "radius", "xyz".index(match[3] or "x")
    if cables is not None and cable >= len(cables):
        raise ValueError(f"must be of a cable from 0 to {len(cables) - 1}, got {shown(name)}")
    if cables is not None and part == "radius" and cables[cable].pulley is None:
        raise ValueError(f"must be of a cable with a pulley, got {shown(name)}")
    return Parameter(cable, part, axis)


def values(robot: Robot, names: Iterable[str]) -> np.ndarray:
    """Return the numbers that the names stand for, (p,) [m].

    Raises
    ------
    InputError
        If `names` is no list of names, or the robot has no such number.
    """
    try:
        listed = None if isinstance(names, str) else list(names)
    except Exception:  # not iterable, as an array of CasADi is, which has `__iter__`
        listed = None
    if listed is None:
        raise InputError(f"names must be a list of names of a robot's numbers, got {shown(names)}")
    radii = robot.pulley_radii[:, None]
    numbers = {"anchor": robot.anchors, "attachment": robot.attachments, "radius": radii}
    places = (_place(robot, "names", name) for name in listed)
    return np.array([numbers[place.part][place.cable, place.axis] for place in places])  # (p,)


def changed(robot: Robot, numbers: Mapping[str, float]) -> dict[str, Any]:
    """Return the data of the robot with other numbers [m], by their names.

    Raises
    ------
    InputError
        If `numbers` is no mapping, the robot has no such number, or a value is not one.
    """
    data = robot.model_dump()
    cables = [dict(cable) for cable in data["cables"]]
    for name, value in required("values", numbers, Mapping).items():
        cable, part, axis = _place(robot, "keys of values", name)
        new = number(name, value, -LARGEST, LARGEST)
        if part == "radius":
            cables[cable]["pulley"] = {**cables[cable]["pulley"], "radius": new}
        else:
            point = list(cables[cable][part])
            point[axis] = new
            cables[cable][part] = point
    return {**data, "cables": cables}


def _place(robot: Robot, field: str, name: object) -> Parameter:
    try:
        return locate(name, robot.cables)
    except ValueError as error:
        raise InputError(f"{field} {error}") from None
