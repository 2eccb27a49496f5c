"""Prove that a load is too heavy for the cables or the carriers: `too_heavy`.

From one rest of the platform to another the mean of its acceleration is zero, so the mean of the force on it is its
weight with its load. No cable gives more than its largest tension in any direction, and no actuator more than its
largest force. If the carriers are at rest at both times too, their actuators hold the weight of all.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..audits.excess import Excess
from ..tasks.scenario import Scenario

OF_WEIGHT = ("t_max", "thrust_max")  # limits that are too small together
CERTAIN = 1e-6  # of the weight


class _Span(NamedTuple):
    """A time from one rest of the platform to another, in which it hangs with one load [kg]."""

    start: float
    end: float
    load: float
    carriers_rest: bool


def too_heavy(scenario: Scenario, rests: np.ndarray) -> Iterator[Excess]:
    """Yield the largest forces that are too small together.

    `rests` states which of platform and carriers are at rest, in {G}, at the start and at the end: (2, 1 + c) of bool.
    """
    robot = scenario.robot
    gravity = float(np.linalg.norm(np.array(robot.gravity) * robot.dof_mask[:3]))
    spans = list(_spans(scenario, rests))
    if scenario.wind is not None or not gravity or not spans:
        return
    platform = gravity * robot.platform.mass
    yield from _unless(platform, float(robot.t_max.sum()), "t_max", "cables", "platform and load", gravity, spans)
    bodies = [carrier.body for carrier in robot.carriers]
    held = [span for span in spans if span.carriers_rest]
    if held and robot.dof_mask[:3].all() and all(body is not None for body in bodies):
        weight = platform + gravity * sum(body.mass for body in bodies if body is not None)
        most = sum(carrier.force_max for carrier in robot.carriers)
        yield from _unless(weight, most, "thrust_max", "carriers", "platform, load and carriers", gravity, held)


def _unless(
    weight: float, most: float, limit: str, what: str, of: str, gravity: float, spans: list[_Span]
) -> Iterator[Excess]:
    """Yield an excess if `most` [N] is less than `weight` [N] with the heaviest load."""
    span = max(spans, key=lambda span: span.load)
    needed = weight + gravity * span.load
    if most < needed * (1 - CERTAIN):
        why = f"the bound is the weight of {of}"
        yield Excess(limit, f"all {what} together", span.start, most, needed, "N", "at least", why)


def _spans(scenario: Scenario, rests: np.ndarray) -> Iterator[_Span]:
    """Yield the longest spans."""
    phases = scenario.phases.all
    if not phases:
        if rests[:, 0].all():
            yield _Span(0.0, scenario.duration, 0.0, bool(rests.all()))
        return
    on_ground = np.array([True] + [False] * (rests.shape[1] - 1))
    first = 0
    for index, phase in enumerate(phases):
        last = index + 1 == len(phases)
        if phase.rests:
            first = index + 1
        elif last or phases[index + 1].rests:
            begins, ends = rests[0] if first == 0 else on_ground, rests[1] if last else on_ground
            loads = [each.load for each in phases[first : index + 1]]
            if begins[0] and ends[0] and all(np.array_equal(loads[0], load) for load in loads):
                yield _Span(phases[first].start, phase.end, float(loads[0][0]), bool((begins & ends).all()))
