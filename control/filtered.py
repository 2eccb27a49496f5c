"""`Filtered`: a controller whose velocities a filter estimates from measured poses."""

from collections import deque
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike
from typing_extensions import override

from ..base.inputs import InputError, required, shown
from ..core import control_move_on
from .as_floats import as_floats, measured_at
from .carried_load import CarriedLoad
from .controller import Command, Controller, Reference, State

SHORT = 1e-5  # [s], in which velocities change by an acceleration


class Filter(Protocol):
    """A filter such as `PoseFilter`, whose estimates have a pose and a velocity, (6,), and a time [s]."""

    def reset(self) -> None:
        """Forget all measurements."""

    def update(
        self, time: float, *, pose: ArrayLike | None = None, reference: Sequence[ArrayLike] | None = None
    ) -> Any:
        """Return the estimate at `time` [s]."""


class Filtered(Controller):
    """Control a robot whose sensors report poses without velocities, such as motion capture.

    The velocities of measured states are not used. A pose that equals the last one is treated as a held reading.

    A `PoseFilter` receives the acceleration that the measured or commanded tensions cause by the robot's dynamics. Its
    estimates are therefore not late when the controller accelerates the platform, and the loop is stable however slow
    the filter is, because it only has to follow disturbances. A filter that knows only the reference must be faster
    than three times the sum of the bandwidths of controller and observer.

    Args:
        controller: Controller that receives the estimated states.
        filter: `estimation.PoseFilter` with the standard deviations of the measured poses and the jerk of disturbances
            (for gusts: `jerk=(0.3, 0.3 / robot.length)`); give the controller its `noise` as `sensors`. Or another
            object with the methods of `Filter`, which receives the reference instead of the computed acceleration.

    Raises:
        InputError: If an argument has a wrong type, or the filter belongs to another robot.
    """

    def __init__(self, controller: Controller, filter: Filter):
        self.controller = required("controller", controller, Controller)
        if isinstance(filter, type) or not all(callable(getattr(filter, name, None)) for name in ("reset", "update")):
            raise InputError(f"filter must be a PoseFilter, or have its methods update and reset, got {shown(filter)}")
        self.filter = filter
        self.drive = self.controller.drive
        self._robot: Any = getattr(filter, "robot", None)
        own: Any = getattr(controller, "robot", self._robot)
        if self._robot is not None and (own.m, len(own.carriers)) != (self._robot.m, len(self._robot.carriers)):
            raise InputError(f"filter must be for the controller's robot, {own.name}, got one for {self._robot.name}")
        self._carried = None if self._robot is None else CarriedLoad(self._robot)
        self._forget()

    def _forget(self) -> None:
        self._pose: np.ndarray | None = None
        self._found: Any = None
        self._steps: deque[tuple[float, Reference, Command]] = deque()
        if self._carried is not None:
            self._carried.reset()

    @override
    def reset(self) -> None:
        self.controller.reset()
        self.filter.reset()
        self._forget()

    @override
    def follow(self, references: Sequence[Reference], period: float, start: float = 0.0) -> None:
        self.controller.follow(references, period, start)

    @override
    def step(self, time: float, state: State, reference: Reference) -> Command:
        required("state", state, State)
        seen = time if state.time is None else measured_at(state.time, time)
        pose = np.array(state.pose, dtype=float)
        if self._found is None and not np.isfinite(pose).all():  # nothing to begin with
            return self.controller.step(time, state, reference)
        new = self._pose is None or not np.array_equal(pose, self._pose)
        self._pose = pose
        found = self._found = self._estimate(seen, pose if new else None, state, time, reference)
        command = self.controller.step(time, state._replace(pose=found.pose, velocity=found.velocity), reference)
        self._steps.append((time, reference, command))
        return command

    def _estimate(self, seen: float, pose: np.ndarray | None, state: State, time: float, reference: Reference) -> Any:
        """Return the estimate for when a pose was `seen` [s], from the commands until then and the step's reference."""
        while len(self._steps) > 1 and self._steps[1][0] <= (seen if self._carried is None else self._found.time):
            self._steps.popleft()
        if self._carried is None or not self._steps:
            planned = self._steps[0][1] if self._steps and seen < time else reference
            return self.filter.update(seen, pose=pose, reference=planned[:3])
        state = as_floats(state, self._robot, None)
        acting = [step for step in self._steps if step[0] < seen] or [self._steps[0]]
        measured = state.tensions is not None and bool(np.isfinite(state.tensions).all())
        excess = state.tensions - acting[-1][2].tensions if measured else 0.0
        ends = [*(begins for begins, *_ in acting[1:]), seen]
        for until, (begins, planned, command) in zip(ends, acting, strict=True):
            motion = planned[:3]
            if measured or command.lengths is None:
                motion = self._accelerated(command.tensions + excess, state, planned, begins)
            self._found = self.filter.update(until, pose=pose if until == seen else None, reference=motion)
        return self._found

    def _accelerated(self, tensions: np.ndarray, state: State, planned: Reference, time: float) -> Sequence[ArrayLike]:
        """Return the estimated motion, accelerated by tensions (m,), or the planned motion if that is not finite."""
        assert self._carried is not None
        bodies = np.zeros((1, 1 + len(state.carrier_pose), 12))
        bodies[0, 0], bodies[0, 1:, :6] = np.append(self._found.pose, self._found.velocity), state.carrier_pose
        still, pulls = np.zeros((len(state.carrier_pose), 6)), np.ascontiguousarray(tensions)[None, None]
        control_move_on(SHORT, self._carried.change(planned.load, time), np.zeros((1, 6)), pulls, None, still, bodies)
        acceleration = (bodies[0, 0, 6:] - self._found.velocity) / SHORT
        if not np.isfinite(acceleration).all():
            return planned[:3]
        return self._found.pose, self._found.velocity, acceleration
