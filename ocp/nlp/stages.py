"""The functions of a program's nodes and intervals: `Stages`.

They are the same for all programs of a task with the same limits, whatever their number of steps and wherever these
have rows of local limits, however their bounds are tightened, and along every path that has the same constants. Writing
and differentiating them is most of the work of building a program.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ...base.display import Displayed
from ..tasks.paths import RestPath
from ..tasks.scenario import Scenario
from .grid import Grid
from .interval import interval_of
from .layout import Layout
from .leaving import Leaving, leaving
from .node import node_of
from .part import Part
from .rows import Mesh, swept


@dataclass(frozen=True)
class Stages(Displayed):
    """Nodes and intervals of a program as functions, and the numbers of which these are functions too."""

    key: tuple[object, ...]  # what the functions are made of, besides the constants of references and loads
    scenario: Scenario
    mesh: Mesh
    layout: Layout
    grid: Grid
    references: np.ndarray  # `reference_motions` at all points
    carried: np.ndarray  # loads and columns of the ground at all points, see `node_of`
    node: Part
    interval: Part
    ends: list[Leaving]

    @staticmethod
    def of(scenario: Scenario, mesh: Mesh, movable: bool = False, known: Iterable[Stages] = ()) -> Stages:
        """Return the stages of a scenario on a mesh, with the functions of `known` ones if they are the same.

        With a `movable` one references and lengths of intervals may change.
        """
        layout, grid, thin = Layout.of(scenario, mesh.elastic), Grid.of(scenario, mesh.steps), swept(scenario, mesh)
        # The unknowns of a smooth scheme are in units of an interval's length.
        unit = (scenario.duration, mesh.steps) if scenario.scheme.smooth else ()
        # The layout says whether the duration is an unknown; which ones are allowed is a matter of bounds.
        undated = scenario.task.model_copy(update={"duration": None})
        same = layout, undated, id(scenario.limits), id(scenario.tightened), *map(id, thin)
        key = *same, scenario.passing, mesh.elastic, mesh.between, *unit
        times = grid.shares * scenario.duration
        numbers = reference_motions(scenario, times), _carried(scenario, times)
        shown = _made_to_vary(scenario, numbers[0]) if movable else numbers[0]
        for its in known:
            if (
                its.key == key
                and _same_constants(its.references, numbers[0])
                and _same_constants(its.carried, numbers[1])
            ):
                node, interval = its.node, its.interval
                break
        else:
            node = node_of(scenario, mesh, layout, shown, numbers[1], thin)
            interval = interval_of(scenario, mesh, layout, shown, thin)
        ends = [] if movable else leaving(scenario, layout, numbers[0])
        return Stages(key, scenario, mesh, layout, grid, *numbers, node, interval, ends)


def _same_constants(known: np.ndarray, values: np.ndarray) -> bool:
    """Return whether what is constant in the columns of `known` has the same value in all of `values`."""
    constant = np.ptp(known, axis=1) == 0.0
    return bool((values[constant] == known[constant, :1]).all())


def reference_motions(scenario: Scenario, nodes: np.ndarray) -> np.ndarray:
    """Return the reference motions, one column per node: platform, then carriers; pose, velocity, acceleration."""
    platform, carriers = scenario.references(nodes)
    return np.hstack([part for motion in (platform, *carriers) for part in motion]).T


def _carried(scenario: Scenario, nodes: np.ndarray) -> np.ndarray:
    """Return loads, columns of the ground and extreme loads, (10 + 6 s + 10 k, nodes); (0, nodes) for none."""
    phases = scenario.phases
    if not (phases.carry or phases.rest):
        return np.zeros((0, len(nodes)))
    columns = phases.columns_at(nodes).swapaxes(1, 2).reshape(len(nodes), -1)
    return np.hstack([phases.loads_at(nodes), columns, *(phases.loads_at(nodes, k) for k in range(phases.extremes))]).T


def _made_to_vary(scenario: Scenario, references: np.ndarray) -> np.ndarray:
    """Return references that are constant only where all motions of a movable program are: carriers without a path."""
    varies = np.zeros((1 + len(scenario.robot.carriers), 18, 1))
    varies[0] = 1.0
    for index, path in scenario.carrier_paths.items():
        varies[1 + index] = not isinstance(path, RestPath)
    return np.hstack([references, references + varies.reshape(-1, 1)])
