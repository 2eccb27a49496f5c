"""Where the planner starts."""

from __future__ import annotations

import numpy as np

from .scenario import POSITION, Deviation, Scenario

__all__ = ["initial_guess"]


def initial_guess(scenario: Scenario, nodes: np.ndarray) -> Deviation:
    """A guess that needs nothing from the user.

    Carriers that may go anywhere keep their places about the platform, as at home; others stay. The tensions are those
    of least norm, cut to their limits.
    """
    robot = scenario.robot
    n = scenario.count
    q, v, a = (np.zeros((len(nodes), n)) for _ in range(3))
    platform, carriers = scenario.references(nodes)
    for column, (owner, coordinate) in enumerate(scenario.owners()):
        if owner is None or scenario.relative or coordinate not in POSITION:
            continue
        if robot.carriers[owner].kind in ("prescribed", "quadrotor"):
            offset = robot.carrier_home[owner, coordinate] - robot.home[coordinate]
            q[:, column] = platform.pose[:, coordinate] + offset - carriers[owner].pose[:, coordinate]
            v[:, column] = platform.velocity[:, coordinate] - carriers[owner].velocity[:, coordinate]
            a[:, column] = platform.acceleration[:, coordinate] - carriers[owner].acceleration[:, coordinate]
    guess = Deviation(nodes, q, v, a, np.zeros((len(nodes), robot.m)))
    moved, bases = scenario.motion(nodes, guess)
    A = scenario.dynamics.wrench_matrix(moved.pose, bases.pose)
    w = scenario.dynamics.required_wrench(*moved, wind=scenario.task.wind)
    least = (np.linalg.pinv(A, rcond=1e-6) @ w[..., None])[..., 0]
    return Deviation(nodes, q, v, a, np.clip(least, *scenario.bounds()))
