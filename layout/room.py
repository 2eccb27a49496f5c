"""`Room`: what a layout keeps besides the margin: the distance between cables, and how long they may be."""

from typing import NamedTuple

import numpy as np

from ..base.text import quantity, quantity_range
from .requirements import Requirements

_SPARE = 1e-3  # of a length: how much stricter a search is


class Room(NamedTuple):
    """Bounds of distances and lengths."""

    clearance: float = 0.0  # smallest distance between two cables [m]; 0: no limit
    shortest: float = 0.0  # lengths of cables [m]
    longest: float = np.inf

    @property
    def limits_lengths(self) -> bool:
        """Return whether there are lengths that cables must not have."""
        return self.shortest > 0.0 or self.longest < np.inf

    def with_spare(self, share: float) -> "Room":
        """Return stricter bounds: a clearance that is larger by a share, and lengths a little inside."""
        return Room(self.clearance * (1.0 + share), self.shortest * (1.0 + _SPARE), self.longest * (1.0 - _SPARE))

    def describe(self) -> list[str]:
        """Return each bound as a text."""
        found = [f"clearance of {quantity(self.clearance, 'm')}"] * (self.clearance > 0.0)
        return found + [f"cables of {quantity_range((self.shortest, self.longest), 'm')}"] * self.limits_lengths


def room_of(requirements: Requirements) -> Room:
    """Return the room of a design."""
    lengths = requirements.cable_length
    return Room(requirements.clearance, *((0.0, np.inf) if lengths is None else (lengths.min, lengths.max)))
