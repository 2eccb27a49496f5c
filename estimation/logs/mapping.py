"""`Fields`: which fields of a log are lengths, pose, tensions and time, as a map says or as their names suggest."""

import os
import re
from collections.abc import Iterator, Sequence
from pathlib import PurePath
from typing import Literal, NamedTuple

import numpy as np
from pydantic import Field as Key

from ...base.inputs import InputError, file_path
from ...models.parsing import read_yaml
from ...models.part import COORDINATES, Part
from ...models.robot import Robot
from .names import UNITS, role
from .recording import AXES, MOST_LISTED, Field, Recording, Topic, in_units, plain
from .usual_fields import usual_fields, within

TITLE = re.compile(r"(.+?)(?:\s+\[([^\]]*)\])?")
OF_STRUCTURES = ("x", "y", "z", "w", "roll", "pitch", "yaw")


class Fields(NamedTuple):
    """The fields of each role; an empty one was not recorded."""

    lengths: tuple[Field, ...] = ()
    tensions: tuple[Field, ...] = ()
    position: tuple[Field, ...] = ()
    orientation: tuple[Field, ...] = ()
    time: tuple[Field, ...] = ()
    commands: tuple[Field, ...] = ()
    thrusts: tuple[Field, ...] = ()
    efforts: tuple[Field, ...] = ()
    directions: tuple[Field, ...] = ()  # x, y, z of each cable, or its azimuth and elevation, or its azimuth alone


class LogMap(Part):
    """Names of the fields of a log, each with a unit in brackets if it is not SI: `/winches/position[*] [mm]`.

    The unit may have a factor: `/winches/angle[*] [0.05 m]` for a drum with a radius of 50 mm, whose angles are in rad.
    """

    lengths: str | list[str] = Key([], description="readings of the lengths, one name or one for each cable")
    tensions: str | list[str] = Key([], description="tensions, as `lengths`")
    pose: str | None = Key(None, description="topic or structure with a position and an orientation")
    position: str | list[str] = Key([], description="x, y, z")
    orientation: str | list[str] = Key([], description="quaternion x, y, z, w, or roll, pitch, yaw")
    time: str | None = Key(None, description="time of the columns of a table")
    commands: str | list[str] = Key([], description="commanded lengths [m] or tensions [N], as `lengths`")
    thrusts: str | list[str] = Key([], description="thrust of each flying carrier, as `lengths`")
    directions: str | list[str] = Key([], description="x, y, z of each cable's unit vector, or azimuth and elevation")
    directions_in: Literal["world", "carrier", "platform"] | None = Key(
        None, description="frame of `directions`; default: found by comparison with the robot's file"
    )
    carriers: dict[str, str] = Key({}, description="topic or beginning of the names of each moving carrier's fields")


def read_map(path: str | os.PathLike[str]) -> LogMap:
    """Read the YAML file of a map; raise InputError if it is not valid."""
    return read_yaml(file_path("map", path), LogMap)


def free_axes(robot: Robot | None) -> str:
    """Return the coordinates that can move, between spaces; a planar robot's log needs no others."""
    return "" if robot is None else " ".join(np.array(COORDINATES)[robot.dof_mask > 0])


def fields_of(
    recordings: Sequence[Recording],
    given: LogMap | None = None,
    m: int | None = None,
    carriers: Sequence[str] = (),
    free: str = "",
) -> Fields:
    """Return the fields of logs: those that a map names, and for all other roles those with usual names.

    - `m`: number of cables, which decides among several candidates.
    - `carriers`: names of carriers, whose poses are not the platform's.
    - `free`: `free_axes` of the robot.

    Raises `InputError` if a field that the map names does not exist, part of a position or an orientation is missing,
    or there are several candidates.
    """
    roles = ("lengths", "tensions", "position", "orientation", "directions")
    found = {name: _named(recordings, name, given, free) for name in roles} if given else {}
    if given and given.pose:
        parts = _below(recordings, given.pose)
        for name in ("position", "orientation"):
            found[name] = found[name] or usual_fields(parts, name, m, (), free=free)
    named = {(id(one.topic), one.name) for of in found.values() for one in of}  # have one role
    everything = _everything(recordings)
    of_platform = _everything(recordings, [_prefix(given, name) for name in carriers])
    for name in roles:
        if not found.get(name) and not (given and given.pose and name in ("position", "orientation")):
            fields = of_platform if name in ("position", "orientation", "directions") else everything
            fields = [one for one in fields if (id(one[1]), one[2]) not in named]
            found[name] = usual_fields(fields, name, m, found.get("position", ()), free=free)
    found["efforts"] = usual_fields(everything, "efforts", m, ())
    return Fields(**found, time=_times(recordings, given))


def command_fields(
    recordings: Sequence[Recording], given: LogMap | None, m: int, carriers: Sequence[str] = ()
) -> Fields:
    """Return the fields of commands and thrusts, and of the tensions that towline writes beside lengths under tension.

    Thrusts with the name of one of the `carriers` are left to `carrier_fields`.

    Raises `InputError` as `fields_of`.
    """
    found = {name: _named(recordings, name, given) for name in ("commands", "thrusts")} if given else {}
    for name, but in {"commands": (), "thrusts": carriers, "efforts": ()}.items():
        fields = _everything(recordings, [_prefix(given, one) for one in but])
        found[name] = found.get(name) or usual_fields(fields, name, m, ())
    return Fields(**found, time=_times(recordings, given))


def carrier_fields(recordings: Sequence[Recording], given: LogMap | None, carrier: str) -> Fields:
    """Return the fields of a carrier: its pose, its thrust or the vector of it, and directions.

    Raises `InputError` as `fields_of`.
    """
    prefix = _prefix(given, carrier)
    parts = [one for one in _everything(recordings) if within(one[1].full(one[2]), prefix)]
    if own := [one for one in recordings if len(recordings) > 1 and _is_of(one, prefix)]:
        parts, prefix = _everything(own), ""
    roles = ("position", "orientation", "thrusts", "directions")
    found = {name: usual_fields(parts, name, None, (), prefix) for name in roles}
    found["thrusts"] = found["thrusts"] or usual_fields(parts, "thrust_vectors", None, (), prefix)
    return Fields(**found, time=_times(recordings, given))


def listed(recordings: Sequence[Recording], but: Sequence[Fields] | None = None) -> str:
    """Return the names of the fields of recordings, the first dozen, except those with a role and some others."""
    used = {(id(one.topic), one.name) for fields in but or () for of in fields for one in of}
    names = [
        plain(topic.full(name))
        for one in recordings
        for topic in one.topics.values()
        for name in topic.fields
        if but is None or not (role(topic.full(name), topic.fields[name]) or (id(topic), name) in used)
    ]
    if len(names) < (1 if but is None else 2):  # a position has two coordinates or more
        return "none" if but is None else ""
    more = " ..." if len(names) > MOST_LISTED else ""
    return f"{', '.join(names[:MOST_LISTED])}{more}; a map (--fields) may name them"


def _times(recordings: Sequence[Recording], given: LogMap | None) -> tuple[Field, ...]:
    """Return the times of all tables: from the map, or by usual names for tables that it does not give."""
    named = _named(recordings, "time", given) if given else ()
    usual = usual_fields(_everything(recordings), "time", None, ())
    return (*named, *(one for one in usual if all(one.topic is not other.topic for other in named)))


def _everything(recordings: Sequence[Recording], but: Sequence[str] = ()) -> list[tuple[Recording, Topic, str]]:
    """Return all fields, except those below some prefixes, or in files of such names if there are several."""
    kept = [one for one in recordings if len(recordings) == 1 or not any(_is_of(one, prefix) for prefix in but)]
    every = [(one, topic, name) for one in kept for topic in one.topics.values() for name in topic.fields]
    return [one for one in every if not any(within(one[1].full(one[2]), prefix) for prefix in but)]


def _is_of(recording: Recording, carrier: str) -> bool:
    """Return whether a file has the name of a carrier, up to the number of a part of a bag."""
    stem = PurePath(recording.where).stem
    return re.fullmatch(rf"{re.escape(carrier)}(_\d+)?", stem, re.IGNORECASE) is not None


def _prefix(given: LogMap | None, carrier: str) -> str:
    return (given.carriers if given else {}).get(carrier, carrier)


def _named(recordings: Sequence[Recording], what: str, given: LogMap, free: str = "") -> tuple[Field, ...]:
    """Return the fields that a map names for a role."""
    texts = getattr(given, what)
    texts = [texts] if isinstance(texts, str) else texts or []
    result: list[Field] = []
    for text in texts:
        match = TITLE.fullmatch(text.strip())
        name, unit = (match[1], match[2] or "") if match else ("", "")
        found = list(_matching(recordings, name)) if match else []
        if not found:
            raise _not_there(f"{what} must name fields of the log", name, recordings)
        for recording, topic, field in found:
            result.append(Field(recording, topic, field, unit or topic.fields[field]))
    sizes = {"position": [0, 3], "orientation": [0, 3, 4]}.get(what)
    if sizes and len(result) not in [*sizes, *(len(set(axes) & set(free.split())) for axes in AXES.values())]:
        raise InputError(f"map: {what} must name {' or '.join(map(str, sizes[1:]))} fields, got {len(result)}")
    kind = "quaternion" if len(result) == 4 and what == "orientation" else "angles" if what == "orientation" else what
    if what == "directions" and any(one.unit in UNITS["azimuths"] for one in result):
        kind = "azimuths"
    return tuple(in_units(one, kind, any(other.unit for other in result)) for one in result)


def _matching(recordings: Sequence[Recording], name: str) -> Iterator[tuple[Recording, Topic, str]]:
    """Yield the fields of a name; [*] stands for all elements, and a structure for its coordinates, in order."""
    pattern = re.escape(name.replace(".", "/")).replace(r"\[\*\]", r"\[([^\]]*)\]").replace(r"\*", r"(\d+)")
    for recording in recordings:
        for topic in recording.topics.values():
            hits: list[tuple[tuple, str]] = []
            for field in topic.fields:
                full = topic.full(field).replace(".", "/")
                if found := re.fullmatch(pattern, full):
                    numbers = re.findall(r"\d+", "".join(found.groups()))
                    hits.append(((int(numbers[-1]) if numbers else 0,), field))
                elif (found := re.fullmatch(rf"{pattern}/({'|'.join(OF_STRUCTURES)})", full)) is not None:
                    hits.append(((OF_STRUCTURES.index(found[found.lastindex or 0]),), field))
            if "*" in name and len({key for key, _ in hits}) < len(hits):
                hits = [((place,), field) for place, (_, field) in enumerate(hits)]  # names without numbers
            yield from ((recording, topic, field) for _, field in sorted(hits))


def _below(recordings: Sequence[Recording], prefix: str) -> list[tuple[Recording, Topic, str]]:
    """Return the fields below a topic or a structure."""
    start = prefix.replace(".", "/").rstrip("/") + "/"
    found = [one for one in _everything(recordings) if one[1].full(one[2]).replace(".", "/").startswith(start)]
    if not found:
        raise _not_there("pose must name a topic or a structure of the log", prefix, recordings)
    return found


def _not_there(wanted: str, name: str, recordings: Sequence[Recording]) -> InputError:
    there = ", ".join(plain(topic.name or "the table") for one in recordings for topic in one.topics.values())
    return InputError(f"map: {wanted}, got {plain(name)}; the log has {there}")
