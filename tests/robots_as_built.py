"""Robots that differ from their files, and what sensors report of them: data for tests of calibration."""

from typing import NamedTuple

import numpy as np

from towline.estimation.calibration import Measurements
from towline.models import Dynamics, Robot, load

ANCHORS, OFFSETS, NOISE = 0.02, 0.05, 1e-3  # [m], standard deviations


class AsBuilt(NamedTuple):
    """A robot as it stands there, its poses, the offsets of its readings and the readings."""

    robot: Robot
    poses: np.ndarray
    offsets: np.ndarray
    readings: np.ndarray

    def measurements(self, known=True, **others):
        return Measurements(self.readings, self.poses if known else None, **others)


def random_poses(robot, count, draw, reach=(3, 3, 1.2, 0.2, 0.2, 0.2)):
    return robot.home + draw.uniform(-1, 1, (count, 6)) * reach * robot.dof_mask


def moved_anchors(robot, draw, size=ANCHORS):
    names = [f"cables[{i}].anchor.{axis}" for i in range(robot.m) for axis in "xyz"]
    values = robot.parameter_values(names) + draw.normal(0, size, len(names))
    return robot.with_parameters(dict(zip(names, values.tolist(), strict=True)))


def as_built(count, seed, name="cogiro", noise=NOISE, offsets=OFFSETS, anchors=ANCHORS, poses=None):
    draw = np.random.default_rng(seed)
    robot = moved_anchors(load(name), draw, anchors)
    poses = random_poses(robot, count, draw) if poses is None else poses
    own = draw.normal(0, offsets, robot.m)
    lengths = Dynamics(robot).cable_lengths(poses)
    return AsBuilt(robot, poses, own, lengths - own + draw.normal(0, noise, lengths.shape))


def rigidly_aligned(points, to):
    """Points (n, 3) moved as a rigid body so that they lie on others as well as can be (Kabsch)."""
    middle, other = points.mean(axis=0), to.mean(axis=0)
    U, _, Vt = np.linalg.svd((points - middle).T @ (to - other))
    turn = U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
    return (points - middle) @ turn + other
