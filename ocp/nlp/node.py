"""Write the rows and the cost of one node: the balance A t = w, and the limits that hold at an instant."""

from collections.abc import Container, Iterator, Mapping
from typing import Any

import casadi as ca
import numpy as np

from ...models.rigid_body import aerodynamic_wrench
from ...models.rotation import rotation
from ..limits import Limit, Rate
from ..tasks.scenario import Scenario
from ..tasks.wind_set import decisive_winds
from .layout import MARGIN, Layout
from .part import Constraints, Part, part_of
from .rows import OTHER_COSTS, Mesh, Row, bounded, costs_at, in_world, motions, reference_symbols, spread

ACCELERATION = 2  # order of a hull: of lower ones an interval has all points, its ends too
SLACK_COST = 1e2  # of a missing wrench as large as the weight
SUPPORT_COST = 1e-8  # of the ground's forces in units of the weight: enough to choose among forces of spare points
WIND_COST = 1e-2  # of the tensions in the decisive winds of a box, beside the planned ones


def node_of(
    scenario: Scenario,
    mesh: Mesh,
    layout: Layout,
    references: np.ndarray,
    carried: np.ndarray,
    on_the_way: Mapping[Limit, ca.Function],
) -> Part:
    """Return cost and constraints of one node: the balance A t = w and the limits that hold at an instant.

    The functions are for the nodes of these `references`, (18 (1 + c), nodes), with the load and the columns of the
    ground of each and extreme loads, `carried` (10 + 6 s + 10 k, nodes), or nothing (0, nodes). Limits `on_the_way`
    are kept between nodes.
    """
    robot, dynamics = scenario.robot, scenario.dynamics
    x, duration = ca.SX.sym("x", layout.width), ca.SX.sym("duration")
    parameters, reference = reference_symbols("p", references)
    parameters_carried, load = reference_symbols("carried", carried)
    platform, *carriers = motions(scenario, layout, x, reference)
    tensions = robot.force_scale * x[layout.tensions]
    pose_rows = [ca.vertcat(*(carrier[k].T for carrier in carriers)) for k in range(3)]
    if scenario.relative:
        A = dynamics.relative.wrench_matrix(platform[0])
        w = dynamics.relative.required_wrench(*platform, *carriers[0], wind=scenario.wind)
    else:
        A = dynamics.wrench_matrix(platform[0], pose_rows[0])
        w = dynamics.required_wrench(*platform, *pose_rows, wind=scenario.wind)
    bodies = [in_world(scenario, platform, carriers), *carriers]
    if scenario.phases.carry:
        w += _in_frame(scenario, dynamics.carried_wrench(*bodies[0], load=load[:10]), carriers)
    if layout.grounds:
        columns = ca.reshape(load[10 : 10 + 6 * layout.grounds], 6, layout.grounds)
        w -= columns @ (robot.force_scale * x[layout.supports])
    scale = robot.force_scale / robot.wrench_scale
    moving = [int(row) for row in np.flatnonzero(robot.dof_mask)]
    # Where A has other tensions too, its derivatives are shared.
    alone = not (scenario.relative or layout.winds)
    pulled = dynamics.cable_wrench(platform[0], tensions, pose_rows[0]) if alone else A @ tensions
    balance = ((pulled - w) / ca.DM(scale))[moving]
    balances = [balance]
    for i, less in enumerate(_decisive(scenario, load, bodies[0])):
        start = layout.wind_tensions.start + i * robot.m
        others = robot.force_scale * x[start : start + robot.m]
        balances.append(((A @ others - w + _in_frame(scenario, less, carriers)) / ca.DM(scale))[moving])
    whole = [ca.vertcat(*body) for body in bodies]
    cost = _node_cost(scenario, layout, x, costs_at(scenario, layout, duration, x, whole)[0])
    if mesh.elastic:
        missing = ca.reshape(x[layout.missing], 6, 1 + layout.winds)
        balances = [each - missing[moving, i] for i, each in enumerate(balances)]
        cost = OTHER_COSTS * cost + SLACK_COST * ca.sumsqr(missing)

    axes = ("fx", "fy", "fz", "mx", "my", "mz")
    in_balance = [Row(f"balance {axes[row]}", 0.0, 0.0) for _ in balances for row in moving]
    # No row says 0 = 0, such as of moments about where all cables end: IPOPT refuses more equations than unknowns.
    each_row = ca.vertsplit(ca.vertcat(*balances))
    needed = [i for i, value in enumerate(each_row) if not value.is_zero()]
    constraints: list[tuple[list[Any], list[Row]]] = [([each_row[i] for i in needed], [in_balance[i] for i in needed])]
    if robot.fixed_lengths is not None and not scenario.relative:
        lengths = dynamics.cable_lengths(platform[0], pose_rows[0])
        squares = (lengths / robot.fixed_lengths) ** 2  # no square root in the derivatives
        constraints.append(([squares], [Row(f"length of cable {i + 1}", 1.0, 1.0) for i in range(robot.m)]))
    if (place := layout.at(MARGIN)) is not None:
        low, high = (np.tile(bound / robot.force_scale, 1 + layout.winds) for bound in scenario.bounds())
        all_tensions = ca.vertcat(x[layout.tensions], x[layout.wind_tensions])
        inside = [all_tensions - x[place] - low, high - x[place] - all_tensions]
        constraints.append((inside, [Row("margin", 0.0, np.inf)] * (2 * all_tensions.numel())))
    cost += _slack_cost(scenario, mesh, layout, x)
    state = [*whole, tensions, spread(scenario, None) @ x[layout.q]]
    of_limits = _limit_rows(scenario, layout, x, state, on_the_way)
    known = {"p": parameters, "carried": parameters_carried, "duration": duration}
    return part_of("node", {"x": x}, known, cost, constraints, scenario.limits, of_limits)


def _in_frame(scenario: Scenario, wrench: ca.SX, carriers: list[list[ca.SX]]) -> ca.SX:
    """Return a wrench (6, 1) of {G} in the axes in which the balance is written."""
    if not scenario.relative:
        return wrench
    R_A = rotation(carriers[0][0][3:6])
    return ca.vertcat(R_A.T @ wrench[0:3], R_A.T @ wrench[3:6])


def _decisive(scenario: Scenario, load: ca.SX, platform: list[ca.SX]) -> list[ca.SX]:
    """Return by how much less wrench the cables must give in {G} in each decisive wind, or with each extreme load."""
    winds, robot, (pose, velocity, _) = scenario.wind_set, scenario.robot, platform
    if winds is None and not scenario.phases.extremes:
        return []
    if winds is None:
        loads = [load[:10], *ca.vertsplit(load[-10 * scenario.phases.extremes :], 10)]
        given, *others = [scenario.dynamics.carried_wrench(*platform, load=each) for each in loads]
        return [given - other for other in others]
    middle = aerodynamic_wrench(robot, pose, velocity, ca.DM(winds.middle))
    return [
        aerodynamic_wrench(robot, pose, velocity, wind) - middle
        for wind in decisive_winds(winds, robot, pose, velocity)
    ]


def _slack_cost(scenario: Scenario, mesh: Mesh, layout: Layout, x: ca.SX) -> ca.SX | float:
    """Return what exceeding the soft limits costs; those of one name share a slack."""
    weight = OTHER_COSTS if mesh.elastic else 1.0
    first = {limit.name: limit for limit in reversed(scenario.limits.all) if limit.soft}
    return sum((weight * (x[layout.slack_of(name)] * first[name].slack_weight) ** 2 for name in layout.soft), 0.0)


def _limit_rows(
    scenario: Scenario, layout: Layout, x: ca.SX, state: list[ca.SX], on_the_way: Container[Limit]
) -> Iterator[tuple[int, Constraints]]:
    """Yield index and constraints of each limit that holds at a node; `interval` has those between two points."""
    limits = scenario.limits
    if not limits.all:
        return
    evaluated = limits.function(*state)
    for index, (limit, place) in enumerate(zip(limits, limits.places, strict=True)):
        hull = limit.hull if limit.is_convex else None
        elsewhere = isinstance(limit, Rate) or limit in on_the_way
        if elsewhere or (hull is not None and (hull.order < ACCELERATION or not scenario.moves(hull))):
            continue
        yield index, bounded(limit, evaluated[place], layout.slack(x, limit))


def _node_cost(scenario: Scenario, layout: Layout, x: ca.SX, cost: ca.SX) -> ca.SX:
    """Return the cost of the task, and the little that tensions in other winds and forces of the ground cost."""
    if layout.winds:
        # Enough to choose among those that spare cables leave free.
        amount = scenario.task.objective.tension or scenario.robot.force_scale
        others = scenario.robot.force_scale * x[layout.wind_tensions] / amount
        cost += WIND_COST / layout.winds * ca.sumsqr(others)
    return cost + SUPPORT_COST * ca.sumsqr(x[layout.supports])
