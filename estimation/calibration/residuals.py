"""State, residuals and derivatives of a calibration's `Model`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .balance import Balanced
from .sightings import Sighted


class State(NamedTuple):
    """Parameters and poses.

    Attributes:
        x: Parameters, (P,).
        shift, turn: Increments of the poses from their initial values, in {G}: (N, 3) [m], (N, 3, 3).
        errors: Errors of the tensions that stretch cables, in standard deviations, (N, d).
    """

    x: np.ndarray
    shift: np.ndarray
    turn: np.ndarray
    errors: np.ndarray

    def only(self, rows: np.ndarray | slice) -> State:
        """Return the state of some samples (k,)."""
        return State(self.x, *(one[rows] for one in self[1:]))


class Residuals(NamedTuple):
    """Differences over their standard deviations.

    Their shapes: readings (m, N), poses and errors of tensions (N, 6 + d), parameters (P,) and kept directions (d,),
    balance of forces (N, 6), directions (m, N, 3); the last two (N, 0), (m, N, 0) if they are no part of the fit.
    """

    readings: np.ndarray
    poses: np.ndarray
    parameters: np.ndarray
    balance: np.ndarray
    directions: np.ndarray

    @classmethod
    def together(cls, parts: Sequence[Residuals]) -> Residuals:
        """Return the residuals of successive parts of a log as one; those of the parameters are the same in all."""
        if len(parts) == 1:
            return parts[0]
        readings, poses, parameters, balance, directions = zip(*parts, strict=True)
        one, other = (np.concatenate(of, axis=1) for of in (readings, directions))
        return cls(one, np.concatenate(poses), parameters[0], np.concatenate(balance), other)

    @property
    def of_samples(self) -> np.ndarray:
        """Return the sum of squares of each sample, (N,), inf where a cable has no length."""
        total = (self.readings**2).sum(axis=0) + (self.directions**2).sum(axis=(0, 2))
        total += sum((part**2).sum(axis=1) for part in (self.poses, self.balance))
        return np.where(np.isfinite(total), total, np.inf)


class Derivatives(NamedTuple):
    """Derivatives of the residuals of readings, and balance and directions, where measured, with their own."""

    cables: np.ndarray  # derivatives by the parameters of the cable itself, (m, N, 15)
    others: np.ndarray  # derivatives by the parameters of the robot and slips that vary, (m, N, k)
    # derivatives by shift and rotation of the sample itself, and errors of its tensions, (m, N, 6 + d)
    poses: np.ndarray
    # R b of each cable (m, N, 3) [m], and its length (m, N) [m]
    arms: np.ndarray
    lengths: np.ndarray
    balance: Balanced | None = None
    directions: Sighted | None = None
    # derivatives of readings by all parameters, through the tensions by weight and inertia, (m, N, P)
    through: np.ndarray | None = None
