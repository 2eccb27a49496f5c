"""Compute the capacity margin of rest along the path, the planner's first stage.

It takes little time beside a nonlinear program. Where it is negative, the platform cannot rest: it has to move, or the
carriers have to be elsewhere. If it is negative at an end at which a fixed motion rests, no duration is possible.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..distribution import wrench_problem
from ..solvers import capacity_margin
from ..text import quantity
from .nlp.guess import initial_guess
from .tasks.scenario import Scenario

__all__ = ["RestMargin", "rest_margin"]

PLACES = 21


@dataclass(frozen=True)
class RestMargin:
    """Capacity margins of rest along the motion that the planner starts from.

    Attributes
    ----------
    times
        When the motion is there, (n,) [s].
    margin
        Distance of the wrench of rest from the boundary of the available wrench set, for tension limits less the
        task's margin and moments over `Robot.length`; negative outside, (n,) [N].
    """

    times: np.ndarray  # (n,)
    margin: np.ndarray  # (n,)

    @property
    def worst(self) -> int:
        """Return the row of the smallest margin."""
        return int(self.margin.argmin())

    def describe(self) -> str:
        """Return one line for a person."""
        least, at = self.margin[self.worst], self.times[self.worst]
        if least >= 0:
            margin = quantity(least, "N")
            return f"rest possible everywhere on the initial motion, capacity margin at least {margin} (t = {at:.3f} s)"
        share = f"{(self.margin < 0).sum()} of {len(self.margin)} poses"
        short = quantity(-least, "N")
        return f"rest impossible at {share} of the initial motion, short by up to {short} (t = {at:.3f} s)"


def rest_margin(scenario: Scenario) -> RestMargin:
    """Return the margins of rest at `PLACES` places, both ends among them."""
    times = np.linspace(0.0, scenario.duration, PLACES)
    deviation = initial_guess(scenario, times) if scenario.count else None
    platform, carriers = scenario.motion(times, deviation)
    still = np.zeros_like(platform.pose)
    A = scenario.dynamics.wrench_matrix(platform.pose, carriers.pose)
    margins = np.full(PLACES, np.inf)
    for wind in scenario.winds_at(platform.pose[0], still[0]):  # at rest they are the same everywhere
        w = scenario.dynamics.required_wrench(platform.pose, still, still, wind=wind)
        problems = (wrench_problem(scenario.robot, *both, *scenario.bounds()) for both in zip(A, w, strict=True))
        margins = np.minimum(margins, [capacity_margin(problem).value for problem in problems])
    return RestMargin(times, margins)
