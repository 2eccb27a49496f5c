"""Write the rows of an interval: exact integration, and limits that hold at every time in between."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from itertools import chain, pairwise
from typing import NamedTuple, TypeAlias

import casadi as ca
import numpy as np

from ..audits.excess import TENSIONS
from ..limits import Limit, Rate
from ..tasks import bernstein
from ..tasks.bernstein import Values
from ..tasks.scenario import Scenario
from .derivatives import Constraints, Part, part_of
from .layout import DURATION, Layout
from .rows import OTHER_COSTS, Mesh, Row, bounded, costs_at, in_world, motions, reference_symbols, spread, stretch

TAKE_UP = 3.0  # cost of a rate on the ground: with so much, tensions rise there nearly linearly


_Whole: TypeAlias = Callable[[], list[list[ca.SX]]]  # the motions in {G} at all points, (18, 1) each


class Points(NamedTuple):
    """Bernstein points over an interval, (k, 1) each: of the position two more than of the acceleration."""

    position: list[Values]
    speed: list[Values]
    acceleration: list[Values]


def points(scenario: Scenario, layout: Layout, h: Values, h_given: float, columns: Sequence[Values]) -> Points:
    """Return the Bernstein points of the free coordinates, by integration from the first column."""
    first, last = columns[0], columns[-1]
    jerk = (first[layout.jerk] / h_given, last[layout.jerk] / h_given)
    acceleration = scenario.scheme.acceleration(h, [column[layout.a] for column in columns], jerk)
    speed = bernstein.integral(h, first[layout.v], acceleration)
    return Points(bernstein.integral(h, first[layout.q], speed), speed, acceleration)


def interval_of(
    scenario: Scenario, mesh: Mesh, layout: Layout, references: np.ndarray, on_the_way: Mapping[Limit, ca.Function]
) -> Part:
    """Return cost of jerk and constraints of one interval: integration, and limits at the Bernstein points.

    The functions are for the nodes of these `references`, (18 (1 + c), nodes), with the distances that are kept
    `on_the_way` from point to point.
    """
    robot, scheme = scenario.robot, scenario.scheme
    wide = 18 * (1 + len(robot.carriers))
    x, x_end = ca.SX.sym("x", layout.width * scheme.size), ca.SX.sym("x_end", layout.width)
    parameters, given_references = reference_symbols("p", np.tile(references, (scheme.size, 1)))
    parameters_end, given_end = reference_symbols("p_end", references)
    columns = [*ca.vertsplit(x, layout.width), _of_leg(scenario, layout, x, x_end, given_end)]
    referred = [*ca.vertsplit(given_references, wide), given_end]
    numbers, duration = ca.SX.sym("grid", 2), ca.SX.sym("duration")
    step, take_up = ca.vertsplit(numbers)
    given = scenario.duration / mesh.steps
    h = step * stretch(layout, x)
    own = points(scenario, layout, h, given, columns)
    constraints = [_chain_rows(layout, h, given, columns, x_end, own), *_inner_rows(scenario, layout, h, columns, own)]

    # Many tasks need neither of these, which take a tenth of the time of building.
    @cache
    def moving() -> list[list[list[ca.SX]]]:
        return [motions(scenario, layout, *pair) for pair in zip(columns, referred, strict=True)]

    @cache
    def whole() -> list[list[ca.SX]]:
        all_bodies = [(in_world(scenario, bodies[0], bodies[1:]), *bodies[1:]) for bodies in moving()]
        return [[ca.vertcat(*body) for body in bodies] for bodies in all_bodies]

    # The mean square of the jerk, and what rates cost.
    jerks = [point / scenario.costs.jerk for point in bernstein.derivative(h, own.acceleration)]
    cost = bernstein.mean_square(jerks, ca.dot)
    cost += _rate_cost(scenario, layout, h, columns, whole, take_up, duration)
    cost *= OTHER_COSTS if mesh.elastic else 1.0
    constraints += _rate_rows(scenario, layout, h, columns, whole)

    @cache
    def points_of(carrier: int | None) -> Points:
        """Return the points of a carrier's whole motion, or of the platform's offset from its path."""
        of_body = spread(scenario, carrier)
        if carrier is None:
            first, last = columns[0], columns[-1]
            position = bernstein.joined(h, own.position, first[layout.v], last[layout.q], last[layout.v])
            own_points = Points(position, own.speed, own.acceleration)
            return Points(*([of_body @ point for point in part] for part in own_points))
        motion = [point[1 + carrier] for point in moving()]
        jerk = [of_body @ column[layout.jerk] / given for column in columns] if scheme.smooth else None
        return _total(scenario, h, motion, [of_body @ column[layout.a] for column in columns], jerk)

    constraints += _hull_rows(scenario, points_of)
    if TENSIONS in mesh.between:
        constraints.append(_tension_rows(scenario, layout, columns))
    if speeds := [limit for limit in scenario.limits if limit.name in mesh.between]:
        offset = [spread(scenario, None) @ column[layout.a] for column in columns]
        jerks = [spread(scenario, None) @ column[layout.jerk] / given for column in columns] if scheme.smooth else None
        inner = _total(scenario, h, [point[0] for point in moving()], offset, jerks).speed[1:-1]
        constraints += [bounded(limit, point[:3], None) for limit in speeds for point in inner]
    known = {"p": parameters, "p_end": parameters_end, "grid": numbers, "duration": duration}
    unknowns, of_limits = {"x": x, "x_end": x_end}, _way_rows(scenario, layout, columns, whole, on_the_way)
    return part_of("interval", unknowns, known, cost, constraints, scenario.limits, of_limits)


def _of_leg(scenario: Scenario, layout: Layout, x: ca.SX, x_end: ca.SX, reference: ca.SX) -> ca.SX:
    """Return the end column of an interval about the references of its own leg, which the next leg may have slower."""
    if not scenario.passing or (place := layout.at(DURATION)) is None:
        return x_end
    seen = ca.SX(x_end)
    for k, part in ((1, layout.v), (2, layout.a)):
        change = 1 / x_end[place] ** k - 1 / x[place] ** k
        seen[part] += spread(scenario, None).T @ reference[6 * k : 6 * k + 6] * change
    seen[place] = x[place]
    return seen


def _smooth_end(layout: Layout, h: ca.SX | float, given: float, columns: list[ca.SX]) -> tuple[ca.SX, ca.SX]:
    """Return acceleration and jerk at the end, the jerk as in its column: the integrals of a linear snap."""
    first, last = columns[0], columns[-1]
    share = h / given
    snap, snap_end = first[layout.snap], last[layout.snap]
    a = first[layout.a] + share * first[layout.jerk] + share**2 / 6 * (2 * snap + snap_end)
    return a, first[layout.jerk] + share / 2 * (snap + snap_end)


def _chain_rows(
    layout: Layout, h: ca.SX | float, given: float, columns: list[ca.SX], x_end: ca.SX, own: Points
) -> Constraints:
    """Return values and rows: the end is the result of the integration, with equal shared unknowns."""
    n = layout.n
    values = [x_end[layout.q] - own.position[-1], (columns[-1][layout.v] - own.speed[-1]) * h]
    names = ["position"] * n + ["velocity"] * n
    if layout.derivatives > 3:
        a, jerk = _smooth_end(layout, h, given, columns)
        values += [x_end[layout.a] - a, x_end[layout.jerk] - jerk]
        names += ["acceleration"] * n + ["jerk"] * n
    values.append(x_end[layout.shared] - columns[0][layout.shared])
    return values, [Row(name, 0.0, 0.0) for name in (*names, *layout.carried)]


def _inner_rows(
    scenario: Scenario, layout: Layout, h: ca.SX | float, columns: list[ca.SX], own: Points
) -> Iterator[Constraints]:
    """Yield values and rows: inner points lie on the polynomials, with equal shared unknowns."""
    names = ["position"] * layout.n + ["velocity"] * layout.n + ["shared"] * len(layout.carried)
    for share, column in zip(scenario.scheme.inner, columns[1:-1], strict=True):
        position = column[layout.q] - bernstein.value(own.position, share)
        speed = (column[layout.v] - bernstein.value(own.speed, share)) * h
        shared = column[layout.shared] - columns[0][layout.shared]
        yield [position, speed, shared], [Row(name, 0.0, 0.0) for name in names]


def _rate_cost(
    scenario: Scenario,
    layout: Layout,
    h: ca.SX | float,
    columns: list[ca.SX],
    whole: _Whole,
    take_up: ca.SX,
    duration: ca.SX,
) -> ca.SX | float:
    """Return what rates from point to point cost.

    On the ground, rates of tensions cost by default, so that the load is taken up over the whole phase.
    """
    objective, robot = scenario.task.objective, scenario.robot
    changing = [ca.SX(0, 1)] * len(columns)
    if scenario.costs.has_rates:
        changing = [costs_at(scenario, layout, duration, *at)[1] for at in zip(columns, whole(), strict=True)]
    if scenario.phases.rest and objective.tension_rate is None:
        gentle = TAKE_UP * take_up * robot.force_scale / (objective.tension or robot.force_scale)
        changing = [ca.vertcat(its, gentle * x[layout.tensions]) for its, x in zip(changing, columns, strict=True)]
    cost: ca.SX | float = 0.0
    for share, first, second in _pieces(scenario, changing):
        cost += share * ca.sumsqr((second - first) / (h * share))
    return cost


def _pieces(scenario: Scenario, at_points: list[ca.SX]) -> list[tuple[float, ca.SX, ca.SX]]:
    """Return each piece between two points of an interval: its share, and what is at its ends."""
    shares = np.diff([0.0, *scenario.scheme.inner, 1.0]).tolist()
    return list(zip(shares, at_points[:-1], at_points[1:], strict=True))


def _rate_rows(
    scenario: Scenario, layout: Layout, h: ca.SX | float, columns: list[ca.SX], whole: _Whole
) -> Iterator[Constraints]:
    """Yield values and rows of the limits of how fast something changes, from point to point."""
    limits = scenario.limits
    if not any(isinstance(limit, Rate) for limit in limits):
        return
    at_points = []
    for column, bodies in zip(columns, whole(), strict=True):
        tensions = scenario.robot.force_scale * column[layout.tensions]
        at_points.append(limits.function(*bodies, tensions, spread(scenario, None) @ column[layout.q]))
    for limit, place in zip(limits, limits.places, strict=True):
        if isinstance(limit, Rate):
            for share, first, second in _pieces(scenario, at_points):
                rate = (second[place] - first[place]) / (h * share)
                yield bounded(limit, rate, layout.slack(columns[0], limit))


def _way_rows(
    scenario: Scenario, layout: Layout, columns: list[ca.SX], whole: _Whole, on_the_way: Mapping[Limit, ca.Function]
) -> Iterator[tuple[int, Constraints]]:
    """Yield index and constraints of the distances from thin regions on the straight way from point to point."""
    for limit, function in on_the_way.items():
        slack = layout.slack(columns[0], limit)
        pieces = [bounded(limit, function(*first, *second), slack) for first, second in pairwise(whole())]
        values, rows = ([*chain(*parts)] for parts in zip(*pieces, strict=True))
        yield scenario.limits.all.index(limit), (values, rows)


def _tension_rows(scenario: Scenario, layout: Layout, columns: list[ca.SX]) -> Constraints:
    """Return values and rows of the middle Bernstein points of the parabolas through the tensions at the points.

    With their limits there, an acceleration that changes from one node to the next does not swing beyond what tensions
    permit: between the points it would by up to an eighth, in intervals of any length.
    """
    first, middle, last = (column[layout.tensions] for column in columns)
    scale = scenario.robot.force_scale
    rows = [Row(TENSIONS, low / scale, high / scale) for low, high in zip(*scenario.bounds(), strict=True)]
    return [2 * middle - (first + last) / 2], rows


def _hull_rows(scenario: Scenario, points_of: Callable[[int | None], Points]) -> Iterator[Constraints]:
    """Yield values and rows of the hard convex limits at Bernstein points: so they hold between the nodes too."""
    for limit in scenario.limits:
        hull = limit.hull
        if hull is None or not limit.is_convex or not scenario.moves(hull):
            continue
        motion = points_of(hull.carrier)
        points = motion[hull.order]
        if hull.order == len(motion) - 1:  # the others are accelerations at points, which `node` limits
            points = [points[i] for i in scenario.scheme.inner_points]
        elif not hull.at_ends:
            points = points[1:-1]
        evaluate = scenario.limits.hull(limit)
        for point in points:
            yield bounded(limit, evaluate(point), None)


def _total(
    scenario: Scenario, h: ca.SX | float, motion: list[list[ca.SX]], offset: list[ca.SX], jerk: list[ca.SX] | None
) -> Points:
    """Return the points of a body's whole motion, its reference taken as a polynomial of the same degree."""
    pose, velocity, total = zip(*motion, strict=True)
    slopes = None
    if jerk is not None:
        rise = (total[-1] - offset[-1] - total[0] + offset[0]) / h
        slopes = (rise + jerk[0], rise + jerk[-1])
    acceleration = scenario.scheme.acceleration(h, total, slopes)
    speed = bernstein.integral(h, velocity[0], acceleration)
    position = bernstein.joined(h, bernstein.integral(h, pose[0], speed), velocity[0], pose[-1], velocity[-1])
    return Points(position, [*speed[:-1], velocity[-1]], acceleration)
