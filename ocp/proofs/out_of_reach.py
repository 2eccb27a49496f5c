"""Prove that carriers cannot hold the platform in a given motion, wherever they are: `out_of_reach`.

A cable pulls from its attachment towards an anchor in a box, so its force is a sum of pulls towards the corners of that
box: these span the cone of all its directions. If the given wrench is no sum of such pulls, however strong, a direction
proves it (Farkas) along which the wrench is positive and no pull is. A carrier whose reach is not a hard limit may be
anywhere around the platform. Still no cables exert a moment about a line through all attachments.
"""

from dataclasses import replace
from itertools import product

import numpy as np

from ...models.points import placed
from ...solvers import Certificate, certify, solve_batch
from ...statics.distribution import wrench_problem
from ..audits.tensions import UNDERACTUATED_TOLERANCE
from ..tasks.paths import Motion
from ..tasks.scenario import Scenario

AROUND = 10.0  # of the largest arms: a box around all attachments, towards whose corners pulls span all directions


def out_of_reach(
    scenario: Scenario, times: np.ndarray, platform: Motion, carriers: Motion, free: np.ndarray
) -> Certificate | None:
    """Return the certificate of the worst of some instants at which the platform is given; None if there is none.

    - `times`: the instants, (n,) [s], none of them on the ground.
    - `platform`, `carriers`: motions there in {G}, (n, 6) and (n, c, 6) each.
    - `free`: whether each carrier may be elsewhere, in its reach box or, without one, anywhere, (n, c).
    """
    robot, corners = scenario.robot, []
    boxes = [(index, scenario.reach(index)) for index in np.flatnonzero(free.any(axis=0)).tolist()]
    if not (len(times) and boxes) or robot.pulley_radii.any():
        return None
    centre = placed(platform.pose, np.array([robot.platform.com]))[:, 0]
    around = AROUND * (robot.length + np.linalg.norm(robot.anchors, axis=1).max())
    for sides in product((False, True), repeat=3):
        poses = carriers.pose.copy()
        for index, box in boxes:
            far = centre + around * np.where(sides, 1.0, -1.0)
            corner = far if box is None else np.where(sides, box.max, box.min)
            poses[:, index, :3] = np.where(free[:, index, None], corner, poses[:, index, :3])
        corners.append(scenario.dynamics.wrench_matrix(platform.pose, poses) * robot.dof_mask[:, None])
    A = np.concatenate(corners, axis=2)  # (n, 6, 8 m)
    w = scenario.required_wrench(times, platform, carriers, scenario.wind) * robot.dof_mask
    limits = np.zeros(A.shape[2]), np.full(A.shape[2], np.inf)
    scaled = A[0] / np.repeat([1.0, robot.length], 3)[:, None]
    if free.all() and not any(box for _, box in boxes) and np.linalg.matrix_rank(scaled) == robot.dof_mask.sum():
        return None  # pulls in all directions at these attachments exert all wrenches
    batch = solve_batch(A, w, *limits, length=robot.length)
    short = np.where(batch.feasible, -np.inf, np.nan_to_num(batch.shortfall))
    for row in np.argsort(-short)[: np.count_nonzero(~batch.feasible)]:  # one certificate takes as long as the batch
        found = certify(wrench_problem(robot, A[row], w[row], *limits))
        if found is not None and found.shortfall > UNDERACTUATED_TOLERANCE * robot.force_scale:
            # Each corner's pull is a cable of the problem; a cable of the robot gives their sum.
            pulls = (A[row, :3] * found.closest).reshape(3, 8, robot.m).sum(axis=1)
            none = np.zeros(0, dtype=np.intp)
            closest = np.linalg.norm(pulls, axis=0)
            return replace(found, time=float(times[row]), at_max=none, at_min=none, closest=closest)
    return None
