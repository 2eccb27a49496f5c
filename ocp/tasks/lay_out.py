"""`lay_out`: lay a task out for one robot, checked."""

from dataclasses import replace
from typing import Any

from ...base.errors import InputError
from ...models import Robot
from ...models.dynamics import dynamics_of
from ..limits.limits import Limits
from .carrier_paths import carrier_paths
from .ends import with_timing
from .initial import Initial
from .lay_out_phases import lay_out_phases
from .limit_list import limit_list
from .measured import Measured, initial_of
from .scenario import ATTITUDE, POSITION, Scenario
from .task import FreeBase, GivenBase, HoldBase, Task
from .task_checks import check_scenario, check_task

OF_LIMITS = {"limits", "margin", "base", "phases", "tube"}  # the fields of a task that its limits depend on


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
