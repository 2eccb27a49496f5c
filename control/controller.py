"""`Controller`: the base class of all controllers, and the `State`, `Reference` and `Command` of a step."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..base.display import record
from ..base.errors import InputError
from ..models.rigid_load import RigidLoad

ANSWERS = ("as planned", "shifted plan", "soft wrench", "hold", "not as modelled", "off the reference")
PLANNED, SHIFTED, SOFT, HOLD, OTHERWISE, OFF = range(6)
NOWHERE, NOTHING = np.full(6, np.nan), np.array(np.nan)
NOWHERE.flags.writeable = NOTHING.flags.writeable = False


class State(NamedTuple):
    """A measured state. All arrays of a batch have the same leading dimension, or none for one robot.

    Attributes:
        pose, velocity: (x, y, z, roll, pitch, yaw) of the platform frame in {G} [m, rad], (..., 6), and its time
            derivative.
        carrier_pose, carrier_velocity: Pose of each carrier's frame in {G}, (..., c, 6), and its time derivative.
        tensions: Measured tensions [N], (..., m); None if the robot has no tension sensors.
        time: Time of the measurement on the clock of the steps [s] (default: now). The controllers of towline predict
            the current state from an older one and the commands that were sent since.
    """

    pose: np.ndarray
    velocity: np.ndarray
    carrier_pose: np.ndarray
    carrier_velocity: np.ndarray
    tensions: np.ndarray | None = None
    time: float | None = None

    __repr__ = record


class Reference(NamedTuple):
    """A reference at one time. If it is the same for a whole batch, its arrays may omit the leading dimension.

    Attributes:
        pose, velocity, acceleration: (x, y, z, roll, pitch, yaw) of the platform frame in {G} [m, rad], (..., 6), and
            its time derivatives.
        carrier_pose, carrier_velocity, carrier_acceleration: Pose of each carrier's frame in {G}, (..., c, 6), and its
            time derivatives.
        tensions: Planned tensions [N], (..., m); None if none are planned; the smallest tensions are then preferred.
        load: `RigidLoad` that the platform carries from this time on; None for no load.
    """

    pose: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    carrier_pose: np.ndarray
    carrier_velocity: np.ndarray
    carrier_acceleration: np.ndarray
    tensions: np.ndarray | None = None
    load: RigidLoad | None = None

    __repr__ = record


class Command(NamedTuple):
    """A command. Arrays have the leading dimension of the state.

    Attributes:
        tensions: (..., m) [N], inside their limits and rate limits; small for a cable that is treated as cut.
        carrier_pose, carrier_velocity, carrier_acceleration: Commanded motion of the carriers, (..., c, 6). Flying
            carriers follow `actuation` instead.
        answered: (...), status of the step, an index of `ANSWERS`. "as planned": the tensions give the required
            wrench; "shifted plan": they are from an earlier solution; "soft wrench": they have the closest wrench;
            "hold": the measured state or the reference contained nan, so the command moves to the planned tensions;
            "not as modelled": computed torque took over, because the robot does not move as predicted; "off the
            reference": the tensions give the required wrench, but the platform is farther away from its reference than
            a simulation passes with by default (0.05 m, or 5 % of the mean cable length if that is less), or turned by
            more than 0.5 rad.
        direction, shortfall: If no tensions inside the limits and rates give the required wrench: the direction of the
            missing wrench, (..., 6), and its size [N], (...); otherwise nan (default). If tensions exist but a flying
            carrier has too little thrust for them, or does not turn as commanded because its actuators were at their
            limits for most of the last 0.1 s, only the size.
        actuation: Commands to the actuators of each carrier, (..., c, a); None if no carrier has any.
        unexplained: Mean acceleration of the platform that was not predicted, (...) [m/s^2], angles times the robot's
            length; nan from controllers that do not predict.
        lengths: Unstrained lengths for winches that take them, (..., m) [m], instead of the tensions, which are then
            those that are expected; default: None.
        released: Cables that their carriers release, (..., m) of bool; default: None.
    """

    tensions: np.ndarray
    carrier_pose: np.ndarray
    carrier_velocity: np.ndarray
    carrier_acceleration: np.ndarray
    answered: np.ndarray
    direction: np.ndarray = NOWHERE
    shortfall: np.ndarray = NOTHING
    actuation: np.ndarray | None = None
    unexplained: np.ndarray = NOTHING
    lengths: np.ndarray | None = None
    released: np.ndarray | None = None

    __repr__ = record


class OneAtATime:
    """Let only one thread at a time run a block of a controller; a copy is unlocked.

    The steps of a controller follow each other in time. Steps of two threads would mix two robots in one memory.
    """

    def __init__(self):
        lock = threading.RLock()  # a step of a predictive controller is made of others
        self._enter, self._leave = lock.acquire, lock.release

    def __enter__(self) -> None:
        """Enter, or raise InputError if another thread is inside."""
        if not self._enter(False):
            raise InputError("controller must be used by one thread at a time, got two; each robot needs its own")

    def __exit__(self, *_: object) -> None:
        """Leave to others."""
        self._leave()

    def __reduce__(self) -> tuple[type[OneAtATime], tuple[()]]:
        """Copy and pickle without the lock, which belongs to this process and its threads."""
        return OneAtATime, ()


class Controller(ABC):
    """Base class of controllers: `step` maps time, measured state and reference to a command.

    A controller may have memory (integrals, the last command), which `reset` clears; a simulation calls it first. For
    an example see docs/adding-a-controller.md.

    Attributes:
        batches: True if `step` accepts states with a leading dimension, a robot in each row, and treats every row
            independently. Otherwise each of many runs uses a copy.
        drive: How `simulate` passes the commands to the plant: one of the drives of `Plant`; default: depends on the
            robot.
    """

    batches = False
    drive: str | None = None

    @abstractmethod
    def step(self, time: float, state: State, reference: Reference) -> Command:
        """Return the command from now until the next step.

        Args:
            time: Time of the step [s], later than the time of the last one.
            state, reference: Measured state, and desired motion at this time.

        Raises:
            InputError: If an argument has a wrong type, shape or value, or another thread uses the controller.
        """

    def follow(self, references: Sequence[Reference], period: float, start: float = 0.0) -> None:
        """Receive the future references; the default ignores them.

        Args:
            references: Reference of each period, from `start` [s] on; the last one holds afterwards.
            period: Period [s].

        Raises:
            InputError: If an argument has a wrong type or value.
        """
        return

    def reset(self) -> None:
        """Forget all earlier steps; default: nothing is remembered."""
        return
