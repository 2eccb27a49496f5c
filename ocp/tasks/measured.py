"""Read a measured state: `initial_of`.

A state is anything with the fields of `control.State`. That class belongs to a package on the same floor, which this
one may not import, and a state estimator of another kind works as well.
"""

from math import remainder
from typing import Any, Protocol

import numpy as np

from ...base.errors import InputError
from ...base.inputs import finite_array, shown
from ...models.parsing import validate
from ...models.part import COORDINATES
from .initial import Initial
from .scenario import ATTITUDE, Scenario

AGREES = 0.01  # [m, rad], of carriers that stay or move as given: sensors are no better
AGREES_SPEED = 0.1  # [m/s, rad/s]
FIELDS = ("pose", "velocity", "carrier_pose", "carrier_velocity", "tensions")


class Measured(Protocol):
    """A measured state: the fields of `control.State`."""

    @property
    def pose(self) -> Any:
        """Return the pose of the platform, (6,) [m, rad]."""

    @property
    def velocity(self) -> Any:
        """Return its time derivative, (6,) [m/s, rad/s]."""

    @property
    def carrier_pose(self) -> Any:
        """Return the pose of each carrier, (c, 6) [m, rad]."""

    @property
    def carrier_velocity(self) -> Any:
        """Return their time derivatives, (c, 6) [m/s, rad/s]."""

    @property
    def tensions(self) -> Any:
        """Return the tensions, (m,) [N]; None if they are not measured."""


def initial_of(
    scenario: Scenario, state: Initial | Measured | dict[str, Any], time: float = 0.0, name: str = "initial"
) -> Initial:
    """Return the state, of this `name`, from which a motion starts at `time` [s] of a scenario.

    Of what the planner does not choose a measured state has to agree within the errors of sensors, and is replaced by
    what the task gives: coordinates of carriers, and of the platform those that are none of its degrees of freedom.

    Raises `InputError` naming the field, if the state is none or does not fit the robot.
    """
    if isinstance(state, Initial):
        return state
    if isinstance(state, dict):
        return validate(state, Initial, name)
    if not all(hasattr(state, field) for field in FIELDS):
        raise InputError(f"{name} must be an Initial, a State or a mapping with its keys, got {shown(state)}")
    robot = scenario.robot
    c, m = len(robot.carriers), robot.m
    platform = np.stack([finite_array(f"{name}.{field}", getattr(state, field), (6,)) for field in FIELDS[:2]])
    carriers = np.stack(
        [finite_array(f"{name}.{field}", getattr(state, field), (c, 6)) for field in FIELDS[2:4]], axis=1
    )
    tensions = None if state.tensions is None else finite_array(f"{name}.tensions", state.tensions, (m,))
    reference, bases = scenario.references(np.array([time]))
    chosen = scenario.owners()
    for i in np.flatnonzero(robot.dof_mask == 0):
        _agree(platform[:, i], np.array([part[0, i] for part in reference[:2]]), "platform", int(i))
    for index, carrier in enumerate(robot.carriers):
        for i in range(6):
            if (index, i) not in chosen:
                _agree(carriers[index, :, i], np.array([part[0, i] for part in bases[index][:2]]), carrier.name, i)
    values = {"pose": platform[0], "velocity": platform[1]}
    values |= {"carrier_pose": carriers[:, 0], "carrier_velocity": carriers[:, 1]}
    values |= {} if tensions is None else {"tensions": tensions}
    return Initial.model_validate({name: value.tolist() for name, value in values.items()})


def _agree(measured: np.ndarray, given: np.ndarray, name: str, coordinate: int) -> None:
    """Replace a measured coordinate and its rate, (2,), by what the task gives, if they agree."""
    off = measured - given
    if coordinate in ATTITUDE:
        off[0] = remainder(off[0], 2 * np.pi)
    for far, limit, what, value, where in zip(
        off, (AGREES, AGREES_SPEED), ("", "speed of "), measured, given, strict=True
    ):
        if abs(far) > limit:
            raise InputError(
                f"initial: {what}{COORDINATES[coordinate]} of the {name} must be within {limit:g} of {where:g}, which "
                f"the task prescribes, got {value:g}"
            )
    measured[:] = given
