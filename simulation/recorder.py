"""`Recorder`: the interface of objects that record runs, `Period` by `Period`."""

from typing import NamedTuple, Protocol

import numpy as np

from ..control import Command


class Period(NamedTuple):
    """A period of parallel runs, from its beginning on. The next one overwrites its arrays.

    Attributes
    ----------
    number
        Number of the period, from 0.
    alive
        Runs that have not diverged at its end, (N,).
    motions, lengths
        As `core.sense` writes them.
    tensions
        Mean tensions over the period, (N, m) [N].
    command
        Command of all runs; for a single run its arrays have no leading dimension.
    """

    number: int
    alive: np.ndarray
    motions: np.ndarray
    lengths: np.ndarray
    tensions: np.ndarray
    command: Command


class Recorder(Protocol):
    """A record of runs."""

    def take(self, period: Period) -> None:
        """Record a period."""
        ...
