"""Time paper F's circle with the base free: towline against CasADi by hand and rockit, in one run.

    python -m towline.benchmarks.planning [--steps 100] [--runs 5]

Every solution is audited by towline's audit; one that does not pass ends the benchmark with code 1. "Again" is the same
program solved once more, from its own solution. The contenders alternate; times are medians of all runs. The ratio
to towline is the median of the ratios of runs in the same turn.

All have the same task: the platform on the circle and level, every tension inside its limits, the base's acceleration
at most 3 m/s^2 and linear in each interval, the last state and the base's last acceleration equal to the first, and the
same costs. All use IPOPT with the same tolerances, scaled unknowns and exact Hessians; they start from a guess on the
path, and again from their own solution and its multipliers. What only the second solve needs is made before its time is
taken.

- towline: `Planner`, which makes its own guess.
- CasADi: the same inverse dynamics written out for this robot and this task alone, as one function of a node that is
  mapped over the nodes, so that it is differentiated only once.
- rockit: as its manual does it, multiple shooting with RK4 of the platform's forward dynamics, tensions and
  base jerk constant in each interval. The step is an SX function: to expand the whole program makes an
  iteration a tenth faster and the first solve four times slower.
"""

import argparse
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ..models import Robot, load
from ..models.rotation import inverse_rate_matrix, rotation
from ..ocp import Planner, Task
from ..ocp.audits.audit import Audit, audit
from ..ocp.nlp.solver import FROM_A_SOLUTION
from ..ocp.tasks.deviation import Deviation
from ..ocp.tasks.lay_out import lay_out
from ..ocp.tasks.paths import Motion
from ..studies.flying.circle import HOVER, tasks
from .harness import alternating, machine, ratio, table as table_of

ROBOT = "wang-flying"
MOST = 3.0  # acceleration of the base [m/s^2]
OFFSET, JERK = 10.0, 10.0  # base away from the hovering point [m], and its jerk [m/s^3], that cost as much as 1 m/s^2
ACCURACY = {"print_level": 0, "sb": "yes", "tol": 1e-8, "constr_viol_tol": 1e-9}
OPTIONS = {"print_time": False, "error_on_fail": True}  # of `nlpsol`: a solve that fails raises RuntimeError
FIRST = ACCURACY | {"mu_init": 1e-3}  # the guess is near: IPOPT's own 0.1 takes more iterations
AGAIN = ACCURACY | FROM_A_SOLUTION
Solve = Callable[..., Any]  # (states, controls, multipliers) -> the same of the solution


class Run(NamedTuple):
    """Times of build and first solve and of the second solve [s], and the audits of both solutions."""

    first: float
    again: float
    audits: tuple[Audit, Audit]


def circle(steps: int) -> Task:
    """Return the circle with the base free, on so many intervals."""
    return tasks()[1].model_copy(update={"steps": steps})


def towline(steps: int) -> Run:
    """Plan twice with one `Planner`; its audits and its check of rest are not counted, since no other has them."""
    robot = load(ROBOT)
    start = time.perf_counter()
    planner = Planner(robot, circle(steps))
    laid_out = time.perf_counter() - start
    first = planner.plan()
    planner.plan()  # the solver for a warm start is made here
    again = planner.plan()
    times = laid_out + first.build_s + first.solve_s, again.build_s + again.solve_s
    return Run(*times, (first.audit, again.audit))


def mapped(steps: int) -> Run:
    """Write inverse dynamics for this robot and this task alone: base motion and tensions at each node.

    The platform is level and does not turn, and neither does the base, so no rotation and no inertia is left. Position
    and speed are integrated exactly from an acceleration that is linear in each interval.
    """
    robot = load(ROBOT)
    weight, m = robot.force_scale, robot.m

    def write(ipopt: dict[str, Any]) -> tuple[Solve, tuple[Any, ...]]:
        task, _, path = _nodes(steps)
        h = task.seconds / steps
        needed = robot.platform.mass * (path.acceleration[:, :3] - np.array(robot.gravity)) / weight
        given = ca.DM(np.hstack([path.pose[:, :3], needed]).T)
        X: Any = ca.MX.sym("X", 9 + m, steps + 1)
        costs, balances = _node(robot).map(steps + 1)(X, given)
        q, v, a = X[:3, :], X[3:6, :], X[6:9, :]
        here, there = a[:, :-1], a[:, 1:]
        position = q[:, 1:] - (q[:, :-1] + h * v[:, :-1] + h**2 / 6 * (2 * here + there))
        speed = h * (v[:, 1:] - (v[:, :-1] + h / 2 * (here + there)))
        shares = np.full((1, steps + 1), 1 / steps)
        shares[0, [0, -1]] /= 2
        problem = {
            "x": ca.vec(X),
            "f": ca.dot(costs, ca.DM(shares)) + ca.sumsqr((there - here) / h) / JERK**2 / steps,
            "g": ca.vertcat(ca.vec(balances), ca.vec(position), ca.vec(speed), X[:9, 0] - X[:9, -1]),
        }
        low, high = np.full((2, 9 + m, steps + 1), np.inf)
        low[:9] *= -1
        low[9:], high[9:] = robot.t_min[:, None] / weight, robot.t_max[:, None] / weight
        node_low, node_high = np.zeros((2, steps + 1, 7))
        node_low[:, 6], node_high[:, 6] = -np.inf, 1.0
        rest = np.zeros(6 * steps + 9)
        bounds = {"lbx": low.ravel("F"), "ubx": high.ravel("F")}
        bounds |= {"lbg": np.r_[node_low.ravel(), rest], "ubg": np.r_[node_high.ravel(), rest]}
        guess = np.zeros((9 + m, steps + 1))
        guess[:3] = (path.pose[:, :3] - path.pose[:, :3].mean(axis=0)).T
        guess[3:6], guess[6:9] = path.velocity[:, :3].T, path.acceleration[:, :3].T
        guess[9:] = 1 / m
        solver = ca.nlpsol("mapped", "ipopt", problem, OPTIONS | {"ipopt": ipopt})

        def solve(*start: Any) -> tuple[ca.DM, ...]:
            found = solver(**dict(zip(("x0", "lam_x0", "lam_g0"), start, strict=True)), **bounds)
            return found["x"], found["lam_x"], found["lam_g"]

        return solve, (guess.ravel("F"), 0, 0)

    def audited(x: ca.DM, *_: ca.DM) -> Audit:
        task, nodes, _path = _nodes(steps)
        columns = x.full().reshape(9 + m, steps + 1, order="F").T
        parts = columns[:, :3], columns[:, 3:6], columns[:, 6:9], weight * columns[:, 9:]
        return audit(lay_out(robot, task), Deviation(nodes, *parts))

    return _twice(write, audited)


def _nodes(steps: int) -> tuple[Task, np.ndarray, Motion]:
    """Return the task, the instants of its nodes (N + 1,) [s], and the path there."""
    task = circle(steps)
    nodes = np.linspace(0.0, task.seconds, steps + 1)
    return task, nodes, task.path.at(nodes, task.seconds)


def _twice(write: Callable[[dict[str, Any]], tuple[Solve, tuple[Any, ...]]], audited: Callable[..., Audit]) -> Run:
    """Write a program and solve it from its guess; then solve it from its solution, with a solver made before."""
    start = time.perf_counter()
    solve, guess = write(FIRST)
    solution = solve(*guess)
    first = time.perf_counter() - start
    solve, _ = write(AGAIN)
    start = time.perf_counter()
    repeated = solve(*solution)
    return Run(first, time.perf_counter() - start, (audited(*solution), audited(*repeated)))


def _node(robot: Robot) -> ca.Function:
    """Return cost and constraints of a node with (q, v, a, tensions / weight), given (place, force / weight)."""
    x, given = ca.SX.sym("x", 9 + robot.m), ca.SX.sym("given", 6)
    q, _, a, tensions = ca.vertsplit(x, [0, 3, 6, 9, 9 + robot.m])
    force, moment = -given[3:], ca.SX.zeros(3)
    for i in range(robot.m):
        cable = ca.DM(np.array(HOVER[:3]) + robot.anchors[i] - robot.attachments[i]) + q - given[:3]
        pull = tensions[i] / ca.norm_2(cable) * cable
        force += pull
        moment += ca.cross(ca.DM(robot.attachments[i] / robot.length), pull)
    cost = ca.sumsqr(tensions) + ca.sumsqr(a) + ca.sumsqr(q) / OFFSET**2
    values = ca.vertcat(force, moment, ca.sumsqr(a) / MOST**2)
    return ca.Function("node", [x, given], [cost, values], {"cse": True, "is_diff_in": [True, False]})


def _step(robot: Robot, h: float) -> ca.Function:
    """Return (x, u) -> x after h [s], by RK4 of Newton's and Euler's equations for a CoM in the platform's origin."""
    x, u = ca.SX.sym("x", 21), ca.SX.sym("u", 9)
    R, rates, inertia = rotation(x[3:6]), x[9:12], ca.DM(robot.inertia)
    force, moment = robot.platform.mass * ca.DM(robot.gravity), ca.SX.zeros(3)
    for i in range(robot.m):
        arm = R @ ca.DM(robot.attachments[i])
        cable = x[12:15] + ca.DM(robot.anchors[i]) - x[:3] - arm
        pull = robot.force_scale * u[i] / ca.norm_2(cable) * cable
        force += pull
        moment += ca.cross(arm, pull)
    turning = ca.inv(inertia) @ (R.T @ moment - ca.cross(rates, inertia @ rates))
    moving = [x[6:9], inverse_rate_matrix(x[3:6]) @ rates, force / robot.platform.mass, turning]
    f = ca.Function("f", [x, u], [ca.vertcat(*moving, x[15:], u[6:])])
    return ca.Function("step", [x, u], [ca.simpleRK(f, 1)(x, u, h)], {"cse": True})


def rockit(steps: int) -> Run:
    """Write a shooting with rockit, and solve it.

    x = (position, angles, velocity and body rates of the platform, position, velocity and acceleration of the base),
    u = (tensions over the weight, jerk of the base).
    """
    robot = load(ROBOT)

    def write(ipopt: dict[str, Any]) -> tuple[Solve, tuple[Any, ...]]:
        from rockit import MultipleShooting, Ocp

        task, _, path = _nodes(steps)
        make: Any = Ocp  # by its types T is a whole number and a state may be None
        ocp = make(T=task.seconds)
        x, u = ocp.state(21), ocp.control(9)
        place = ocp.parameter(6, grid="control+")
        ocp.set_value(place, path.pose.T)
        ocp.set_next(x, _step(robot, task.seconds / steps)(x, u))
        ocp.subject_to(robot.t_min / robot.force_scale <= (u[:6] <= robot.t_max / robot.force_scale))
        ocp.subject_to(ca.sumsqr(x[18:]) / MOST**2 <= 1)
        ocp.subject_to(x[:6] == place, include_first=False)
        ocp.subject_to(ocp.at_t0(x) == ocp.at_tf(x))
        moved = ca.sumsqr(x[18:]) + ca.sumsqr(x[12:15] - ca.DM(HOVER[:3])) / OFFSET**2
        ocp.add_objective(ocp.sum(ca.sumsqr(u[:6]) + ca.sumsqr(u[6:]) / JERK**2 + moved) / steps)
        ocp.solver("ipopt", OPTIONS | {"ipopt": ipopt})
        ocp.method(MultipleShooting(N=steps))
        X, U = (ocp.sample(each, grid=grid)[1] for each, grid in ((x, "control"), (u, "control-")))
        places = ocp.sample(place, grid="control")[1]
        multipliers = ocp._method.opti.lam_g  # rockit's own code generator takes it from here too
        solve = ocp.to_function("rockit", [X, U, multipliers, places], [X, U, multipliers])
        # On the path, the base above it, the weight shared out.
        base = path.pose[:, :3] - path.pose[:, :3].mean(axis=0) + HOVER[:3]
        acceleration = path.acceleration[:, :3]
        states = np.hstack([path.pose, path.velocity, base, path.velocity[:, :3], acceleration]).T  # (21, N + 1)
        jerk = np.diff(acceleration, axis=0) * steps / task.seconds
        controls = np.hstack([np.full((steps, 6), 1 / 6), jerk]).T  # (9, N)
        return lambda X, U, multipliers: solve(X, U, multipliers, path.pose.T), (states, controls, 0)

    def audited(x: ca.DM, u: ca.DM, _: ca.DM) -> Audit:
        task, nodes, _path = _nodes(steps)
        q, v, a = np.hsplit(x.full()[12:].T, 3)
        tensions = robot.force_scale * np.vstack([u.full()[:6].T, u.full()[:6, -1]])
        return audit(lay_out(robot, task), Deviation(nodes, q - HOVER[:3], v, a, tensions))

    return _twice(write, audited)


CONTENDERS: dict[str, Callable[[int], Run]] = {"towline": towline, "CasADi, mapped": mapped, "rockit": rockit}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--steps", type=int, default=100, help="intervals (default: 100)")
    parser.add_argument("--runs", type=int, default=5, help="of each contender (default: 5)")
    options = parser.parse_args()
    if options.steps < 4 or options.runs < 1:
        parser.error(f"--steps must be 4 or more and --runs 1 or more, got {options.steps} and {options.runs}")
    print(machine(("casadi", "rockit-meco", "numpy")))
    runs = measure(options.steps, options.runs)
    print("\n".join(table(runs)))
    if not all(audit.passed for each in runs.values() for run in each for audit in run.audits):
        raise SystemExit(1)


def measure(steps: int, count: int) -> dict[str, list[Run]]:
    """Return `count` runs of each contender on `steps` intervals, alternating."""
    runs: dict[str, list[Run]] = {name: [] for name in CONTENDERS}
    for _, (name, contender) in alternating([*CONTENDERS.items()], count):
        runs[name].append(contender(steps))
    return runs


def table(runs: dict[str, list[Run]]) -> list[str]:
    """Return a line for each contender: medians, their ratios to towline's, and the worst of the audits."""
    rows = []
    for name, each in runs.items():
        cells = [name]
        for kind in ("first", "again"):
            times, ours = ({turn: getattr(run, kind) for turn, run in enumerate(of)} for of in (each, runs["towline"]))
            cells += [f"{np.median([*times.values()]):.3f} s", f"{ratio(times, ours):.2f}"]
        audits = [audit for run in each for audit in run.audits]
        passed = "passed" if all(audit.passed for audit in audits) else "NOT PASSED"
        worst = max(float(audit.violation.max()) for audit in audits)
        rows.append((*cells, f"{passed}, short by {worst:.1e} N at most"))
    return table_of("contender | build and first solve | ratio | again | ratio | audit", rows)


if __name__ == "__main__":
    main()
