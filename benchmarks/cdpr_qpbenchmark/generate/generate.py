"""Write `data/cdpr.parquet` and `data/cdpr_infeasible.parquet` from the robots of towline's library.

    python generate/generate.py [FOLDER]

Needs towline and qpbenchmark. Everything is seeded. Each QP that is declared feasible is one that towline solves, and
each that is declared infeasible has a verified certificate.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import qpbenchmark
from qpbenchmark.problem_list import ProblemList

from towline.benchmarks.qp_solver import as_qp
from towline.models import Dynamics, available, load
from towline.solvers import TensionProblem, certify, solve
from towline.statics.distribution import pose_problem, wrench_problem

DATA = Path(__file__).resolve().parent.parent / "data"

REDUNDANT = ["acrobot", "caroca", "cogiro", "example-spatial", "ipanema-1", "ipanema-2", "the-cable-robot-simulator"]
STIFFNESS = 1e3  # Cost of a missing wrench in the soft problems, relative to the same tension.
STEP = 1e-3  # [s] of the trajectories


def static_poses(rng: np.random.Generator) -> Iterator[TensionProblem]:
    """Yield robots at rest: home if they can rest there, and two random poses; up to three for each robot."""
    for name in available():
        dynamics = Dynamics(load(name))
        robot = dynamics.robot
        spread = robot.dof_mask * np.r_[np.ptp(robot.home_anchors, axis=0) / 4, np.full(3, 0.2)]
        count = 0
        for trial in range(60):
            pose = robot.home + spread * rng.uniform(-1, 1, 6) * min(trial, 1) * 0.97**trial
            problem = pose_problem(dynamics, pose)
            if count < 3 and solve(problem).feasible:
                count += 1
                yield problem


def trajectories(rng: np.random.Generator) -> Iterator[TensionProblem]:
    """Yield twelve samples at 1 kHz of a circle about home by two robots: nearly equal, as in a control loop."""
    for name, radius, frequency in (("ipanema-1", 0.3, 1.0), ("caroca", 0.5, 0.5)):
        dynamics = Dynamics(load(name))
        start, omega = rng.uniform(0, 1), 2 * np.pi * frequency
        for k in range(12):
            phase = omega * (start + STEP * k)
            circle = radius * np.array([np.cos(phase), np.sin(phase), 0, 0, 0, 0])
            tangent = radius * np.array([-np.sin(phase), np.cos(phase), 0, 0, 0, 0])
            yield pose_problem(dynamics, dynamics.robot.home + circle, omega * tangent, -(omega**2) * circle)


def near_singular(rng: np.random.Generator) -> Iterator[TensionProblem]:
    """Yield wrench matrices with singular values of 1e-3 to 1e-9, and at last two that have lost rank.

    Every cable line of wang-flying-printed meets in one point when the platform is level; all upper cables of ipanema-1
    lie in a plane when the platform is as high as their anchors.
    """
    for tilt in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 0.0):
        yield _given(rng, "wang-flying-printed", np.array([0, 0, 0, tilt, 0.7 * tilt, -0.4 * tilt]))
    for below in (1e-2, 1e-4, 1e-6, 1e-8, 0.0):
        yield _given(rng, "ipanema-1", np.array([0.2, 0.1, 1.0 - below, 0, 0, 0]))


def degenerate(rng: np.random.Generator) -> Iterator[TensionProblem]:
    """Yield wrenches on the boundary of the available wrench set, where the limits alone determine the tensions."""
    for name in REDUNDANT:
        for _ in range(2):
            yield _beyond(rng, name, 0.0)


def soft(rng: np.random.Generator) -> Iterator[TensionProblem]:
    """Yield wrenches within reach and out of it, of which some may be missing: variables (t, e) with A t + e = w."""
    for name in REDUNDANT:
        for beyond in (0.0, 1.0, 3.0):
            hard = _beyond(rng, name, beyond) if beyond else _given(rng, name, np.zeros(6))
            yield TensionProblem(
                np.hstack([hard.scaled_A, np.eye(hard.n)]),
                hard.scaled_w,
                np.r_[hard.t_min, np.full(hard.n, -np.inf)],
                np.r_[hard.t_max, np.full(hard.n, np.inf)],
                weights=np.r_[np.ones(hard.m), np.full(hard.n, STIFFNESS)],
            )


def infeasible(rng: np.random.Generator) -> Iterator[TensionProblem]:
    """Yield wrenches beyond the available wrench set, by 1e-6 to 1 of the largest tension."""
    for name in REDUNDANT:
        for part in (1e-6, 1e-4, 1e-2, 0.1, 1.0):
            yield _beyond(rng, name, part)


def _given(rng: np.random.Generator, name: str, offset: np.ndarray) -> TensionProblem:
    """Return the wrench of random tensions between the limits, at an offset from home."""
    dynamics = Dynamics(load(name))
    robot = dynamics.robot
    A = dynamics.wrench_matrix(robot.home + offset)
    tensions = robot.t_min + rng.uniform(0.02, 0.98, robot.m) * (robot.t_max - robot.t_min)
    return wrench_problem(robot, A, A @ tensions)


def _beyond(rng: np.random.Generator, name: str, part: float) -> TensionProblem:
    """Return a wrench at `part` times the largest tension beyond the boundary, along the normal there."""
    dynamics = Dynamics(load(name))
    robot = dynamics.robot
    scale = robot.wrench_scale * robot.dof_mask
    spread = np.r_[np.ptp(robot.home_anchors, axis=0) / 8, np.full(3, 0.1)]
    A = dynamics.wrench_matrix(robot.home + robot.dof_mask * spread * rng.uniform(-1, 1, 6))
    normal = rng.normal(size=6) * robot.dof_mask
    normal /= np.linalg.norm(normal)
    corner = np.where((scale * normal) @ A > 0, robot.t_max, robot.t_min)
    w = A @ corner + part * robot.t_max.max() * normal / np.where(scale > 0, scale, 1.0)
    return wrench_problem(robot, A, w)


SETS = {"STATIC": static_poses, "TRAJ": trajectories, "SINGULAR": near_singular, "DEGEN": degenerate, "SOFT": soft}


def feasible_problems() -> Iterator[tuple[str, TensionProblem]]:
    """Yield names and problems of the test set."""
    for seed, (code, make) in enumerate(SETS.items()):
        for number, problem in enumerate(make(np.random.default_rng(seed))):
            answer = solve(problem)
            if not answer.feasible:
                raise RuntimeError(f"{code}{number}: {answer.status}: {answer.detail}")
            yield f"{code}{number:03d}", problem


def infeasible_problems() -> Iterator[tuple[str, TensionProblem]]:
    """Yield names and problems of the set kept apart."""
    for number, problem in enumerate(infeasible(np.random.default_rng(100))):
        if certify(problem) is None:
            raise RuntimeError(f"INFEAS{number}: has no certificate")
        yield f"INFEAS{number:03d}", problem


def collect(named: Iterator[tuple[str, TensionProblem]]) -> ProblemList:
    """Return the problems as qpbenchmark saves them."""
    problems = ProblemList()
    for name, problem in named:
        qp: dict[str, Any] = {"G": None, "h": None, **as_qp(problem)}
        problems.append(qpbenchmark.Problem(name=name, **qp))
    return problems


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else DATA
    collect(feasible_problems()).to_parquet(str(folder / "cdpr.parquet"))
    collect(infeasible_problems()).to_parquet(str(folder / "cdpr_infeasible.parquet"))
