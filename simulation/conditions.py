"""`Conditions`: what flights are flown in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from ..control import Reference
from .faults import Fault
from .noise import Noise

__all__ = ["Conditions", "Wind"]


class Wind(Protocol):
    """A wind over time."""

    def __call__(self, times: np.ndarray, seed: int) -> np.ndarray:
        """Return the velocity of the air at the times, (K, 3) [m/s]."""
        ...


class Conditions(NamedTuple):
    """The conditions of flights.

    Attributes
    ----------
    period
        Of the controller [s].
    substeps
        Runge-Kutta steps in a period.
    references
        One for each period.
    wind
        Velocity of the air in {G} [m/s], a function of the times (K,) and a seed that returns (K, 3); None without
        air.
    disturbance
        Force [N] and moment about the CoM [N m] on the platform in {G}, (6,).
    noise
        Of the sensors.
    faults
        In the order of their times.
    """

    period: float
    substeps: int
    references: Sequence[Reference]
    wind: Wind | None
    disturbance: np.ndarray
    noise: Noise
    faults: tuple[Fault, ...]
