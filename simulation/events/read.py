"""Read the events of a simulation from lines such as "cut 3 at 2.5", mappings, files, or events: `read_events`."""

import json
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ...base.errors import InputError
from ...base.inputs import printable, shown
from ...models.parsing import read_yaml, validate
from ...models.part import Part
from ...models.robot import Robot
from .event import Event

_FORM = re.compile(r"(?P<kind>[\w-]+)(?P<words>(\s.*)?)\s+at\s+(?P<at>\S+)(\s+for\s+(?P<duration>\S+))?")
_FILES = (".yaml", ".yml", ".json")


class EventFile(Part):
    """A file with events."""

    events: tuple[Any, ...]


def read_events(robot: Robot, events: Sequence[Any], name: str = "events") -> list[tuple[str, Event]]:
    """Return events, the earliest first, each with its place in the argument.

    Args:
        robot: The robot. In lines and files its cables are numbered from 1, and its carriers are named.
        events: Each a line such as "cut 3 at 2.5" (times in [s]), a mapping with a `kind` or such a mapping in JSON,
            the YAML file of a list `events` of these, or an `Event`.
        name: Name of the argument, for errors.

    Raises `InputError` if one has another form, or cannot happen to the robot.
    """
    if isinstance(events, str) or not isinstance(events, Sequence):
        raise InputError(f"{name} must be a list, each item {_accepted()}, got {shown(events)}")
    read = [event for number, given in enumerate(events) for event in _read(robot, given, f"{name}[{number}]")]
    return sorted(read, key=lambda named: named[1].at)


def _read(robot: Robot, given: Any, where: str, folder: Path | None = None) -> Iterator[tuple[str, Event]]:
    # Only here, not in a file, which could name itself.
    if folder is None and isinstance(given, str) and given.endswith(_FILES) and not _FORM.fullmatch(given.strip()):
        file = Path(given)
        for number, inner in enumerate(read_yaml(file, EventFile).events):
            yield from _read(robot, inner, f"{where}: events[{number}]", file.parent)
        return
    if not isinstance(given, Event):
        given = _from_data(_as_mapping(given, where), where, folder)
    try:
        given.check(robot)
    except InputError as error:
        raise InputError(f"{where} {error}") from None
    yield where, given


def _as_mapping(given: Any, where: str) -> dict[str, Any]:
    """Return the mapping that a line, or a mapping in JSON, stands for."""
    if isinstance(given, str):
        text = given.strip()
        if text.startswith("{"):
            try:
                given = json.loads(text)
            except (ValueError, RecursionError) as error:
                raise InputError(f"{where} must be {_accepted()}, got JSON with an error ({error})") from None
        elif (match := _FORM.fullmatch(text)) and (event := Event.kinds.get(match["kind"])) and event.short:
            duration = {} if match["duration"] is None else {"duration": match["duration"]}
            return {"kind": match["kind"], "at": match["at"], **event.in_words(match["words"].split()), **duration}
    if not isinstance(given, dict):
        raise InputError(f"{where} must be {_accepted()}, got {shown(given)}")
    return {str(key): value for key, value in given.items()}


def _from_data(data: dict[str, Any], where: str, folder: Path | None) -> Event:
    kind = data.get("kind")
    if not isinstance(kind, str) or kind not in Event.kinds:
        kinds = ", ".join(sorted(Event.kinds))
        raise InputError(f"{where}: kind must be one of {kinds}, got {printable(shown(kind))}")
    return validate(data, Event.kinds[kind], where, folder)


def _accepted() -> str:
    """Return what is accepted."""
    last = {event: "duration" in event.model_fields and event.said != "duration" for event in Event.kinds.values()}
    lines = [f"'{event.short} at SECONDS{' [for SECONDS]' * lasts}'" for event, lasts in last.items() if event.short]
    return f"{', '.join(lines)}, a mapping with a kind, or a YAML file with the list `events` of these"
