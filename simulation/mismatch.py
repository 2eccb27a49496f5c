"""`Mismatch`: how simulated robots differ from the model of their file, and `Drawn`, the numbers of one run."""

from typing import Annotated, NamedTuple, TypeAlias

import numpy as np
from pydantic import AfterValidator

from ..base.errors import InputError
from ..base.text import quantity_range, quantity_row
from ..models.part import Part, optional
from ..models.robot import Robot

BODIES = ("mass", "com", "stiffness")  # fields of the robot itself
TENSIONS, LAGS = ("tension_gain", "friction"), ("winch_lag", "rotor_lag", "carrier_lag")  # fields of its drives


def _within(low: float, high: float) -> AfterValidator:
    """Return the check of a number, or of the ends of a range."""

    def check(value: Amount) -> Amount:
        ends = value if isinstance(value, tuple) else (value, value)
        if not low <= ends[0] <= ends[1] <= high:
            raise ValueError(f"must be a number from {low:g} to {high:g}, or [lowest, highest]")
        return value

    return AfterValidator(check)


Amount: TypeAlias = float | tuple[float, float]
Factor: TypeAlias = Annotated[Amount, _within(0.01, 100.0)]
Offset: TypeAlias = Annotated[Amount, _within(-10.0, 10.0)]
Force: TypeAlias = Annotated[Amount, _within(0.0, 1e6)]
Lag: TypeAlias = Annotated[Amount, _within(0.0, 10.0)]


class Mismatch(Part):
    """Differences between the simulated robot and its file, which the controller keeps using; by default none.

    A number holds in every run. From a range [low, high] each run draws a number, a different one for each cable or
    carrier; the numbers of a run depend on its seed.
    """

    geometry: bool = optional("true: each run draws a robot from the file's `uncertainty`", False)
    mass: Factor = optional("factor of the platform's mass and inertia", 1.0)
    com: Offset = optional("displacement of the CoM from its position in the file, along each axis [m]", 0.0)
    stiffness: Factor = optional("factor of the stiffness of cables", 1.0)
    tension_gain: Factor = optional("tension that a winch gives, divided by the command", 1.0)
    friction: Force = optional("dry friction of winches and pulleys, as a force on a cable [N]", 0.0)
    winch_lag: Lag = optional("time constant with which winches follow commands [s]", 0.0)
    rotor_lag: Lag = optional("time constant of the actuators of flying carriers [s]", 0.0)
    carrier_lag: Lag = optional("time constant of carriers whose motion is commanded [s]", 0.0)

    def check(self, robot: Robot) -> None:
        """Check that the robot has the parts to which the differences refer.

        Raises:
            InputError: If it lacks one.
        """
        if self.geometry and (robot.uncertainty is None or robot.uncertainty.geometry is None):
            raise InputError("mismatch.geometry must be false for a robot file without an uncertainty, got true")
        moved = any(carrier.moves and not carrier.actuators for carrier in robot.carriers)
        reasons = {
            "stiffness": None if all(cable.stiffness for cable in robot.cables) else "cables that do not stretch",
            "rotor_lag": None if any(carrier.actuators for carrier in robot.carriers) else "carriers that do not fly",
            "carrier_lag": None if moved else "no carriers whose motion is commanded",
        } | {
            name: None if robot.fixed_lengths is None else "cables of fixed length" for name in (*TENSIONS, "winch_lag")
        }
        for name, reason in reasons.items():
            if reason is not None and name in self.model_dump(exclude_defaults=True):
                raise InputError(f"mismatch.{name} must be left out for a robot with {reason}, got {robot.name!r}")

    @property
    def varies(self) -> bool:
        """Return whether runs have different robots, and not only different drives."""
        return self.geometry or any(isinstance(getattr(self, name), tuple) for name in BODIES)

    @property
    def of_drives(self) -> bool:
        """Return whether drives differ from their commands."""
        return any(name in self.model_dump(exclude_defaults=True) for name in (*TENSIONS, *LAGS))

    @property
    def stiffest(self) -> "Mismatch":
        """Return the robot with the fastest vibrations."""
        return Mismatch(mass=float(np.min(self.mass)), stiffness=float(np.max(self.stiffness)))

    def drawn(self, robot: Robot, seed: int) -> "Drawn":
        """Return the numbers of a run. Each key has its own random numbers."""
        sizes = (1, 3, *4 * (robot.m,), *2 * (len(robot.carriers),))
        random, values = np.random.default_rng([seed, 2]), []
        for name, size in zip(Drawn._fields, sizes, strict=True):
            low, high = np.broadcast_to(getattr(self, name), 2)
            values.append(low + (high - low) * random.uniform(size=size))
        return Drawn(*values)

    def robot(self, robot: Robot, seed: int) -> Robot:
        """Return the robot of a run."""
        if not (self.geometry or any(name in self.model_dump(exclude_defaults=True) for name in BODIES)):
            return robot
        drawn, platform = self.drawn(robot, seed), robot.platform
        factor, com = float(drawn.mass[0]), np.array(platform.com) + drawn.com
        inertia = platform.inertia and tuple(factor * one for one in platform.inertia)
        changes = {"mass": factor * platform.mass, "com": tuple(com.tolist()), "inertia": inertia}
        exact = robot.drawn(1, seed)[0] if self.geometry else robot
        cables = tuple(
            cable.model_copy(update={"stiffness": cable.stiffness and cable.stiffness * by})
            for cable, by in zip(exact.cables, drawn.stiffness.tolist(), strict=True)
        )
        return exact.model_copy(update={"platform": platform.model_copy(update=changes), "cables": cables})


class Drawn(NamedTuple):
    """The numbers of a run, as in `Mismatch`: (1,), (3,), (m,) for each cable, (c,) for each carrier."""

    mass: np.ndarray
    com: np.ndarray
    stiffness: np.ndarray
    tension_gain: np.ndarray
    friction: np.ndarray
    winch_lag: np.ndarray
    rotor_lag: np.ndarray
    carrier_lag: np.ndarray

    def describe(self, of: Mismatch) -> str:
        """Return what differs from the file, in words."""
        units = {"com": "m", "friction": "N"} | dict.fromkeys(("winch_lag", "rotor_lag", "carrier_lag"), "s")
        units |= dict.fromkeys(("mass", "stiffness"), "times the file's")
        parts = ["geometry drawn from the uncertainty"] if of.geometry else []
        for name in of.model_dump(exclude_defaults=True, exclude={"geometry"}):
            values, write = getattr(self, name), quantity_row if name == "com" else quantity_range
            word = "CoM off by" if name == "com" else name.replace("_", " ")
            parts.append(f"{word} {write(values, units.get(name, ''), digits=3)}")
        return "; ".join(parts)
