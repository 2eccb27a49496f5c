"""Turn what a user lets the planner start from, a plan or a path, into a deviation from the references."""

from typing import Any

import numpy as np
from pydantic import Field

from ...base.errors import InputError
from ...base.inputs import shown
from ...models.parsing import validate
from ...models.part import Part
from ..nlp.guess import initial_guess
from ..plan import Plan
from ..tasks.deviation import Deviation
from ..tasks.paths import AnyPath, PathBase, RestPath
from ..tasks.scenario import Scenario
from ..timing.fastest_law import FastestLaw


class _Start(Part):
    """A path that stands alone, checked as a task's is."""

    start: AnyPath = Field(description="for the platform to start from")


def deviation_from(scenario: Scenario, start: Plan | AnyPath | dict[str, Any]) -> Deviation | None:
    """Return the deviation of a start from the references of `scenario`; None if the task fixes the motion.

    Raises `InputError` if the start is not one of the accepted types, or does not fit the scenario.
    """
    if isinstance(start, Plan):
        return _of_plan(scenario, start)
    if isinstance(start, dict):
        start = validate({"start": start}, _Start, "plan").start
    if not isinstance(start, PathBase):
        raise InputError(f"start must be a Plan, a path or a mapping with its keys, got {shown(start)}")
    return _along(scenario, start, {}, start.natural_duration or scenario.duration)


def _of_plan(scenario: Scenario, start: Plan) -> Deviation | None:
    """Return a plan's own deviation, stretched to this scenario's duration."""
    if start.deviation is None:
        return None if start.law is None else _of_law(scenario, start.law)
    theirs = start.deviation
    if start.scenario.owners() != scenario.owners() or theirs.tensions.shape[1] != scenario.robot.m:
        raise InputError(
            "start must be a plan whose robot, tube and base leave the same coordinates free, got one of "
            f"{start.scenario.robot.name!r} for {start.scenario.task.name!r}"
        )
    return _lasting(scenario, theirs)


def _of_law(scenario: Scenario, law: FastestLaw) -> Deviation | None:
    robot = law.parametrised.robot
    if not law.exists:
        raise InputError("start must be a plan with a time law, got one of time_along without")
    if robot.name != scenario.robot.name or robot.m != scenario.robot.m:
        raise InputError(f"start must be a plan of robot {scenario.robot.name!r}, got one of {robot.name!r}")
    carriers: dict[int, AnyPath] = {
        index: path for index, path in law.carrier_paths.items() if not isinstance(path, RestPath)
    }
    return _along(scenario, law.path, carriers, law.path.natural_duration or scenario.duration)


def _along(scenario: Scenario, path: AnyPath, carriers: dict[int, AnyPath], seconds: float) -> Deviation | None:
    """Return the deviation of a platform on `path` and of carriers on theirs, or where the planner guesses them."""
    if path.frame != scenario.path.frame:
        raise InputError(f"start.frame must be {scenario.path.frame!r}, as in the task's path, got {path.frame!r}")
    if scenario.count == 0:
        return None
    nodes = np.linspace(0.0, seconds, scenario.task.steps + 1)
    there = scenario.along(path, seconds)
    about = initial_guess(there, nodes)
    mine, bases = scenario.lasting(seconds).references(nodes)
    given = [owner is None or owner in carriers for owner, _ in scenario.owners()]
    theirs = [carriers[i].at(nodes, seconds) if i in carriers else base for i, base in enumerate(bases)]
    values = []
    for k, guessed in enumerate((about.q, about.v, about.a)):
        off = np.stack([its[k] - base[k] for its, base in zip(theirs, bases, strict=True)], axis=1)
        values.append(np.where(given, scenario.free_of(there.references(nodes)[0][k] - mine[k], off), guessed))
    q, v, a = values
    return _lasting(scenario, Deviation(nodes, q, v, a, about.tensions))


def _lasting(scenario: Scenario, theirs: Deviation) -> Deviation:
    """Return the deviation stretched to the scenario's duration, or if that is open, to its own inside the range."""
    seconds, span = scenario.duration, scenario.duration_range
    if span is not None:
        seconds = float(np.clip(theirs.nodes[-1], span.min, span.max))
    return theirs.stretched(seconds / theirs.nodes[-1])
