"""Faults: a cable breaks, a winch sticks, a carrier loses its actuators, the controller does not respond."""

from abc import ABC
from collections.abc import Callable
from typing import Annotated, ClassVar, Literal, TypeAlias

import numpy as np
from pydantic import BeforeValidator, Field
from typing_extensions import override

from ...base.inputs import InputError, shown
from ...base.text import quantity
from ...models.part import Whole
from ...models.robot import Robot
from ...plant import Plant
from .event import Event, Running, Seconds, number_in

Change: TypeAlias = Callable[[Plant, np.ndarray, int], np.ndarray]  # of states, with the index of a cable


class OfCable(Event, ABC):
    """A fault of one cable: what happened to it, and how it changes states of a plant."""

    happened: ClassVar[str]
    change: ClassVar[Change]
    said: ClassVar[str] = "cable"
    cable: Annotated[Whole, BeforeValidator(number_in)] = Field(description="number of the cable, from 1")

    @override
    def check(self, robot: Robot) -> None:
        if not 1 <= self.cable <= robot.m:
            raise InputError(f"must name a cable of {robot.name!r}, 1 to {robot.m}, got {shown(self.cable)}")

    @override
    def describe(self, robot: Robot) -> str:
        return self.happened.format(self.cable)

    @override
    def begin(self, running: Running) -> None:
        running.states = type(self).change(running.plant, running.states, self.cable - 1)


class Cut(OfCable):
    """A cable breaks."""

    kind: Literal["cut"] = "cut"
    short: ClassVar[str] = "cut CABLE"
    happened: ClassVar[str] = "cable {} was cut"
    change: ClassVar[Change] = Plant.cut


class Stick(OfCable):
    """The winch of a cable holds its length."""

    kind: Literal["stick"] = "stick"
    short: ClassVar[str] = "stick CABLE"
    happened: ClassVar[str] = "the winch of cable {} stuck"
    change: ClassVar[Change] = Plant.stick


class Lose(Event):
    """The actuators of a carrier stop, such as the rotors of a quadrotor."""

    kind: Literal["lose"] = "lose"
    short: ClassVar[str] = "lose CARRIER"
    said: ClassVar[str] = "carrier"
    carrier: str = Field(description="name of the carrier")

    @override
    def check(self, robot: Robot) -> None:
        known = [carrier.name for carrier in robot.carriers if carrier.actuators]
        if self.carrier not in known:
            names = ", ".join(known) or "it has none"
            raise InputError(
                f"must name a carrier of {robot.name!r} with actuators ({names}), got {shown(self.carrier)}"
            )

    @override
    def describe(self, robot: Robot) -> str:
        return f"the actuators of {self.carrier} were lost"

    @override
    def begin(self, running: Running) -> None:
        names = [carrier.name for carrier in running.plant.robot.carriers]
        running.periods.lose(names.index(self.carrier))


class Miss(Event):
    """The controller does not respond for some time."""

    kind: Literal["miss"] = "miss"
    short: ClassVar[str] = "miss DURATION"
    said: ClassVar[str] = "duration"
    duration: Seconds = Field(description="time without a response [s]")

    @override
    def describe(self, robot: Robot) -> str:
        return f"the controller paused for {quantity(self.duration, 's')}"

    @override
    def begin(self, running: Running) -> None:
        running.silent_until = max(running.silent_until, self.at + self.duration)
