"""`Fault`: something that breaks during a flight, from a line such as "cut 3 at 2.5"."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from ..errors import InputError
from ..inputs import shown
from ..models.robot import Robot

__all__ = ["Fault", "read_faults"]

ACCEPTED = "'cut CABLE at SECONDS', 'stick CABLE at SECONDS' or 'miss DURATION at SECONDS'"
_FORM = re.compile(r"(cut|stick|miss)\s+(\S+)\s+at\s+(\S+)")


class Fault(NamedTuple):
    """A fault.

    Attributes
    ----------
    kind
        "cut": a cable tears; "stick": its winch holds it at its length; "miss": the controller does not answer.
    at
        When it begins [s].
    cable
        The index of the cable, from 0; -1 for "miss".
    lasting
        How long the controller does not answer [s].
    """

    kind: str
    at: float
    cable: int = -1
    lasting: float = 0.0


def read_faults(robot: Robot, faults: Sequence[str]) -> tuple[Fault, ...]:
    """Return faults, the earliest first.

    Parameters
    ----------
    robot
        The robot, whose cables count from 1 in `faults`.
    faults
        Lines: "cut 3 at 2.5", "stick 2 at 1", "miss 0.05 at 1.2" (times in [s]).

    Raises
    ------
    InputError
        If a line has another form, or there is no such cable.
    """
    if isinstance(faults, str) or not isinstance(faults, Sequence):
        raise InputError(f"faults must be a list of texts, each {ACCEPTED}, got {shown(faults)}")
    return tuple(sorted((_read(robot, text, number) for number, text in enumerate(faults)), key=lambda fault: fault.at))


def _read(robot: Robot, text: object, number: int) -> Fault:
    where = f"faults[{number}]"
    match = _FORM.fullmatch(text.strip()) if isinstance(text, str) else None
    if match is None:
        raise InputError(f"{where} must be {ACCEPTED}, got {shown(text)}")
    kind, what, when = match.groups()
    at = _seconds(where, when)
    if kind == "miss":
        return Fault(kind, at, lasting=_seconds(where, what))
    if not what.isdecimal() or not 1 <= int(what) <= robot.m:
        raise InputError(f"{where} must name a cable of {robot.name!r}, 1 to {robot.m}, got {shown(what)}")
    return Fault(kind, at, cable=int(what) - 1)


def _seconds(where: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 0 <= value <= 1e6:
        raise InputError(f"{where} must have times from 0 to 1e6 s, got {shown(text)}")
    return value
