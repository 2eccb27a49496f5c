"""`PlannerStep`: one step of the planner, its message and its time."""

from __future__ import annotations

from typing import NamedTuple


class PlannerStep(NamedTuple):
    """One step of the planner.

    Attributes
    ----------
    name
        Name of the stage: "ends and path", "timing", "nonlinear program, 100 steps".
    message
        Result as text with units; may be empty.
    seconds
        Wall time [s].
    """

    name: str
    message: str
    seconds: float
