"""Faults: a cable breaks, a winch sticks, a carrier loses its actuators, the controller does not respond."""

from abc import ABC
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field
from typing_extensions import override

from ...base.errors import InputError
from ...base.inputs import shown
from ...base.text import quantity
from ...models.part import Whole
from ...models.robot import Robot
from .event import Event, Running, Seconds, number_in


class OfCable(Event, ABC):
    """A fault of one cable."""

    said = "cable"
    cable: Annotated[Whole, BeforeValidator(number_in)] = Field(description="number of the cable, from 1")

    @override
    def check(self, robot: Robot) -> None:
        """Check that the robot has the cable.

        Raises
        ------
        InputError
            If it has not.
        """
        if not 1 <= self.cable <= robot.m:
            raise InputError(f"must name a cable of {robot.name!r}, 1 to {robot.m}, got {shown(self.cable)}")


class Cut(OfCable):
    """A cable breaks."""

    kind: Literal["cut"] = "cut"
    short = "cut CABLE"

    @override
    def describe(self, robot: Robot) -> str:
        """Return what happened."""
        return f"cable {self.cable} was cut"

    @override
    def begin(self, running: Running) -> None:
        """Let it happen."""
        running.states = running.plant.cut(running.states, self.cable - 1)


class Stick(OfCable):
    """The winch of a cable holds its length."""

    kind: Literal["stick"] = "stick"
    short = "stick CABLE"

    @override
    def describe(self, robot: Robot) -> str:
        """Return what happened."""
        return f"the winch of cable {self.cable} stuck"

    @override
    def begin(self, running: Running) -> None:
        """Let it happen."""
        running.states = running.plant.stick(running.states, self.cable - 1)


class Lose(Event):
    """The actuators of a carrier stop, such as the rotors of a quadrotor."""

    kind: Literal["lose"] = "lose"
    short, said = "lose CARRIER", "carrier"
    carrier: str = Field(description="name of the carrier")

    @override
    def check(self, robot: Robot) -> None:
        """Check that the robot has the carrier, with actuators.

        Raises
        ------
        InputError
            If it has not.
        """
        known = [carrier.name for carrier in robot.carriers if carrier.actuators]
        if self.carrier not in known:
            names = ", ".join(known) or "it has none"
            raise InputError(
                f"must name a carrier of {robot.name!r} with actuators ({names}), got {shown(self.carrier)}"
            )

    @override
    def describe(self, robot: Robot) -> str:
        """Return what happened."""
        return f"the actuators of {self.carrier} were lost"

    @override
    def begin(self, running: Running) -> None:
        """Let it happen."""
        names = [carrier.name for carrier in running.plant.robot.carriers]
        running.periods.lose(names.index(self.carrier))


class Miss(Event):
    """The controller does not respond for some time."""

    kind: Literal["miss"] = "miss"
    short, said = "miss DURATION", "duration"
    duration: Seconds = Field(description="time without a response [s]")

    @override
    def describe(self, robot: Robot) -> str:
        """Return what happened."""
        return f"the controller missed {quantity(self.duration, 's')}"

    @override
    def begin(self, running: Running) -> None:
        """Let it happen."""
        running.silent_until = max(running.silent_until, self.at + self.duration)
