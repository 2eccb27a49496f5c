"""Loads on the platform: `Carry`, a load that is picked up, exchanged or released."""

from typing import Any, ClassVar, Literal

from typing_extensions import override

from ...base.errors import InputError
from ...base.inputs import shown
from ...base.text import quantity
from ...models.rigid_load import RigidLoad
from ...models.robot import Robot
from .event import Event, Running, number_in


class Carry(RigidLoad, Event):
    """The platform carries a load from now on, instead of any earlier one; a mass of 0 releases it.

    The load moves with the platform when it is picked up, as in the phases of a plan, so no velocity changes. Wind and
    pushes act at the common CoM.
    """

    kind: Literal["carry"] = "carry"
    short: ClassVar[str] = "carry MASS"

    @override
    @classmethod
    def in_words(cls, words: list[str]) -> dict[str, Any]:
        """Return the mass from the words between its kind and "at"."""
        return {"mass": number_in(" ".join(words))} if words else {}

    @override
    def check(self, robot: Robot) -> None:
        if not self.mass and any(self.inertia):
            raise InputError(f"must have the inertia 0 kg m^2 with the mass 0 kg, got {shown(self.inertia)}")
        if robot.platform.inertia is None and (any(self.com) or any(self.inertia)):
            name, value = ("com", self.com) if any(self.com) else ("inertia", self.inertia)
            raise InputError(
                f"must have the {name} 0 for {robot.name!r}, whose platform has no inertia, got {shown(value)}"
            )

    @override
    def describe(self, robot: Robot) -> str:
        return f"a load of {quantity(self.mass, 'kg')} was picked up" if self.mass else "the load was released"

    @override
    def begin(self, running: Running) -> None:
        """Give the platform the mass, CoM and inertia of platform and load; the state of a plant describes the CoM."""
        running.carry(self.on(running.plant.robot))
