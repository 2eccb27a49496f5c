"""Order a program's unknowns and rows: all at once for IPOPT, stage by stage for fatrop.

fatrop factorises along the time: each stage k has states x_k and controls u_k, its dynamics x_{k+1} = F(x_k, u_k), and
rows of x_k and u_k alone. The state of a node is its motion and what all nodes share; its tensions too, if their rates
count. Controls are the rest of its column, the columns of the interval's inner points, and what is free of the next
state (its acceleration, or its snap). Rows of an interval that contain its end contain F in its place.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np

from ..limits import Rate
from ..tasks.scenario import Scenario
from .derivatives import Block
from .grid import Grid
from .held import eased
from .layout import Layout

__all__ = ["Stages", "Unknowns", "all_at_once", "put_in_order", "stage_by_stage"]


class Stages(NamedTuple):
    """Sizes of the stages 0 to N: states, controls and rows of each."""

    states: list[int]
    controls: list[int]
    rows: list[int]


class Unknowns(NamedTuple):
    """A program's unknowns, and the columns that they make.

    Attributes
    ----------
    columns
        (width, points), zero where a point has no such unknown.
    ends
        (width, N), the column at the end of each interval, as the interval's rows contain it.
    order
        The place of each unknown among the entries of the columns, one column after the other.
    copies
        The unknowns that repeat such an entry, as controls of the stage before.
    gaps
        x_{k+1} - F(x_k, u_k), (states, N); None where the interval's own rows contain it.
    controls
        The number of controls of each stage; empty where there are no stages.
    where
        (width, points), the place of each entry of the columns in x, -1 where there is none; None where columns contain
        more than unknowns.
    """

    x: ca.MX
    columns: ca.MX
    ends: ca.MX
    order: np.ndarray
    copies: np.ndarray
    gaps: ca.MX | None
    controls: list[int]
    where: np.ndarray | None = None


def _exists(scenario: Scenario, layout: Layout, steps: int) -> np.ndarray:
    """Return which entries of the columns exist, (points, width): tensions and slacks only where there is a balance."""
    scheme = scenario.scheme
    there = np.zeros((steps * scheme.size + 1, layout.width), dtype=bool)
    there[scheme.balance_points(steps)] = True
    there[:, layout.motion] = there[:, layout.shared] = True
    return there


def _gathered(x: ca.MX, where: np.ndarray) -> ca.MX:
    """Return a matrix of entries of x, zero for a place of -1; each row of `where` has the places of a column."""
    flat = where.ravel()
    if np.array_equal(flat, np.arange(x.numel())):
        return ca.reshape(x, where.shape[1], -1)
    places = np.where(flat < 0, x.numel(), flat)
    return ca.reshape(ca.vertcat(x, 0.0)[places.tolist()], where.shape[1], -1)


def all_at_once(scenario: Scenario, layout: Layout, grid: Grid, flow: ca.Function) -> Unknowns:
    """Return the unknowns point after point, each of them once."""
    steps = len(grid.steps)
    there = _exists(scenario, layout, steps)
    order = np.flatnonzero(there)
    where = np.full(there.size, -1)
    where[order] = np.arange(len(order))
    where = where.reshape(there.shape)
    x = ca.MX.sym("x", len(order))
    columns = _gathered(x, where)
    size = scenario.scheme.size
    return Unknowns(x, columns, columns[:, size::size], order, np.zeros(len(order), dtype=bool), None, [], where.T)


def stage_by_stage(scenario: Scenario, layout: Layout, grid: Grid, flow: ca.Function) -> Unknowns:
    """Return the unknowns stage after stage: the state, then the controls."""
    steps = len(grid.steps)
    there, width, size = _exists(scenario, layout, steps), layout.width, scenario.scheme.size
    state, free = _parts(scenario, layout)
    order: list[int] = []
    ends = np.full((steps, width), -1)
    copies: list[int] = []
    controls = []
    for k in range(steps + 1):
        points = there[k * size : (k + 1) * size].copy()
        points[0, state] = False
        own = np.flatnonzero(points) + k * size * width
        order += [*(k * size * width + state), *own]
        if k < steps:
            ends[k, free] = np.arange(len(free)) + len(order)
            copies += ends[k, free].tolist()
            order += ((k + 1) * size * width + free).tolist()
        controls.append(len(own) + (len(free) if k < steps else 0))
    places = np.array(order)
    copied = np.zeros(len(places), dtype=bool)
    copied[copies] = True
    where = np.full(there.size, -1)
    where[places[~copied]] = np.flatnonzero(~copied)
    x = ca.MX.sym("x", len(places))
    columns = _gathered(x, where.reshape(there.shape))
    groups = ca.reshape(columns[:, :-1], width * size, -1)
    # A smooth scheme's acceleration follows from its snap first, then the rest from its acceleration.
    end = _gathered(x, ends)
    for _ in range(1 + scenario.scheme.smooth):
        end = flow.map(steps)(groups, end, ca.DM(grid.intervals))
    gaps = columns[state.tolist(), size::size] - end[state.tolist(), :]
    return Unknowns(x, columns, end, places, copied, gaps, controls)


def _parts(scenario: Scenario, layout: Layout) -> tuple[np.ndarray, np.ndarray]:
    """Return which entries of a node's column are its state, and which of those the stage before chooses."""
    at = np.arange(layout.width)
    limited = any(isinstance(limit, Rate) for limit in scenario.limits)
    rated = limited or scenario.task.objective.tension_rate is not None
    tensions = at[layout.tensions] if rated else at[:0]
    top = layout.snap if scenario.scheme.smooth else layout.a
    return np.concatenate([at[layout.motion], at[layout.shared], tensions]), np.concatenate([at[top], tensions])


def put_in_order(unknowns: Unknowns, blocks: list[Block], grid: Grid) -> tuple[ca.MX, np.ndarray, Stages | None]:
    """Return all rows as one column with their bounds, (k, 2); in a program with stages stage by stage, gaps first."""
    nodes = np.concatenate([[0.0], np.cumsum(grid.steps)]) / grid.steps.sum()
    bounds = np.concatenate([_bounds(block, nodes) for block in blocks])
    values = ca.vertcat(*(ca.vec(block.values) for block in blocks))
    if unknowns.gaps is None:
        return values, bounds, None
    states, steps = unknowns.gaps.shape
    bounds = np.concatenate([np.zeros((states * steps, 2)), bounds])
    values = ca.vertcat(ca.vec(unknowns.gaps), values)
    own = np.concatenate([np.repeat(block.stages, len(block.rows)) for block in blocks])
    stage = np.concatenate([np.repeat(np.arange(steps), states), own])
    order = np.argsort(stage, kind="stable")
    counts = np.bincount(own, minlength=steps + 1)
    sizes = Stages([states] * (steps + 1), unknowns.controls, counts.tolist())
    return values[order.tolist()], bounds[order], sizes


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
