"""`Controller`: the base of all controllers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

from .command import Command
from .reference import Reference
from .state import State


class Controller(ABC):
    """One step: a time, a measured state and a reference in, a command out. docs/adding-a-controller.md has an example.

    A controller has memory of its own (integrals, the last command), which `reset` erases; a simulation calls it first.

    Attributes
    ----------
    batches
        Whether `step` accepts states with a leading dimension, a robot in each row, and answers each row as it answers
        it alone. Controllers that do not are copied for each flight of a simulation of many.
    """

    batches = False

    @abstractmethod
    def step(self, time: float, state: State, reference: Reference) -> Command:
        """Return the command for the time [s] from now until the next step."""

    def follow(self, references: Sequence[Reference], period: float, start: float = 0.0) -> None:
        """Receive the references of the times to come; default: they are not needed.

        Parameters
        ----------
        references
            One for each period, from `start` [s] on; the last one holds afterwards.
        period
            [s].
        """
        return

    def reset(self) -> None:
        """Forget all earlier steps; default: nothing is remembered."""
        return
