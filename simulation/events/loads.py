"""Loads on the platform: `Carry`, a load that is picked up, exchanged or released."""

from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field
from typing_extensions import override

from ...base.errors import InputError
from ...base.inputs import shown
from ...base.text import quantity
from ...models.part import Inertia, NonNegative, Vector3, inertia_matrix
from ...models.robot import Robot
from .event import Event, Running, number_in


class Carry(Event):
    """The platform carries a load from now on, instead of the last one; a mass of 0 releases it.

    The load moves with the platform when it is picked up, as in the phases of a plan, so no velocity changes.
    """

    kind: Literal["carry"] = "carry"
    short: ClassVar[str] = "carry MASS"
    mass: NonNegative = Field(description="mass of the load [kg]; 0: none")
    com: Vector3 = Field(default=(0.0, 0.0, 0.0), description="CoM of the load in the platform frame [m]")
    inertia: Inertia = Field(
        default=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        description="inertia (Ixx, Iyy, Izz, Ixy, Ixz, Iyz) about the CoM of the load in platform axes [kg m^2]",
    )

    @override
    @classmethod
    def in_words(cls, words: list[str]) -> dict[str, Any]:
        """Return the mass from the words between its kind and "at"."""
        return {"mass": number_in(" ".join(words))} if words else {}

    @override
    def check(self, robot: Robot) -> None:
        """Check that the load has a possible inertia, and none on a platform that is a point.

        Raises
        ------
        InputError
            If it has not.
        """
        if np.linalg.eigvalsh(inertia_matrix(self.inertia))[0] < 0:
            raise InputError(f"must have an inertia without negative moments, got {shown(self.inertia)}")
        if robot.platform.inertia is None and (any(self.com) or any(self.inertia)):
            raise InputError(f"must be a point at the origin for {robot.name!r}, whose platform has no inertia")

    @override
    def describe(self, robot: Robot) -> str:
        """Return what happened."""
        return f"a load of {quantity(self.mass, 'kg')} was picked up" if self.mass else "the load was released"

    @override
    def begin(self, running: Running) -> None:
        """Give the platform the mass, CoM and inertia of both; the state of a plant describes the CoM."""
        loaded = self._on(running.plant.robot)
        running.carry(loaded)

    def _on(self, robot: Robot) -> Robot:
        """Return the robot with a platform that includes the load."""
        platform = robot.platform
        bodies = [(platform.mass, platform.com, platform.inertia or (0.0,) * 6), (self.mass, self.com, self.inertia)]
        mass = platform.mass + self.mass
        com = sum((m * np.array(c) for m, c, _ in bodies), np.zeros(3)) / mass
        total = np.zeros((3, 3))
        for m, c, inertia in bodies:
            arm = np.array(c) - com
            total += inertia_matrix(inertia) + m * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        changes: dict[str, Any] = {"mass": mass, "com": tuple(com.tolist())}
        if platform.inertia is not None:
            changes["inertia"] = tuple(total[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist())
        return robot.model_copy(update={"platform": platform.model_copy(update=changes)})
