"""Random states that a control step has to cope with: easy, impossible, singular, at limits, and no states."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from towline.models import Dynamics, Robot

from ..framed import framed
from .step_code import Array, States

__all__ = ["KINDS", "random_states", "twelve_cables"]

KINDS = ("near", "inside", "at limits", "forceful", "far", "symmetric", "gimbal", "at rest", "no state")


def random_states(robot: Robot, count: int, seed: int, single: bool = False) -> States:
    """Return states of all `KINDS`, one after the other.

    Args:
        robot: Whose states.
        count, seed: How many, and which.
        single: Whether each number is one of single precision.
    """
    rng = np.random.default_rng(seed)
    dynamics, c = Dynamics(robot), len(robot.carriers)
    kind = np.arange(count) % len(KINDS)
    size = float(np.ptp(np.vstack([robot.home_anchors, robot.home[None, :3]]), axis=0).max()) or 1.0
    pose = np.tile(robot.home, (count, 1))
    pose[:, :3] += rng.normal(size=(count, 3)) * 0.1 * size
    pose[:, 3:] += rng.normal(size=(count, 3)) * 0.15
    velocity, acceleration = rng.normal(size=(2, count, 6))
    carriers = np.tile(robot.carrier_home, (count, 1, 1))
    moves = np.array([carrier.moves for carrier in robot.carriers])
    shifts = np.concatenate([np.full(3, 0.03 * size), np.full(3, 0.1)])
    carriers += rng.normal(size=(count, c, 6)) * shifts * moves[:, None]
    wind = rng.normal(size=(count, 3)) * 3.0 if robot.platform.aero else None
    disturbance = rng.normal(size=(count, 6)) * 0.02 * robot.force_scale * np.repeat([1.0, robot.length], 3)

    def rows(name: str) -> NDArray[np.intp]:
        return np.flatnonzero(kind == KINDS.index(name))

    far = rows("far")
    pose[far, :3] += rng.normal(size=(far.size, 3)) * 2.0 * size
    pose[far, 3:] = rng.uniform(-np.pi, np.pi, (far.size, 3))
    symmetric = rows("symmetric")  # where hexagons and boxes lose rank: not turned, some coordinates as at home
    pose[symmetric, 3:] = robot.home[3:]
    keep = rng.random((symmetric.size, 3)) < 0.6
    pose[symmetric, :3] = np.where(keep, robot.home[:3], pose[symmetric, :3])
    carriers[symmetric] = robot.carrier_home
    gimbal = rows("gimbal")
    pose[gimbal, 4] = rng.choice([-0.5, 0.5], gimbal.size) * np.pi
    forceful = rows("forceful")
    acceleration[forceful] *= rng.choice([3.0, 10.0, 100.0, 1e4], (forceful.size, 1))
    rest = rows("at rest")
    pose[rest], carriers[rest] = robot.home, robot.carrier_home
    for still in (velocity, acceleration, disturbance, *([] if wind is None else [wind])):
        still[rest] = 0.0

    # Accelerations that given tensions cause: inside the limits, or with some of them at their limits.
    for name in ("inside", "at limits"):
        chosen = rows(name)
        share = rng.uniform(0.0, 1.0, (chosen.size, robot.m))
        if name == "at limits":
            share = np.where(rng.random(share.shape) < 0.6, np.round(share), share)
        t = robot.t_min + share * (robot.t_max - robot.t_min)
        states = States(pose, velocity, acceleration, carriers, wind, disturbance).select(chosen)
        acceleration[chosen] = _acceleration(dynamics, states, t)

    # Rounded to what a float controller measures: the same state for all.
    everything = [pose, velocity, acceleration, carriers, disturbance, *([] if wind is None else [wind])]
    if single:
        for part in everything:
            part[...] = part.astype(np.float32)
    wrong = rows("no state")
    for row in wrong:
        part = everything[rng.integers(3)]
        part[row, rng.integers(6)] = rng.choice([np.nan, np.inf, -np.inf])
    apart = wrong[::4]  # platforms at the anchor of a cable, which then has no length
    pose[apart] = 0.0
    carriers[apart] = robot.carrier_home
    pose[apart, :3] = robot.home_anchors[0] - robot.attachments[0]
    velocity[apart] = acceleration[apart] = 0.0
    return States(pose, velocity, acceleration, carriers, wind, disturbance)


def _acceleration(dynamics: Dynamics, states: States, tensions: Array) -> Array:
    """Return the acceleration that tensions and disturbance cause, (N, 6), where it is finite, else zero."""
    zero = np.zeros_like(states.pose)
    A = np.asarray(dynamics.wrench_matrix(states.pose, states.carrier_pose))
    still = np.asarray(
        dynamics.required_wrench(states.pose, states.velocity, zero, states.carrier_pose, wind=states.wind)
    )
    pull = np.einsum("nij,nj->ni", A, tensions) + states.disturbance - still
    units = np.eye(6)[:, None] + 0.0 * states.pose  # (6, N, 6)
    inertia = np.asarray(dynamics.required_wrench(states.pose, zero, units, states.carrier_pose)) - np.asarray(
        dynamics.required_wrench(states.pose, zero, zero, states.carrier_pose)
    )  # (6, N, 6): column j of the mass matrix of each
    free = dynamics.robot.dof_mask > 0.0
    matrix = np.moveaxis(inertia, 0, -1)[:, free][:, :, free]
    found = zero
    found[:, free] = np.linalg.solve(matrix, pull[:, free, None])[..., 0]
    return np.where(np.isfinite(found), found, 0.0)


def twelve_cables() -> Robot:
    """Return a robot of twelve cables: a box of 4 m on a frame of 20 m, from each corner of which runs at least one."""
    corners = np.array([[x, y, z] for z in (0.0, 8.0) for x in (-10.0, 10.0) for y in (-7.0, 7.0)])
    inner = np.array([[x, y, z] for z in (1.0, -1.0) for x in (-1.0, 1.0) for y in (-0.7, 0.7)])
    middles = np.array([[0.0, -7.0, 8.0], [0.0, 7.0, 8.0], [-10.0, 0.0, 8.0], [10.0, 0.0, 8.0]])
    middle_inner = np.array([[0.9, -0.7, -1.0], [-0.9, 0.7, -1.0], [-1.0, -0.6, -1.0], [1.0, 0.6, -1.0]])
    swapped = inner[[1, 0, 3, 2, 6, 7, 4, 5]] * np.array([1.0, 1.0, 0.8])
    ends = zip(np.vstack([corners, middles]), np.vstack([swapped, middle_inner]), strict=True)
    body = {"mass": 60.0, "inertia": [20.0, 25.0, 18.0, 0.5, -0.3, 0.2], "home": [0, 0, 4, 0, 0, 0]}
    return framed(ends, body, {"name": "twelve"}, t_min=20.0, t_max=1500.0)
