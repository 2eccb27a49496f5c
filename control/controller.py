"""`Controller`: the base class of all controllers."""

from abc import ABC, abstractmethod
from collections.abc import Sequence

from .command import Command
from .state import Reference, State


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
