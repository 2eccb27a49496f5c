"""`Stage`: one step of the planner's ladder, what it said and how long it took."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["Stage"]


class Stage(NamedTuple):
    """One step of the ladder.

    Attributes
    ----------
    name
        What was asked: "rest along the path", "timing", "program of 100 steps".
    verdict
        What it said, in words with units.
    seconds
        Wall time [s].
    """

    name: str
    verdict: str
    seconds: float
