"""`OpenLoop`: the plan without feedback."""

import numpy as np
from typing_extensions import override

from ..base.inputs import InputError, required
from ..models.files import AnyRobot, as_robot
from ..models.robot import Robot
from .as_floats import as_floats, rows_of
from .controller import HOLD, PLANNED, Command, Controller, Reference, State


class OpenLoop(Controller):
    """Command the planned tensions, or the lowest ones, and the planned motion of the carriers: a baseline.

    Args:
        robot: A `Robot`, the name of one in the library, or the path of a robot file. Its carriers must not fly,
            because flying requires feedback.

    Raises:
        InputError: If the robot has flying carriers.
    """

    batches = True

    def __init__(self, robot: AnyRobot):
        self.robot = as_robot(robot)
        flying = [carrier.name for carrier in self.robot.carriers if carrier.actuators]
        if flying:
            raise InputError(
                f"robot must have no carriers that fly, got {self.robot.name!r} with carrier {flying[0]!r}"
            )

    @override
    def step(self, time: float, state: State, reference: Reference) -> Command:
        rows = rows_of(required("state", state, State))
        reference = as_floats(required("reference", reference, Reference), self.robot, rows)
        return planned_command(self.robot, reference, rows)


def planned_command(robot: Robot, reference: Reference, rows: int | None) -> Command:
    """Return planned tensions inside their limits, or the lowest, and motion of carriers, for a batch of `rows`."""
    lead, planned = () if rows is None else (rows,), reference.tensions
    known = planned is not None and bool(np.isfinite(planned).all())
    tensions = np.clip(robot.t_min if planned is None or not known else planned, robot.t_min, robot.t_max)
    follows = known and all(np.isfinite(part).all() for part in reference[3:6])
    answered = np.full(lead, PLANNED if follows else HOLD, dtype=np.int8)
    pose, velocity, acceleration = (np.broadcast_to(part, (*lead, *np.shape(part)[-2:])) for part in reference[3:6])
    return Command(np.broadcast_to(tensions, (*lead, robot.m)), pose, velocity, acceleration, answered)
