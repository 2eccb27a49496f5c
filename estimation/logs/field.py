"""`Field`: a field of a recording, and its unit."""

from contextlib import suppress
from typing import NamedTuple

import numpy as np

from ...base.errors import InputError
from .names import UNITS, unit_of
from .recording import Recording, Topic, plain

AXES = {"position": ("x", "y", "z"), "quaternion": ("x", "y", "z", "w"), "angles": ("roll", "pitch", "yaw")}
AXES["thrust_vectors"] = AXES["position"]
MOST_LISTED = 12


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
