"""`Periods`: a plant run one period after the other, in arrays of the caller's and without checks, for closed loops."""

from __future__ import annotations

import numpy as np

from . import layout
from .machine import run_rows
from .plant import Plant

__all__ = ["Periods"]


class Periods:
    """Run many flights of a plant side by side.

    Attributes
    ----------
    geometry
        Bodies, all of them free, and cables in the columns of `layout`, and the place of the CoM in the platform, (3,).
    """

    def __init__(self, plant: Plant, period: float, substeps: int):
        self._arrays, self._period, self._substeps = plant.arrays, period, substeps
        self._run = run_rows()
        bodies, cables, _ = plant.arrays
        bodies = bodies.copy()
        bodies[:, layout.MOTION] = layout.FREE
        self.geometry = (bodies, cables, np.array(plant.robot.platform.com))

    def lose(self, carrier: int) -> None:
        """Let the actuators of a carrier give nothing from the next period on, whatever they are commanded."""
        bodies, *rest = self._arrays
        bodies = bodies.copy()
        bodies[1 + carrier, layout.ACTUATORS :] = 0.0
        self._arrays = (bodies, *rest)

    def run(self, states: np.ndarray, commands: np.ndarray, history: np.ndarray, tensions: np.ndarray) -> None:
        """Write states and tensions at the beginning and at the end of a period.

        Parameters
        ----------
        states, commands
            (N, n) and (N, K, k), see `Plant`: the first command is that of the period; carriers move on to a second.
        history, tensions
            Results, (N, 2, n) and (N, 2, m) [N].
        """
        of = (states, commands, 1, self._period, self._substeps, 1)
        self._run(0, len(states), *self._arrays, *of, history, tensions)
