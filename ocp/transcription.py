"""The nonlinear program of a scenario: inverse dynamics at the nodes, exact integrators between them.

Unknown at each node k are the free coordinates q_k, their rates v_k and accelerations a_k, and the tensions t_k:

    min   mean over time of sum |quantity / what costs one|^2                      (`task.Objective`)
    s.t.  A(q_k) t_k = w(q_k, v_k, a_k)                                            at every node
          (q, v)_{k+1} = integral of the linear acceleration from a_k to a_{k+1}   (`spline`)
          t_min + margin <= t_k <= t_max - margin
          tube, reach, speed, tilt at the Bernstein points, acceleration at the nodes: so they hold between nodes too

Tensions are in units of `Robot.force_scale`, the weight, moments over `Robot.length`. `build` makes the program and
`solve` solves it, so that it can be looked at in between.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ..errors import SolverError
from . import spline
from .scenario import ATTITUDE, POSITION, Deviation, Limits, Scenario

OTHER_COSTS = 1e-6  # of all but the missing wrench, in the elastic program: which is then the least there is
SLACK_COST = 1e2  # of a missing wrench as large as the weight
Progress = Callable[[int, float, float], None]  # iteration, objective, infeasibility


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
    nodes: np.ndarray  # (N + 1,) [s]
    problem: dict[str, ca.MX]
    lower: np.ndarray
    upper: np.ndarray
    lower_g: np.ndarray
    upper_g: np.ndarray
    width: int  # unknowns of a node

    def read(self, x: np.ndarray) -> Deviation:
        """The deviation that a solution x stands for."""
        n, m = self.scenario.count, self.scenario.robot.m
        columns = x[: self.width * len(self.nodes)].reshape(len(self.nodes), self.width)
        q, v, a, t = np.split(columns[:, : 3 * n + m], [n, 2 * n, 3 * n], axis=1)
        return Deviation(self.nodes, q, v, a, t * self.scenario.robot.force_scale)

    def pack(self, deviation: Deviation) -> np.ndarray:
        """The x that a deviation at the nodes stands for, slacks zero."""
        columns = np.zeros((len(self.nodes), self.width))
        parts = (deviation.q, deviation.v, deviation.a, deviation.tensions / self.scenario.robot.force_scale)
        values = np.hstack(parts)
        columns[:, : values.shape[1]] = values
        return columns.ravel()


@dataclass(frozen=True)
class Outcome:
    """What the solver came back with."""

    deviation: Deviation
    success: bool
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
        Share by which the carriers' speed and acceleration limits are lowered, likewise.
    elastic
        Let A t = w + s with a high cost on the slack s, so that there always is a solution.
    """

    steps: int
    reserve: float = 0.0
    shrink: float = 0.0
    elastic: bool = False


def build(scenario: Scenario, mesh: Mesh) -> Program:
    """The nonlinear program of `scenario` on `mesh`."""
    n, m, steps = scenario.count, scenario.robot.m, mesh.steps
    nodes = np.linspace(0.0, scenario.duration, steps + 1)
    width = 3 * n + m + (6 if mesh.elastic else 0)
    parameters = ca.DM(_parameters(scenario, nodes))
    X = ca.MX.sym("x", width, steps + 1)

    node, node_rows = _node_function(scenario, mesh)
    interval, interval_rows = _interval_function(scenario, mesh, nodes[1], width)
    cost, node_values = node.map(steps + 1)(X, parameters)
    jerk_cost, interval_values = interval.map(steps)(X[:, :-1], X[:, 1:], parameters[:, :-1], parameters[:, 1:])
    # Trapezoid rule: the two end nodes stand for half an interval each.
    weights = np.full(steps + 1, 1.0 / steps)
    weights[[0, -1]] /= 2
    objective = ca.dot(cost, ca.DM(weights).T) + ca.sum2(jerk_cost) / steps

    g = [ca.vec(node_values), ca.vec(interval_values)]
    low = [np.tile([row[1] for row in node_rows], steps + 1), np.tile([row[1] for row in interval_rows], steps)]
    high = [np.tile([row[2] for row in node_rows], steps + 1), np.tile([row[2] for row in interval_rows], steps)]
    if getattr(scenario.task.base, "ends", None) == "periodic":
        carriers = [i for i, owner in enumerate(scenario.owners()) if owner[0] is not None]
        picked = [block * n + i for block in range(3) for i in carriers]
        g.append(X[picked, 0] - X[picked, -1])
        low.append(np.zeros(len(picked)))
        high.append(np.zeros(len(picked)))

    lower, upper = _simple_bounds(scenario, mesh, nodes, width)
    return Program(
        scenario=scenario,
        nodes=nodes,
        problem={"x": ca.vec(X), "f": objective, "g": ca.vertcat(*g)},
        lower=lower,
        upper=upper,
        lower_g=np.concatenate(low),
        upper_g=np.concatenate(high),
        width=width,
    )


def solve(program: Program, guess: Deviation, progress: Progress | None = None, max_iterations: int = 400) -> Outcome:
    """Solve the program with IPOPT from `guess`; that it found nothing is told, not raised.

    Raises
    ------
    SolverError
        If CasADi or IPOPT break.
    KeyboardInterrupt
        If a person stopped it.
    """
    options: dict[str, Any] = {
        "ipopt": {
            "print_level": 0,
            "sb": "yes",
            "tol": 1e-8,
            "constr_viol_tol": 1e-9,
            "max_iter": max_iterations,
            "mu_init": 1e-2,  # the guess is near: the default 0.1 throws it away; "adaptive" took 8 times as long
        },
        "print_time": False,
        "error_on_fail": False,
    }
    watch = _Watch(program, progress)
    options["iteration_callback"] = watch
    bounds = {"lbx": program.lower, "ubx": program.upper, "lbg": program.lower_g, "ubg": program.upper_g}
    try:
        solver = ca.nlpsol("planner", "ipopt", program.problem, options)
        result = solver(x0=program.pack(guess), **bounds)
    except RuntimeError as error:
        raise SolverError(f"planner: CasADi failed ({str(error).splitlines()[-1]})") from None
    statistics = solver.stats()
    if watch.interrupted or statistics["return_status"] == "User_Requested_Stop":
        raise KeyboardInterrupt
    x = result["x"].full().ravel()
    slack = 0.0
    n, robot = program.scenario.count, program.scenario.robot
    if program.width > 3 * n + robot.m:
        columns = x.reshape(len(program.nodes), program.width)
        slack = float(np.linalg.norm(columns[:, 3 * n + robot.m :], axis=1).max() * robot.force_scale)
    return Outcome(
        deviation=program.read(x),
        success=bool(statistics["success"]) and bool(np.isfinite(x).all()),
        message=str(statistics["return_status"]),
        iterations=int(statistics["iter_count"]),
        slack=slack,
    )


def initial_guess(scenario: Scenario, nodes: np.ndarray) -> Deviation:
    """A guess that needs nothing from the user.

    A single carrier that may go anywhere keeps its place above the platform, as at home; others stay. The tensions are
    those of least norm, cut to their limits.
    """
    robot = scenario.robot
    n = scenario.count
    q, v, a = (np.zeros((len(nodes), n)) for _ in range(3))
    platform, carriers = scenario.references(nodes)
    follows = len(robot.carriers) == 1 and robot.carriers[0].kind == "prescribed" and not scenario.relative
    if follows:
        offset = robot.carrier_home[0, :3] - robot.home[:3]
        for column, (owner, coordinate) in enumerate(scenario.owners()):
            if owner is not None and coordinate in POSITION:
                q[:, column] = platform.pose[:, coordinate] + offset[coordinate] - carriers[0].pose[:, coordinate]
                v[:, column] = platform.velocity[:, coordinate] - carriers[0].velocity[:, coordinate]
                a[:, column] = platform.acceleration[:, coordinate] - carriers[0].acceleration[:, coordinate]
    guess = Deviation(nodes, q, v, a, np.zeros((len(nodes), robot.m)))
    moved, bases = scenario.motion(nodes, guess)
    A = scenario.dynamics.wrench_matrix(moved.pose, bases.pose)
    w = scenario.dynamics.required_wrench(*moved, wind=scenario.task.wind)
    least = (np.linalg.pinv(A, rcond=1e-6) @ w[..., None])[..., 0]
    return Deviation(nodes, q, v, a, np.clip(least, *scenario.bounds()))


Row = tuple[str, float, float]  # name, lower and upper bound


def _parameters(scenario: Scenario, nodes: np.ndarray) -> np.ndarray:
    """Reference motions at the nodes, one column a node: platform, then each carrier; pose, velocity, acceleration."""
    platform, carriers = scenario.references(nodes)
    return np.hstack([part for motion in (platform, *carriers) for part in motion]).T


def _motions(scenario: Scenario, x: ca.SX, parameters: ca.SX) -> list[list[ca.SX]]:
    """Platform and carriers as symbols, [pose, velocity, acceleration] each: reference plus deviation."""
    n = scenario.count
    owners: list[int | None] = [None, *range(len(scenario.robot.carriers))]
    motions = []
    for position, owner in enumerate(owners):
        chosen = ca.DM(6, n)
        for column, (whose, coordinate) in enumerate(scenario.owners()):
            if whose == owner:
                chosen[coordinate, column] = 1
        reference = ca.vertsplit(parameters[18 * position : 18 * (position + 1)], 6)
        deviation = ca.vertsplit(x[: 3 * n], n)
        motions.append([at + chosen @ off for at, off in zip(reference, deviation, strict=True)])
    return motions


def _node_function(scenario: Scenario, mesh: Mesh) -> tuple[ca.Function, list[Row]]:
    """Cost and constraints of one node: the balance A t = w and the limits on accelerations."""
    robot, n, dynamics = scenario.robot, scenario.count, scenario.dynamics
    width = 3 * n + robot.m + (6 if mesh.elastic else 0)
    x = ca.SX.sym("x", width)
    parameters = ca.SX.sym("p", 18 * (1 + len(robot.carriers)))
    platform, *carriers = _motions(scenario, x, parameters)
    tensions = robot.force_scale * x[3 * n : 3 * n + robot.m]
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
    cost = _node_cost(scenario, x)
    if mesh.elastic:
        slack = x[3 * n + robot.m :]
        balance -= slack[moving]
        cost = OTHER_COSTS * cost + SLACK_COST * ca.sumsqr(slack)

    values: list[ca.SX] = [balance]
    axes = ("fx", "fy", "fz", "mx", "my", "mz")
    rows_of_g: list[Row] = [(f"balance {axes[row]}", 0.0, 0.0) for row in moving]
    if robot.fixed_lengths is not None and not scenario.relative:
        lengths = dynamics.cable_lengths(platform[0], pose_rows[0])
        values.append((lengths / robot.fixed_lengths) ** 2)  # squared: no square root in the derivatives
        rows_of_g += [(f"length of cable {i + 1}", 1.0, 1.0) for i in range(robot.m)]
    for index, limit in scenario.free_limits(mesh.shrink).items():
        name, acceleration = robot.carriers[index].name, carriers[index][2]
        if limit.acceleration is not None:
            values.append(ca.sumsqr(acceleration[0:3]) / limit.acceleration**2)
            rows_of_g.append((f"{name} acceleration", -np.inf, 1.0))
        if limit.tilt and limit.turn_acceleration is not None:
            values.append(acceleration[3:5] / limit.turn_acceleration)
            rows_of_g += [(f"{name} turn acceleration", -1.0, 1.0)] * 2
    return ca.Function("node", [x, parameters], [cost, ca.vertcat(*values)]), rows_of_g


def _node_cost(scenario: Scenario, x: ca.SX) -> ca.SX:
    robot, n, objective = scenario.robot, scenario.count, scenario.task.objective
    tension_scale = objective.tension or robot.force_scale
    tube = scenario.task.tube
    deviation_scale = objective.deviation or 0.1 * max(tube.position, robot.length * tube.attitude)
    cost = ca.sumsqr(robot.force_scale * x[3 * n : 3 * n + robot.m] / tension_scale)
    for column, (owner, coordinate) in enumerate(scenario.owners()):
        q, a = x[column], x[2 * n + column]
        if owner is None:
            arm = 1.0 if coordinate in POSITION else robot.length
            cost += (arm * q / deviation_scale) ** 2
        else:
            cost += (q / objective.carrier_offset) ** 2 + (a / objective.carrier_acceleration) ** 2
    return cost


def _interval_function(scenario: Scenario, mesh: Mesh, h: float, width: int) -> tuple[ca.Function, list[Row]]:
    """Cost of jerk and constraints of one interval: integration, and limits at the Bernstein points."""
    robot, n = scenario.robot, scenario.count
    x, x_end = ca.SX.sym("x", width), ca.SX.sym("x_end", width)
    parameters = ca.SX.sym("p", 18 * (1 + len(robot.carriers)))
    parameters_end = ca.SX.sym("p_end", 18 * (1 + len(robot.carriers)))
    start = (x[:n], x[n : 2 * n], x[2 * n : 3 * n])
    end = (x_end[:n], x_end[n : 2 * n], x_end[2 * n : 3 * n])
    jerk = (end[2] - start[2]) / h
    cost = ca.sumsqr(jerk / scenario.task.objective.jerk) * (OTHER_COSTS if mesh.elastic else 1.0)

    q_defect, v_defect = spline.defects(h, start, end)
    values: list[ca.SX] = [q_defect, v_defect * h]
    rows: list[Row] = [("position", 0.0, 0.0)] * n + [("velocity", 0.0, 0.0)] * n

    _tube_rows(scenario, h, start, end, values, rows)
    before, after = (_motions(scenario, *pair)[1:] for pair in ((x, parameters), (x_end, parameters_end)))
    for index, limit in scenario.free_limits(mesh.shrink).items():
        _carrier_rows(robot.carriers[index].name, limit, h, before[index], after[index], values, rows)
    return ca.Function("interval", [x, x_end, parameters, parameters_end], [cost, ca.vertcat(*values)]), rows


def _tube_rows(scenario: Scenario, h: float, start: tuple, end: tuple, values: list[ca.SX], rows: list[Row]) -> None:
    tube = scenario.task.tube
    inner = spline.position_points(h, start[0], start[1], end[0], end[1])
    moving = [i for i, coordinate in enumerate(scenario.platform_free) if coordinate in POSITION]
    turning = [i for i, coordinate in enumerate(scenario.platform_free) if coordinate in ATTITUDE]
    if moving:
        for q in (start[0], *inner, end[0]):
            values.append(ca.sumsqr(q[moving]) / tube.position**2)
            rows.append(("tube", -np.inf, 1.0))
    if turning:
        for q in inner:
            values.append(q[turning] / tube.attitude)
            rows += [("tube attitude", -1.0, 1.0)] * len(turning)


def _carrier_rows(
    name: str, limit: Limits, h: float, start: list[ca.SX], end: list[ca.SX], values: list[ca.SX], rows: list[Row]
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


def _simple_bounds(scenario: Scenario, mesh: Mesh, nodes: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the unknowns themselves: tensions, attitude in the tube, and what is fixed at the ends."""
    n, m = scenario.count, scenario.robot.m
    lower, upper = np.full((len(nodes), width), -np.inf), np.full((len(nodes), width), np.inf)
    low, high = scenario.bounds()
    reserve = np.minimum(mesh.reserve, (high - low) / 4)
    lower[:, 3 * n : 3 * n + m] = (low + reserve) / scenario.robot.force_scale
    upper[:, 3 * n : 3 * n + m] = (high - reserve) / scenario.robot.force_scale
    tube, ends = scenario.task.tube, getattr(scenario.task.base, "ends", "free")
    references = scenario.references(nodes[[0, -1]])[1]
    for column, (owner, coordinate) in enumerate(scenario.owners()):
        if owner is None and coordinate in ATTITUDE:
            lower[:, column], upper[:, column] = -tube.attitude, tube.attitude
        for end in (0, -1):
            if (tube.ends if owner is None else ends) == "exact":
                lower[end, [column, n + column]] = upper[end, [column, n + column]] = 0.0
            elif owner is not None and ends == "rest":
                # The deviation undoes what speed the reference has there.
                lower[end, n + column] = upper[end, n + column] = -references[owner].velocity[end, coordinate]
    return lower.ravel(), upper.ravel()


class _Watch(ca.Callback):
    """Tells a progress function about each iteration of the solver, and stops it when a person presses Ctrl-C."""

    def __init__(self, program: Program, progress: Progress | None):
        super().__init__()
        self._sizes = {"x": program.problem["x"].numel(), "g": program.problem["g"].numel(), "f": 1}
        self._bounds = (program.lower_g, program.upper_g)
        self._progress = progress
        self._iteration = 0
        self.interrupted = False
        self.construct("watch", {})

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
