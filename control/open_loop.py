"""`OpenLoop`: the plan as it is, whatever the sensors report."""

from __future__ import annotations

import os

import numpy as np
from typing_extensions import override

from ..base.errors import InputError
from ..base.inputs import required
from ..models.files import as_robot
from ..models.robot import Robot
from .as_floats import as_floats, rows_of
from .command import HOLD, PLANNED, Command
from .controller import Controller
from .reference import Reference
from .state import State


class OpenLoop(Controller):
    """Order the planned tensions and the planned motion of the carriers: what a controller has to be better than.

    Parameters
    ----------
    robot
        A `Robot`, the name of one in the library, or the path of a robot file. Its carriers must not fly: nothing
        stays in the air without sensors.

    Raises
    ------
    InputError
        If the robot has carriers with thrusts of their own.
    """

    batches = True

    def __init__(self, robot: Robot | str | os.PathLike[str]):
        self.robot = as_robot(robot)
        flying = [carrier.name for carrier in self.robot.carriers if carrier.actuators]
        if flying:
            raise InputError(
                f"robot must have no carriers that fly, got {self.robot.name!r} with carrier {flying[0]!r}"
            )

    @override
    def step(self, time: float, state: State, reference: Reference) -> Command:
        """Return the planned tensions, or the lowest where none are planned, and the planned motion of the carriers.

        Parameters
        ----------
        time, state
            Do not matter, but for the leading dimension of the state.
        reference
            The plan at this time.

        Raises
        ------
        InputError
            If state or reference are none, or an array of theirs does not have the shape of the robot's.
        """
        rows = rows_of(required("state", state, State))
        reference = as_floats(required("reference", reference, Reference), self.robot, rows)
        lead, planned = () if rows is None else (rows,), reference.tensions
        known = planned is not None and bool(np.isfinite(planned).all())
        tensions = self.robot.t_min if planned is None or not known else planned
        carriers = (reference.carrier_pose, reference.carrier_velocity, reference.carrier_acceleration)
        answered = np.full(lead, PLANNED if known else HOLD, dtype=np.int8)
        given = np.broadcast_to(np.clip(tensions, self.robot.t_min, self.robot.t_max), (*lead, self.robot.m))
        pose, velocity, acceleration = (np.broadcast_to(part, (*lead, *np.shape(part)[-2:])) for part in carriers)
        return Command(given, pose, velocity, acceleration, answered)
