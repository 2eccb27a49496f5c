"""`Event`: what happens to a robot at a time of a simulation, as a line, a mapping or a file names it."""

from __future__ import annotations

import json
import re
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Annotated, Any, ClassVar, get_args

import numpy as np
from pydantic import BeforeValidator, Field

from ...base.display import Displayed
from ...base.inputs import InputError, printable, shown
from ...models.parsing import read_yaml, validate
from ...models.part import Part
from ...models.robot import Robot
from ...models.trajectory import Trajectory
from ...plant import Plant
from ...plant.steps import Periods

_FORM = re.compile(r"(?P<kind>[\w-]+)(?P<words>(\s.*)?)\s+at\s+(?P<at>\S+)(\s+for\s+(?P<duration>\S+))?")
_FILES = (".yaml", ".yml", ".json")


def number_in(text: Any) -> Any:
    """Return the number that a word is, or the word."""
    try:
        return float(text) if isinstance(text, str) else text
    except ValueError:
        return text


LONGEST = 1e6  # [s]
Seconds = Annotated[float, BeforeValidator(number_in), Field(ge=0, le=LONGEST, allow_inf_nan=False)]


@dataclass
class Running(Displayed):
    """A running simulation, which events may change.

    Attributes:
        plant, periods: The plant, and how it is stepped.
        states: States of all runs, (N, n), see `Plant`.
        silent_until: Time until which the controller does not respond [s].
    """

    plant: Plant
    periods: Periods
    states: np.ndarray
    silent_until: float = -1.0

    def carry(self, robot: Robot) -> None:
        """Give the platform the mass, CoM and inertia of a robot; its motion does not change."""
        self.states = self.periods.carry(self.states, robot)


class Event(Part, ABC):
    """An event. One of your own defines `kind`, `describe`, and one or more of `begin`, `wrench` and `follow`.

    Attributes:
        at: Time at which it begins [s]. It acts from the next period of the controller on.
        kinds: The registry: every defined event by its kind.
        short: Its form in one line, without "at SECONDS" and "for SECONDS"; empty if it has none.
        said: The field whose value is the words between its kind and "at".
    """

    kinds: ClassVar[dict[str, type[Event]]] = {}
    short: ClassVar[str] = ""
    said: ClassVar[str] = "what"

    at: Seconds = Field(description="time at which it begins [s]")

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Any) -> None:
        super().__pydantic_init_subclass__(**options)
        if "kind" in cls.__annotations__:
            Event.kinds[get_args(cls.model_fields["kind"].annotation)[0]] = cls

    @property
    def until(self) -> float:
        """Return the time at which it ends [s]; infinity if it does not."""
        return inf

    @classmethod
    def in_words(cls, words: list[str]) -> dict[str, Any]:
        """Return its fields, except the time, from the words between its kind and "at"."""
        return {cls.said: " ".join(words)} if words else {}

    def check(self, robot: Robot) -> None:
        """Check that it can happen to the robot.

        Raises:
            InputError: If it cannot: "must ..., got ...".
        """

    @abstractmethod
    def describe(self, robot: Robot) -> str:
        """Return what happened, such as "cable 3 was cut"."""

    def begin(self, running: Running) -> None:
        """Change the running simulation once, as the event begins."""

    def longest_step(self, robot: Robot) -> float:
        """Return the longest time for which a value of `wrench` may be held [s]; infinity (default): any period."""
        return inf

    def wrench(self, time: float, motions: np.ndarray) -> np.ndarray | None:
        """Return force [N] and moment about the CoM [N m] on the platform in {G}, (6,) or (N, 6), for one step.

        With three dimensions, (N, 1 + c, 6), they act on the platform and on the carriers, whose motion they change
        if these have mass. A step is a period of the controller or a part of it, see `longest_step`.

        Args:
            time: Time at which the step begins [s].
            motions: Poses of platform and carriers then, and their derivatives, in N runs: (N, 1 + c, 12).
        """
        return None

    def follow(self, robot: Robot, trajectory: Trajectory, time: float) -> Trajectory | None:
        """Return the reference from the event on, with time 0 at the event; None if the reference does not change.

        Args:
            robot: The robot.
            trajectory: The reference until then.
            time: The time in it [s].
        """
        return None


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
    last = {event: "duration" in event.model_fields and event.said != "duration" for event in Event.kinds.values()}
    lines = [f"'{event.short} at SECONDS{' [for SECONDS]' * lasts}'" for event, lasts in last.items() if event.short]
    return f"{', '.join(lines)}, a mapping with a kind, or a YAML file with the list `events` of these"
