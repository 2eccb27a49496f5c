"""The unknowns of a program, point after point, and its rows with their bounds, one below the other."""

from typing import NamedTuple

import casadi as ca
import numpy as np

from ..tasks.scenario import Scenario
from .derivatives import Block
from .grid import Grid
from .held import eased
from .layout import Layout


class Unknowns(NamedTuple):
    """A program's unknowns, and the columns that they make."""

    x: ca.MX
    columns: ca.MX  # (width, points)
    ends: ca.MX  # (width, N), the column at the end of each interval
    where: np.ndarray  # (width, points), the place of each entry of the columns in x


def unknowns_of(scenario: Scenario, layout: Layout, steps: int) -> Unknowns:
    """Return the unknowns of all points, each of them once."""
    size = scenario.scheme.size
    points = steps * size + 1
    x = ca.MX.sym("x", points * layout.width)
    columns = ca.reshape(x, layout.width, points)
    where = np.arange(points * layout.width).reshape(points, layout.width).T
    return Unknowns(x, columns, columns[:, size::size], where)


def stacked(blocks: list[Block], grid: Grid) -> tuple[ca.MX, np.ndarray]:
    """Return all rows as one column, with their bounds, (k, 2)."""
    nodes = np.concatenate([[0.0], np.cumsum(grid.steps)]) / grid.steps.sum()
    bounds = np.concatenate([_bounds(block, nodes) for block in blocks])
    return ca.vertcat(*(ca.vec(block.values) for block in blocks)), bounds


def _bounds(block: Block, nodes: np.ndarray) -> np.ndarray:
    """Return the bounds of a block's rows, one stage after the other, (k, 2): tightened where the task permits it.

    `nodes` are where the stages begin, as shares of the duration. A row of a stage may be about all of it.
    """
    first, last = nodes[block.stages], nodes[np.minimum(block.stages + 1, len(nodes) - 1)]
    parts = {held: eased(held, first, last) for held in {row.held for row in block.rows}}
    bounds = np.empty((len(block.stages), len(block.rows), 2))
    for i, row in enumerate(block.rows):
        bounds[:, i, 0] = row.low + parts[row.held] * row.tighter[0]
        bounds[:, i, 1] = row.high - parts[row.held] * row.tighter[1]
    return bounds.reshape(-1, 2)
