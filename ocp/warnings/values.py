"""Values of which a plan warns: numbers that fit only in another unit, cable lengths, long turns, weak formations."""

import re
from collections.abc import Iterator, Mapping
from math import pi, remainder
from typing import Any, NamedTuple

import numpy as np
from pydantic import BaseModel

from ...base.text import quantity
from ...base.tolerances import INDEPENDENT
from ...models import Robot
from ...solvers.certificate import direction_text
from ..tasks.paths import LinePath, PathBase, SequencePath
from ..tasks.task import Task
from .positions import Instants

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
SHORT = 0.05  # of a cable's length at home
SLACK = -1e-6  # of the weight: less tension than that is slack
SHORT_OF_WHOLE = 1e-3  # [rad], by which a turn must be less than a whole one, which is meant
OTHER_WAY = "the other way to the same attitude"
WEAK = 0.05  # of the smallest singular value at home
LEAST_SHARE = 1e-4  # smaller shares are reported as less than this
SMALLER = 0.3  # of the formation, as advice


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


def short_cables(seen: Instants) -> list[str]:
    """Return a sentence if cables get shorter than `SHORT` of their length at home; none if their lengths are fixed."""
    robot = seen.robot
    if robot.fixed_lengths is not None:
        return []
    at_home = seen.dynamics.cable_lengths(robot.home)
    lengths = seen.dynamics.cable_lengths(seen.pose, seen.carriers)
    shares = lengths / at_home
    short = np.flatnonzero(shares.min(axis=0) < SHORT)
    if not short.size:
        return []
    row, cable = np.unravel_index(int(shares.argmin()), shares.shape)
    others = f", and so do {short.size - 1} more cables" if short.size > 2 else ", and so does one more"
    tows = robot.carriers[robot.carrier_of_cable[cable]].tows
    fixed = ", and with drive: fixed-length in the robot's file no winch reels it in" * tows
    return [
        f"cable {cable + 1} gets as short as {quantity(1e3 * lengths[row, cable], 'mm', 3)} at t = "
        f"{seen.times[row]:.3f} s, {quantity(100 * shares[row, cable], '%', 2)} of its "
        f"{quantity(at_home[cable], 'm', 3)} at home{others * (short.size > 1)}; limits.cable_length would keep it "
        f"longer{fixed}"
    ]


def fixed_cables(seen: Instants, tensions: np.ndarray) -> list[str]:
    """Return a sentence if the lengths of cables of fixed length do not keep the planned tensions, (n, m) [N].

    Lengths are such that the first tensions are as planned. From then on cables in a motion as planned have the
    tensions t that give the required wrench with the least elastic energy of their changes:

        min  (t - t_0)' diag(l / EA) (t - t_0)    s.t.  A t = A t_plan
    """
    robot = seen.robot
    stiffness = np.array([cable.stiffness or 0.0 for cable in robot.cables])
    if robot.fixed_lengths is None or not stiffness.all() or not np.isfinite(tensions).all():
        return []
    root = np.sqrt(robot.fixed_lengths / stiffness)
    A = robot.wrench_scale[:, None] * seen.dynamics.wrench_matrix(seen.pose, seen.carriers) / root
    A = A[:, np.flatnonzero(robot.dof_mask)]
    change = np.linalg.pinv(A, 1e-6) @ (A @ (root * (tensions - tensions[0]))[..., None])
    kept = tensions[0] + change[..., 0] / root
    row, cable = np.unravel_index(int(kept.argmin()), kept.shape)
    if kept[row, cable] >= SLACK * robot.force_scale:
        return []
    planned = quantity(tensions[row, cable], "N", 2)
    return [
        f"cable {cable + 1} can go slack at t = {seen.times[row]:.3f} s, where {planned} are planned: the lengths of "
        "cables of fixed length determine how they share the load; a larger margin could keep them taut"
    ]


def long_turns(path: PathBase) -> list[str]:
    """Return a sentence for each angle of a line, also of a part of a sequence, that turns the longer way."""
    if isinstance(path, SequencePath):
        return [sentence for piece in path.parts for sentence in long_turns(piece.path)]
    if not isinstance(path, LinePath):
        return []
    found = []
    for name, start, end in zip(("roll", "pitch", "yaw"), path.start[3:], path.end[3:], strict=True):
        short = remainder(end - start, 2 * pi)
        if pi < abs(end - start) < 2 * pi - SHORT_OF_WHOLE:
            turns, least = (quantity(np.rad2deg(abs(turn)), "degrees", 4) for turn in (end - start, short))
            other = f"{OTHER_WAY}, to a {name} of {quantity(start + short, 'rad', digits=6)}, is {least}"
            found.append(f"the line turns by {turns} in {name}; {other}")
    return found


def weak_formation(seen: Instants, formation: float | None = None) -> list[str]:
    """Return a sentence if the wrench matrix comes close to losing rank, in comparison with home.

    Moments are divided by the robot's length. Singular values that are near zero at home do not count, unless they are
    so in the motion, too. `formation` is the objective's [m]; default: the mean length of the cables.
    """
    robot = seen.robot
    rows = np.flatnonzero(robot.dof_mask)
    scale = robot.wrench_scale[rows, None]
    at_home = np.linalg.svd(scale * seen.dynamics.wrench_matrix(robot.home)[rows], compute_uv=False)
    rank = int((at_home > INDEPENDENT * at_home[0]).sum())
    U, values, _ = np.linalg.svd(scale * seen.dynamics.wrench_matrix(seen.pose, seen.carriers)[:, rows])
    lost = rank < len(rows) <= robot.m and values[:, -1].min() <= INDEPENDENT * at_home[0]
    last = values.shape[1] - 1 if lost else rank - 1
    k, direction = int(values[:, last].argmin()), np.zeros(6)
    direction[rows], share = U[k, :, last], values[k, last] / at_home[last]
    if lost:
        return [
            f"at t = {seen.times[k]:.3f} s, as at home, the cables cannot pull along {direction_text(direction)}, "
            "because the wrench matrix is singular; other homes of the carriers could change that"
        ]
    if share > WEAK:
        return []
    of_home = quantity(100 * share, "%", 2) if share >= LEAST_SHARE else f"less than {100 * LEAST_SHARE:g} %"
    smaller = quantity(SMALLER * (formation or float(seen.dynamics.cable_lengths(robot.home).mean())), "m", 2)
    return [
        f"from where the carriers are at t = {seen.times[k]:.3f} s, the cables pull along {direction_text(direction)} "
        f"with {of_home} of their effect at home; a smaller objective.formation, such as "
        f"{smaller}, keeps carriers closer to their formation at home"
    ]
