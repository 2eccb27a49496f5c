"""`answer_others`: the status of steps whose tensions are not optimal, and tensions where there are none."""

import numpy as np

from ..models.robot import Robot
from ..solvers.in_place import InPlace
from ..solvers.status import OPTIMAL
from .command import HOLD, PLANNED, SOFT

NEGLIGIBLE = 1e-3  # of the robot's scale of forces: a wrench that is missed by less is given as planned
CARRIED = 0.1  # the same of what fewer cables than degrees of freedom cannot give, and leave to their carriers


def answer_others(robot: Robot, problems: InPlace, last: np.ndarray) -> np.ndarray:
    """Return the status of each row, and let rows without tensions have those of the `last` command, (N, m) [N]."""
    force = robot.force_scale
    if robot.m < len(robot.platform.dof):
        # What is missing along a cable, tensions would give if limits let them; the rest is for the carriers.
        scale = robot.wrench_scale
        missing = scale * (problems.w - (problems.A @ problems.tensions[..., None])[..., 0])
        along = np.abs((scale * missing)[:, None] @ problems.A)[:, 0].max(axis=1)
        square = np.einsum("ij,ij->i", missing, missing)
        nearly = (along <= NEGLIGIBLE * force) & (square <= (CARRIED * force) ** 2)
    else:
        nearly = problems.shortfall <= NEGLIGIBLE * force  # false for nan
    answered = np.where((problems.code == OPTIMAL) | nearly, PLANNED, SOFT).astype(np.int8)
    lost = ~np.isfinite(problems.tensions).all(axis=1)
    answered[lost] = HOLD
    target = np.where(np.isfinite(problems.t_ref), problems.t_ref, last)
    problems.tensions[lost] = np.clip(target, *problems.bounds)[lost]
    return answered
