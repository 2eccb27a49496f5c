"""`answer_others`: the status of steps whose tensions are not optimal, and tensions where there are none."""

import numpy as np

from ..models.robot import Robot
from ..solvers.in_place import InPlace
from ..solvers.solution import OPTIMAL
from .controller import HOLD, PLANNED, SOFT

NEGLIGIBLE = 1e-3  # of the robot's scale of forces: a wrench that is missed by less is given as planned
CARRIED = 0.1  # the same of what fewer cables than degrees of freedom cannot give, and leave to their carriers


def answer_others(robot: Robot, problems: InPlace, last: np.ndarray) -> np.ndarray:
    """Return the status of each row, and give rows without tensions those of the `last` command, (N, m) [N].

    The direction and the shortfall of a row then describe the wrench that its tensions miss, if that proves more.
    """
    force, scale = robot.force_scale, robot.wrench_scale
    missing = scale * (problems.w - (problems.A @ problems.tensions[..., None])[..., 0])
    size = np.sqrt(np.einsum("ij,ij->i", missing, missing))
    if problems.is_sparing:
        # What is missing along a cable, tensions would give if limits let them; the rest is for the carriers.
        along = np.abs((scale * missing)[:, None] @ problems.A)[:, 0].max(axis=1)
        nearly = (along <= NEGLIGIBLE * force) & (size <= CARRIED * force)
    else:
        nearly = size <= NEGLIGIBLE * force  # false for nan
    _prove_more(problems, scale * missing / np.where(size > 0, size, np.nan)[:, None])
    answered = np.where((problems.code == OPTIMAL) | nearly, PLANNED, SOFT).astype(np.int8)
    lost = ~np.isfinite(problems.tensions).all(axis=1)
    answered[lost] = HOLD
    target = np.where(np.isfinite(problems.t_ref), problems.t_ref, last)
    problems.tensions[lost] = np.clip(target, *problems.bounds)[lost]
    return answered


def _prove_more(problems: InPlace, directions: np.ndarray) -> None:
    """Take other directions, (N, 6), where w exceeds what the limits permit along them by more.

    The core proves that no tensions give w by the first direction that it finds, along which little can be missing.
    """
    gains = (directions[:, None] @ problems.A)[:, 0]  # (N, m)
    support = np.maximum(*(gains * bound for bound in problems.bounds)).sum(axis=1)
    shortfall = np.einsum("ij,ij->i", directions, problems.w) - support
    more = shortfall > problems.shortfall  # false for nan, where nothing is proven
    problems.direction[more], problems.shortfall[more] = directions[more], shortfall[more]
