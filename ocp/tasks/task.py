"""What a planner is asked: a path for the platform, what the carriers may do, a margin, and what is cheap."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from ...errors import InputError
from ...models.parsing import read_yaml, validate
from ...models.robot import Name, NonNegative, Part, Pose, Positive, Vector3
from .path import AnyPath
from .scheme import SchemeName
from .task_limits import TaskLimits
from .wind_set import WindBox

FREE_TURN = 1.2  # [rad], from the path's angles, short of where Euler angles lose their meaning


class Tube(Part):
    """How far the platform may leave its path, and whether it may at the ends."""

    position: NonNegative | Literal["free"] = Field(
        default=0.0, description="radius about the path [m]; 0: follow it exactly; free: the path is only a first guess"
    )
    attitude: NonNegative | Literal["free"] = Field(
        default=0.0, description="each of roll, pitch, yaw [rad]; 0: follow them exactly; free: up to 1.2 rad"
    )
    ends: Literal["free", "exact"] = Field(
        default="free", description="exact: no deviation and no deviating speed at start and end"
    )
    waypoints: Literal["free", "exact"] = Field(
        default="free", description="exact: no deviation at the points of a path of kind waypoints either"
    )

    @property
    def radius(self) -> float:
        """Of the tube about the path [m]; infinite if the position is free."""
        return np.inf if self.position == "free" else self.position

    @property
    def turn(self) -> float:
        """How far each angle may leave the path's [rad]."""
        return FREE_TURN if self.attitude == "free" else self.attitude


class DurationRange(Part):
    """A duration that the planner chooses."""

    min: Positive = Field(description="[s]")
    max: Positive = Field(description="[s]")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.min > self.max:
            raise ValueError(f"min: {self.min:g} s is more than max: {self.max:g} s; accepted: min <= max")
        return self


class HoldBase(Part):
    """Carriers stay where they are."""

    kind: Literal["hold"]
    poses: dict[Name, Pose] = Field(default={}, description="where, by carrier, in {G} [m, rad]; others at home")


class GivenBase(Part):
    """Carriers move as given: their motion is a disturbance."""

    kind: Literal["given"]
    paths: dict[Name, AnyPath] = Field(min_length=1, description="by carrier, in {G}; others stay at home")


class FreeBase(Part):
    """Carriers move as the planner likes, inside these limits and those of the robot's file."""

    kind: Literal["free"]
    around: dict[Name, AnyPath] = Field(
        default={}, description="a motion that costs no offset, by carrier, in {G}; others: resting at home"
    )
    acceleration_max: Positive | None = Field(default=None, description="[m/s^2]")
    speed_max: Positive | None = Field(default=None, description="[m/s]")
    tilt_max: float = Field(
        default=0.0,
        ge=0,
        lt=1.5,
        description="largest angle to the vertical [rad]; 0: prescribed carriers keep their attitude, quadrotors have "
        "the limit of the robot's file",
    )
    turn_acceleration_max: Positive | None = Field(default=None, description="[rad/s^2], each Euler angle")
    ends: Literal["free", "rest", "periodic", "exact"] = Field(
        default="free",
        description="free: start and end wherever it suits; rest: at zero speed; periodic: end as they started; "
        "exact: as `around` says",
    )


AnyBase = Annotated[HoldBase | GivenBase | FreeBase, Field(discriminator="kind")]


class Objective(Part):
    """What costs: each number is the amount that costs as much as one of the others does (Bryson's rule).

    The cost is the mean over time of sum |quantity / number|^2. A term has a part only where its quantity is free to
    choose.
    """

    tension: Positive | None = Field(default=None, description="tension of each cable [N]; null: the platform's weight")
    deviation: Positive | None = Field(
        default=None, description="platform off its path [m], angles times `Robot.length`; null: a tenth of the tube"
    )
    carrier_acceleration: Positive = Field(default=1.0, description="[m/s^2, rad/s^2]")
    carrier_offset: Positive = Field(default=10.0, description="carrier away from `around` or home [m, rad]")
    jerk: Positive = Field(default=10.0, description="of every free coordinate [m/s^3, rad/s^3]; keeps motions smooth")
    tension_rate: Positive | None = Field(default=None, description="of each tension [N/s]; null: costs nothing")
    time: Positive | None = Field(default=None, description="duration that costs one, itself not squared [s]")
    margin: Positive | None = Field(
        default=None,
        description="smallest distance of any tension from its limits that earns one, itself not squared [N]",
    )


class Task(Part):
    """A planning task. In a file: YAML with these keys."""

    name: Name = "task"
    path: AnyPath = Field(description="what the platform follows")
    duration: Positive | DurationRange | None = Field(
        default=None, description="[s], or a range for the planner to choose from; none: the path's own"
    )
    base: AnyBase = Field(default=HoldBase(kind="hold"), description="what the carriers do: hold, given or free")
    tube: Tube = Tube()
    margin: NonNegative = Field(default=0.0, description="every tension stays this far inside its limits [N]")
    wind: Vector3 | WindBox | None = Field(
        default=None,
        description="on the platform, constant, in {G} [m/s]; a box {min, max}: one motion for which tensions exist in "
        "each of its winds, the planned ones being those of its middle; none: no air",
    )
    limits: TaskLimits = TaskLimits()
    steps: int = Field(default=100, ge=4, le=20_000, description="intervals of the transcription")
    scheme: SchemeName = Field(
        default="linear",
        description="how the acceleration runs in an interval: constant; linear; hermite and gauss: quadratic, with "
        "more balances A t = w; spline: a cubic B-spline, smooth",
    )
    solver: Literal["ipopt", "fatrop"] = Field(
        default="ipopt", description="of the nonlinear program; fatrop takes tasks without periodic ends"
    )
    objective: Objective = Objective()
    time_limit: Positive = Field(
        default=600.0,
        description="of all runs of the solver together [s]; then the best motion so far is taken. fatrop cannot be "
        "stopped in a run, only between its runs",
    )
    output_rate: Positive = Field(
        default=100.0, description="samples of the saved trajectory, each of them audited [1/s]"
    )

    @property
    def seconds(self) -> float:
        """How long the motion lasts [s]; of a range its geometric mean, where the planner starts.

        Raises
        ------
        InputError
            If neither the task nor its path says so.
        """
        if isinstance(self.duration, DurationRange):
            return float(np.sqrt(self.duration.min * self.duration.max))
        seconds = self.duration if self.duration is not None else self.path.natural_duration
        if seconds is None:
            raise InputError(f"task {self.name!r}: duration: is missing; accepted: a number > 0 [s]")
        return seconds


def read_task(task: Task | dict[str, Any] | str | os.PathLike[str]) -> Task:
    """A `Task` from itself, from a mapping or from a YAML file.

    Raises
    ------
    InputError
        In one line that names the field and the value.
    """
    if isinstance(task, Task):
        return task
    if isinstance(task, dict):
        return validate(task, Task, "task")
    try:
        path = Path(task)
    except TypeError:
        raise InputError(f"task: {task!r}; accepted: a Task, a mapping or the path of a YAML file") from None
    return read_yaml(path, Task)
