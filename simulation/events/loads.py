"""Loads on the platform: `Carry`, what it picks up or releases; `Push`, a force for some time; and a `Wall`."""

from abc import ABC
from math import inf, sqrt
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, PrivateAttr, model_validator
from typing_extensions import override

from ...base.inputs import InputError, shown
from ...base.text import quantity
from ...models.part import NonNegative, Positive, Vector3, optional
from ...models.rigid_load import RigidLoad
from ...models.robot import Robot
from .event import Event, Running, Seconds, number_in

ROUNDING = 1e-9  # of a force or moment, which may have been computed
PART = 0.2  # of the time constants of a wall: longest step
TINY = 1e-200  # [m], instead of no change


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


class Lasting(Event, ABC):
    """An event that acts for some time."""

    duration: Seconds | None = optional("how long it acts [s]; default: until the end")

    @property
    @override
    def until(self) -> float:
        """Return the time at which it ends [s]; infinity if it does not."""
        return inf if self.duration is None else self.at + self.duration


class Push(Lasting):
    """A force and a moment on the platform, or on a carrier that flies, from one time to another."""

    kind: Literal["push"] = "push"
    short: ClassVar[str] = "push [CARRIER] FX FY FZ [MX MY MZ]"
    carrier: str | None = optional("name of the carrier on which it acts; default: the platform")
    force: Vector3 = optional("force in {G} [N]", (0.0, 0.0, 0.0))
    moment: Vector3 = optional("moment about the CoM in {G} [N m]", (0.0, 0.0, 0.0))
    _body: int = PrivateAttr(default=0)  # on which it acts

    @override
    @classmethod
    def in_words(cls, words: list[str]) -> dict[str, Any]:
        """Return the carrier, if the first word is not a number, and force and moment from the numbers."""
        numbers = [number_in(word) for word in words]
        which = {"carrier": numbers.pop(0)} if numbers and isinstance(numbers[0], str) else {}
        return {**which, "force": numbers[:3]} | ({"moment": numbers[3:]} if len(numbers) > 3 else {})

    @override
    def check(self, robot: Robot) -> None:
        flying = [carrier.name for carrier in robot.carriers if carrier.body is not None]
        if self.carrier is not None and self.carrier not in flying:
            names = ", ".join(flying) or "it has none"
            raise InputError(f"must name a carrier of {robot.name!r} that flies ({names}), got {shown(self.carrier)}")
        if self.carrier is not None:
            return
        locked = robot.dof_mask == 0
        if locked[3:].sum() < 2 or any(robot.home[3:]):
            locked[3:] &= locked[3:].all()  # an axis of rotation may have a share in each of {G}
        wrench = np.reshape([self.force, self.moment], (2, 3))
        if (np.abs(wrench * locked.reshape(2, 3)) > ROUNDING * np.linalg.norm(wrench, axis=1, keepdims=True)).any():
            free, given = ", ".join(robot.platform.dof), [*self.force, *self.moment]
            raise InputError(f"must push {robot.name!r} along what it can move ({free}), got {shown(given)}")

    @override
    def begin(self, running: Running) -> None:
        """Find the carrier of the robot."""
        names = [carrier.name for carrier in running.plant.robot.carriers]
        self._body = 0 if self.carrier is None else 1 + names.index(self.carrier)

    @override
    def describe(self, robot: Robot) -> str:
        sizes = quantity(float(np.linalg.norm(self.force)), "N"), quantity(float(np.linalg.norm(self.moment)), "N m")
        parts = [size for size, part in zip(sizes, (self.force, self.moment), strict=True) if any(part)]
        lasting = "" if self.duration is None else f" for {quantity(self.duration, 's')}"
        place = "" if self.carrier is None else f" on {self.carrier}"
        return f"a push of {' and '.join(parts) or '0 N'}{place}{lasting}"

    @override
    def wrench(self, time: float, motions: np.ndarray) -> np.ndarray:
        """Return force [N] and moment [N m], the same at each time [s]: (6,), or (1, 1 + c, 6) on a carrier."""
        push = np.array([*self.force, *self.moment])
        if self.carrier is None:
            return push
        result = np.zeros((1, motions.shape[1], 6))
        result[:, self._body] = push
        return result


class Wall(Lasting):
    """A plane that pushes the platform away, with a spring and a damper and without friction.

    It touches the ball of the given radius about the origin of the platform frame. The force acts along the normal and
    through the CoM; it never pulls. In each step it is the mean while the platform moves on with its velocity, so that
    a wall without damping gives back the energy of an impact.
    """

    kind: Literal["wall"] = "wall"
    point: Vector3 = Field(description="a point of the plane in {G} [m]")
    normal: Vector3 = Field(description="direction in {G} towards the robot, of any length")
    stiffness: Positive = Field(description="force per depth [N/m]")
    damping: NonNegative = optional("force per speed into the wall [N s/m]", 0.0)
    radius: NonNegative = optional("radius of the ball that touches the wall [m]", 0.0)
    _step: float = PrivateAttr(default=0.0)  # for which a force is held [s]

    @model_validator(mode="after")
    def _has_normal(self) -> Self:
        if not np.linalg.norm(self.normal) > 0:  # of squares that do not underflow
            raise ValueError(f"normal must have a length, got {shown(self.normal) if any(self.normal) else 'zeros'}")
        return self

    @override
    def describe(self, robot: Robot) -> str:
        damped = f" and a damping of {quantity(self.damping, 'N s/m')}" if self.damping else ""
        return f"a wall with a stiffness of {quantity(self.stiffness, 'N/m')}{damped} appeared"

    @override
    def longest_step(self, robot: Robot) -> float:
        """Return a fifth of the time in which a contact changes [s]."""
        mass = robot.platform.mass
        return PART * min(sqrt(mass / self.stiffness), mass / self.damping if self.damping else inf)

    @override
    def begin(self, running: Running) -> None:
        """Store the duration of a step, over which `wrench` averages the force."""
        self._step = running.periods.period

    @override
    def wrench(self, time: float, motions: np.ndarray) -> np.ndarray:
        """Return the force [N] on the platforms of N runs, with no moment, (N, 6), the same at each time [s]."""
        normal = np.array(self.normal) / np.linalg.norm(self.normal)
        position, velocity = motions[:, 0, :3], motions[:, 0, 6:9]
        # Not by BLAS, whose rounding of a run depends on how many there are.
        begins = self.radius - ((position - np.array(self.point)) * normal).sum(axis=1)
        speed = -(velocity * normal).sum(axis=1)
        ends = begins + self._step * speed
        change = np.maximum(np.abs(ends - begins), TINY)
        share = np.clip(np.maximum(begins, ends) / change, 0.0, 1.0)  # of the step, in contact
        depth = (np.maximum(begins, 0.0) + np.maximum(ends, 0.0)) / 2
        force = share * (self.stiffness * depth + self.damping * speed)
        result = np.zeros((len(motions), 6))
        result[:, :3] = np.maximum(force, 0.0)[:, None] * normal
        return result
