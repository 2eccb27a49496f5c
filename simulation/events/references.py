"""Changes of the reference: a stop on its path, and another plan."""

import os
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, PrivateAttr, ValidationInfo, field_serializer, field_validator
from typing_extensions import override

from ...base.errors import InputError
from ...base.text import quantity
from ...control.trajectory import read_trajectory
from ...models.points import shortest_way
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
    _stop: str = PrivateAttr(default="to stop")  # later with duration and distance

    @override
    def describe(self, robot: Robot) -> str:
        return f"the reference began {self._stop}"

    @override
    def follow(self, robot: Robot, trajectory: Trajectory, time: float) -> Trajectory | None:
        """Return the stop that begins at the time [s], with time 0 there; None if the reference is a pose to hold."""
        if trajectory.duration is None:
            return None  # a pose
        halt = stop_along(robot, trajectory, time)
        self._stop = f"a stop of {quantity(halt.duration, 's')} and {quantity(halt.distance, 'm')}"
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
        """Return the plan, with a note if its start or its load differs from the reference at the time [s]."""
        new, carried = self._trajectory(robot), trajectory.load_at(time)
        notes = [new.doubt]
        if carried is not None and not new.loads:
            notes.append(f"another plan, without the load of {quantity(carried.mass, 'kg')} that the platform carries")
        jumps = _motions(new, 0.0) - _motions(trajectory, time)  # (2, 1 + c, 6)
        jumps[0] = shortest_way(jumps[0])
        flies = [bool(carrier.actuators) for carrier in robot.carriers]
        jumps[:, 1:, 3:][:, flies] = 0.0  # their attitudes follow from their accelerations
        most = np.abs(jumps).max(axis=(0, 2))
        if most.max() > JUMP:
            which = 0 if most[0] > JUMP else int(np.argmax(most))
            moved, faster = np.linalg.norm(jumps[:, which, :3], axis=1).tolist()
            whose = f"whose carrier {robot.carriers[which - 1].name!r}" if which else "which"
            jump = f"{quantity(1e3 * moved, 'mm')} and {quantity(faster, 'm/s')}"
            notes.append(f"another plan, {whose} jumps by {jump} at the hand-over")
        return new._replace(doubt="; ".join(filter(None, notes)))


def _motions(trajectory: Trajectory, time: float) -> np.ndarray:
    """Return poses and velocities of the platform and of the carriers at a time [s], (2, 1 + c, 6)."""
    platform, carriers = trajectory.at(np.array([time]))
    return np.stack([np.vstack([platform[i], carriers[i][0]]) for i in (0, 1)])
