"""Plan random tasks over six robots, and check what each plan claims.

    python -m towline.benchmarks.random_tasks [--count 200] [--start 0]

A seed determines a task. A feasible plan must have tensions inside their limits that give the force, by equations that
are written here again. An infeasible plan must have a certificate, which is verified again, or carriers that the task
itself moves beyond their limits. Plans of status "not-found" are counted. The exit code is 1 if more than 5 % have
that status or any plan claims what is not true.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from typing import Any, NamedTuple

import numpy as np

from ..distribution import wrench_problem
from ..errors import TowlineError
from ..models import Dynamics, Robot, load
from ..ocp import MotionStatus, Plan, Task, plan
from ..solvers import solve

ROBOTS = ("wang-flying", "wang-ctmrts-6", "ipanema-1", "cogiro", "planar-4", "wang-flying-quadrotor")
MOST_NOT_FOUND = 0.05


class Outcome(NamedTuple):
    """Hold the result of the task of one seed."""

    seed: int
    robot: str
    result: str  # a `MotionStatus`, or "wrong: ..." with the reason
    seconds: float


def main() -> None:
    """Run the tasks and print a summary."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=200, help="number of tasks (default: 200)")
    parser.add_argument("--start", type=int, default=0, help="the first seed (default: 0)")
    options = parser.parse_args()
    if options.count < 1:
        parser.error(f"--count must be 1 or more, got {options.count}")
    if options.start < 0:
        parser.error(f"--start must be 0 or more, got {options.start}")
    outcomes = []
    for seed in range(options.start, options.start + options.count):
        outcomes.append(attempt(seed))
        if outcomes[-1].result not in (MotionStatus.FEASIBLE, MotionStatus.INFEASIBLE):
            print(f"seed {seed}, {outcomes[-1].robot}: {outcomes[-1].result}", flush=True)
    counts = Counter(outcome.result.split(":")[0] for outcome in outcomes)
    times = [outcome.seconds for outcome in outcomes]
    slowest = max(outcomes, key=lambda outcome: outcome.seconds)
    longest = f"longest {slowest.seconds:.1f} s (seed {slowest.seed}, {slowest.robot})"
    print(f"{dict(counts)}; median {np.median(times):.2f} s, {longest}")
    sys.exit(counts["wrong"] > 0 or counts[MotionStatus.NOT_FOUND] > MOST_NOT_FOUND * len(outcomes))


def attempt(seed: int) -> Outcome:
    """Plan the task of a seed and check what the plan claims."""
    name, task = random_task(seed)
    start = time.perf_counter()
    try:
        planned = plan(load(name), task)
        result = wrong(planned) or planned.status.value
    except TowlineError as error:
        result = f"wrong: {error}"
    return Outcome(seed, name, result, time.perf_counter() - start)


def wrong(planned: Plan) -> str:
    """Return which claim of a plan is not true, "wrong: ..."; empty if all are."""
    audit, robot = planned.audit, planned.scenario.robot
    low, high = robot.t_min, robot.t_max
    if planned.status is MotionStatus.FEASIBLE:
        tensions = audit.tensions
        if not ((tensions >= low) & (tensions <= high)).all():
            return "wrong: feasible, but a tension is beyond its limits"
        A = planned.scenario.dynamics.wrench_matrix(audit.motion.pose, audit.carriers.pose)
        w = planned.scenario.dynamics.required_wrench(*audit.motion, *audit.carriers, wind=planned.scenario.wind)
        short = ((np.einsum("nij,nj->ni", A, tensions) - w) * robot.dof_mask)[:, :3]
        if np.linalg.norm(short, axis=1).max() > max(audit.tolerance, 1e-6):
            return "wrong: feasible, but the tensions do not give the force"
        return "" if not audit.excess else "wrong: feasible, but a limit is exceeded"
    if planned.status is MotionStatus.INFEASIBLE and not audit.excess:
        certificate = planned.certificate
        if certificate is None or certificate.time is None:
            return "wrong: infeasible, but nothing proves it"
        row = int(np.argmin(np.abs(audit.times - certificate.time)))
        pose, carriers = audit.motion.pose[row], audit.carriers.pose[row]
        A = planned.scenario.dynamics.wrench_matrix(pose, carriers)
        motions = [part[row] for part in (*audit.motion, *audit.carriers)]
        wind = certificate.wind or planned.scenario.wind
        w = planned.scenario.dynamics.required_wrench(*motions, wind=wind)
        problem = wrench_problem(planned.scenario.robot, A, w, *planned.scenario.bounds())
        return "" if certificate.verify(problem) else "wrong: infeasible, but its certificate proves nothing"
    return ""


def random_task(seed: int) -> tuple[str, Task]:
    """Return a robot's name and a task for it: path, duration, tube, base, limits and objective of any kind.

    Where the planner has something to choose, the platform can rest at the points that make the path, with its carriers
    at home. Every fifth task leaves nothing to choose and goes anywhere.
    """
    rng = np.random.default_rng(seed)
    name = ROBOTS[seed % len(ROBOTS)]
    robot = load(name)
    anchors = robot.anchors + robot.carrier_home[robot.carrier_of_cable, :3]
    size = float(np.clip(np.ptp(anchors, axis=0).max(), 0.5, 3.0))
    fixed = seed % 5 == 0
    path = _path(rng, robot, 0.25 * size, anywhere=fixed)
    task: dict[str, Any] = {"name": f"random-{seed}", "path": path, "steps": 40}
    stretches = path["kind"] in ("line", "waypoints")
    duration = float(rng.uniform(3.0, 8.0))
    if stretches:
        task["duration"] = duration
    if fixed:
        task["base"] = _fixed_base(rng, robot)
        return name, Task.model_validate(task)
    task["margin"] = float(rng.choice([0.0, 0.05]))
    task["base"] = _base(rng, robot)
    if stretches and rng.random() < 0.3:
        task["duration"] = {"min": 0.5 * duration, "max": 3.0 * duration}
        task["objective"] = {"time": 1.0}
    if rng.random() < 0.5:
        task["tube"] = {"position": float(rng.choice([0.02, 0.1])) * size, "attitude": float(rng.choice([0.0, 0.1]))}
    if rng.random() < 0.3:
        task["limits"] = {"platform_speed": float(rng.uniform(2.0, 5.0)), "tension_rate": 1e4}
    return name, Task.model_validate(task)


def _path(rng: np.random.Generator, robot: Robot, reach: float, anywhere: bool) -> dict[str, Any]:
    """Return a path about the platform's home, in its degrees of freedom."""
    dynamics, home = Dynamics(robot), robot.home
    rest = np.zeros(6)

    def near() -> np.ndarray:
        pose = home.copy()
        for attempt in range(100):
            pose = home.copy()
            pose[:3] += rng.uniform(-reach, reach, 3) * 0.97**attempt * robot.dof_mask[:3]
            pose[3:] += rng.uniform(-0.05, 0.05, 3) * robot.dof_mask[3:]
            if anywhere or _can_rest(dynamics, pose, rest):
                break
        return pose

    kind = rng.choice(["line", "waypoints", "circle"])
    if kind == "circle" and robot.dof_mask[:2].all():
        radius = 0.5 * float(np.linalg.norm((near() - home)[:2]))
        rate = float(rng.choice([-1, 1]) * rng.uniform(0.3, 1.0))
        return {
            "kind": "circle",
            "centre": home[:3].tolist(),
            "radius": radius,
            "rate": rate,
            "attitude": home[3:].tolist(),
        }
    if kind == "waypoints":
        return {"kind": "waypoints", "points": [near().tolist() for _ in range(3)]}
    return {"kind": "line", "start": near().tolist(), "end": near().tolist()}


def _can_rest(dynamics: Dynamics, pose: np.ndarray, rest: np.ndarray) -> bool:
    robot = dynamics.robot
    A, w = dynamics.wrench_matrix(pose), dynamics.required_wrench(pose, rest, rest)
    spare = 0.05 * (robot.t_max - robot.t_min)
    return solve(wrench_problem(dynamics.robot, A, w, robot.t_min + 0.1, robot.t_max - spare)).feasible


def _fixed_base(rng: np.random.Generator, robot: Robot) -> dict[str, Any]:
    """Return carriers at rest at home, or one carrier that moves along a given path."""
    carrier = robot.carriers[0]
    if carrier.confined or carrier.efforts or rng.random() < 0.5:
        return {"kind": "hold"}
    start = robot.carrier_home[0]
    end = start + np.r_[rng.uniform(-1, 1, 3), 0.0, 0.0, 0.0]
    path = {"kind": "line", "start": start.tolist(), "end": end.tolist()}
    return {"kind": "given", "paths": {carrier.name: path}}


def _base(rng: np.random.Generator, robot: Robot) -> dict[str, Any]:
    """Return free carriers where the robot has some that can move: always for quadrotors, mostly for others."""
    held, movable = (any(values) for values in zip(*((c.efforts, c.moves) for c in robot.carriers), strict=True))
    if held or (movable and rng.random() < 0.8):
        return {"kind": "free", "ends": str(rng.choice(["free", "rest"]))}
    return {"kind": "hold"}


if __name__ == "__main__":
    main()
