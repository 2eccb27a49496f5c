"""`usual_fields`: the fields of a role in a log by their usual names."""

import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TypeAlias

from ...base.errors import InputError
from .names import ANGLE_OF, LETTERS, TURNED, Role, corner, measured_name, role
from .recording import AXES, MOST_LISTED, Field, Recording, Topic, in_units

OTHER_AXES = ("012", "123", "ned", "enu")  # of position[0], PlatformPosition_1 and PN, for x, y, z
OF_DIRECTION = ("x", "y", "z", "swivel", "azimuth", "elevation")
GREEK = re.compile(r"(?i)phi|theta|psi|heading|[./_ ][abc]$")
OF_PLATFORM = re.compile(r"(?i)(?<![a-z])(platform|payload|end[_ ]?effector|ee|tcp)(?![a-z])")
BEHIND_NUMBER = re.compile(r"\d[_ ][^\]0-9]+\]$")  # words in the name of a joint

Every: TypeAlias = Sequence[tuple[Recording, Topic, str]]
_Key: TypeAlias = tuple[int, str, str, str]  # recording, topic of a time, kind of the fields, and their name with "#"
_Group: TypeAlias = list[tuple[Role, Field]]


def usual_fields(
    everything: Every, what: str, m: int | None, position: Sequence[Field], prefix: str = "", free: str = ""
) -> tuple[Field, ...]:
    """Return the fields of a role by their usual names, those after `prefix` if there is one, in order.

    Raises `InputError` if some of a group of fields are missing, or several groups may have the role.
    """
    groups = _groups(everything, what, prefix)
    if what == "time":
        return tuple(members[0][1] for members in groups.values())
    complete: list[tuple[Field, ...]] = []
    for (_, _, kind, _), members in groups.items():
        if kind in AXES:
            found = _of_axes(members, kind, free)
        elif what == "directions":
            found = _of_directions(members)
        else:
            found = _of_cables(members, what, m, groups)
        complete += [] if found is None else [found]
    complete = _preferred(complete, what, m, position)
    if len(complete) > 1 and what == "position":  # of a body that has an orientation, rather than of its markers
        with suppress(InputError):
            turned = usual_fields(everything, "orientation", None, (), prefix, free)
            stem = re.split(r"(?i)orientation|rotation|quat", turned[0].full)[0] if turned else ""
            complete = [one for one in complete if stem and one[0].full.startswith(stem)] or complete
    if len(complete) > 1 and what == "orientation" and {len(one) for one in complete} == {3, 4} and len(complete) == 2:
        raise InputError("must have an orientation as roll, pitch, yaw or as qx, qy, qz, qw, got both")
    if len(complete) > 1:
        names = "; ".join(f"{one[0].full} ..." for one in complete[:MOST_LISTED])
        raise InputError(f"must have one candidate for {what}, got {names}: choose one in a map (--fields)")
    return complete[0] if complete else ()


def within(full: str, prefix: str) -> str:
    """Return what follows a topic or a beginning of names in the name of a field, empty if it is another's."""
    pattern = rf"(?:^|[^0-9A-Za-z]){re.escape(prefix.strip('/'))}[^0-9A-Za-z]+(.+)"
    found = re.search(pattern, full, re.IGNORECASE)
    return found[1] if found else ""


def _groups(everything: Every, what: str, prefix: str) -> dict[_Key, _Group]:
    """Return the fields that may have a role, in groups of names that differ in a number, a letter or an axis."""
    several = {"orientation": ("quaternion", "angles"), "commands": ("lengths", "tensions")}
    several["directions"] = ("directions", "azimuths")
    roles = several.get(what, (what,))
    groups: dict[_Key, _Group] = {}
    for recording, topic, name in everything:
        full = within(topic.full(name), prefix) if prefix else topic.full(name)
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
        groups[key] = [(found, in_units(one, key[2], stated)) for found, one in members]
    return groups


def _of_axes(members: _Group, kind: str, free: str) -> tuple[Field, ...] | None:
    """Return the fields of a position, an orientation or a thrust, None if the group is none.

    Raises `InputError` if some of a table are missing.
    """
    by_name = {found.which: one for found, one in members}
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
    return None if missing else tuple(by_name[axis] for axis in axes)


def _of_directions(members: _Group) -> tuple[Field, ...]:
    """Return the fields of the directions of all cables, or raise InputError if some are missing."""
    by_name = {found.which: one for found, one in members}
    order = sorted(by_name, key=_of_direction)
    cables, axes = (len(set(part)) for part in zip(*map(_of_direction, order), strict=True))
    if cables * axes != len(order):
        names = ", ".join(by_name[which].full for which in order[:MOST_LISTED])
        raise InputError(f"must have directions with the same axes for each cable, got {names}")
    return tuple(by_name[which] for which in order)


def _of_cables(members: _Group, what: str, m: int | None, groups: dict[_Key, _Group]) -> tuple[Field, ...] | None:
    """Return the fields of a role that each cable or carrier has, None if the group is none.

    Raises `InputError` if some of a table are missing, or stand in another of the `groups`.
    """
    by_name = {found.which: one for found, one in members}
    letters = [which for which in by_name if which and not which.isdigit()]
    if len(letters) == len(by_name):
        in_order = set(letters) == set(LETTERS[: len(letters)])
        known = in_order or all(corner(one.full) for one in by_name.values())
        if known and len(letters) == (m or max(len(letters), 2)):
            return tuple(by_name[which] for which in (sorted(letters) if in_order else letters))
        return None
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
    return tuple(by_name[i] for i in order)


def _preferred(
    complete: list[tuple[Field, ...]], what: str, m: int | None, position: Sequence[Field]
) -> list[tuple[Field, ...]]:
    """Return the groups that are left of several by one preference after the other."""
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
    return complete


def _of_direction(which: str) -> tuple[int, int]:
    """Return the number of the cable, 0 if there is none, and the number of the axis."""
    *number, axis = which.split()
    return int(number[0]) if number else 0, OF_DIRECTION.index(axis)


def _like(member: tuple[Role, Field], which: str) -> str:
    """Return the name of another field of the same group."""
    return member[0].group.replace("#", which)
