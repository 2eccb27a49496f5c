"""What happened in a simulation, in order of time: its events, and the first instants at which limits were exceeded."""

from typing import Any, NamedTuple

import numpy as np

from ..base.text import quantity
from .data import SimulationData


class Occurrence(NamedTuple):
    """An event, or the first excess of a limit, at a time [s].

    Its kind is "fault" (also of a stop, a push and any other event), "slack", "tension", "error" or "end".
    """

    at: float
    kind: str
    what: str

    def to_dict(self) -> dict[str, Any]:
        """Return it ready for JSON."""
        return {"at_s": self.at, "kind": self.kind, "what": self.what}


def occurrences(flight: SimulationData) -> list[Occurrence]:
    """Return the events of a run and the first instants at which limits were exceeded, in order of time."""
    found = [Occurrence(event.at, "fault", event.describe(flight.robot)) for event in flight.conditions.events]
    if flight.slack.any():
        row, cable = np.argwhere(flight.slack)[0]
        found.append(Occurrence(float(flight.times[row]), "slack", f"the first cable to slacken was {cable + 1}"))
    if (above := flight.above > 0).any():
        row, cable = np.argwhere(above)[0]
        found.append(
            Occurrence(float(flight.times[row]), "tension", f"cable {cable + 1} was the first above its t_max")
        )
    if (beyond := ~(flight.error <= flight.tolerance)).any():
        within = quantity(1e3 * flight.tolerance, "mm")
        found.append(Occurrence(float(flight.times[np.argmax(beyond)]), "error", f"the error exceeded {within}"))
    if flight.lasted < len(flight.references):
        found.append(Occurrence(flight.lasted * flight.period, "end", "the simulation diverged"))
    shown = [event for event in found if event.at <= max(flight.lasted, 1) * flight.period]
    return sorted(shown, key=lambda event: event.at)


def sentence(of: list[Occurrence]) -> str:
    """Return them in one sentence."""
    return "; ".join(f"{event.what} at {event.at:.4g} s" for event in of)
