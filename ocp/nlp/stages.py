"""The functions of a program's nodes and intervals: `Stages`.

They are the same for all programs of a scenario with so many steps, wherever these have rows of local limits and
however their bounds are tightened. Writing and differentiating them is most of the work of building a program.
"""

from __future__ import annotations

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
from .rows import Mesh


@dataclass(frozen=True)
class Stages(Displayed):
    """Nodes and intervals of a program as functions, and the numbers of which these are functions too."""

    layout: Layout
    grid: Grid
    references: np.ndarray  # `reference_motions` at all points
    carried: np.ndarray  # loads and columns of the ground at all points, see `node_of`
    node: Part
    interval: Part
    ends: list[Leaving]

    @staticmethod
    def of(scenario: Scenario, mesh: Mesh, movable: bool = False) -> Stages:
        """Return those of a scenario on a mesh; with a `movable` one references and lengths of intervals may change."""
        layout, grid = Layout.of(scenario, mesh.elastic), Grid.of(scenario, mesh.steps)
        times = grid.shares * scenario.duration
        references, carried = reference_motions(scenario, times), _carried(scenario, times)
        shown, lengths = references, grid.intervals
        if movable:
            shown, lengths = _made_to_vary(scenario, references), np.hstack([lengths, lengths * [[2.0], [1.0]]])
        node = node_of(scenario, mesh, layout, shown, carried)
        interval = interval_of(scenario, mesh, layout, shown, lengths)
        ends = [] if movable else leaving(scenario, layout, references)
        return Stages(layout, grid, references, carried, node, interval, ends)


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
