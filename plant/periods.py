"""`Periods`: run a plant period by period, in arrays of the caller and without checks, for closed loops."""

import numpy as np

from ..core import run_plant
from ..models.record import record_of
from ..models.robot import Robot
from . import layout
from .plant import Plant


class Periods:
    """Run many simulations of a plant in parallel.

    `record` is the robot as the core reads it, which events change in place; `period` is the duration of one [s].
    """

    def __init__(self, plant: Plant, period: float, substeps: int):
        self.record, self._settings = plant.record.copy(), plant.settings
        self.period, self._substeps, self._m = period, substeps, plant.robot.m
        self._conditions = layout.BODY * (1 + len(plant.robot.carriers)) + layout.CONDITION * self._m

    def lose(self, carrier: int) -> None:
        """Disable the actuators of a carrier from the next period on."""
        self.record["body"]["actuator"][1 + carrier] = 0

    def carry(self, states: np.ndarray, robot: Robot) -> np.ndarray:
        """Take the platform's mass, CoM and inertia from a robot, and return states (N, n) of the same motion.

        States describe the CoM of the platform: where it is now, and how fast it moves there.
        """
        new, states = record_of(robot), states.copy()
        arm = new["com"] - self.record["com"]
        for name in ("mass", "com"):
            self.record[name] = new[name]
        for name in ("mass", "inverse_mass", "inertia", "inverse_inertia"):
            self.record["body"][name][0] = new["body"][name][0]
        w, axis = states[:, [layout.QUATERNION]], states[:, layout.QUATERNION + 1 : layout.VELOCITY]

        def turned(vectors: np.ndarray) -> np.ndarray:
            return vectors + 2 * np.cross(axis, np.cross(axis, vectors) + w * vectors)

        rate = states[:, layout.RATE : layout.BODY]
        states[:, layout.VELOCITY : layout.RATE] += turned(np.cross(rate, arm))
        states[:, : layout.QUATERNION] += turned(np.tile(arm, (len(states), 1)))
        return states

    def release(self, states: np.ndarray, which: np.ndarray) -> None:
        """Cut cables of states (N, n) in place: those that are true in `which`, (m,) or (N, m)."""
        conditions = states[:, self._conditions : self._conditions + self._m]
        conditions[np.broadcast_to(which, conditions.shape) != 0] = layout.CUT

    def run(
        self,
        states: np.ndarray,
        commands: np.ndarray,
        history: np.ndarray,
        tensions: np.ndarray,
        means: np.ndarray | None = None,
    ) -> None:
        """Write states and tensions at the beginning and at the end of a period, and the mean tensions in it.

        - `states`, `commands`: (N, n) and (N, K, k), see `Plant`: the first command belongs to the period; carriers
          move on to a second.
        - `history`, `tensions`: results, (N, 2, n) and (N, 2, m) [N].
        - `means`: results, (N, m) [N], with which the momentum of the bodies changes but for impacts.
        """
        of_rows = (states, commands, history, tensions, means)
        run_plant(self.record, self._settings, *of_rows, 1, self.period, self._substeps, 1)
