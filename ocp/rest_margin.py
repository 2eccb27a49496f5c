"""The first stage: whether the platform can rest along the path, and how far inside the available wrench set it is.

The capacity margin at rest costs little beside a nonlinear program and tells a lot: where it is negative the motion has
to be quick, or the carriers elsewhere; where it is negative at an end that a fixed motion rests at, no duration helps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..distribution import wrench_problem
from ..solvers import capacity_margin
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
        Distance of rest's wrench from the boundary of what the cables can give inside their limits less the task's
        margin, moments over `Robot.length`; negative: none give it, (n,) [N].
    """

    times: np.ndarray  # (n,)
    margin: np.ndarray  # (n,)

    @property
    def worst(self) -> int:
        """Row of the smallest margin."""
        return int(self.margin.argmin())

    def describe(self) -> str:
        """One line for a person."""
        least, at = self.margin[self.worst], self.times[self.worst]
        if least >= 0:
            return f"possible everywhere, capacity margin {least:.4g} N and more (least at t = {at:.3f} s)"
        share = f"{(self.margin < 0).sum()} of {len(self.margin)} places"
        return f"impossible at {share}, short by up to {-least:.4g} N (at t = {at:.3f} s)"


def rest_margin(scenario: Scenario) -> RestMargin:
    """Margins of rest at `PLACES` places, both ends among them."""
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
