"""Paper F's circle with the base free: towline against rockit and CasADi's Opti, in one run.

    python -m towline.benchmarks.planning [--steps 100] [--runs 5] [--figure cost.png]

All three plan the same motion: the platform on the circle and level, the tensions inside their limits, the quadrotor's
acceleration at most 3 m/s^2, the last state as the first. The peers do it as their manuals do: multiple shooting with
RK4 of the platform's forward dynamics, tensions and base acceleration constant in each interval, the pose as the path
says at every node, IPOPT with its defaults, from a guess that stands on the path (towline makes its own). "Again" is
the same object solved once more, from its own solution. Each figure is the median of several runs.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ..models import Dynamics, load
from ..ocp import Planner, Task
from ..studies.flying.circle import HOVER, tasks
from .machine import machine

ROBOT = "wang-flying"
MOST = 3.0  # acceleration of the base [m/s^2]
QUIET = {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes"}}
STEPS = (50, 100, 200, 400, 800, 1600)


class Timing(NamedTuple):
    """Build and first solve, and once more [s]; whether it converged."""

    first: float
    again: float
    converged: bool


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--figure", type=Path, help="PNG of towline's cost against the number of steps")
    options = parser.parse_args()
    if options.steps < 4 or options.runs < 1:
        parser.error(f"--steps: {options.steps}, --runs: {options.runs}; accepted: from 4 on, from 1 on")
    print(machine(("casadi", "rockit-meco", "numpy")))
    ours = _medians(towline, options.steps, options.runs)
    print(_line("towline", ours, ours))
    for name, contender in (("casadi Opti", opti), ("rockit", rockit)):
        # They take a minute: three runs tell as much.
        print(_line(name, _medians(contender, options.steps, min(options.runs, 3)), ours), flush=True)
    if options.figure is not None:
        times = [_medians(towline, steps, options.runs).first for steps in STEPS]
        for steps, seconds in zip(STEPS, times, strict=True):
            print(f"towline, {steps} steps: {seconds:.3f} s, {1e3 * seconds / steps:.2f} ms a step")
        draw(times, options.figure)


def _medians(contender: Callable[[int], Timing], steps: int, runs: int) -> Timing:
    done = [contender(steps) for _ in range(runs)]
    return Timing(
        median(one.first for one in done), median(one.again for one in done), all(one.converged for one in done)
    )


def _line(name: str, timing: Timing, ours: Timing) -> str:
    ratios = f"{timing.first / ours.first:6.1f} x, {timing.again / ours.again:6.1f} x of towline"
    converged = "" if timing.converged else "  NOT CONVERGED"
    return f"{name:12} build and first solve {timing.first:8.3f} s, again {timing.again:8.3f} s  {ratios}{converged}"


def task(steps: int) -> Task:
    """The circle with the base free."""
    return tasks()[1].model_copy(update={"steps": steps})


def towline(steps: int) -> Timing:
    """Plan, and plan again; the audit is not counted, the others have none."""
    robot = load(ROBOT)
    planner = Planner(robot, task(steps))
    first = planner.plan()
    planner.plan()  # the solver for a warm start is made here
    again = planner.plan()
    return Timing(first.build_s + first.solve_s, again.build_s + again.solve_s, first.feasible and again.feasible)


class _Shooting:
    """What both peers need: the dynamics as x' = f(x, u), the path, bounds and a guess."""

    def __init__(self, steps: int) -> None:
        self.robot = load(ROBOT)
        self.steps = steps
        path = task(steps).path
        self.seconds = task(steps).seconds
        nodes = np.linspace(0.0, self.seconds, steps + 1)
        self.path = path.at(nodes, self.seconds)
        x, u = ca.SX.sym("x", 18), ca.SX.sym("u", 9)
        base = ca.horzcat(x[12:15].T, ca.DM(HOVER[3:]).T)
        acceleration = Dynamics(self.robot).functions["acceleration"](x[:6], x[6:12], u[:6], base)
        rate = ca.vertcat(x[6:12], acceleration, x[15:18], u[6:9])
        self.f = ca.Function("f", [x, u], [rate])

    def guess(self) -> tuple[np.ndarray, np.ndarray]:
        """States (18, N + 1) and controls (9, N): the path, the base above it, tensions in the middle of the weight."""
        offset = np.array([0.0, 0.0, HOVER[2] - self.path.pose[0, 2]])
        base = self.path.pose[:, :3] + offset
        states = np.hstack([self.path.pose, self.path.velocity, base, self.path.velocity[:, :3]]).T
        tensions = np.full((self.steps, 6), self.robot.force_scale / 6)
        return states, np.hstack([tensions, self.path.acceleration[:-1, :3]]).T

    def cost(self, u: Any, x: Any) -> Any:
        """Running cost: as towline's, tensions by the weight, the base by its offset and acceleration."""
        offset = x[12:15] - ca.DM(HOVER[:3])
        return ca.sumsqr(u[:6]) / self.robot.force_scale**2 + ca.sumsqr(u[6:9]) + ca.sumsqr(offset) / 100.0


def opti(steps: int) -> Timing:
    """CasADi's Opti, by hand."""
    start = time.perf_counter()
    problem = _Shooting(steps)
    h = problem.seconds / steps
    x, u = ca.MX.sym("x", 18), ca.MX.sym("u", 9)
    k1 = problem.f(x, u)
    k2 = problem.f(x + h / 2 * k1, u)
    k3 = problem.f(x + h / 2 * k2, u)
    k4 = problem.f(x + h * k3, u)
    step = ca.Function("step", [x, u], [x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])
    nlp = ca.Opti()
    X, U = nlp.variable(18, steps + 1), nlp.variable(9, steps)
    cost = 0.0
    for k in range(steps):
        nlp.subject_to(X[:, k + 1] == step(X[:, k], U[:, k]))
        nlp.subject_to(nlp.bounded(problem.robot.t_min, U[:6, k], problem.robot.t_max))
        nlp.subject_to(ca.sumsqr(U[6:9, k]) <= MOST**2)
        nlp.subject_to(X[:6, k + 1] == problem.path.pose[k + 1])
        cost += problem.cost(U[:, k], X[:, k]) / steps
    nlp.subject_to(X[:, 0] == X[:, -1])
    nlp.minimize(cost)
    nlp.solver("ipopt", {"print_time": False}, QUIET["ipopt"])
    states, controls = problem.guess()
    nlp.set_initial(X, states)
    nlp.set_initial(U, controls)
    converged, solution = _solved(nlp.solve)
    first = time.perf_counter() - start
    if solution is None:
        return Timing(first, np.nan, False)
    start = time.perf_counter()
    nlp.set_initial(nlp.x, solution.value(nlp.x))
    nlp.set_initial(nlp.lam_g, solution.value(nlp.lam_g))
    again, _ = _solved(nlp.solve)
    return Timing(first, time.perf_counter() - start, converged and again)


def rockit(steps: int) -> Timing:
    """Rockit, as in its examples."""
    from rockit import MultipleShooting, Ocp

    start = time.perf_counter()
    problem = _Shooting(steps)
    make: Any = Ocp  # its types say that T is a whole number and that a state may be None
    ocp = make(T=problem.seconds)
    x, u = ocp.state(18), ocp.control(9)
    wanted = ocp.parameter(6, grid="control+")
    ocp.set_value(wanted, problem.path.pose.T)
    ocp.set_der(x, problem.f(x, u))
    ocp.subject_to(problem.robot.t_min <= (u[:6] <= problem.robot.t_max))
    ocp.subject_to(ca.sumsqr(u[6:9]) <= MOST**2)
    ocp.subject_to(x[:6] == wanted, include_first=False)
    ocp.subject_to(ocp.at_t0(x) == ocp.at_tf(x))
    ocp.add_objective(ocp.integral(problem.cost(u, x)) / problem.seconds)
    ocp.solver("ipopt", QUIET)
    ocp.method(MultipleShooting(N=steps, M=1, intg="rk"))
    states, controls = problem.guess()
    ocp.set_initial(x, states)
    ocp.set_initial(u, controls)
    converged, solution = _solved(ocp.solve)
    first = time.perf_counter() - start
    if solution is None:
        return Timing(first, np.nan, False)
    start = time.perf_counter()
    ocp.set_initial(x, solution.sample(x, grid="control")[1].T)
    ocp.set_initial(u, solution.sample(u, grid="control")[1][:-1].T)
    again, _ = _solved(ocp.solve)
    return Timing(first, time.perf_counter() - start, converged and again)


def _solved(solve: Callable[[], Any]) -> tuple[bool, Any]:
    """Whether it converged, and the solution; both peers raise if it did not."""
    try:
        return True, solve()
    except RuntimeError:
        return False, None


def draw(times: list[float], path: Path) -> None:
    """Draw towline's time against the number of steps, with a line of constant cost a step and 20 % above it."""
    from ..figures import style

    canvas = style.figure(4.0, 3.0)
    ax = style.axes(canvas, "intervals N", "build and solve [s]")
    steps = np.array(STEPS, dtype=float)
    ax.loglog(steps, times, "o-", color=style.colour(0), label="towline")
    linear = times[0] * steps / steps[0]
    ax.loglog(steps, linear, **style.LIMIT, label="linear from N = 50")
    ax.legend(fontsize="small")
    style.save(canvas, path)


if __name__ == "__main__":
    main()
