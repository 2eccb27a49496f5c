"""`Fault`: something that breaks during a flight, from a line such as "cut 3 at 2.5"."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from ..base.errors import InputError
from ..base.inputs import shown
from ..models.robot import Robot

ACCEPTED = "'cut CABLE at SECONDS', 'stick CABLE at SECONDS', 'lose CARRIER at SECONDS' or 'miss DURATION at SECONDS'"
_FORM = re.compile(r"(cut|stick|lose|miss)\s+(\S+)\s+at\s+(\S+)")


class Fault(NamedTuple):
    """A fault.

    Attributes
    ----------
    kind
        "cut": a cable tears; "stick": its winch holds it at its length; "lose": the actuators of a carrier give nothing
        any more, such as the thrust of a quadrotor; "miss": the controller does not answer.
    at
        When it begins [s].
    part
        Index of the cable or, for "lose", of the carrier, from 0; -1 for "miss".
    lasting
        How long the controller does not answer [s].
    """

    kind: str
    at: float
    part: int = -1
    lasting: float = 0.0


def read_faults(robot: Robot, faults: Sequence[str], duration: float, name: str = "events") -> tuple[Fault, ...]:
    """Return faults, the earliest first.

    Parameters
    ----------
    robot
        The robot, whose cables count from 1 in `faults`, and whose carriers have names.
    faults
        Lines: "cut 3 at 2.5", "stick 2 at 1", "lose quad-1 at 2", "miss 0.05 at 1.2" (times in [s]).
    duration
        Of the flight [s]: faults begin before its end.
    name
        Of the argument, for errors.

    Raises
    ------
    InputError
        If a line has another form, there is no such cable or carrier, or the flight ends before.
    """
    if isinstance(faults, str) or not isinstance(faults, Sequence):
        raise InputError(f"{name} must be a list of texts, each {ACCEPTED}, got {shown(faults)}")
    read = [_read(robot, text, f"{name}[{number}]") for number, text in enumerate(faults)]
    for number, fault in enumerate(read):
        if fault.at >= duration:
            raise InputError(f"{name}[{number}] must begin before the end at {duration:g} s, got {fault.at:g} s")
    return tuple(sorted(read, key=lambda fault: fault.at))


def _read(robot: Robot, text: object, where: str) -> Fault:
    match = _FORM.fullmatch(text.strip()) if isinstance(text, str) else None
    if match is None:
        raise InputError(f"{where} must be {ACCEPTED}, got {shown(text)}")
    kind, what, when = match.groups()
    at = _seconds(where, when)
    if kind == "miss":
        return Fault(kind, at, lasting=_seconds(where, what))
    if kind == "lose":
        return Fault(kind, at, _with_actuators(robot, what, where))
    if not what.isdecimal() or not 1 <= int(what) <= robot.m:
        raise InputError(f"{where} must name a cable of {robot.name!r}, 1 to {robot.m}, got {shown(what)}")
    return Fault(kind, at, int(what) - 1)


def _with_actuators(robot: Robot, name: str, where: str) -> int:
    """Return the index of a carrier that has actuators to lose."""
    known = {carrier.name: index for index, carrier in enumerate(robot.carriers) if carrier.actuators}
    if name not in known:
        names = ", ".join(known) or "it has none"
        raise InputError(f"{where} must name a carrier of {robot.name!r} with actuators ({names}), got {shown(name)}")
    return known[name]


def _seconds(where: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 0 <= value <= 1e6:
        raise InputError(f"{where} must have times from 0 to 1e6 s, got {shown(text)}")
    return value
