"""Search for the feasible pose closest to an infeasible one."""

import numpy as np

from ..models import Robot
from .condition import Condition
from .places import Places

SCATTERED = 4000  # poses of the first round, at distances of all magnitudes
ROUNDS, AROUND, BETWEEN = 10, 400, 40  # then about the best pose so far, and on the line to it
SHRINK = 0.6  # of the surroundings, each round
NEAREST = 1e-4  # of the size, in the first round


def nearest_feasible(
    robot: Robot, condition: Condition, pose: np.ndarray, carriers: np.ndarray, size: float
) -> np.ndarray | None:
    """Return the pose closest to `pose` at which a condition holds, to a few per cent of the distance, or None.

    The search samples poses and may miss a feasible set that is thin or has several parts. Distances are in metres,
    with radians multiplied by `Robot.length`.

    - `pose`, `carriers`: (6,) and (c, 6) in {G} [m, rad]. Carriers are fixed.
    - `size`: search radius [m].
    """
    rng, free = np.random.default_rng(0), robot.dof_mask.astype(bool)
    unit = np.where(np.arange(6) < 3, 1.0, 1.0 / robot.length) * free

    def holding(poses: np.ndarray) -> np.ndarray:
        """Return the poses at which the condition holds, the closest first."""
        places = Places(poses, np.broadcast_to(carriers, (len(poses), *carriers.shape)))
        there = poses[condition.evaluate(robot, places)]
        return there[np.argsort(distances(there))]

    def distances(poses: np.ndarray) -> np.ndarray:
        return np.linalg.norm((poses - pose)[:, free] / unit[free], axis=1)

    directions = rng.normal(size=(SCATTERED, 6)) * unit
    # Half of them keep the attitude: far away, random turns are large, and few platforms permit these.
    directions[::2, 3:] = 0.0
    directions /= np.linalg.norm(directions[:, free] / unit[free], axis=1, keepdims=True)
    reach = size * np.geomspace(NEAREST, 1.0, SCATTERED)[:, None]
    best = holding(np.vstack([pose, robot.home, pose + reach * directions]))[:1]
    if not len(best):
        return None
    spread = float(distances(best)[0])
    for _ in range(ROUNDS):
        near = best + spread * rng.normal(size=(AROUND, 6)) / np.sqrt(free.sum()) * unit
        near[::2, 3:] = best[:, 3:]
        best = holding(np.vstack([best, near]))[:1]
        # The end of the line is `best` but for rounding, which may be too much for a thin feasible set.
        best = holding(np.vstack([best, pose + np.linspace(0.0, 1.0, BETWEEN)[:, None] * (best - pose)]))[:1]
        spread *= SHRINK
    return best[0]
