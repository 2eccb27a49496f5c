"""`CarriedLoad`: the model of a robot with the load that its reference names."""

from typing import Any

import numpy as np

from ..base.inputs import required
from ..models.dynamics import dynamics_of
from ..models.record import record_of
from ..models.rigid_load import RigidLoad
from ..models.robot import Robot
from .as_floats import ROUNDING
from .late_states import OLDEST


class CarriedLoad:
    """The load on the platform of a robot, from a time on, and the model of both.

    States that were measured before this time belong to the earlier load, whose momentum and weight differ. So the
    observer of the platform pauses until a later state arrives, and continues from its estimate.
    """

    def __init__(self, robot: Robot):
        self._robot = robot
        self.reset()

    def reset(self) -> None:
        """Carry nothing."""
        self.load, self._of_both = None, self._robot
        self._begun = [(-np.inf, record_of(self._robot))]  # with its loads, as far back as states may be late

    def change(self, load: Any, time: float) -> np.ndarray:
        """Carry a load from a time on [s], and return the record of the robot with it.

        Raises `InputError` if it is neither a `RigidLoad` nor None.
        """
        if load is not None and required("reference.load", load, RigidLoad) == self.load:
            self.load = load  # the same numbers in another object
            return record_of(self._of_both)
        self.load, self._of_both = load, self._robot if load is None else load.on(self._robot)
        past, record = sum(ends < time - OLDEST for ends, _ in self._begun[1:]), record_of(self._of_both)
        self._begun = [*self._begun[past:], (time, record)]
        return record

    def record(self, load: RigidLoad | None) -> np.ndarray:
        """Return the record of the robot with any load."""
        if load is None or load is self.load:
            return record_of(self._robot if load is None else self._of_both)
        return record_of(load.on(self._robot))

    def records_between(self, start: float, end: float) -> list[tuple[np.ndarray, float]]:
        """Return the records of the robot between two times [s], each with its duration."""
        times = np.clip([*(begins for begins, _ in self._begun), np.inf], start, end)
        spans = zip(self._begun, np.diff(times).tolist(), strict=True)
        return [(record, lasting) for (_, record), lasting in spans if lasting > ROUNDING]

    def is_later(self, time: float) -> bool:
        """Return whether a state of this time [s] was measured with this load."""
        return time > self._begun[-1][0] + ROUNDING

    def continue_observer(self, platform: np.ndarray, motions: np.ndarray) -> None:
        """Keep the estimates of an observer, records (N,), for platforms with the momentum of motions (N, 12)."""
        known = np.isfinite(motions).all(axis=1)
        if known.any():
            dynamics, (pose, velocity) = dynamics_of(self._of_both), np.split(motions[known], 2, axis=1)
            weight = dynamics.required_wrench(pose, 0 * velocity, 0 * velocity)
            momentum = dynamics.required_wrench(pose, 0 * velocity, velocity) - weight
            bandwidth = np.maximum(platform["observer"][known], ROUNDING)[:, None]  # without one there is no estimate
            platform["explained"][known] = momentum - platform["disturbance"][known] / bandwidth
            platform["unseen"][known] = 0.0
