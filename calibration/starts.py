"""Poses to begin with where none was measured: those that the lengths of the file's robot give."""

from __future__ import annotations

import numpy as np

from ..models import points
from ..models.robot import Robot
from . import rotations
from .geometry import runs

MOST_STEPS = 60
ENOUGH = 1e-10  # [m^2] of decrease


def start_poses(robot: Robot, lengths: np.ndarray, start: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return poses (N, 6) [m, rad] whose lengths are nearest to `lengths` (N, m) [m], and how far they are (N,)."""
    count = len(lengths)
    begin = np.tile(robot.home, (count, 1)) if start is None else start
    position, rotation, cost = _descend(robot, lengths, begin[:, :3], points.rotations(begin[:, 3:]))
    # What ended elsewhere begins again where a sample with similar lengths ended well.
    for _ in range(3):
        good = cost <= 4 * max(np.median(cost), 1e-12)
        if good.all():
            break
        bad = np.flatnonzero(~good)
        apart = ((lengths[bad, None] - lengths[None, good]) ** 2).sum(axis=2)
        near = np.flatnonzero(good)[np.argmin(apart, axis=1)]
        again = _descend(robot, lengths[bad], position[near], rotation[near])
        better = again[2] < cost[bad]
        for old, new in zip((position, rotation, cost), again, strict=True):
            old[bad[better]] = new[better]
    return np.hstack([position, rotations.angles_of(rotation)]), np.sqrt(cost / robot.m)


def _descend(
    robot: Robot, lengths: np.ndarray, position: np.ndarray, rotation: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    count, rows = len(lengths), np.flatnonzero(robot.dof_mask)
    turned = points.rotations(robot.carrier_home[robot.carrier_of_cable, 3:])
    axes = np.einsum("mij,mj->mi", turned, robot.pulley_axes)

    def differences(p: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        arms = np.einsum("nij,mj->mni", R, robot.attachments)
        run = runs(robot.home_anchors, axes, robot.pulley_radii, p + arms)
        e = (run.lengths - lengths.T).T
        cost = (e**2).sum(axis=1)
        G = np.concatenate([run.directions, np.cross(arms, run.directions)], axis=2).transpose(1, 0, 2)[..., rows]
        return e, np.where(np.isfinite(cost), cost, np.inf), G

    position, rotation = position.copy(), rotation.copy()
    damping = np.full(count, 1e-3)
    e, cost, G = differences(position, rotation)
    for _ in range(MOST_STEPS):
        H = np.einsum("nma,nmb->nab", G, G)
        H[:, range(len(rows)), range(len(rows))] *= 1 + damping[:, None]
        H[:, range(len(rows)), range(len(rows))] += 1e-9
        step = np.zeros((count, 6))
        step[:, rows] = -np.linalg.solve(H, np.einsum("nma,nm->na", G, e)[..., None])[..., 0]
        p, R = position + step[:, :3], rotations.from_vectors(step[:, 3:]) @ rotation
        e_new, cost_new, G_new = differences(p, R)
        better = cost_new < cost
        gained = np.where(better, cost - cost_new, 0.0).max()
        position[better], rotation[better], e[better], G[better] = p[better], R[better], e_new[better], G_new[better]
        cost = np.where(better, cost_new, cost)
        damping = np.where(better, damping / 10, damping * 10)
        if gained < ENOUGH and _ > 5:
            break
    return position, rotation, cost
