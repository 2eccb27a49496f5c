"""`listing`: what logs contain, and what can be done with them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...base.errors import InputError
from ...base.text import quantity
from ...figures.report import Part, Report, Section, Table
from ...models.robot import Robot
from .mapping import Fields, LogMap, carrier_fields, command_fields, fields_of, free_axes
from .names import UNITS, time_unit
from .reading import of_two_sensors
from .recorded import missing_for_replay
from .recording import GAP, Recording, Topic, plain
from .streams import are_too_partial

MOST_NAMED = 8  # fields of a topic
ROLES = ("lengths", "position", "orientation", "tensions", "directions")


def listing(recordings: Sequence[Recording], given: LogMap | None = None, robot: Robot | None = None) -> dict[str, Any]:
    """Return the contents of logs as plain data: files with topics, fields by their roles, and uses.

    If a role cannot be found, `problem` is the reason, in one line. With a robot there are the fields of its moving
    carriers, too.
    """
    moving = [] if robot is None else [carrier.name for carrier in robot.carriers if carrier.moves]
    others: dict[str, list[str]] = {}
    problem, found, commands, placed = None, Fields(), Fields(), list[str]()
    try:
        found = fields_of(recordings, given, None if robot is None else robot.m, moving, free_axes(robot))
        for name in moving:
            of = carrier_fields(recordings, given, name)
            found = found._replace(directions=found.directions or of.directions)
            placed += [name] if of.position else []
            others[name] = [one.label for one in (*of.position, *of.orientation, *of.thrusts, *of.directions)]
        commands = command_fields(recordings, given, len(found.lengths) if robot is None else robot.m, moving)
        if given and given.thrusts and robot is not None:
            others["thrusts"] = [one.label for one in commands.thrusts]
        if found.efforts and not found.tensions:
            others["tensions for replays"] = [one.label for one in found.efforts]
    except InputError as error:
        problem = f"{error}{', or give the robot (--robot)' if robot is None else ''}"
    return {
        "files": [
            {
                "file": one.where,
                "kind": one.kind,
                "notes": list(one.notes),
                "topics": [_topic(topic, found) for topic in one.topics.values()],
            }
            for one in recordings
        ],
        "fields": {name: [one.label for one in getattr(found, name)] for name in ROLES} | others,
        "uses": _uses(found, commands, robot, placed),
        "problem": problem,
    }


def _topic(topic: Topic, found: Fields) -> dict[str, Any]:
    times, clock = topic.times, next((one for one in found.time if one.topic is topic), None)
    if times is None and clock is not None:
        values = topic.read([clock.name]).values[:, 0]
        times = values * UNITS["time"][clock.unit or time_unit(values)]
    apart = np.array([]) if times is None else np.diff(times)
    median = float(np.median(apart)) if apart.size else 0.0
    wide = apart[apart > GAP * median] if median > 0 else apart[:0]
    empty: dict[str, int] = {}
    if topic.times is None:  # a table, which is in memory
        for name in ROLES:
            names = [one.name for one in getattr(found, name) if one.topic is topic]
            empty[name] = int(np.isnan(topic.read(names).values).any(axis=1).sum()) if names else 0
    return {
        "topic": topic.name,
        "type": topic.kind,
        "count": topic.count,
        "rate": 1 / median if median > 0 else None,
        "duration": float(times[-1] - times[0]) if times is not None and len(times) else None,
        "gaps": len(wide),
        "longest_gap": float(wide.max(initial=0.0)),
        "empty": {name: count for name, count in empty.items() if count},
        "fields": {plain(name): unit for name, unit in topic.fields.items()},
    }


def _uses(found: Fields, commands: Fields, robot: Robot | None, placed: Sequence[str]) -> dict[str, str | None]:
    """Return what logs can be used for, and None, or what is missing."""
    fixed = robot is not None and robot.fixed_lengths is not None  # cables of fixed length have no readings
    first = found.lengths or ((found.position or found.directions) if fixed else ())
    timed = bool(first) and (first[0].topic.times is not None or any(one.topic is first[0].topic for one in found.time))
    no_lengths = _missing_lengths(found) if first else "lengths"
    poses = bool(found.position or found.orientation)
    return {
        "calibration with poses": no_lengths or (None if poses else "poses (or give another file with --poses)"),
        "calibration without poses": no_lengths,
        "pose from lengths": no_lengths,
        "replay": no_lengths or missing_for_replay(found, commands, timed, robot, placed),
    }


def _missing_lengths(found: Fields) -> str | None:
    """Return in how many lines of a table lengths are missing, if these are too many to read it; otherwise None."""
    topic = found.lengths[0].topic if found.lengths else None
    if topic is None or topic.times is not None or any(one.topic is not topic for one in found.lengths):
        return None  # messages
    lengths = topic.read([one.name for one in found.lengths]).values
    pose, finite = found.position or found.orientation, np.isfinite(lengths)
    together = found.time and pose and pose[0].topic is topic
    if together and of_two_sensors(lengths, topic.read([one.name for one in pose]).values):
        return None
    lines = f"lengths in {quantity(int((~finite).any(axis=1).sum()))} of {quantity(len(finite))} lines"
    return lines if are_too_partial(finite) else None


def report(data: dict[str, Any]) -> Report:
    """Return the report of a `listing`."""
    parts: list[Part] = []
    for one in data["files"]:
        rows = [
            (
                topic["topic"] or "columns",
                topic["type"],
                quantity(topic["count"]),
                quantity(topic["rate"], "Hz", 4),
                quantity(topic["duration"], "s", 5),
                f"{topic['gaps']}, up to {quantity(topic['longest_gap'], 's', 3)}" if topic["gaps"] else "none",
            )
            for topic in one["topics"]
        ]
        columns = ("topic", "type", "samples", "rate", "duration", "gaps")
        lost = [pair for topic in one["topics"] for pair in topic["empty"].items()]
        empty = [f"lines with missing {name}: {quantity(count)}" for name, count in lost]
        parts += [Table(f"{one['file']}: {one['kind']}", columns, rows, (2, 3, 4)), *empty, *one["notes"]]
        parts.append(Section("Fields", [(topic["topic"] or "columns", _names(topic)) for topic in one["topics"]]))
    if data["problem"]:
        parts.append(data["problem"])
    fields = [(name, _briefly(names) or "not found") for name, names in data["fields"].items()]
    uses = [(name, f"no, missing: {missing}" if missing else "yes") for name, missing in data["uses"].items()]
    parts += [Section("Fields that towline uses", fields), Section("What the log can be used for", uses)]
    count = len(data["files"])
    return Report("log", "", f"{count} files" if count > 1 else data["files"][0]["kind"], parts)


def _names(topic: dict[str, Any]) -> str:
    names = [f"{name} [{unit}]" if unit else name for name, unit in topic["fields"].items()]
    return _briefly(names) or "no numbers, or an unknown encoding"


def _briefly(names: list[str]) -> str:
    return ", ".join(names if len(names) <= MOST_NAMED else [*names[: MOST_NAMED - 2], "...", names[-1]])
