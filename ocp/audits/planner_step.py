"""`PlannerStep`: one step of the planner, its message and its time."""

from __future__ import annotations

from typing import NamedTuple


class PlannerStep(NamedTuple):
    """One step of the planner.

    Attributes
    ----------
    name
        What was computed: "ends and path", "timing", "nonlinear program, 100 steps".
    message
        Its result, as text with units; empty if it has no result worth a line.
    seconds
        Wall time [s].
    """

    name: str
    message: str
    seconds: float
