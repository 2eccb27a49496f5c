"""A first look at the workspace: random positions about home, and whether tensions hold the platform there."""

import numpy as np

from ..base.inputs import required, whole_number
from ..models import Dynamics
from .feasibility import feasible, rest_wrench
from .places import Places
from .region import surrounding_box

MOST = 1_000_000  # positions


def hints(dynamics: Dynamics, count: int = 400, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Draw random positions about home, and check at each whether tensions inside the limits hold the platform at rest.

    The positions are uniform in the box of home and anchors, at the attitude of home. `sample` computes workspaces with
    volumes and other conditions.

    Parameters
    ----------
    dynamics
        Dynamics of the robot.
    count
        Number of positions.
    seed
        Seed of the random positions.

    Returns
    -------
    Positions (count, 3) in {G} [m], and flags (count,).

    Raises
    ------
    InputError
        If an argument has a wrong type or value.
    """
    robot = required("dynamics", dynamics, Dynamics).robot
    whole_number("count", count, 1, MOST)
    whole_number("seed", seed, 0, 2**63 - 1)
    low, high = surrounding_box(robot, {})
    poses = np.tile(robot.home, (count, 1))
    poses[:, :3] = low + np.random.default_rng(seed).uniform(size=(count, 3)) * (high - low)
    return poses[:, :3], feasible(robot, Places.at_home(robot, poses), rest_wrench(robot)[None])
