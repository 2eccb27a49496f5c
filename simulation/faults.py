"""`Fault`: a fault or a stop during a simulation, from a string such as "cut 3 at 2.5"."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from ..base.errors import InputError
from ..base.inputs import shown
from ..models.robot import Robot

ACCEPTED = (
    "'cut CABLE at SECONDS', 'stick CABLE at SECONDS', 'lose CARRIER at SECONDS', 'miss DURATION at SECONDS' or "
    "'stop at SECONDS'"
)
_FORM = re.compile(r"(?:(cut|stick|lose|miss)\s+(\S+)|(stop))\s+at\s+(\S+)")


class Fault(NamedTuple):
    """A fault.

    Attributes
    ----------
    kind
        "cut": a cable breaks; "stick": its winch holds its length; "lose": the actuators of a carrier stop, such as the
        thrust of a quadrotor; "miss": the controller does not respond; "stop": the reference stops.
    at
        Time at which it begins [s].
    part
        Index of the cable or, for "lose", of the carrier, from 0; -1 for "miss" and "stop".
    lasting
        Time during which the controller does not respond [s].
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
        The robot. In `faults` its cables count from 1, and its carriers are named.
    faults
        Strings: "cut 3 at 2.5", "stick 2 at 1", "lose quad-1 at 2", "miss 0.05 at 1.2", "stop at 3" (times in
        [s]).
    duration
        Simulated time [s]; faults must begin before its end.
    name
        Name of the argument, for errors.

    Raises `InputError` if a string has another form, there is no such cable or carrier, or the simulation ends
    earlier.
    """
    if isinstance(faults, str) or not isinstance(faults, Sequence):
        raise InputError(f"{name} must be a list of strings, each {ACCEPTED}, got {shown(faults)}")
    read = [_read(robot, text, f"{name}[{number}]") for number, text in enumerate(faults)]
    for number, fault in enumerate(read):
        if fault.at >= duration:
            raise InputError(f"{name}[{number}] must begin before the end at {duration:g} s, got {fault.at:g} s")
    return tuple(sorted(read, key=lambda fault: fault.at))


def _read(robot: Robot, text: object, where: str) -> Fault:
    match = _FORM.fullmatch(text.strip()) if isinstance(text, str) else None
    if match is None:
        raise InputError(f"{where} must be {ACCEPTED}, got {shown(text)}")
    kind, what, stops, when = match.groups()
    at = _seconds(where, when)
    if stops:
        return Fault(stops, at)
    if kind == "miss":
        return Fault(kind, at, lasting=_seconds(where, what))
    if kind == "lose":
        return Fault(kind, at, _with_actuators(robot, what, where))
    if not what.isdecimal() or not 1 <= int(what) <= robot.m:
        raise InputError(f"{where} must name a cable of {robot.name!r}, 1 to {robot.m}, got {shown(what)}")
    return Fault(kind, at, int(what) - 1)


def _with_actuators(robot: Robot, name: str, where: str) -> int:
    """Return the index of a carrier with actuators."""
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
