"""Events of a simulation in order of time: faults, and the first instants at which limits were exceeded."""

from typing import Any, NamedTuple

import numpy as np

from ..base.text import quantity
from .data import SimulationData


class Event(NamedTuple):
    """An event at a time [s].

    Its kind is "fault" (also of a stop), "slack", "tension", "error" or "end".
    """

    at: float
    kind: str
    what: str

    def to_dict(self) -> dict[str, Any]:
        """Return it ready for JSON."""
        return {"at_s": self.at, "kind": self.kind, "what": self.what}


def events(flight: SimulationData) -> list[Event]:
    """Return the faults of a run and the first instants at which limits were exceeded, in order of time."""
    found = [Event(fault.at, "fault", _words(fault, flight)) for fault in flight.conditions.faults]
    if flight.slack.any():
        row, cable = np.argwhere(flight.slack)[0]
        found.append(Event(float(flight.times[row]), "slack", f"the first cable to slacken was {cable + 1}"))
    if (above := flight.above > 0).any():
        row, cable = np.argwhere(above)[0]
        found.append(Event(float(flight.times[row]), "tension", f"cable {cable + 1} was the first above its t_max"))
    if (beyond := ~(flight.error <= flight.tolerance)).any():
        within = quantity(1e3 * flight.tolerance, "mm")
        found.append(Event(float(flight.times[np.argmax(beyond)]), "error", f"the error exceeded {within}"))
    if flight.lasted < len(flight.references):
        found.append(Event(flight.lasted * flight.period, "end", "the simulation diverged"))
    shown = [event for event in found if event.at <= max(flight.lasted, 1) * flight.period]
    return sorted(shown, key=lambda event: event.at)


def sentence(of: list[Event]) -> str:
    """Return events in one sentence."""
    return "; ".join(f"{event.what} at {event.at:.4g} s" for event in of)


def _words(fault: Any, flight: SimulationData) -> str:
    if fault.kind == "cut":
        return f"cable {fault.part + 1} was cut"
    if fault.kind == "stick":
        return f"the winch of cable {fault.part + 1} stuck"
    if fault.kind == "lose":
        return f"the actuators of {flight.robot.carriers[fault.part].name} were lost"
    if fault.kind == "stop":
        return "the reference began to stop"
    return f"the controller missed {quantity(fault.lasting, 's')}"
