"""Solve a program from the solutions of easier ones: slower, coarser, with linear distances (`from_easier`)."""

from dataclasses import replace

import numpy as np

from ..limits.places import CablesOutside
from ..nlp.guess import balanced
from ..nlp.near import has_places, jumps
from ..nlp.rows import CABLES, MANY, Mesh
from ..nlp.solver import CIRCLING, Outcome
from ..tasks.deviation import Deviation
from .search import Search

COARSE = 50  # steps: from four times as many on, the program of so few is solved first
COARSE_OF_MANY = 25  # steps, the same where much is free: a team's program of 100 steps then takes a third of the time
# At least, past regions: half the steps then lead to more plans, in two thirds of the time.
COARSE_PAST_PLACES = 30
SLOWER = 3.0  # than the duration that the planner starts from


def from_easier(search: Search, mesh: Mesh, start: Deviation | None, guessed: bool, another: bool = False) -> Outcome:
    """Solve the program from a motion that is nearer to its solution than `start`, if there is one.

    If there is `another` start, the coarse program without a solution is the outcome: a fine one takes far longer.
    """
    if search.knows(mesh):
        return search.solve("nonlinear program", mesh, start)
    coarse = _coarse(search, mesh) if guessed else None
    near = _slowly(search, coarse or mesh, start) if guessed else None
    linear = search.approach(coarse or mesh, near or start)
    near = near if linear is None else linear.deviation
    optimal = False
    if coarse is not None:
        outcome = search.solve("coarse program", coarse, near or start, clear=near is not None)
        # Through a region between its nodes it is on no side of it: finer programs would end far from where they begin.
        ends = outcome.success or outcome.message == CIRCLING
        optimal = ends and not jumps(search.scenario, outcome.deviation)
        near = outcome.deviation if optimal else near
        if another and not ends:
            return outcome
    # Linear distances leave a motion at their bounds. From a small barrier the program would creep along them.
    outcome = search.solve("nonlinear program", mesh, near or start, coarser=optimal, clear=near is not None)
    if guessed and outcome.success and _cable_jumps(search, mesh, outcome.deviation):
        swept = replace(mesh, between=(CABLES,))
        again = from_easier(search, swept, start, guessed)
        if again.success:
            search.between = swept.between  # of later meshes too
            return again
    if outcome.success or near is None or search.seconds_left <= 0:
        return outcome
    return search.solve("nonlinear program", mesh, start)


def _slowly(search: Search, mesh: Mesh, start: Deviation | None) -> Deviation | None:
    """Return a team's motion past obstacles that begins with a slower one; None if there is none.

    The slower a motion is, the less must its carriers tilt, and a guess that is balanced at rest is nearly balanced.
    """
    scenario, span = search.scenario, search.scenario.duration_range
    if scenario.count <= MANY or not scenario.stretches:
        return None
    slow = scenario.held(SLOWER * scenario.duration if span is None else min(SLOWER * scenario.duration, span.max))
    if start is not None:
        # As few nodes as the mesh has: what is sharp between them would tilt carriers as no limit lets them.
        nodes = np.linspace(0.0, slow.duration, mesh.steps + 1)
        start = balanced(slow, start.stretched(slow.duration / start.nodes[-1]).at(nodes))
    linear = search.approach(mesh, start, slow)
    if linear is None:
        return None
    return linear.deviation.stretched(scenario.duration / slow.duration) if span is None else linear.deviation


def _cable_jumps(search: Search, mesh: Mesh, motion: Deviation) -> bool:
    """Return whether a motion jumps over a region, and a mesh with rows of cables between its nodes could prevent it.

    A cable on the far side at one node and on the near side at the next does not come out of there on finer meshes.
    """
    scenario = search.scenario
    possible = CABLES not in mesh.between and scenario.count <= MANY and search.seconds_left > 0
    possible = possible and any(isinstance(limit, CablesOutside) for limit in scenario.limits)
    return possible and jumps(scenario, motion)


def _coarse(search: Search, mesh: Mesh) -> Mesh | None:
    """Return the mesh whose optimum the program of the task's own starts from; None if that would save no time."""
    scenario = search.scenario
    steps, coarse, times = scenario.task.steps, COARSE, 4
    if scenario.count > MANY:
        coarse, times = COARSE_OF_MANY, 2 if has_places(scenario) else 4
    elif has_places(scenario):
        coarse, times = min(max(steps // 2, COARSE_PAST_PLACES), COARSE), 2
    return replace(mesh, steps=coarse) if steps >= times * coarse else None
