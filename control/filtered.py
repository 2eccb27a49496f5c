"""`Filtered`: a controller whose velocities a filter estimates from measured poses."""

from collections import deque
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike
from typing_extensions import override

from ..base.errors import InputError
from ..base.inputs import required, shown
from .command import Command
from .controller import Controller
from .reference import Reference
from .state import State


class Filter(Protocol):
    """A filter such as `PoseFilter`, whose estimates have a pose and a velocity, (6,)."""

    def reset(self) -> None:
        """Forget all measurements."""

    def update(
        self, time: float, *, pose: ArrayLike | None = None, reference: Sequence[ArrayLike] | None = None
    ) -> Any:
        """Return the estimate at `time` [s]."""


class Filtered(Controller):
    """Control a robot whose sensors report poses without velocities, such as motion capture.

    The velocities of measured states are not used. A pose that equals the last one is treated as a held reading.

    Args:
        controller: Controller that receives the estimated states.
        filter: `estimation.PoseFilter` of the platform's poses, with their standard deviations, or a filter with its
            methods. It receives the reference, so that it filters deviations from it.

    Raises:
        InputError: If an argument has a wrong type.
    """

    def __init__(self, controller: Controller, filter: Filter):
        self.controller = required("controller", controller, Controller)
        if isinstance(filter, type) or not all(callable(getattr(filter, name, None)) for name in ("reset", "update")):
            raise InputError(f"filter must be a PoseFilter, or have its methods update and reset, got {shown(filter)}")
        self.filter = filter
        self.drive = self.controller.drive
        self._forget()

    def _forget(self) -> None:
        self._pose: np.ndarray | None = None
        self._references: deque[tuple[float, Reference]] = deque()

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
        seen = time if state.time is None else state.time
        self._references.append((time, reference))
        while len(self._references) > 1 and self._references[1][0] <= seen:
            self._references.popleft()
        pose = np.array(state.pose, dtype=float)
        new = self._pose is None or not np.array_equal(pose, self._pose)
        self._pose = pose
        found = self.filter.update(seen, pose=pose if new else None, reference=self._references[0][1][:3])
        return self.controller.step(time, state._replace(pose=found.pose, velocity=found.velocity), reference)
