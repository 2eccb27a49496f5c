"""`lay_out`: lay a task out for one robot, checked; `initial_of`: read a measured state.

A state is anything with the fields of `control.State`. That class belongs to a package on the same floor, which this
one may not import, and a state estimator of another kind works as well.
"""

from dataclasses import replace
from math import remainder
from typing import Any, Protocol

import numpy as np

from ...base.inputs import InputError, finite_array, shown
from ...models import Robot
from ...models.dynamics import dynamics_of
from ...models.parsing import validate
from ...models.part import COORDINATES
from ..limits.limits import Limits
from .ends import with_timing
from .initial import Initial
from .lay_out_phases import lay_out_phases
from .limit_list import limit_list
from .paths import AnyPath, RestPath
from .scenario import ATTITUDE, POSITION, Scenario
from .task import FreeBase, GivenBase, HoldBase, Task
from .task_checks import check_scenario, check_task

AGREES = 0.01  # [m, rad], of carriers that stay or move as given: sensors are no better
AGREES_SPEED = 0.1  # [m/s, rad/s]
FIELDS = ("pose", "velocity", "carrier_pose", "carrier_velocity", "tensions")
OF_LIMITS = {"limits", "margin", "base", "phases", "tube"}  # the fields of a task that its limits depend on


def carrier_paths(robot: Robot, task: Task) -> dict[int, AnyPath]:
    """Return the carriers' reference paths by the index of the carrier; the others stay at home.

    Raises `InputError` if a name is unknown or that of a carrier that never moves, or if a path is not given in
    {G}.
    """
    base = task.base
    if isinstance(base, HoldBase):
        paths: dict[str, AnyPath] = {name: RestPath(kind="rest", pose=pose) for name, pose in base.poses.items()}
        key = "poses"
    elif isinstance(base, GivenBase):
        paths, key = base.paths, "paths"
    else:
        paths, key = base.around, "around"
    field, names = f"task {task.name!r}: base.{key}", [carrier.name for carrier in robot.carriers]
    paths_by_index = {}
    for name, path in paths.items():
        if name not in names:
            raise InputError(f"{field} must name carriers of the robot ({', '.join(names)}), got {name!r}")
        carrier = robot.carriers[names.index(name)]
        if not carrier.moves:
            raise InputError(f"{field} must name carriers that move, got {name!r}, which is of kind {carrier.kind}")
        if path.frame != "world":
            raise InputError(f"{field}.{name}.frame must be world, got {path.frame!r}")
        paths_by_index[names.index(name)] = path
    return paths_by_index


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


def lay_out(
    robot: Robot, task: Task, initial: Initial | Measured | dict[str, Any] | None = None, limits: Limits | None = None
) -> Scenario:
    """Check that `task` fits `robot` and lay it out.

    `initial`: the state from which the motion starts, instead of the task's (`initial_of`). `limits`: limits of a
    task with the same `OF_LIMITS`, whose functions are built already.

    Raises `InputError` naming the field of the task that does not fit, its value and the accepted values.
    """
    check_task(robot, task)
    task = with_timing(robot, task)
    opened = [*POSITION] * (task.tube.radius > 0) + [*ATTITUDE] * (task.tube.turn > 0)
    scenario = Scenario(
        robot=robot,
        task=task,
        path=task.path,
        dynamics=dynamics_of(robot),
        relative=task.path.frame != "world",
        platform_free=[coordinate for coordinate in opened if robot.dof_mask[coordinate]],
        carrier_free=_free_carriers(robot, task.base, f"task {task.name!r}"),
        limits=limit_list(robot, task) if limits is None else limits,
        carrier_paths=carrier_paths(robot, task),
        duration=task.seconds,
    )
    if initial is not None:
        state = initial_of(scenario, initial)
        scenario = replace(scenario, task=task.model_copy(update={"initial": state}))
    check_scenario(scenario)
    return replace(scenario, phases=lay_out_phases(scenario))


def with_task(scenario: Scenario, **changes: Any) -> Scenario:
    """Return the scenario of a task with other values of some fields, laid out for the same robot."""
    limits = scenario.limits if OF_LIMITS.isdisjoint(changes) else None
    return lay_out(scenario.robot, scenario.task.model_copy(update=changes), limits=limits)


def _free_carriers(robot: Robot, base: HoldBase | GivenBase | FreeBase, where: str) -> list[tuple[int, int]]:
    """Return the (carrier, coordinate) pairs that the planner chooses."""
    if not isinstance(base, FreeBase):
        return []
    free = [
        (index, coordinate)
        for index, carrier in enumerate(robot.carriers)
        for coordinate in carrier.planned_coordinates(robot.drive, tilts=base.tilt_max > 0)
    ]
    if not any(carrier.moves for carrier in robot.carriers):
        raise InputError(
            f"{where}: base must be left out, got kind free: the carriers of robot {robot.name!r} are on the ground"
        )
    if not free:
        raise InputError(
            f"{where}: base.kind must be hold or given, got free: only winches move robot {robot.name!r}, its carriers "
            f"stay (drive: {robot.drive})"
        )
    return free
