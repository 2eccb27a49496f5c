"""`Task`: the path of the platform, the motion of the carriers, limits, and the objective."""

from __future__ import annotations

import os
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Literal, Self, cast

import numpy as np
from pydantic import ConfigDict, Field, field_validator, model_validator
from pydantic.json_schema import SkipJsonSchema
from typing_extensions import override

from ...base.inputs import InputError, file_path, number
from ...models.parsing import read_yaml, save_yaml, validate
from ...models.part import (
    Name,
    NonNegative,
    Part,
    Pose,
    Positive,
    PositiveRange,
    Share,
    Title,
    Vector3,
    Whole,
    optional,
)
from ..costs.cost import Cost
from .initial import Final, Initial
from .paths import AnyPath
from .phase import Phase, path_of
from .scheme import SchemeName
from .task_limits import TaskLimits
from .wind_set import WindBox, WindDisc

FREE_TURN = 1.2  # [rad], from the path's angles, short of where Euler angles lose their meaning


class Tube(Part):
    """The permitted distance of the platform from its path."""

    position: NonNegative | Literal["free"] = optional(
        "radius about the path [m]; 0: followed exactly; free: the path is only an initial guess", 0.0
    )
    attitude: NonNegative | Literal["free"] = optional(
        "largest deviation of each of roll, pitch, yaw from the path [rad]; 0: followed exactly; free: 1.2 rad", 0.0
    )
    ends: Literal["free", "rest", "periodic", "exact"] | None = optional(
        "state at the start and the end. free: anywhere in the tube; periodic: the end state equals the start state, "
        "without a stop, for a path that ends where it starts; rest: position on the path, zero velocity and "
        "acceleration (free angular acceleration if the robot has fewer cables than degrees of freedom, or cables of "
        "fixed length); exact: position and velocity of the path, free acceleration; default: rest if the path starts "
        "and ends at rest but is not of kind rest, and the base is not of kind given; otherwise free"
    )
    waypoints: Literal["free", "exact"] = optional(
        "exact: the platform passes through the points of a path of kind waypoints, even if the path rounds them",
        "free",
    )

    @property
    def radius(self) -> float:
        """Return the radius of the tube about the path [m]; infinite if the position is free."""
        return np.inf if self.position == "free" else self.position

    @property
    def turn(self) -> float:
        """Return the largest deviation of each angle from the path [rad]."""
        return FREE_TURN if self.attitude == "free" else self.attitude


class HoldBase(Part):
    """Carriers that hold their positions."""

    kind: Literal["hold"]
    poses: dict[Name, Pose] = optional("pose of each carrier by its name, in {G} [m, rad]; all others stay at home", {})


class GivenBase(Part):
    """Carriers that follow given paths: their motion is a disturbance."""

    kind: Literal["given"]
    paths: dict[Name, AnyPath] = Field(
        min_length=1, description="path of each carrier by its name, in {G}; all others stay at home"
    )


class FreeBase(Part):
    """Carriers whose motion the planner chooses, inside these limits and the limits of the robot's file."""

    kind: Literal["free"]
    around: dict[Name, AnyPath] = optional(
        "reference motion of each carrier by its name, in {G}; default: rest at home", {}
    )
    acceleration_max: Positive | None = optional("largest acceleration [m/s^2]")
    speed_max: Positive | None = optional("largest speed [m/s]")
    tilt_max: float = optional(
        "largest angle to the vertical [rad]; 0: prescribed carriers keep their attitude, and quadrotors have "
        "the limit of the robot file",
        0.0,
        ge=0,
        lt=1.5,
    )
    turn_acceleration_max: Positive | None = optional("largest second derivative of each Euler angle [rad/s^2]")
    ends: Literal["free", "rest", "periodic", "exact"] | None = optional(
        "state at the start and the end. free: any state; rest: zero velocity, and zero linear acceleration (free "
        "if the robot has fewer cables than degrees of freedom, or cables of fixed length); periodic: the end state "
        "equals the start state; exact: the states of the paths `around`; default: as `tube.ends` if that is rest or "
        "periodic, otherwise free"
    )


AnyBase = Annotated[HoldBase | GivenBase | FreeBase, Field(discriminator="kind")]


class Objective(Part):
    """Scales of the cost terms: each number is the amount of its quantity that adds 1 (Bryson's rule).

    The cost is the mean over time of sum |quantity / number|^2, so a larger number makes a term less important. A term
    applies only if its quantity is free.
    """

    model_config = ConfigDict(arbitrary_types_allowed=True)

    tension: Positive | None = optional("tension of each cable [N]; default: the platform's weight")
    deviation: Positive | None = optional(
        "distance from the path [m], angles times `Robot.length`; default: a tenth of the tube"
    )
    carrier_acceleration: Positive = optional("acceleration of carriers [m/s^2, rad/s^2]", 1.0)
    carrier_offset: Positive = optional("distance of carriers from `around` or home [m, rad]", 10.0)
    formation: Positive | None = optional(
        "distance of carriers from their formation at home, which moves and yaws with the platform [m]; default: the "
        "mean length of the cables if several carriers are free without `around`, otherwise no cost"
    )
    jerk: Positive = optional("jerk of every free coordinate [m/s^3, rad/s^3]; keeps motions smooth", 10.0)
    tension_rate: Positive | None = optional("rate of each tension [N/s]; default: no cost")
    time: Positive | None = optional("duration that adds 1 to the cost, not squared [s]; default: no cost")
    margin: Positive | None = optional("tension margin that lowers the cost by 1, not squared [N]; default: no reward")
    own: SkipJsonSchema[tuple[Cost, ...]] = Field(
        default=(), exclude=True, description="costs of your own, in Python alone (docs/adding-a-cost.md)"
    )

    @field_validator("own")
    @classmethod
    def _own_have_amounts(cls, own: tuple[Cost, ...]) -> tuple[Cost, ...]:
        for cost in own:
            number(f"amount of cost {cost.name!r}", cost.amount, 1e-9, 1e9)
        return own


def _or_phases(schema: dict[str, Any]) -> None:
    """Require one of path and phases."""
    schema["oneOf"] = [{"required": ["path"]}, {"required": ["phases"]}]
    del schema["properties"]["path"]["default"]


class Task(Part):
    """A planning task. A task file is YAML with these keys."""

    model_config = ConfigDict(json_schema_extra=_or_phases)

    name: Title = optional("name of the task, for reports and file names", "task")
    path: AnyPath = optional("path of the platform; with phases: the sequence of their paths", cast(Any, None))
    phases: tuple[Phase, ...] | None = optional(
        "instead of path and duration: parts of the motion, with their loads", min_length=1
    )
    duration: Positive | PositiveRange | None = optional(
        "duration [s], or a range from which the planner chooses; default: the path's own"
    )
    base: AnyBase = optional(
        "motion of the carriers: hold (stay), given (follow paths) or free (the planner chooses)", HoldBase(kind="hold")
    )
    tube: Tube = Tube()
    initial: Initial | None = optional(
        "measured initial state of a moving robot; default: as `tube.ends` and `base.ends` require"
    )
    final: Final | None = optional("state in which the motion ends; default: as `tube.ends` and `base.ends` require")
    margin: NonNegative = optional("smallest distance of every tension from its limits [N]", 0.0)
    robust: Share | None = optional(
        "fraction, such as 0.95: all tensions must keep the margin from their limits for this fraction of all robots "
        "within the `uncertainty` of the robot file, to first order; default: only for the nominal robot"
    )
    stop_within: Positive | None = optional(
        "time within which the robot must be able to stop on its path from every instant of the plan, inside the "
        "tension limits [s]; checked every 0.02 s, or at 200 instants if the plan takes more than 4 s; default: not "
        "checked"
    )
    wind: Vector3 | WindBox | WindDisc | None = optional(
        "wind on the platform in {G} [m/s]: one velocity; a range {min, max}; or {speed}, every horizontal wind up to "
        "a speed. In a range, tensions exist for every wind, and the planned tensions are for the middle of the "
        "range (for {speed}: still air). [0, 0, 0] is still air, with drag on a moving platform; default: no "
        "aerodynamic forces"
    )
    limits: TaskLimits = TaskLimits()
    steps: Whole = optional("number of intervals between the nodes of the planner", 100, ge=4, le=20_000)
    scheme: SchemeName | None = optional(
        "acceleration within an interval: linear; hermite: quadratic, and tensions give the required wrench halfway "
        "too; spline: a smooth cubic B-spline; default: linear, or hermite if the audit of a linear plan reports that "
        "carriers cannot follow the motion between the nodes"
    )
    objective: Objective = Objective()
    time_limit: Positive = optional(
        "time for the whole search [s]. When it is over, the operation in progress is finished, and the best motion so "
        "far is audited and returned",
        600.0,
    )
    output_rate: Positive = optional("samples per second of the saved trajectory, all of them audited [1/s]", 100.0)

    @model_validator(mode="before")
    @classmethod
    def _without_solver(cls, data: Any) -> Any:
        """Accept `solver: ipopt`, which files of earlier versions have: there was another one."""
        if isinstance(data, Mapping) and data.get("solver") == "ipopt":
            return {key: value for key, value in data.items() if key != "solver"}
        return data

    @model_validator(mode="after")
    def _one_path(self) -> Self:
        given: AnyPath | None = self.path
        if self.phases is None:
            if given is None:
                raise ValueError("path is missing: path of the platform (or phases)")
            return self
        for key in ("path", "duration"):
            if key in self.model_fields_set and getattr(self, key) is not None:
                raise ValueError(f"{key} must be left out with phases, which have their own")
        object.__setattr__(self, "path", path_of(self.phases))
        return self

    @override
    def model_copy(self, **options: Any) -> Self:
        """Return a copy, with `options` of pydantic; with phases, its `path` is the sequence of their paths."""
        copy = super().model_copy(**options)
        if copy.phases is not None:
            object.__setattr__(copy, "path", path_of(copy.phases))
        return copy

    @override
    def model_dump(self, **options: Any) -> dict[str, Any]:
        """Return the fields, by `options` of pydantic; without `path` if that follows from `phases`.

        Raises:
            InputError: In mode "json", as for a file, if the task has limits or costs defined in Python.
        """
        for key, own in (("limits", self.limits.own), ("objective", self.objective.own)):
            if own and options.get("mode") == "json":
                names = ", ".join(repr(each.name) for each in own)
                must = f"{key}.own must be empty to be saved, since a file holds no Python"
                raise InputError(f"task {self.name!r}: {must}, got {names}")
        fields = super().model_dump(**options)
        if self.phases is not None:
            fields.pop("path", None)
        return fields

    def in_file(self) -> Task:
        """Return the task without the limits and costs that are defined in Python."""
        if not (self.limits.own or self.objective.own):
            return self
        objective = self.objective.model_copy(update={"own": ()})
        return self.model_copy(update={"limits": self.limits.without_own(), "objective": objective})

    def save(self, file: str | os.PathLike[str]) -> Path:
        """Save the task as a task file (YAML) atomically: `towline plan` and `plan` read an equal task from it.

        Raises `InputError` if the file cannot be written, or the task has limits or costs defined in Python.
        """
        return save_yaml(self, file)

    @property
    def seconds(self) -> float:
        """Return the duration of the motion [s]; for a range its geometric mean, from which the planner starts.

        If the path has dwell times, durations below their sum are excluded.

        Raises:
            InputError: If neither the task nor its path gives it.
        """
        if isinstance(self.duration, PositiveRange):
            return float(np.sqrt(max(self.duration.min, self.path.resting) * self.duration.max))
        seconds = self.duration if self.duration is not None else self.path.natural_duration
        if seconds is None:
            raise InputError(f"task {self.name!r}: duration must be a number > 0 [s] or a range, got nothing")
        return seconds


def read_task(task: Task | dict[str, Any] | str | os.PathLike[str]) -> Task:
    """Return a `Task` from a task, a mapping or a YAML file.

    Raises `InputError` if the task is invalid; the message names the field, the accepted values and the value.
    """
    if isinstance(task, Task):
        return task
    if isinstance(task, dict):
        return validate(task, Task, "task")
    return read_yaml(file_path("task", task, "a Task, a mapping or the path of a YAML file"), Task)


class MotionStatus(StrEnum):
    """The status of a plan or of `time_along`; the values are plain strings."""

    FEASIBLE = "feasible"
    """The motion keeps every limit, as confirmed by the audit on its dense grid."""

    INFEASIBLE = "infeasible"
    """No motion that the task allows is feasible, and this is proven: by the certificate of an instant at which no
    tensions give the required wrench, or by a limit that all these motions exceed (`Audit.excess`). If the duration
    is free, no duration and no time law that the task allows are feasible. The certificate then refers to the
    slowest motion, and `Plan.stages` gives the reasons that exclude the others."""

    NOT_FOUND = "not-found"
    """The search ended without a motion that keeps every limit and without a proof that none exists. Certificate and
    `excess` refer to the closest motion known."""
