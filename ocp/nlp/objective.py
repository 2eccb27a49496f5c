"""Evaluate the costs of a task in the columns of a program."""

from collections.abc import Sequence
from typing import Any

import casadi as ca

from ..tasks.scenario import Scenario
from .layout import MARGIN, Layout
from .rows import differentiated, offsets, stretch


def costs_at(scenario: Scenario, layout: Layout, x: ca.SX, bodies: Sequence[ca.SX]) -> tuple[ca.SX, ca.SX]:
    """Return what costs in column x, and the values whose rates cost, in amounts (`Costs.function`).

    `bodies` are the motions of the platform in {G} and of the carriers, (18, 1) each.
    """
    force, place = scenario.robot.force_scale, layout.at(MARGIN)
    duration = scenario.duration * stretch(layout, x)
    margin = 0.0 if place is None else force * x[place]
    tensions = force * x[layout.tensions]
    inputs = [*bodies, *offsets(scenario, layout, x), tensions, duration, margin]
    outputs: Any = scenario.costs.function.call(inputs)
    return tuple(outputs)


def cost_function(
    name: str,
    cost: ca.SX,
    unknowns: dict[str, ca.SX],
    parameters: dict[str, ca.SX],
    last: dict[str, ca.SX] | None = None,
) -> ca.Function:
    """Return the function of a cost, whose inputs have parameters only where it depends on them."""
    depends = any(ca.depends_on(cost, each) for each in parameters.values())
    inputs = unknowns | (parameters if depends else {}) | (last or {})
    names = list(inputs)
    options = differentiated(len(names), len(unknowns))
    return ca.Function(name, list(inputs.values()), [cost], names, ["cost"], options)
