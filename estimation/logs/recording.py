"""`Recording`: the topics of a log of any kind, each with times and fields of numbers; `Field`: one of these fields."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ...base.inputs import InputError, printable
from .names import UNITS, unit_of

GAP = 5.0  # median times between samples
COUNTED = 1e8  # [s]: times beyond count from 1970, and are read from the first one
AXES = {"position": ("x", "y", "z"), "quaternion": ("x", "y", "z", "w"), "angles": ("roll", "pitch", "yaw")}
AXES["thrust_vectors"] = AXES["position"]
MOST_LISTED = 12


class Samples(NamedTuple):
    """Values (N, k) of some fields at times (N,) [s], which a topic without a clock of its own does not have."""

    times: np.ndarray | None
    values: np.ndarray


@dataclass(frozen=True, eq=False)
class Topic:
    """Fields of numbers that are recorded together: the messages of a topic, or the columns of a table.

    Attributes:
        name, kind: Name, "" of a table, and type of the messages.
        count: Number of messages or lines.
        times: When they were recorded [s], (N,), or None if no clock is known; a table has one among its fields.
        fields: Names of the fields and their units as they are stated, "" if they are not.
        read: Function that returns the values of some fields as they are recorded.
    """

    name: str
    kind: str
    count: int
    times: np.ndarray | None
    fields: Mapping[str, str]
    read: Callable[[Sequence[str]], Samples]

    def full(self, name: str) -> str:
        """Return the name of a field with its topic's name."""
        return f"{self.name}/{name}" if self.name else name


@dataclass(eq=False)
class Recording:
    """A log and its topics.

    Attributes:
        where, kind: Path and kind of the file, such as "MCAP".
        topics: Its topics by their names.
        sigma: Standard deviations that the file states, by the names of `Sigma`.
        framed: Frames of its poses that are known roughly, as in `Measurements`.
        notes: Remarks about the file, such as that its end is missing.
        ahead: Time by which its clock is ahead of the poses' clock [s], which is found when several files are read
            together.
    """

    where: str
    kind: str
    topics: Mapping[str, Topic]
    sigma: Mapping[str, float] = field(default_factory=dict)
    framed: tuple[str, ...] = ()
    notes: Sequence[str] = ()
    ahead: float = 0.0


def plain(name: object) -> str:
    """Return a name of a file as a terminal shows it."""
    return printable(str(name), 120)


def check_rising(times: np.ndarray) -> None:
    """Raise InputError unless times (N,) increase."""
    falling = np.flatnonzero(~(np.diff(times) > 0))
    if falling.size:
        row = int(falling[0])
        raise InputError(
            f"times must increase from sample to sample, got {times[row]:.15g} s and then {times[row + 1]:.15g} s at "
            f"sample {row + 1}{'; cut the log where its clock was set back' if times[row + 1] < times[row] else ''}"
        )


class Field(NamedTuple):
    """A field of a recording, and its unit, of which `factor` are 1."""

    recording: Recording
    topic: Topic
    name: str
    unit: str
    factor: float = 1.0

    @property
    def full(self) -> str:
        """Return the name with its topic's name, as a message gives it."""
        return plain(self.topic.full(self.name))

    @property
    def label(self) -> str:
        """Return the name and the unit, as in a map."""
        return f"{self.full} [{'' if self.factor == 1 else f'{self.factor:g} '}{self.unit}]"


def in_units(one: Field, kind: str, stated: bool) -> Field:
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
