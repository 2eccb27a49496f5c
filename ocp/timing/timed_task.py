"""The tasks whose paths `time_along` can time: `check_task`."""

from ...base.errors import InputError
from ...models import Robot
from ..tasks.task import FreeBase, Task
from ..tasks.task_checks import check_margin
from ..tasks.wind_set import WindBox, WindDisc

SPEEDS = ("platform_speed", "zone_speed", "cable_speed", "carrier_speed")
ACCELERATIONS = ("platform_acceleration", "platform_lateral_acceleration", "cable_acceleration", "carrier_acceleration")
WITHOUT_POWER = (*SPEEDS, *ACCELERATIONS)
KNOWN_LIMITS = (*WITHOUT_POWER, "winch_power")


def check_task(robot: Robot, task: Task) -> None:
    """Refuse a task that does not fit the robot, or that requires more than a time law along its path.

    Raises `InputError` naming the field and what is accepted.
    """
    where = f"task {task.name!r}"
    if task.phases is not None:
        raise InputError(
            f"{where}: phases must be left out to time a path, got {len(task.phases)} phases; plan the task instead"
        )
    if isinstance(task.base, FreeBase):
        raise InputError(f"{where}: base.kind must be hold or given to time a path, got 'free'")
    if task.tube.radius or task.tube.turn:
        raise InputError(f"{where}: tube must be left out to time a path, which is then followed exactly")
    for name in type(task.limits).model_fields:
        if name not in (*KNOWN_LIMITS, "soft") and getattr(task.limits, name):
            raise InputError(
                f"{where}: limits.{name} must be left out to time a path; a time law keeps {', '.join(KNOWN_LIMITS)}"
            )
    if task.limits.soft:
        raise InputError(f"{where}: limits.soft must be left out to time a path, whose limits are all hard")
    for name in ("initial", "final", "robust", "stop_within"):
        if getattr(task, name) is not None:
            raise InputError(f"{where}: {name} must be left out to time a path; plan the task instead")
    if isinstance(task.wind, WindBox | WindDisc) or (task.wind is not None and any(task.wind)):
        raise InputError(f"{where}: wind must be [0, 0, 0], still air, or left out to time a path")
    if task.wind is not None and robot.platform.aero is None:
        raise InputError(f"{where}: wind must be left out, since robot {robot.name!r} has no platform.aero")
    check_margin(robot, task)


def can_be_timed(robot: Robot, task: Task) -> bool:
    """Return whether `time_along` accepts a task."""
    try:
        check_task(robot, task)
    except InputError:
        return False
    return True
