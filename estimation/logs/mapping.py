"""`Fields`: which fields of a log are lengths, pose, tensions and time, as a map says or as their names suggest."""

import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import PurePath
from typing import Literal, NamedTuple

import numpy as np
from pydantic import Field as Key

from ...base.errors import InputError
from ...base.inputs import file_path
from ...models.parsing import read_yaml
from ...models.part import COORDINATES, Part
from ...models.robot import Robot
from .names import ANGLE_OF, LETTERS, TURNED, UNITS, Role, corner, measured_name, role, unit_of
from .recording import Recording, Topic, plain

AXES = {"position": ("x", "y", "z"), "quaternion": ("x", "y", "z", "w"), "angles": ("roll", "pitch", "yaw")}
AXES["thrust_vectors"] = AXES["position"]
OTHER_AXES = ("012", "123", "ned", "enu")  # of position[0], PlatformPosition_1 and PN, for x, y, z
OF_DIRECTION = ("x", "y", "z", "swivel", "azimuth", "elevation")
TITLE = re.compile(r"(.+?)(?:\s+\[([^\]]*)\])?")
OF_STRUCTURES = ("x", "y", "z", "w", "roll", "pitch", "yaw")
MOST_LISTED = 12
GREEK = re.compile(r"(?i)phi|theta|psi|heading|[./_ ][abc]$")
OF_PLATFORM = re.compile(r"(?i)(?<![a-z])(platform|payload|end[_ ]?effector|ee|tcp)(?![a-z])")
BEHIND_NUMBER = re.compile(r"\d[_ ][^\]0-9]+\]$")  # words in the name of a joint


class Field(NamedTuple):
    """A field of a recording, and its unit, of which `factor` are 1."""

    recording: Recording
    topic: Topic
    name: str
    unit: str
    factor: float = 1.0

    @property
    def full(self) -> str:
        """Return the name with that of its topic, as a message names it."""
        return plain(self.topic.full(self.name))

    @property
    def label(self) -> str:
        """Return the name and the unit, as in a map."""
        return f"{self.full} [{'' if self.factor == 1 else f'{self.factor:g} '}{self.unit}]"


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
    """Return the coordinates that can move, between spaces; those of a planar robot suffice in a log."""
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
            found[name] = found[name] or _usual(parts, name, m, (), free=free)
    named = {(id(one.topic), one.name) for of in found.values() for one in of}  # have one role
    everything = _everything(recordings)
    of_platform = _everything(recordings, [_prefix(given, name) for name in carriers])
    for name in roles:
        if not found.get(name) and not (given and given.pose and name in ("position", "orientation")):
            fields = of_platform if name in ("position", "orientation", "directions") else everything
            fields = [one for one in fields if (id(one[1]), one[2]) not in named]
            found[name] = _usual(fields, name, m, found.get("position", ()), free=free)
    found["efforts"] = _usual(everything, "efforts", m, ())
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
        found[name] = found.get(name) or _usual(fields, name, m, ())
    return Fields(**found, time=_times(recordings, given))


def carrier_fields(recordings: Sequence[Recording], given: LogMap | None, carrier: str) -> Fields:
    """Return the fields of a carrier: its pose, its thrust or the vector of it, and directions.

    Raises `InputError` as `fields_of`.
    """
    prefix = _prefix(given, carrier)
    parts = [one for one in _everything(recordings) if _within(one[1].full(one[2]), prefix)]
    if own := [one for one in recordings if len(recordings) > 1 and _is_of(one, prefix)]:
        parts, prefix = _everything(own), ""
    roles = ("position", "orientation", "thrusts", "directions")
    found = {name: _usual(parts, name, None, (), prefix) for name in roles}
    found["thrusts"] = found["thrusts"] or _usual(parts, "thrust_vectors", None, (), prefix)
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
    """Return the times of all tables: that of the map, and the usual ones of tables that have none from there."""
    named = _named(recordings, "time", given) if given else ()
    usual = _usual(_everything(recordings), "time", None, ())
    return (*named, *(one for one in usual if all(one.topic is not other.topic for other in named)))


def _everything(recordings: Sequence[Recording], but: Sequence[str] = ()) -> list[tuple[Recording, Topic, str]]:
    """Return all fields, except those below some prefixes, or in files of such names if there are several."""
    kept = [one for one in recordings if len(recordings) == 1 or not any(_is_of(one, prefix) for prefix in but)]
    every = [(one, topic, name) for one in kept for topic in one.topics.values() for name in topic.fields]
    return [one for one in every if not any(_within(one[1].full(one[2]), prefix) for prefix in but)]


def _is_of(recording: Recording, carrier: str) -> bool:
    """Return whether a file has the name of a carrier, up to the number of a part of a bag."""
    stem = PurePath(recording.where).stem
    return re.fullmatch(rf"{re.escape(carrier)}(_\d+)?", stem, re.IGNORECASE) is not None


def _prefix(given: LogMap | None, carrier: str) -> str:
    return (given.carriers if given else {}).get(carrier, carrier)


def _within(full: str, prefix: str) -> str:
    """Return what follows a topic or a beginning of names in the name of a field, empty if it is another's."""
    pattern = rf"(?:^|[^0-9A-Za-z]){re.escape(prefix.strip('/'))}[^0-9A-Za-z]+(.+)"
    found = re.search(pattern, full, re.IGNORECASE)
    return found[1] if found else ""


def _usual(
    everything: Sequence[tuple[Recording, Topic, str]],
    what: str,
    m: int | None,
    position: Sequence[Field],
    prefix: str = "",
    free: str = "",
) -> tuple[Field, ...]:
    """Return the fields of a role by their usual names, those after `prefix` if there is one, in order."""
    several = {"orientation": ("quaternion", "angles"), "commands": ("lengths", "tensions")}
    several["directions"] = ("directions", "azimuths")
    roles = several.get(what, (what,))
    groups: dict[tuple[int, str, str, str], list[tuple[Role, Field]]] = {}
    for recording, topic, name in everything:
        full = _within(topic.full(name), prefix) if prefix else topic.full(name)
        found = role(full if what != "commands" else measured_name(full) or "", topic.fields[name])
        if found is None or found.role not in roles:
            continue
        key = (id(recording), topic.name if what == "time" else "", found.role, found.group)
        unit = topic.fields[name] or found.unit
        groups.setdefault(key, []).append((found, Field(recording, topic, name, unit)))
    for key, members in list(groups.items()):
        names = {found.which for found, _ in members}
        if key[2] in AXES and not names & set(AXES[key[2]]) and not any(names == set(axes) for axes in OTHER_AXES):
            del groups[key]  # position[0] to position[7]
            continue
        if key[2] == "quaternion" and re.search("(^|[./_ ])o[./_ ]?#$", key[3]) and "w" not in names:
            del groups[key]  # ox, oy, oz of an origin
            continue
        if key[2] == "quaternion" and re.search("r#$|rot", key[3]) and "w" not in names:
            del groups[key]  # rx, ry, rz or rot_x, rot_y, rot_z alone are angles
            key = (*key[:2], "angles", key[3])
            members = [(found._replace(which=ANGLE_OF[found.which]), one) for found, one in members]
        stated = any(one.unit for _, one in members)
        groups[key] = [(found, _in_units(one, key[2], stated)) for found, one in members]
    if what == "time":
        return tuple(members[0][1] for members in groups.values())
    complete: list[tuple[Field, ...]] = []
    for (_, _, kind, _), members in groups.items():
        by_name = {found.which: one for found, one in members}
        if kind in AXES:
            if (others := next((one for one in OTHER_AXES if set(by_name) == set(one)), None)) is not None:
                by_name = {axis: by_name[other] for axis, other in zip(AXES[kind], others, strict=True)}
            axes = tuple(axis for axis in AXES[kind] if axis in free.split() and kind != "quaternion")
            if kind in ("angles", "position") and 0 < len(axes) == len(by_name) < 3:  # of a planar robot, in any plane
                by_name = dict(zip(axes, (by_name[name] for name in sorted(by_name)), strict=True))
            axes = axes if set(axes) == set(by_name) else AXES[kind]
            missing = set(axes) - set(by_name)
            greek = GREEK.search(members[0][1].name) is not None  # which have other meanings too
            named = kind != "thrust_vectors" and not greek and set(by_name) <= set(AXES[kind])
            if missing and named and not members[0][1].topic.name:
                names = ", ".join(one.full for _, one in members)
                if kind == "quaternion" and "w" in missing and members[0][1].full.endswith("1"):  # q1, q2, q3, q4
                    how = f"'lengths: {members[0][1].full[:-1]}*' or 'orientation: [...]' with the names of x, y, z, w"
                    raise InputError(f"{names}, ... may be lengths or a quaternion: a map (--fields) must say {how}")
                wanted = ", ".join(_like(members[0], axis) for axis in axes)
                raise InputError(f"must have all columns {wanted} or none of them, got {names}")
            complete += [] if missing else [tuple(by_name[axis] for axis in axes)]
        elif what == "directions":
            order = sorted(by_name, key=_of_direction)
            cables, axes = (len(set(part)) for part in zip(*map(_of_direction, order), strict=True))
            if cables * axes != len(order):
                names = ", ".join(by_name[which].full for which in order[:MOST_LISTED])
                raise InputError(f"must have directions with the same axes for each cable, got {names}")
            complete.append(tuple(by_name[which] for which in order))
        else:
            letters = [which for which in by_name if which and not which.isdigit()]
            if len(letters) == len(by_name):
                in_order = set(letters) == set(LETTERS[: len(letters)])
                known = in_order or all(corner(one.full) for one in by_name.values())
                if known and len(letters) == (m or max(len(letters), 2)):
                    complete.append(tuple(by_name[which] for which in (sorted(letters) if in_order else letters)))
                continue
            order = sorted(set(by_name) - set(letters), key=lambda which: int(which or 0))
            first, count = int(order[0] or 0), len(order)
            wanted = [str(i) for i in range(min(first, 1), min(first, 1) + count)]
            lone = count == 1 and what == "thrusts"  # thrust_body[2], of PX4
            if order not in (wanted, [""]) and not (lone or members[0][1].topic.name):
                mine = [one.full for _, one in members]
                others = [one.full for its in groups.values() if its is not members for _, one in its]
                if len(mine) < len(others):
                    rest = ", ".join(others)
                    raise InputError(f"must have {what} under names of one kind, got {rest} and {', '.join(mine)}")
                names = [_like(members[0], i) for i in (wanted[0], wanted[-1])]
                lost = _like(members[0], next(i for i in wanted if i not in order))
                raise InputError(f"must have columns {names[0]} to {names[1]} without a gap, got no {lost}")
            complete.append(tuple(by_name[i] for i in order))
    better: tuple[tuple[str, Callable[[tuple[Field, ...]], bool]], ...] = (
        ("lengths tensions commands", lambda one: m is None or len(one) == m),
        ("lengths tensions commands", lambda one: not corner(one[0].full)),
        ("lengths", lambda one: not BEHIND_NUMBER.search(one[0].full)),  # winch_1 rather than pulley_1_joint
        ("lengths tensions directions thrusts thrust_vectors", lambda one: measured_name(one[0].full) is None),
        ("lengths", lambda one: not re.search(TURNED, one[0].full.lower())),  # l1 rather than angle_1
        ("position", lambda one: "Pose" in one[0].topic.kind),  # messages of poses rather than transforms and scenes
        ("position orientation", lambda one: bool(OF_PLATFORM.search(one[0].full))),  # rather than those of cameras
        ("orientation", lambda one: not re.search(r"(?i)rot\[\d\]$", one[0].full)),  # of the matrix of Qualisys
        (what, lambda one: not position or one[0].topic is position[0].topic),
    )
    for of, is_better in better:
        if len(complete) > 1 and what in of.split():
            complete = [one for one in complete if is_better(one)] or complete
    if len(complete) > 1 and what == "position":  # of a body that has an orientation, rather than of its markers
        with suppress(InputError):
            turned = _usual(everything, "orientation", None, (), prefix, free)
            stem = re.split(r"(?i)orientation|rotation|quat", turned[0].full)[0] if turned else ""
            complete = [one for one in complete if stem and one[0].full.startswith(stem)] or complete
    if len(complete) > 1 and what == "orientation" and {len(one) for one in complete} == {3, 4} and len(complete) == 2:
        raise InputError("must have an orientation as roll, pitch, yaw or as qx, qy, qz, qw, got both")
    if len(complete) > 1:
        names = "; ".join(f"{one[0].full} ..." for one in complete[:MOST_LISTED])
        raise InputError(f"must have one candidate for {what}, got {names}: choose one in a map (--fields)")
    return complete[0] if complete else ()


def _of_direction(which: str) -> tuple[int, int]:
    """Return the number of the cable, 0 if there is none, and that of the axis."""
    *number, axis = which.split()
    return int(number[0]) if number else 0, OF_DIRECTION.index(axis)


def _like(member: tuple[Role, Field], which: str) -> str:
    """Return the name of another field of the same group."""
    return member[0].group.replace("#", which)


def _in_units(one: Field, kind: str, stated: bool) -> Field:
    """Return a field with its unit, SI where none is stated; raise InputError for another one, or if others are."""
    if not one.unit and not stated:  # of times by their size, when they are read
        return one if kind == "time" else one._replace(unit=next(iter(UNITS[kind])))
    number, _, unit = one.unit.rpartition(" ")
    with suppress(ValueError):  # such as 20 N
        one = one._replace(unit=unit, factor=float(number)) if number else one
    if one.unit not in UNITS[kind]:
        one = one._replace(unit=unit_of(one.unit))
    if one.unit not in UNITS[kind] or not 0 < abs(one.factor) < np.inf:
        hint = f" (or a multiple, such as [0.05 {next(iter(UNITS[kind]))}])" if one.unit else ""
        raise InputError(f"the unit of {one.full} must be one of {', '.join(UNITS[kind])}, got {one.unit!r}{hint}")
    return one


def _named(recordings: Sequence[Recording], what: str, given: LogMap, free: str = "") -> tuple[Field, ...]:
    """Return the fields that a map names for a role."""
    texts = getattr(given, what)
    texts = [texts] if isinstance(texts, str) else texts or []
    result: list[Field] = []
    for text in texts:
        match = TITLE.fullmatch(text.strip())
        assert match is not None
        name, unit = match[1], match[2] or ""
        found = list(_matching(recordings, name))
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
    return tuple(_in_units(one, kind, any(other.unit for other in result)) for one in result)


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
