"""Write the rows of an interval: exact integration, and limits that hold at every time in between."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np

from ..tasks import bernstein
from ..tasks.bernstein import Values
from ..tasks.scenario import ATTITUDE, POSITION, CarrierLimits, Scenario
from .layout import Layout
from .rows import OTHER_COSTS, Mesh, Row, differentiated, motions, reference_symbols, spread, stretch

JUMP = 0.05  # of an interval: how long a jump of the acceleration counts

__all__ = ["Interval", "Points", "interval_of", "points"]


class Points(NamedTuple):
    """Bernstein points over an interval, (k, 1) each: of the position two more than of the acceleration."""

    position: list[Values]
    speed: list[Values]
    acceleration: list[Values]


@dataclass(frozen=True)
class Interval:
    """One interval as functions of its columns: all but the end's, one below the other, and the end's.

    Attributes
    ----------
    function
        (x, x_end, p, p_end) -> (cost, values), with the reference motions p at the same points.
    flow
        (x, x_end) -> the end's motion that integration gives, from what is free at the end: its acceleration, or its
        snap; and what all nodes share.
    rows
        Names and bounds of `values`. The first are `gaps` equations: the end is what `flow` gives.
    """

    function: ca.Function
    flow: ca.Function
    rows: list[Row]
    gaps: int


def points(scenario: Scenario, layout: Layout, h: Values, h_given: float, columns: Sequence[Values]) -> Points:
    """Return the Bernstein points of the free coordinates, by integration from the first column."""
    first, last = columns[0], columns[-1]
    jerk = (first[layout.jerk] / h_given, last[layout.jerk] / h_given)
    acceleration = scenario.scheme.acceleration(h, [column[layout.a] for column in columns], jerk)
    speed = bernstein.integral(h, first[layout.v], acceleration)
    return Points(bernstein.integral(h, first[layout.q], speed), speed, acceleration)


def interval_of(scenario: Scenario, mesh: Mesh, layout: Layout, references: np.ndarray) -> Interval:
    """Return cost of jerk and constraints of one interval: integration, and limits at the Bernstein points.

    The functions are for the nodes of these `references`, (18 (1 + c), nodes).
    """
    robot, scheme = scenario.robot, scenario.scheme
    wide = 18 * (1 + len(robot.carriers))
    x, x_end = ca.SX.sym("x", layout.width * scheme.size), ca.SX.sym("x_end", layout.width)
    parameters, given_references = reference_symbols("p", np.tile(references, (scheme.size, 1)))
    parameters_end, given_end = reference_symbols("p_end", references)
    columns = [*ca.vertsplit(x, layout.width), x_end]
    referred = [*ca.vertsplit(given_references, wide), given_end]
    given = scenario.duration / mesh.steps
    h = given * stretch(layout, x)
    own = points(scenario, layout, h, given, columns)
    values: list[ca.SX] = []
    rows: list[Row] = []

    _chain_rows(layout, h, given, columns, own, values, rows)
    values.append(x_end[layout.shared] - x[layout.shared])
    rows += [("shared", 0.0, 0.0)] * len(layout.carried)
    flow = ca.Function("flow", [x, x_end], [_end(layout, h, given, columns, own)])
    gaps = len(rows)

    _inner_rows(scenario, layout, h, columns, own, values, rows)
    cost = _jerk_cost(scenario, h, own, x_end[layout.a])
    cost += _rate_rows(scenario, mesh, layout, h, columns, values, rows)
    cost *= OTHER_COSTS if mesh.elastic else 1.0
    _tube_rows(scenario, _within(layout, h, columns, own.position), values, rows)
    moving = [motions(scenario, layout, *pair) for pair in zip(columns, referred, strict=True)]
    for index, limit in scenario.free_limits(mesh.shrink).items():
        motion = [point[1 + index] for point in moving]
        jerk = [spread(scenario, index) @ column[layout.jerk] / given for column in columns] if scheme.smooth else None
        offset = [spread(scenario, index) @ column[layout.a] for column in columns]
        total = _total(scenario, h, motion, offset, jerk)
        _carrier_rows(scenario, index, limit, total, values, rows)
    inputs = [x, x_end, parameters, parameters_end]
    function = ca.Function("interval", inputs, [cost, ca.vertcat(*values)], differentiated(4, 2))
    return Interval(function, flow, rows, gaps)


def _smooth_end(layout: Layout, h: ca.SX | float, given: float, columns: list[ca.SX]) -> tuple[ca.SX, ca.SX]:
    """Return acceleration and jerk at the end, the jerk as in its column: the integrals of a linear snap."""
    first, last = columns[0], columns[-1]
    share = h / given
    snap, snap_end = first[layout.snap], last[layout.snap]
    a = first[layout.a] + share * first[layout.jerk] + share**2 / 6 * (2 * snap + snap_end)
    return a, first[layout.jerk] + share / 2 * (snap + snap_end)


def _chain_rows(
    layout: Layout,
    h: ca.SX | float,
    given: float,
    columns: list[ca.SX],
    own: Points,
    values: list[ca.SX],
    rows: list[Row],
) -> None:
    """Add rows: the end is the result of the integration."""
    x_end, n = columns[-1], layout.n
    values += [x_end[layout.q] - own.position[-1], (x_end[layout.v] - own.speed[-1]) * h]
    rows += [("position", 0.0, 0.0)] * n + [("velocity", 0.0, 0.0)] * n
    if layout.derivatives > 3:
        a, jerk = _smooth_end(layout, h, given, columns)
        values += [x_end[layout.a] - a, x_end[layout.jerk] - jerk]
        rows += [("acceleration", 0.0, 0.0)] * n + [("jerk", 0.0, 0.0)] * n


def _end(layout: Layout, h: ca.SX | float, given: float, columns: list[ca.SX], own: Points) -> ca.SX:
    """Return the end's column: motion from the integration, what is free there as it is, zeros elsewhere."""
    x_end = ca.SX.zeros(layout.width)
    x_end[layout.motion] = columns[-1][layout.motion]
    x_end[layout.tensions] = columns[-1][layout.tensions]
    x_end[layout.shared] = columns[0][layout.shared]
    x_end[layout.q], x_end[layout.v] = own.position[-1], own.speed[-1]
    if layout.derivatives > 3:
        x_end[layout.a], x_end[layout.jerk] = _smooth_end(layout, h, given, columns)
    return x_end


def _inner_rows(
    scenario: Scenario,
    layout: Layout,
    h: ca.SX | float,
    columns: list[ca.SX],
    own: Points,
    values: list[ca.SX],
    rows: list[Row],
) -> None:
    """Add rows: inner points lie on the polynomials, with equal shared unknowns; so does the start if a jumps there."""
    n = layout.n
    for share, column in zip(scenario.scheme.inner, columns[1:-1], strict=True):
        values += [column[layout.q] - bernstein.value(own.position, share)]
        values += [(column[layout.v] - bernstein.value(own.speed, share)) * h]
        values.append(column[layout.shared] - columns[0][layout.shared])
        rows += [("position", 0.0, 0.0)] * n + [("velocity", 0.0, 0.0)] * n
        rows += [("shared", 0.0, 0.0)] * len(layout.carried)
    if not scenario.scheme.continuous:
        values.append(columns[0][layout.a] - own.acceleration[0])
        rows += [("acceleration", 0.0, 0.0)] * n


def _jerk_cost(scenario: Scenario, h: ca.SX | float, own: Points, a_end: ca.SX) -> ca.SX:
    """Return the mean square of the jerk in units of the objective's.

    A jump is spread over an interval where there is no other jerk, else over a small part of one: otherwise a motion
    would jump by half and climb by half, at half the cost.
    """
    scale = scenario.task.objective.jerk
    cost, took = ca.SX(0), 1.0
    if scenario.scheme.degree:
        took = JUMP
        jerk = [point / scale for point in bernstein.derivative(h, own.acceleration)]
        cost += bernstein.mean_square(jerk, ca.dot)
    if not scenario.scheme.continuous:
        cost += ca.sumsqr((a_end - own.acceleration[-1]) / h / scale) / took
    return cost


def _rate_rows(
    scenario: Scenario,
    mesh: Mesh,
    layout: Layout,
    h: ca.SX | float,
    columns: list[ca.SX],
    values: list[ca.SX],
    rows: list[Row],
) -> ca.SX | float:
    """Add rows that limit tension rates from point to point; return what the rates cost."""
    objective, most, robot = scenario.task.objective, scenario.task.limits.tension_rate, scenario.robot
    if objective.tension_rate is None and most is None:
        return 0.0
    cost: ca.SX | float = 0.0
    places = [0.0, *scenario.scheme.inner, 1.0]
    for i, share in enumerate(np.diff(places)):
        rise = columns[i + 1][layout.tensions] - columns[i][layout.tensions]
        rate = robot.force_scale * rise / (h * float(share))
        if objective.tension_rate is not None:
            cost += float(share) * ca.sumsqr(rate / objective.tension_rate)
        if most is None:
            continue
        share_of_most = rate / (most * (1.0 - mesh.shrink))
        if (place := layout.slack_of("tension_rate")) is None:
            values.append(share_of_most)
            rows += [("tension_rate", -1.0, 1.0)] * robot.m
        else:
            for sign in (1.0, -1.0):
                values.append(sign * share_of_most - columns[0][place])
                rows += [("tension_rate", -np.inf, 1.0)] * robot.m
    return cost


def _within(layout: Layout, h: ca.SX | float, columns: list[ca.SX], position: list[ca.SX]) -> list[ca.SX]:
    first, last = columns[0], columns[-1]
    return bernstein.joined(h, position, first[layout.v], last[layout.q], last[layout.v])


def _tube_rows(scenario: Scenario, position: list[ca.SX], values: list[ca.SX], rows: list[Row]) -> None:
    tube = scenario.task.tube
    moving = [i for i, coordinate in enumerate(scenario.platform_free) if coordinate in POSITION]
    turning = [i for i, coordinate in enumerate(scenario.platform_free) if coordinate in ATTITUDE]
    if moving and np.isfinite(tube.radius):
        for q in position:
            values.append(ca.sumsqr(q[moving]) / tube.radius**2)
            rows.append(("tube", -np.inf, 1.0))
    if turning:
        for q in position[1:-1]:
            values.append(q[turning] / tube.turn)
            rows += [("tube attitude", -1.0, 1.0)] * len(turning)


def _total(
    scenario: Scenario, h: ca.SX | float, motion: list[list[ca.SX]], offset: list[ca.SX], jerk: list[ca.SX] | None
) -> Points:
    """Return the points of a carrier's whole motion, its reference taken as a polynomial of the same degree."""
    pose, velocity, total = zip(*motion, strict=True)
    slopes = None
    if jerk is not None:
        rise = (total[-1] - offset[-1] - total[0] + offset[0]) / h
        slopes = (rise + jerk[0], rise + jerk[-1])
    acceleration = scenario.scheme.acceleration(h, total, slopes)
    speed = bernstein.integral(h, velocity[0], acceleration)
    position = bernstein.joined(h, bernstein.integral(h, pose[0], speed), velocity[0], pose[-1], velocity[-1])
    return Points(position, [*speed[:-1], velocity[-1]], acceleration)


def _carrier_rows(
    scenario: Scenario, index: int, limit: CarrierLimits, total: Points, values: list[ca.SX], rows: list[Row]
) -> None:
    name = scenario.robot.carriers[index].name
    if np.isfinite(limit.low).all():
        chosen = [axis for axis in POSITION if (index, axis) in scenario.carrier_free]  # the others are constant
        for point in total.position:
            values.append(point[chosen])
            rows += [(f"{name} reach", limit.low[axis], limit.high[axis]) for axis in chosen]
    if limit.speed is not None:
        for speed in total.speed:
            values.append(ca.sumsqr(speed[0:3]) / limit.speed**2)
            rows.append((f"{name} speed", -np.inf, 1.0))
    if limit.tilt:
        for point in total.position:
            # Below 90 degrees {cos r cos p >= c} is convex, so the Bernstein points bound the whole interval.
            values.append(ca.cos(point[3]) * ca.cos(point[4]))
            rows.append((f"{name} tilt", float(np.cos(limit.tilt)), np.inf))
    for i in scenario.scheme.inner_points:  # the others are accelerations at points, which `node` limits
        acceleration = total.acceleration[i]
        if limit.acceleration is not None:
            values.append(ca.sumsqr(acceleration[0:3]) / limit.acceleration**2)
            rows.append((f"{name} acceleration", -np.inf, 1.0))
        if limit.tilt and limit.turn_acceleration is not None:
            values.append(acceleration[3:5] / limit.turn_acceleration)
            rows += [(f"{name} turn acceleration", -1.0, 1.0)] * 2
