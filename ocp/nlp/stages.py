"""The functions of a program's nodes and intervals: `Stages`.

They are the same for all programs of a task with the same limits, whatever their number of steps and wherever these
have rows of local limits, however their bounds are tightened, and along every path that has the same constants. Writing
and differentiating them is most of the work of building a program.

At a fixed end that lies on a bound, the value of a limit of speed is given, and its slope is a matter of the
acceleration there, which may be free. The nodes alone would permit a slope that leads beyond the bound and back before
the next one, in steps of any length.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ...base.display import Displayed
from ...models.rigid_body import aerodynamic_wrench
from ...models.rotation import rotation
from ..limits import Body, Limit, Rate
from ..limits.limits import motions as whole_motions
from ..tasks.ends import fixed_values
from ..tasks.paths import RestPath
from ..tasks.scenario import Scenario
from ..tasks.wind_set import decisive_winds
from .derivatives import Constraints, Differentiable, Part, function_of, part_of
from .grid import Grid
from .held import Spans, at_ends, held_spans
from .interval import interval_of
from .layout import MARGIN, Layout
from .rows import OTHER_COSTS, Mesh, Row, bounded, costs_at, in_world, motions, reference_symbols, spread, swept

ACCELERATION = 2  # order of a hull: of lower ones an interval has all points, its ends too
SLACK_COST = 1e2  # of a missing wrench as large as the weight
SUPPORT_COST = 1e-8  # of the ground's forces in units of the weight: enough to choose among forces of spare points
WIND_COST = 1e-2  # of the tensions in the decisive winds of a box, beside the planned ones
ON_IT = 1e-6  # of the scale of a limit: an end so near to a bound is on it


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
        elsewhere = isinstance(limit, Rate) or (limit in on_the_way and not limit.only_between)
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


class Leaving(NamedTuple):
    """Rows of an end."""

    function: Differentiable  # of its point
    rows: list[Row]
    point: int


def leaving(scenario: Scenario, layout: Layout, references: np.ndarray) -> list[Leaving]:
    """Return the rows of both ends: what is on its bound there has a slope to the inside, in parts of its scale.

    `references` are the motions at all points, (18 (1 + c), points).
    """
    if all(limit.is_convex or limit.is_equation for limit in scenario.limits):
        return []  # they hold between the nodes anyway
    ends, last, held = [], references.shape[1] - 1, held_spans(scenario, lambda _: ON_IT)
    for end, point, forwards in ((0, 0, 1.0), (-1, last, -1.0)):
        fixed = [value.column for value in fixed_values(scenario) if (value.end, value.order) == (end, 2)]
        free = [column for column in range(layout.n) if column not in fixed]
        x = ca.SX.sym("x", layout.width)
        parameters, reference = reference_symbols("p", references)
        platform, *carriers = motions(scenario, layout, x, reference)
        bodies = [ca.vertcat(*body) for body in (in_world(scenario, platform, carriers), *carriers)]
        values, rows = [], list[Row]()
        for name, slope in _slopes_outwards(scenario, end, held):
            value = forwards * slope(*bodies)
            if ca.jacobian(value, x)[:, layout.a][:, free].nnz():
                values.append(value)
                rows.append(Row(f"slope of {name}", -np.inf, 0.0))
        if rows:
            function = function_of("leaving", {"x": x}, {"p": parameters}, ca.vertcat(*values))
            ends.append(Leaving(function, rows, point))
    return ends


def _slopes_outwards(scenario: Scenario, end: int, held: dict[Limit, Spans]) -> Iterator[tuple[str, ca.Function]]:
    """Yield the names of the limits of speed that are on a bound at an end, and how fast they leave it.

    Functions are of the motions of platform and carriers, (18, 1) each. `held` is when the task fixes what each limit
    bounds.
    """
    limits, share = scenario.limits, 0.0 if end == 0 else 1.0
    if not any((share, share) in spans for spans in held.values()):
        return
    there = [motion[end] for motion in whole_motions(*at_ends(scenario))]
    bodies = [Body.symbols() for _ in there]
    others = [ca.SX.sym("t", scenario.robot.m), ca.SX.sym("off_path", 6)]
    whole = [ca.vertcat(*body) for body in bodies]
    evaluated = limits.function(*whole, *others) if limits.all else ca.SX(0, 1)
    unknown = ca.vertcat(*(acceleration for *_, acceleration in bodies), *others)
    for limit, place in zip(limits, limits.places, strict=True):
        if (share, share) not in held.get(limit, ()) or limit.is_convex or limit.is_equation:
            continue
        value, low, high = limit.rows(evaluated[place])
        if ca.depends_on(value, unknown):
            continue
        slope = ca.SX.zeros(*value.shape)
        for pose, velocity, acceleration in bodies:
            slope += ca.jtimes(value, pose, velocity) + ca.jtimes(value, velocity, acceleration)
        at = ca.Function("at", whole, [value])(*there).full().ravel()
        for i, reached in enumerate(at):
            if reached > high - ON_IT or reached < low + ON_IT:
                sign = 1.0 if reached > high - ON_IT else -1.0
                yield limit.name, ca.Function("slope", whole, [sign * slope[i]])


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
