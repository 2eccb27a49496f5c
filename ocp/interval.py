"""What a program asks of two neighbouring nodes: exact integration, and limits that hold at every time in between."""

from __future__ import annotations

import casadi as ca
import numpy as np

from . import spline
from .layout import Layout
from .rows import OTHER_COSTS, Mesh, Row, motions, stretch
from .scenario import ATTITUDE, POSITION, CarrierLimits, Scenario

__all__ = ["interval_function"]


def interval_function(scenario: Scenario, mesh: Mesh, layout: Layout) -> tuple[ca.Function, list[Row]]:
    """Cost of jerk and constraints of one interval: integration, and limits at the Bernstein points."""
    robot, n = scenario.robot, layout.n
    x, x_end = ca.SX.sym("x", layout.width), ca.SX.sym("x_end", layout.width)
    parameters = ca.SX.sym("p", 18 * (1 + len(robot.carriers)))
    parameters_end = ca.SX.sym("p_end", 18 * (1 + len(robot.carriers)))
    h = scenario.duration / mesh.steps * stretch(layout, x)
    start, end = ((column[layout.q], column[layout.v], column[layout.a]) for column in (x, x_end))
    objective = scenario.task.objective
    cost = ca.sumsqr((end[2] - start[2]) / h / objective.jerk)
    tension_rate = robot.force_scale * (x_end[layout.tensions] - x[layout.tensions]) / h
    if objective.tension_rate is not None:
        cost += ca.sumsqr(tension_rate / objective.tension_rate)
    cost *= OTHER_COSTS if mesh.elastic else 1.0

    q_defect, v_defect = spline.defects(h, start, end)
    values: list[ca.SX] = [q_defect, v_defect * h, x_end[layout.shared] - x[layout.shared]]
    rows: list[Row] = [("position", 0.0, 0.0)] * n + [("velocity", 0.0, 0.0)] * n
    rows += [("shared", 0.0, 0.0)] * len(layout.carried)
    if (most := scenario.task.limits.tension_rate) is not None:
        keep = most * (1.0 - mesh.shrink)
        if (place := layout.slack_of("tension_rate")) is None:
            values.append(tension_rate / keep)
            rows += [("tension_rate", -1.0, 1.0)] * robot.m
        else:
            for sign in (1.0, -1.0):
                values.append(sign * tension_rate / keep - x[place])
                rows += [("tension_rate", -np.inf, 1.0)] * robot.m

    _tube_rows(scenario, h, start, end, values, rows)
    before, after = (motions(scenario, layout, *pair)[1:] for pair in ((x, parameters), (x_end, parameters_end)))
    for index, limit in scenario.free_limits(mesh.shrink).items():
        _carrier_rows(robot.carriers[index].name, limit, h, before[index], after[index], values, rows)
    return ca.Function("interval", [x, x_end, parameters, parameters_end], [cost, ca.vertcat(*values)]), rows


def _tube_rows(
    scenario: Scenario, h: ca.SX | float, start: tuple, end: tuple, values: list[ca.SX], rows: list[Row]
) -> None:
    tube = scenario.task.tube
    inner = spline.position_points(h, start[0], start[1], end[0], end[1])
    moving = [i for i, coordinate in enumerate(scenario.platform_free) if coordinate in POSITION]
    turning = [i for i, coordinate in enumerate(scenario.platform_free) if coordinate in ATTITUDE]
    if moving and np.isfinite(tube.radius):
        for q in (start[0], *inner, end[0]):
            values.append(ca.sumsqr(q[moving]) / tube.radius**2)
            rows.append(("tube", -np.inf, 1.0))
    if turning:
        for q in inner:
            values.append(q[turning] / tube.turn)
            rows += [("tube attitude", -1.0, 1.0)] * len(turning)


def _carrier_rows(
    name: str,
    limit: CarrierLimits,
    h: ca.SX | float,
    start: list[ca.SX],
    end: list[ca.SX],
    values: list[ca.SX],
    rows: list[Row],
) -> None:
    inner = spline.position_points(h, start[0], start[1], end[0], end[1])
    if np.isfinite(limit.low).all():
        for point in (start[0], *inner, end[0]):
            values.append(point[0:3])
            rows += [(f"{name} reach", low, high) for low, high in zip(limit.low, limit.high, strict=True)]
    if limit.speed is not None:
        for speed in (start[1], spline.speed_point(h, start[1], start[2]), end[1]):
            values.append(ca.sumsqr(speed[0:3]) / limit.speed**2)
            rows.append((f"{name} speed", -np.inf, 1.0))
    if limit.tilt:
        for point in (start[0], *inner, end[0]):
            # Below 90 degrees {cos r cos p >= c} is convex, so the Bernstein points bound the whole interval.
            values.append(ca.cos(point[3]) * ca.cos(point[4]))
            rows.append((f"{name} tilt", float(np.cos(limit.tilt)), np.inf))
