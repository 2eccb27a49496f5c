"""`slipped_units`: numbers that fit the robot only in another unit, such as millimetres instead of metres."""

import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from pydantic import BaseModel

from ...base.text import quantity
from ...models import Robot
from ..tasks.task import Task

READS = "towline reads"  # is in each sentence
OTHERS = {  # by the unit that is read: its name, and the names and sizes of units that are written instead
    "m": ("metres", {"millimetres": 1e-3, "centimetres": 1e-2}),
    "rad": ("radians", {"degrees": np.pi / 180}),
    "rad/s": ("radians per second", {"degrees per second": np.pi / 180, "revolutions per minute": np.pi / 30}),
    "kg": ("kilograms", {"grams": 1e-3, "tonnes": 1e3}),
    "kg m^2": ("kilogram square metres", {"kilogram square millimetres": 1e-6}),
    "m/s": ("metres per second", {"millimetres per second": 1e-3}),
    "wind": ("metres per second", {"kilometres per hour": 1 / 3.6}),
    "m/s^2": ("metres per second squared", {"millimetres per second squared": 1e-3}),
    "N": ("newtons", {"kilonewtons": 1e3}),
    "N/s": ("newtons per second", {"kilonewtons per second": 1e3}),
    "W": ("watts", {"kilowatts": 1e3}),
    "s": ("seconds", {"milliseconds": 1e-3, "minutes": 60.0}),
}
FAR, WIDE = 5.0, 2.0  # times the robot's size: no position of a task is farther away, and no other length is larger
FAR_ANYWHERE = 100.0  # the same of robots whose carriers can go anywhere
LARGEST = 1e3  # [m]: no robot is larger
LEAST = {True: 0.02, False: 0.002}  # of the robot's size: no position, and no other length, is written that is smaller
LEAST_SPREAD = 4e-4  # of the anchors' spread: attachments that are nearer together are in a larger unit than anchors
SLOWEST = 5e-5  # of the speed after a fall from the height of the robot: no motion has a smaller mean speed
PLACES = 101  # along a path, for its length
_UNIT = re.compile(r"\[([^\]]+)\]")  # in the description of a field


class _Number(NamedTuple):
    """A number of a task or robot or an array of them, with its dotted key and its unit."""

    key: str
    unit: str
    values: np.ndarray


class _Suspect(NamedTuple):
    """A number that is too large or too small, and the units that it may have; its unit is a key of `OTHERS`."""

    key: str
    size: float
    side: str
    unit: str
    named: tuple[str, ...]


def slipped_units(robot: Robot, task: Task) -> list[str]:
    """Return a sentence for each unit in which numbers of a task or robot seem to be, instead of what towline reads.

    A number is suspect if it is unusual for the robot, but usual in the other unit.
    """
    numbers = [*_numbers(robot, ""), *_numbers(task, "")]
    suspects = [*_lengths(robot, numbers)] or [*_durations(robot, task)]
    suspects += _unusual(robot, numbers)
    sentences = []
    for side, unit, named in dict.fromkeys(suspect[2:] for suspect in suspects):
        of_kind = [suspect for suspect in suspects if suspect[2:] == (side, unit, named)]
        keys = dict.fromkeys(re.sub(r"^(cables|carriers)\[\d+\]", r"\1", suspect.key) for suspect in of_kind)
        size = (max if side == "large" else min)(suspect.size for suspect in of_kind)
        written, others = quantity(size, unit.replace("wind", "m/s"), 4), " Or ".join(f"{name}?" for name in named)
        about = f"{', '.join(keys)}: {written} is too {side} for this robot"
        sentences.append(f"{about}; are these {others} {READS} {OTHERS[unit][0]}")
    return sentences


def _numbers(part: Any, key: str) -> Iterator[_Number]:
    """Yield the numbers with units that a part of a task or robot was given."""
    for name, field in type(part).model_fields.items():
        if name not in part.model_fields_set:
            continue
        found = _UNIT.search(field.description or "")
        units = tuple(found[1].split(", ")) if found else ("",)
        yield from _of(getattr(part, name), f"{key}.{name}".removeprefix("."), units)


def _of(value: Any, key: str, units: tuple[str, ...]) -> Iterator[_Number]:
    """Yield the numbers of a value; of a pose lengths are the first three columns, angles the others."""
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
        if len(units) == 2 and array.ndim and array.shape[-1] > 3:
            yield _Number(key, units[1], array[..., 3:])
            array = array[..., :3]
        if array.size:
            yield _Number(key, units[0], array)


def _unusual(robot: Robot, numbers: list[_Number]) -> Iterator[_Suspect]:
    """Yield the numbers that are usual only in another unit."""
    t_max, size, mass = np.minimum(robot.t_max, 1e12), _frame(robot)[1], robot.platform.mass
    strongest, liftable = float(t_max.max()), float(t_max.sum()) / max(float(np.linalg.norm(robot.gravity)), 1e-9)
    weight = robot.weight / robot.m  # that a cable carries
    usual = [  # unit, pattern of keys, least and most; the first that matches decides
        ("rad", r"path|pose|home|(?<!^tube\.)attitude|around", 0.0, 2 * np.pi + 0.1),
        ("rad", "", 0.0, np.pi / 2 + 0.1),  # of a limit
        ("rad/s", "", 0.0, 20.0),
        ("wind", "^wind", 0.0, 33.0),  # of a hurricane
        ("m/s", "", 0.0, 25.0),  # no cable robot is faster or accelerates more
        ("m/s^2", "", 0.0, 500.0),
        ("kg", r"load\.mass$", 2e-4 * liftable, liftable),
        ("kg", r"^platform\.mass$", liftable / 5000, 20 * liftable),
        ("kg m^2", r"^platform\.inertia$", 0.0, mass * size**2),
        ("N", r"^(margin|objective\.(tension|margin))$", 2e-3 * weight, strongest),
        ("N", r"t_max$", weight / 20, np.inf),
        ("N", r"stiffness$", strongest, np.inf),
        ("N/s", "", 1e-3 * strongest, np.inf),
        ("W", "", 2e-3 * weight * np.sqrt(10 * size), np.inf),
    ]
    for key, unit, values in numbers:
        largest = float(np.abs(values).max(initial=0.0))
        for of, keys, least, most in usual:
            if unit == of.replace("wind", "m/s") and re.search(keys, key):
                named = tuple(name for name, factor in OTHERS[of][1].items() if least <= factor * largest <= most)
                if named and 0.0 < largest < np.inf and not least <= largest <= most:
                    yield _Suspect(key, largest, "large" if largest > most else "small", of, named)
                break


def _frame(robot: Robot) -> tuple[np.ndarray, float]:
    """Return centre (3,) and size [m] of the box about anchors in a frame and its floor, or about anchors and platform.

    A floor is at height 0 if none is given: a crane's anchors may be much nearer to one another than to its load.
    """
    points = robot.home_anchors
    if np.ptp(points, axis=0).any() and all(robot.carriers[index].confined for index in robot.carrier_of_cable):
        points = np.vstack([points, [*points[0, :2], robot.floor or 0.0]])
    else:
        points = np.vstack([points, robot.home[:3] + robot.attachments])
    return (points.min(axis=0) + points.max(axis=0)) / 2, float(np.linalg.norm(np.ptp(points, axis=0)))


def _lengths(robot: Robot, numbers: list[_Number]) -> Iterator[_Suspect]:
    """Yield the lengths that are far from the robot, and the units in which they are near, or too large a robot."""
    centre, size = _frame(robot)
    if size > LARGEST or 0.0 < np.linalg.norm(np.ptp(robot.attachments, axis=0)) < LEAST_SPREAD * size:
        yield _Suspect("cables.anchor", float(np.abs(robot.home_anchors).max()), "large", "m", ("millimetres",))
        return
    confined = all(robot.carriers[index].confined for index in robot.carrier_of_cable)
    lengths = {each.key: each.values for each in numbers if each.unit == "m"}
    keys, largest, least = dict[str, float](), 0.0, 0.0
    for key, values in lengths.items():
        position, low = bool(values.ndim) and values.shape[-1] == 3, lengths.get(key.replace(".max", ".min"))
        if key.endswith(".min"):
            continue
        away = np.abs(values - centre if position else values)
        if key.endswith(".max") and low is not None and low.size == 3:
            away = np.maximum(np.maximum(low - centre, centre - values), 0.0)  # of the box
        most = FAR_ANYWHERE if not confined else FAR if position else WIDE
        if np.isfinite(far := float(away.max())) and far > most * size:
            keys[key.removesuffix(".max")] = float(np.abs(values).max())
            largest, least = max(largest, far), max(least, LEAST[position] * size)
    named = tuple(name for name, metres in OTHERS["m"][1].items() if least <= metres * largest <= size)
    yield from (_Suspect(key, written, "large", "m", named) for key, written in keys.items() if named)


def _durations(robot: Robot, task: Task) -> Iterator[_Suspect]:
    """Yield the durations in which the platform can hardly move so far, or creeps, and the units in which it moves."""
    pull = float(np.minimum(robot.t_max, 1e12).sum()) / robot.platform.mass + float(np.linalg.norm(robot.gravity))
    for key, part in [(f"phases[{i}].duration", phase) for i, phase in enumerate(task.phases or ())] or [
        ("duration", task)
    ]:
        if not isinstance(part.duration, float) or part.path is None:
            continue
        places = part.path.at(np.linspace(0.0, part.duration, PLACES), part.duration).pose[:, :3]
        way = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
        least, most = 2 * np.sqrt(way / pull), way / (SLOWEST * np.sqrt(10 * _frame(robot)[1]))
        units = OTHERS["s"][1].items()
        named = tuple(name for name, seconds in units if 2 * least <= seconds * part.duration <= most / 100)
        if named and not least <= part.duration <= most:
            yield _Suspect(key, part.duration, "large" if part.duration > most else "small", "s", named)
