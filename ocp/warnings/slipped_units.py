"""`slipped_units`: numbers of a task that fit the robot only in another unit, such as millimetres instead of metres."""

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from pydantic import BaseModel

from ...base.text import quantity
from ...models import Robot
from ..tasks.task import Task

FAR = 5.0  # times the robot's size: no task of it is farther away
FAR_ANYWHERE = 100.0  # the same of robots whose carriers can go anywhere
SMALLER = {"centimetres": 100.0, "millimetres": 1000.0}  # in a metre
TURN, QUARTER = 2 * np.pi + 0.1, np.pi / 2 + 0.1  # [rad]: larger angles occur in no pose, and in no limit
FAST = {"m/s": 60.0, "m/s^2": 500.0, "rad/s": 20.0}  # no cable robot is faster or accelerates more
LEAST = 0.02  # of the robot's size: what would be smaller in millimetres is taken for centimetres
GRAMS = 1000.0  # in a kilogram
TOO_LARGE = "is too large for this robot"
_UNIT = re.compile(r"\[([^\]]+)\]")  # in the description of a field


class _Number(NamedTuple):
    """A number of a task or an array of them, with its dotted key and the unit of each column, or of all."""

    key: str
    units: tuple[str, ...]
    values: np.ndarray

    def of(self, unit: str) -> np.ndarray:
        """Return the values in a unit; of a pose lengths are the first three columns, angles the others."""
        if len(self.units) == 2 and self.values.ndim and self.values.shape[-1] > 3:
            return (
                self.values[..., :3] if unit == self.units[0] else self.values[..., 3:] if unit in self.units else _NO
            )
        return self.values if unit == self.units[0] else _NO


class _Suspect(NamedTuple):
    """Keys of numbers that are too large, the largest, and the unit that they seem to have."""

    keys: list[str]
    largest: float
    named: str


_NO = np.zeros(0)


def slipped_units(robot: Robot, task: Task) -> list[str]:
    """Return a sentence for each unit in which numbers of a task seem to be, instead of the unit that towline reads.

    A number is suspect if it is too large for the robot, but usual in the other unit.
    """
    numbers = list(_numbers(task, ""))
    suspects = [
        ("m", "metres", _lengths(robot, numbers)),
        ("rad", "radians", _above(numbers, "rad", "degrees", lambda key: TURN if key.startswith("path") else QUARTER)),
        ("rad/s", "radians per second", _above(numbers, "rad/s", "degrees per second", lambda key: FAST["rad/s"])),
        ("kg", "kilograms", _masses(robot, task)),
    ]
    for unit, read in (("m/s", "metres per second"), ("m/s^2", "metres per second squared")):
        of_task = _above(numbers, unit, f"milli{read}", lambda key, unit=unit: np.inf if key == "wind" else FAST[unit])
        suspects.append((unit, read, of_task))
    of_wind = _above(numbers, "m/s", "kilometres per hour", lambda key: FAST["m/s"] if key == "wind" else np.inf)
    suspects.append(("m/s", "metres per second", of_wind))
    return [
        f"{', '.join(suspect.keys)}: {quantity(suspect.largest, unit, 4)} {TOO_LARGE}; "
        f"are these {suspect.named}? towline reads {read}"
        for unit, read, suspect in suspects
        if suspect is not None
    ]


def _numbers(part: Any, key: str) -> Iterator[_Number]:
    """Yield the numbers with units that a part of a task was given."""
    for name, field in type(part).model_fields.items():
        if name not in part.model_fields_set:
            continue
        found = _UNIT.search(field.description or "")
        units = tuple(found[1].split(", ")) if found else ("",)
        yield from _of(getattr(part, name), f"{key}.{name}".removeprefix("."), units)


def _of(value: Any, key: str, units: tuple[str, ...]) -> Iterator[_Number]:
    if isinstance(value, BaseModel):
        yield from _numbers(value, key)
    elif isinstance(value, Mapping):
        for name, its in value.items():
            yield from _of(its, f"{key}.{name}", units)
    elif isinstance(value, tuple | list) and any(isinstance(each, BaseModel) for each in value):
        for i, its in enumerate(value):
            yield from _of(its, f"{key}[{i}]", units)
    elif units[0] and value is not None and not isinstance(value, str | bool):
        try:
            array = np.array(value, dtype=float)
        except (TypeError, ValueError):
            return
        if array.size:
            yield _Number(key, units, array)


def _lengths(robot: Robot, numbers: list[_Number]) -> _Suspect | None:
    """Return the lengths that are far from the robot, and the unit in which they are near."""
    points = np.vstack([robot.home_anchors, robot.home[:3] + robot.attachments])
    centre, size = (points.min(axis=0) + points.max(axis=0)) / 2, float(np.linalg.norm(np.ptp(points, axis=0)))
    confined = all(robot.carriers[index].confined for index in robot.carrier_of_cable)
    lower = {each.key.removesuffix(".min"): each.of("m") for each in numbers if each.key.endswith(".min")}
    keys, largest, written = [], 0.0, 0.0
    for each in numbers:
        values = each.of("m")
        if not values.size or each.key.endswith(".min"):
            continue
        away = np.abs(values - centre if values.ndim and values.shape[-1] == 3 else values)
        if (
            each.key.endswith(".max")
            and (low := lower.get(each.key.removesuffix(".max"))) is not None
            and low.size == 3
        ):
            away = np.maximum(np.maximum(low - centre, centre - values), 0.0)  # of the box
        if np.isfinite(far := float(away.max())) and far > (FAR if confined else FAR_ANYWHERE) * size:
            keys.append(each.key.removesuffix(".max"))
            largest, written = max(largest, far), max(written, float(np.abs(values).max()))
    named = "millimetres" if largest >= 1e3 * LEAST * size else "centimetres"
    return _Suspect(keys, written, named) if keys and largest <= SMALLER[named] * size else None


def _above(numbers: list[_Number], unit: str, named: str, most: Callable[[str], float]) -> _Suspect | None:
    """Return the numbers in a unit that are above what `most` returns of their key."""
    sizes = {each.key: float(np.abs(each.of(unit)).max(initial=0.0)) for each in numbers}
    keys = [key for key, size in sizes.items() if most(key) < size < np.inf]
    return _Suspect(keys, max(sizes[key] for key in keys), named) if keys else None


def _masses(robot: Robot, task: Task) -> _Suspect | None:
    """Return the loads that all cables together cannot lift, but could if their numbers were grams."""
    most = float(np.minimum(robot.t_max, 1e12).sum()) / max(float(np.linalg.norm(robot.gravity)), 1e-9)
    loads = {f"phases[{i}].load.mass": phase.load.mass for i, phase in enumerate(task.phases or ()) if phase.load}
    keys = [key for key, mass in loads.items() if most < mass <= GRAMS * most]
    return _Suspect(keys, max(loads[key] for key in keys), "grams") if keys else None
