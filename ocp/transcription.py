"""The nonlinear program of a scenario: inverse dynamics at the nodes, exact integrators between them.

Unknown at each node k are the free coordinates q_k, their rates v_k and accelerations a_k, and the tensions t_k; the
duration T too where the task leaves it open:

    min   mean over time of sum |quantity / what costs one|^2  (+ T / time - margin)   (`task.Objective`)
    s.t.  A(q_k) t_k = w(q_k, v_k, a_k)                                            at every node
          (q, v)_{k+1} = integral of the linear acceleration from a_k to a_{k+1}   (`spline`)
          t_min + margin <= t_k <= t_max - margin
          the limits of `limits`                                                   at every node
          tube, reach, speed, tilt at the Bernstein points, acceleration at the nodes: so they hold between nodes too

Tensions are in units of `Robot.force_scale`, the weight, moments over `Robot.length`. `build` makes the program and
a `Solver` solves it, so that it can be looked at in between.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ..errors import SolverError
from . import spline
from .guess import initial_guess
from .layout import DURATION, MARGIN, Layout
from .limits import limits as limits_of
from .path import WaypointPath
from .scenario import ATTITUDE, POSITION, CarrierLimits, Deviation, Scenario

OTHER_COSTS = 1e-6  # of all but the missing wrench, in the elastic program: which is then the least there is
SLACK_COST = 1e2  # of a missing wrench as large as the weight
MET = 1e-8  # what constraints of a program may miss, in its units
Progress = Callable[[int, float, float], None]  # iteration, objective, infeasibility
Row = tuple[str, float, float]  # name, lower and upper bound


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
        if (place := layout.at(DURATION)) is not None:
            columns[:, place] = deviation.nodes[-1] / self.scenario.duration
        return columns.ravel()


@dataclass(frozen=True)
class Outcome:
    """What the solver came back with."""

    deviation: Deviation
    duration: float  # [s]
    success: bool  # whether all constraints are met; the message tells whether it is an optimum too
    message: str
    iterations: int
    slack: float  # largest missing wrench at a node [N], zero in the rigid program


@dataclass(frozen=True)
class Mesh:
    """How finely and how carefully a program looks at its scenario.

    Attributes
    ----------
    steps
        Intervals.
    reserve
        Further distance from the tension limits [N], for what happens between the nodes.
    shrink
        Share by which the carriers' speed and acceleration limits, and those of the task, are lowered, likewise.
    elastic
        Let A t = w + s with a high cost on the slack s, so that there always is a solution.
    """

    steps: int
    reserve: float = 0.0
    shrink: float = 0.0
    elastic: bool = False


def build(scenario: Scenario, mesh: Mesh) -> Program:
    """The nonlinear program of `scenario` on `mesh`."""
    steps, layout = mesh.steps, Layout.of(scenario, mesh.elastic)
    shares = np.linspace(0.0, 1.0, steps + 1)
    nodes = shares * scenario.duration
    parameters = ca.DM(_parameters(scenario, nodes))
    X = ca.MX.sym("x", layout.width, steps + 1)

    node, node_rows = _node_function(scenario, mesh, layout)
    interval, interval_rows = _interval_function(scenario, mesh, layout)
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


# The guess is near: IPOPT's default 0.1 throws it away, and "adaptive" took 8 times as long.
_FROM_A_GUESS = {"mu_init": 1e-2}
# A motion that was found on another mesh or for another task is nearer: a minimum time of three robots took 96
# iterations from the coarser mesh instead of more than 150.
_FROM_A_MOTION = {"mu_init": 1e-3}
# A solution with its multipliers is nearer still.
_FROM_A_SOLUTION = {
    "mu_init": 1e-6,
    "warm_start_init_point": "yes",
    "warm_start_bound_push": 1e-6,
    "warm_start_bound_frac": 1e-6,
    "warm_start_slack_bound_push": 1e-6,
    "warm_start_slack_bound_frac": 1e-6,
    "warm_start_mult_bound_push": 1e-6,
}

_STARTS: dict[str, dict[str, Any]] = {"guess": _FROM_A_GUESS, "motion": _FROM_A_MOTION, "solution": _FROM_A_SOLUTION}


class Solver:
    """IPOPT for one program, to be run from several guesses, or from its own last solution."""

    def __init__(self, program: Program, max_iterations: int = 400):
        self.program = program
        self._watch = _Watch(program)
        self._max_iterations = max_iterations
        self._solvers: dict[str, ca.Function] = {}
        self._last: dict[str, ca.DM] | None = None

    def prepare(self, guess: Deviation | None) -> ca.Function:
        """IPOPT for a run from `guess`, made when it is first asked for."""
        start = "motion" if guess is not None else "guess" if self._last is None else "solution"
        if start not in self._solvers:
            self._solvers[start] = self._make(_STARTS[start])
        return self._solvers[start]

    def _make(self, start: dict[str, Any]) -> ca.Function:
        quiet = {"print_level": 0, "sb": "yes"}
        accuracy = {"tol": 1e-8, "constr_viol_tol": 1e-9, "max_iter": self._max_iterations}
        options = {"print_time": False, "error_on_fail": False, "iteration_callback": self._watch}
        try:
            return ca.nlpsol("planner", "ipopt", self.program.problem, {"ipopt": quiet | accuracy | start, **options})
        except RuntimeError as error:
            raise _broken(error) from None

    def solve(self, guess: Deviation | None, progress: Progress | None = None) -> Outcome:
        """Solve from `guess`; None: from the last solution and its multipliers, or else from a guess of our own.

        That nothing is found is told, not raised.

        Raises
        ------
        SolverError
            If CasADi or IPOPT break.
        KeyboardInterrupt
            If a person stopped it.
        """
        program, watch = self.program, self._watch
        start: dict[str, Any] = {
            "lbx": program.lower,
            "ubx": program.upper,
            "lbg": program.lower_g,
            "ubg": program.upper_g,
        }
        nlp = self.prepare(guess)
        if guess is not None or self._last is None:
            if guess is None:
                guess = initial_guess(program.scenario, program.shares * program.scenario.duration)
            start["x0"] = program.pack(guess)
        else:
            start |= {"x0": self._last["x"], "lam_x0": self._last["lam_x"], "lam_g0": self._last["lam_g"]}
        watch.begin(progress)
        try:
            result = nlp(**start)
        except RuntimeError as error:
            raise _broken(error) from None
        statistics = nlp.stats()
        if watch.interrupted or statistics["return_status"] == "User_Requested_Stop":
            raise KeyboardInterrupt
        self._last = result if statistics["success"] else None
        x = result["x"].full().ravel()
        # A minimum time is often found long before IPOPT is sure that there is no shorter one.
        met = program.violation(x, result["g"].full().ravel()) <= MET
        missing = program.layout.columns(x)[:, program.layout.missing]
        return Outcome(
            deviation=program.read(x),
            duration=program.duration(x),
            success=(bool(statistics["success"]) or met) and bool(np.isfinite(x).all()),
            message=str(statistics["return_status"]),
            iterations=int(statistics["iter_count"]),
            slack=float(np.linalg.norm(missing, axis=1).max(initial=0.0) * program.scenario.robot.force_scale),
        )


def _broken(error: RuntimeError) -> SolverError:
    return SolverError(f"planner: CasADi failed ({str(error).splitlines()[-1]})")


def _parameters(scenario: Scenario, nodes: np.ndarray) -> np.ndarray:
    """Reference motions at the nodes, one column a node: platform, then each carrier; pose, velocity, acceleration."""
    platform, carriers = scenario.references(nodes)
    return np.hstack([part for motion in (platform, *carriers) for part in motion]).T


def _stretch(scenario: Scenario, layout: Layout, x: ca.SX) -> ca.SX | float:
    """The duration of column x, relative to that of the references."""
    place = layout.at(DURATION)
    return 1.0 if place is None else x[place]


def _motions(scenario: Scenario, layout: Layout, x: ca.SX, parameters: ca.SX) -> list[list[ca.SX]]:
    """Platform and carriers as symbols, [pose, velocity, acceleration] each: reference plus deviation."""
    owners: list[int | None] = [None, *range(len(scenario.robot.carriers))]
    stretch = _stretch(scenario, layout, x)
    motions = []
    for position, owner in enumerate(owners):
        chosen = ca.DM(6, layout.n)
        for column, (whose, coordinate) in enumerate(scenario.owners()):
            if whose == owner:
                chosen[coordinate, column] = 1
        reference = ca.vertsplit(parameters[18 * position : 18 * (position + 1)], 6)
        deviation = (x[layout.q], x[layout.v], x[layout.a])
        motions.append(
            [at / stretch**k + chosen @ off for k, (at, off) in enumerate(zip(reference, deviation, strict=True))]
        )
    return motions


def _node_function(scenario: Scenario, mesh: Mesh, layout: Layout) -> tuple[ca.Function, list[Row]]:
    """Cost and constraints of one node: the balance A t = w and the limits that hold at an instant."""
    robot, dynamics = scenario.robot, scenario.dynamics
    x = ca.SX.sym("x", layout.width)
    parameters = ca.SX.sym("p", 18 * (1 + len(robot.carriers)))
    platform, *carriers = _motions(scenario, layout, x, parameters)
    tensions = robot.force_scale * x[layout.tensions]
    wind = scenario.task.wind
    pose_rows = [ca.vertcat(*(carrier[k].T for carrier in carriers)) for k in range(3)]
    if scenario.relative:
        A = dynamics.relative.wrench_matrix(platform[0])
        w = dynamics.relative.required_wrench(*platform, *carriers[0], wind=wind)
    else:
        A = dynamics.wrench_matrix(platform[0], pose_rows[0])
        w = dynamics.required_wrench(*platform, *pose_rows, wind=wind)
    scale = robot.force_scale * np.array([1.0, 1, 1, robot.length, robot.length, robot.length])
    moving = [int(row) for row in np.flatnonzero(robot.dof_mask)]
    balance = ((A @ tensions - w) / ca.DM(scale))[moving]
    cost = _node_cost(scenario, layout, x)
    if mesh.elastic:
        missing = x[layout.missing]
        balance -= missing[moving]
        cost = OTHER_COSTS * cost + SLACK_COST * ca.sumsqr(missing)

    values: list[ca.SX] = [balance]
    axes = ("fx", "fy", "fz", "mx", "my", "mz")
    rows: list[Row] = [(f"balance {axes[row]}", 0.0, 0.0) for row in moving]
    if robot.fixed_lengths is not None and not scenario.relative:
        lengths = dynamics.cable_lengths(platform[0], pose_rows[0])
        values.append((lengths / robot.fixed_lengths) ** 2)  # squared: no square root in the derivatives
        rows += [(f"length of cable {i + 1}", 1.0, 1.0) for i in range(robot.m)]
    for index, limit in scenario.free_limits(mesh.shrink).items():
        name, acceleration = robot.carriers[index].name, carriers[index][2]
        if limit.acceleration is not None:
            values.append(ca.sumsqr(acceleration[0:3]) / limit.acceleration**2)
            rows.append((f"{name} acceleration", -np.inf, 1.0))
        if limit.tilt and limit.turn_acceleration is not None:
            values.append(acceleration[3:5] / limit.turn_acceleration)
            rows += [(f"{name} turn acceleration", -1.0, 1.0)] * 2
    if (place := layout.at(MARGIN)) is not None:
        low, high = (bound / robot.force_scale for bound in scenario.bounds())
        values += [x[layout.tensions] - x[place] - low, high - x[place] - x[layout.tensions]]
        rows += [("margin", 0.0, np.inf)] * (2 * robot.m)
    if scenario.relative:
        platform = list(dynamics.relative.motion_in_world(*platform, *carriers[0]))
    cost += _limit_rows(scenario, mesh, layout, x, [platform, *carriers], tensions, values, rows)
    return ca.Function("node", [x, parameters], [cost, ca.vertcat(*values)]), rows


def _limit_rows(
    scenario: Scenario,
    mesh: Mesh,
    layout: Layout,
    x: ca.SX,
    motions: list[list[ca.SX]],
    tensions: ca.SX,
    values: list[ca.SX],
    rows: list[Row],
) -> ca.SX | float:
    """Add the limits of `limits`, in units of their scale; return what passing the soft ones costs."""
    limits = limits_of(scenario)
    if not limits.all:
        return 0.0
    evaluated = limits.function(*(ca.vertcat(*motion) for motion in motions), tensions)
    cost, at = 0.0, 0
    paid: set[str] = set()  # limits of one name share a slack
    for limit in limits.all:
        size = limit.values.numel()
        value = evaluated[at : at + size] / limit.scale
        at += size
        reserve = 0.0 if limit.equation else mesh.shrink * limit.scale
        low, high = (limit.low + reserve) / limit.scale, (limit.high - reserve) / limit.scale
        if limit.soft is None or mesh.elastic:
            values.append(value)
            rows += [(f"{limit.name} of {label}", low, high) for label in limit.labels]
            continue
        slack = x[layout.slacks][_place_of(scenario, limit.name)]
        if limit.name not in paid:
            cost += (slack * limit.scale / limit.soft) ** 2
            paid.add(limit.name)
        for sign, bound in ((1.0, low), (-1.0, -high)):
            if np.isfinite(bound):
                values.append(sign * value + slack)
                rows += [(f"{limit.name} of {label}", bound, np.inf) for label in limit.labels]
    return cost


def _place_of(scenario: Scenario, name: str) -> int:
    """Which slack belongs to a soft limit."""
    return list(scenario.task.limits.soft).index(name)


def _node_cost(scenario: Scenario, layout: Layout, x: ca.SX) -> ca.SX:
    robot, objective = scenario.robot, scenario.task.objective
    tension_scale = objective.tension or robot.force_scale
    deviation_scale = objective.deviation or _tenth_of_tube(scenario)
    cost = ca.sumsqr(robot.force_scale * x[layout.tensions] / tension_scale)
    q, a = x[layout.q], x[layout.a]
    for column, (owner, coordinate) in enumerate(scenario.owners()):
        if owner is None:
            arm = 1.0 if coordinate in POSITION else robot.length
            if np.isfinite(deviation_scale):
                cost += (arm * q[column] / deviation_scale) ** 2
        else:
            cost += (q[column] / objective.carrier_offset) ** 2 + (a[column] / objective.carrier_acceleration) ** 2
    return cost


def _tenth_of_tube(scenario: Scenario) -> float:
    tube = scenario.task.tube
    turn = 0.0 if tube.attitude == "free" else tube.turn
    return 0.1 * max(tube.radius, scenario.robot.length * turn)


def _shared_cost(scenario: Scenario, layout: Layout, x: ca.MX) -> ca.MX | float:
    """What the duration costs and the margin earns."""
    objective, cost = scenario.task.objective, 0.0
    if (place := layout.at(DURATION)) is not None and objective.time is not None:
        cost += x[place] * scenario.duration / objective.time
    if (place := layout.at(MARGIN)) is not None and objective.margin is not None:
        cost -= x[place] * scenario.robot.force_scale / objective.margin
    return cost


def _interval_function(scenario: Scenario, mesh: Mesh, layout: Layout) -> tuple[ca.Function, list[Row]]:
    """Cost of jerk and constraints of one interval: integration, and limits at the Bernstein points."""
    robot, n = scenario.robot, layout.n
    x, x_end = ca.SX.sym("x", layout.width), ca.SX.sym("x_end", layout.width)
    parameters = ca.SX.sym("p", 18 * (1 + len(robot.carriers)))
    parameters_end = ca.SX.sym("p_end", 18 * (1 + len(robot.carriers)))
    h = scenario.duration / mesh.steps * _stretch(scenario, layout, x)
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
        values.append(tension_rate / keep)
        rows += [("tension_rate", -1.0, 1.0)] * robot.m

    _tube_rows(scenario, h, start, end, values, rows)
    before, after = (_motions(scenario, layout, *pair)[1:] for pair in ((x, parameters), (x_end, parameters_end)))
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


def _simple_bounds(scenario: Scenario, mesh: Mesh, layout: Layout, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the unknowns themselves: tensions, attitude in the tube, what is fixed at the ends, what is shared."""
    n = layout.n
    lower, upper = (np.full((len(nodes), layout.width), bound) for bound in (-np.inf, np.inf))
    low, high = scenario.bounds()
    reserve = np.minimum(mesh.reserve, (high - low) / 4)
    lower[:, layout.tensions] = (low + reserve) / scenario.robot.force_scale
    upper[:, layout.tensions] = (high - reserve) / scenario.robot.force_scale
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


class _Watch(ca.Callback):
    """Tells a progress function about each iteration of the solver, and stops it when a person presses Ctrl-C."""

    def __init__(self, program: Program):
        super().__init__()
        self._sizes = {"x": program.problem["x"].numel(), "g": program.problem["g"].numel(), "f": 1}
        self._bounds = (program.lower_g, program.upper_g)
        self.begin(None)
        self.construct("watch", {})

    def begin(self, progress: Progress | None) -> None:
        """Start to count anew."""
        self._progress = progress
        self._iteration = 0
        self.interrupted = False

    def get_n_in(self) -> int:
        return ca.nlpsol_n_out()

    def get_n_out(self) -> int:
        return 1

    def get_name_in(self, i: int) -> str:
        return ca.nlpsol_out(i)

    def get_name_out(self, i: int) -> str:
        return "stop"

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        name = ca.nlpsol_out(i)
        size = self._sizes.get({"lam_x": "x", "lam_g": "g"}.get(name, name), 0)
        return ca.Sparsity.dense(size) if size else ca.Sparsity(0, 0)

    def eval(self, arg: Sequence[ca.DM]) -> list[int]:
        try:
            if self._progress is not None:
                g = arg[2].full().ravel()
                low, high = self._bounds
                infeasibility = float(np.maximum(np.maximum(low - g, g - high), 0).max(initial=0.0))
                self._progress(self._iteration, float(arg[1]), infeasibility)
            self._iteration += 1
        except KeyboardInterrupt:
            self.interrupted = True
        return [int(self.interrupted)]
