"""`Recorder`: whatever keeps what happens in flights, `Period` by `Period`."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from ..control import Command


class Period(NamedTuple):
    """A period of flights side by side, from its beginning on; the next one overwrites its arrays.

    Attributes
    ----------
    number
        From 0.
    alive
        Which flights survive it, (N,); the others are over.
    motions, lengths
        As `core.sense` writes them.
    tensions
        Their means over the period, (N, m) [N].
    command
        Of all flights; of a single one its arrays have no leading dimension.
    """

    number: int
    alive: np.ndarray
    motions: np.ndarray
    lengths: np.ndarray
    tensions: np.ndarray
    command: Command


class Recorder(Protocol):
    """A record of flights."""

    def take(self, period: Period) -> None:
        """Keep what a period has to be kept for."""
        ...
