"""`Periods`: run a plant period by period, in arrays of the caller and without checks, for closed loops."""

import numpy as np

from ..core import run_plant
from . import layout
from .plant import Plant


class Periods:
    """Run many simulations of a plant in parallel."""

    def __init__(self, plant: Plant, period: float, substeps: int):
        self._record, self._settings = plant.record, plant.settings
        self._period, self._substeps, self._m = period, substeps, plant.robot.m
        self._conditions = layout.BODY * (1 + len(plant.robot.carriers)) + layout.CONDITION * self._m

    def lose(self, carrier: int) -> None:
        """Disable the actuators of a carrier from the next period on."""
        self._record = self._record.copy()
        self._record["body"]["actuator"][1 + carrier] = 0

    def release(self, states: np.ndarray, which: np.ndarray) -> None:
        """Cut cables of states (N, n) in place: those that are true in `which`, (m,) or (N, m)."""
        conditions = states[:, self._conditions : self._conditions + self._m]
        conditions[np.broadcast_to(which, conditions.shape) != 0] = layout.CUT

    def run(self, states: np.ndarray, commands: np.ndarray, history: np.ndarray, tensions: np.ndarray) -> None:
        """Write states and tensions at the beginning and at the end of a period.

        - `states`, `commands`: (N, n) and (N, K, k), see `Plant`: the first command is that of the period; carriers
          move on to a second.
        - `history`, `tensions`: results, (N, 2, n) and (N, 2, m) [N].
        """
        of_rows = (states, commands, history, tensions)
        run_plant(self._record, self._settings, *of_rows, 1, self._period, self._substeps, 1)
