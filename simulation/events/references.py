"""Changes of the reference: a stop on its path, and another plan."""

import os
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_serializer, field_validator
from typing_extensions import override

from ...base.errors import InputError
from ...base.text import quantity
from ...control.trajectory import read_trajectory
from ...models.robot import Robot
from ...models.trajectory import Trajectory
from ...statics.stops import stop_along
from .event import Event

BEYOND = "a stop that needs tensions beyond their limits"
JUMP = 1e-3  # [m, rad, m/s, rad/s], between two references: less is no jump


class StopReference(Event):
    """The reference stops on its path, as `control.stop` does."""

    kind: Literal["stop"] = "stop"
    short: ClassVar[str] = "stop"

    @override
    def describe(self, robot: Robot) -> str:
        return "the reference began to stop"

    @override
    def follow(self, robot: Robot, trajectory: Trajectory, time: float) -> Trajectory | None:
        """Return the stop that begins at the time [s], with time 0 there; None if the reference is a pose to hold."""
        if trajectory.duration is None:
            return None  # a pose
        halt = stop_along(robot, trajectory, time)
        return read_trajectory(robot, halt, None)._replace(doubt="" if halt.feasible else BEYOND)


class Follow(Event):
    """The reference becomes another plan, which begins then."""

    kind: Literal["follow"] = "follow"
    short: ClassVar[str] = "follow PLAN.nc"
    said: ClassVar[str] = "plan"
    plan: Any = Field(description="a plan, or the NetCDF file of one")

    @field_validator("plan")
    @classmethod
    def _placed(cls, plan: Any, info: ValidationInfo) -> Any:
        """Take a file's name as relative to the folder of the file that names it."""
        folder = (info.context or {}).get("folder")
        return Path(folder, plan) if folder is not None and isinstance(plan, str | os.PathLike) else plan

    @field_serializer("plan")
    def _named(self, plan: Any) -> str:
        return str(plan) if isinstance(plan, str | os.PathLike) else type(plan).__name__

    def _trajectory(self, robot: Robot) -> Trajectory:
        return read_trajectory(robot, self.plan, None)

    @override
    def check(self, robot: Robot) -> None:
        try:
            self._trajectory(robot)
        except InputError as error:
            raise InputError(str(error).removeprefix("reference ")) from None

    @override
    def describe(self, robot: Robot) -> str:
        return "the reference became another plan"

    @override
    def follow(self, robot: Robot, trajectory: Trajectory, time: float) -> Trajectory:
        """Return the plan, with a note if its start differs from the reference at the time [s]."""
        new = self._trajectory(robot)
        (before, _), (after, _) = trajectory.at(np.array([time])), new.at(np.zeros(1))
        pose, velocity = (after[i][0] - before[i][0] for i in (0, 1))
        pose[3:] = (pose[3:] + np.pi) % (2 * np.pi) - np.pi
        if max(np.abs(pose).max(), np.abs(velocity).max()) <= JUMP:
            return new
        moved, faster = (float(np.linalg.norm(part[:3])) for part in (pose, velocity))
        jump = f"jumps by {quantity(1e3 * moved, 'mm')} and {quantity(faster, 'm/s')} at the hand-over"
        return new._replace(doubt="; ".join(filter(None, [new.doubt, f"another plan, which {jump}"])))
