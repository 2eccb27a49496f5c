"""The nonlinear program of a scenario: inverse dynamics at the nodes, exact integrators between them.

Unknown at each node k are the free coordinates q_k, their rates v_k and accelerations a_k, and the tensions t_k; the
duration T too where the task leaves it open:

    min   mean over time of sum |quantity / what costs one|^2  (+ T / time - margin)   (`task.Objective`)
    s.t.  A(q_k) t_k = w(q_k, v_k, a_k)                                            at every node
          (q, v)_{k+1} = integral of the linear acceleration from a_k to a_{k+1}   (`spline`)
          t_min + margin <= t_k <= t_max - margin
          the same two for tensions of their own in each decisive wind of a box      (`wind_set`)
          the limits of `limits`                                                   at every node
          tube, reach, speed, tilt at the Bernstein points, acceleration at the nodes: so they hold between nodes too

What holds at one node is in `node`, what binds two in `interval`. Tensions are in units of `Robot.force_scale`, the
weight, moments over `Robot.length`.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from .interval import interval_function
from .layout import DURATION, MARGIN, Layout
from .node import node_function
from .path import WaypointPath
from .rows import Mesh, Row
from .scenario import ATTITUDE, Deviation, Scenario

__all__ = ["Program", "build"]


@dataclass(frozen=True)
class Program:
    """A nonlinear program in CasADi's form, its bounds, and how to read its solution.

    Attributes
    ----------
    problem
        {"x", "f", "g"} for `casadi.nlpsol`.
    lower, upper, lower_g, upper_g
        Bounds of x and g.
    """

    scenario: Scenario
    layout: Layout
    shares: np.ndarray  # (N + 1,) of the duration, where the nodes are
    problem: dict[str, ca.MX]
    lower: np.ndarray
    upper: np.ndarray
    lower_g: np.ndarray
    upper_g: np.ndarray

    def duration(self, x: np.ndarray) -> float:
        """The duration that a solution x has [s]."""
        place = self.layout.at(DURATION)
        return self.scenario.duration if place is None else float(x[place] * self.scenario.duration)

    def read(self, x: np.ndarray) -> Deviation:
        """The deviation that a solution x stands for."""
        layout, columns = self.layout, self.layout.columns(x)
        tensions = columns[:, layout.tensions] * self.scenario.robot.force_scale
        q, v, a = (columns[:, part] for part in (layout.q, layout.v, layout.a))
        return Deviation(self.shares * self.duration(x), q, v, a, tensions)

    def violation(self, x: np.ndarray, g: np.ndarray) -> float:
        """How far x and its constraints g are beyond their bounds at most; infinite if they are no numbers."""
        beyond = [self.lower - x, x - self.upper, self.lower_g - g, g - self.upper_g]
        worst = float(np.concatenate(beyond).max())
        return worst if np.isfinite(worst) else np.inf

    def pack(self, deviation: Deviation) -> np.ndarray:
        """The x that a deviation at the nodes stands for, slacks zero."""
        layout = self.layout
        columns = np.zeros((len(self.shares), layout.width))
        for part, values in ((layout.q, deviation.q), (layout.v, deviation.v), (layout.a, deviation.a)):
            columns[:, part] = values
        columns[:, layout.tensions] = deviation.tensions / self.scenario.robot.force_scale
        columns[:, layout.wind_tensions] = np.tile(columns[:, layout.tensions], layout.winds)
        if (place := layout.at(DURATION)) is not None:
            columns[:, place] = deviation.nodes[-1] / self.scenario.duration
        return columns.ravel()


def build(scenario: Scenario, mesh: Mesh) -> Program:
    """The nonlinear program of `scenario` on `mesh`."""
    steps, layout = mesh.steps, Layout.of(scenario, mesh.elastic)
    shares = np.linspace(0.0, 1.0, steps + 1)
    nodes = shares * scenario.duration
    parameters = ca.DM(_parameters(scenario, nodes))
    X = ca.MX.sym("x", layout.width, steps + 1)

    node, node_rows = node_function(scenario, mesh, layout)
    interval, interval_rows = interval_function(scenario, mesh, layout)
    cost, node_values = node.map(steps + 1)(X, parameters)
    change_cost, interval_values = interval.map(steps)(X[:, :-1], X[:, 1:], parameters[:, :-1], parameters[:, 1:])
    # Trapezoid rule: the two end nodes stand for half an interval each.
    weights = np.full(steps + 1, 1.0 / steps)
    weights[[0, -1]] /= 2
    objective = ca.dot(cost, ca.DM(weights).T) + ca.sum2(change_cost) / steps + _shared_cost(scenario, layout, X[:, 0])

    g = [ca.vec(node_values), ca.vec(interval_values)]
    rows = [*node_rows * (steps + 1), *interval_rows * steps]
    if getattr(scenario.task.base, "ends", None) == "periodic":
        carriers = [i for i, owner in enumerate(scenario.owners()) if owner[0] is not None]
        picked = [block * layout.n + i for block in range(3) for i in carriers]
        g.append(X[picked, 0] - X[picked, -1])
        rows += [("periodic", 0.0, 0.0)] * len(picked)
    g_waypoints, waypoint_rows = _waypoint_rows(scenario, layout, X, steps)
    g += g_waypoints
    rows += waypoint_rows

    lower, upper = _simple_bounds(scenario, mesh, layout, nodes)
    return Program(
        scenario=scenario,
        layout=layout,
        shares=shares,
        problem={"x": ca.vec(X), "f": objective, "g": ca.vertcat(*g)},
        lower=lower,
        upper=upper,
        lower_g=np.array([row[1] for row in rows]),
        upper_g=np.array([row[2] for row in rows]),
    )


def _parameters(scenario: Scenario, nodes: np.ndarray) -> np.ndarray:
    """Reference motions at the nodes, one column a node: platform, then each carrier; pose, velocity, acceleration."""
    platform, carriers = scenario.references(nodes)
    return np.hstack([part for motion in (platform, *carriers) for part in motion]).T


def _shared_cost(scenario: Scenario, layout: Layout, x: ca.MX) -> ca.MX | float:
    """What the duration costs and the margin earns."""
    objective, cost = scenario.task.objective, 0.0
    if (place := layout.at(DURATION)) is not None and objective.time is not None:
        cost += x[place] * scenario.duration / objective.time
    if (place := layout.at(MARGIN)) is not None and objective.margin is not None:
        cost -= x[place] * scenario.robot.force_scale / objective.margin
    return cost


def _waypoint_rows(scenario: Scenario, layout: Layout, X: ca.MX, steps: int) -> tuple[list[ca.MX], list[Row]]:
    """No deviation of the platform at the waypoints: a cubic of the interval that each of them lies in."""
    path = scenario.task.path
    platform = [i for i, owner in enumerate(scenario.owners()) if owner[0] is None]
    if scenario.task.tube.waypoints != "exact" or not isinstance(path, WaypointPath) or not platform:
        return [], []
    values = []
    place = layout.at(DURATION)
    for share in path.knots(scenario.duration)[1:-1] / scenario.duration:
        k = min(int(share * steps), steps - 1)
        h = scenario.duration / steps * (1.0 if place is None else X[place, k])
        s = (share * steps - k) * h
        q, v, a = (X[part, k][platform] for part in (layout.q, layout.v, layout.a))
        slope = (X[layout.a, k + 1][platform] - a) / h
        values.append(q + s * v + s**2 / 2 * a + s**3 / 6 * slope)
    return values, [("waypoint", 0.0, 0.0)] * (len(values) * len(platform))


def _simple_bounds(scenario: Scenario, mesh: Mesh, layout: Layout, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the unknowns themselves: tensions, attitude in the tube, what is fixed at the ends, what is shared."""
    n = layout.n
    lower, upper = (np.full((len(nodes), layout.width), bound) for bound in (-np.inf, np.inf))
    low, high = scenario.bounds()
    reserve = np.minimum(mesh.reserve, (high - low) / 4)
    for part, count in ((layout.tensions, 1), (layout.wind_tensions, layout.winds)):
        lower[:, part] = np.tile((low + reserve) / scenario.robot.force_scale, count)
        upper[:, part] = np.tile((high - reserve) / scenario.robot.force_scale, count)
    lower[:, layout.slacks] = 0.0
    if (place := layout.at(DURATION)) is not None and (span := scenario.duration_range) is not None:
        lower[:, place], upper[:, place] = span.min / scenario.duration, span.max / scenario.duration
    if (place := layout.at(MARGIN)) is not None:
        lower[:, place] = 0.0
    tube, ends = scenario.task.tube, getattr(scenario.task.base, "ends", "free")
    references = scenario.references(nodes[[0, -1]])[1]
    for column, (owner, coordinate) in enumerate(scenario.owners()):
        if owner is None and coordinate in ATTITUDE:
            lower[:, column], upper[:, column] = -tube.turn, tube.turn
        for end in (0, -1):
            if (tube.ends if owner is None else ends) == "exact":
                lower[end, [column, n + column]] = upper[end, [column, n + column]] = 0.0
            elif owner is not None and ends == "rest":
                # The deviation undoes what speed the reference has there.
                lower[end, n + column] = upper[end, n + column] = -references[owner].velocity[end, coordinate]
    return lower.ravel(), upper.ravel()
