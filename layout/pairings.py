"""The best pairing of anchors and attachments that are given: exact, over all rows, for up to eight cables."""

from itertools import permutations

import numpy as np

from ..models import Robot
from ..models.dynamics import dynamics_of
from ..solvers.margin import margins
from .evaluation import Evaluation, Rows
from .requirements import Requirements
from .room import room_of
from .variables import variables_of

_FIRST = 8  # rows that all pairings are computed at; the best are then computed at all
_AT_ONCE = 32


def with_attachments(robot: Robot, attachment_of: np.ndarray) -> Robot:
    """Return the robot whose cable i has the attachment of cable attachment_of[i]."""
    cables = [
        {**cable.model_dump(), "attachment": robot.cables[other].attachment}
        for cable, other in zip(robot.cables, attachment_of, strict=True)
    ]
    return Robot.model_validate({**robot.model_dump(), "cables": cables})


def best_pairing(
    robot: Robot, rows: Rows, cables: tuple[int, ...], requirements: Requirements
) -> tuple[np.ndarray, int]:
    """Return whose attachment each cable gets, (m,), for the largest smallest margin, and the number of pairings.

    The least margin over a few rows bounds the one over all. So pairings are computed at all rows in the order of this
    bound, until it is no larger than the best.

    - `robot`, `rows`: the robot with its points, and the rows that count.
    - `cables`: cables that exchange their attachments, at most `MOST_PAIRED`.
    - `requirements`: their room is kept. If no pairing has it, the robot's own is returned.
    """
    room = room_of(robot, requirements)
    own, kept = np.arange(robot.m), np.flatnonzero(robot.dof_mask)
    scale = robot.wrench_scale[kept]
    w = rows.wrenches[:, kept] * scale
    every = np.array(list(permutations(cables)))
    pairings = np.tile(own, (len(every), 1))
    pairings[:, list(cables)] = every
    # Cable i with attachment j: each turn of the list makes m of these columns.
    columns = np.empty((robot.m, robot.m, len(rows.poses), kept.size))
    for turn in range(len(cables)):
        turned = own.copy()
        turned[list(cables)] = np.roll(cables, turn)
        A = dynamics_of(with_attachments(robot, turned)).wrench_matrix(rows.poses)[:, kept] * scale[:, None]
        columns[own, turned] = A.transpose(2, 0, 1)

    def values(some: np.ndarray, chosen: np.ndarray) -> np.ndarray:
        """Return the margins of some pairings at some rows, (pairings, rows)."""
        A = columns[own[:, None, None], some.T[:, :, None], rows.pose_of[chosen]]  # (m, pairings, rows, n)
        A = np.ascontiguousarray(A.transpose(1, 2, 3, 0)).reshape(-1, kept.size, robot.m)
        return margins(A, np.tile(w[chosen], (len(some), 1)), robot.t_min, robot.t_max).reshape(len(some), -1)

    all_rows = np.arange(len(w))
    first = np.argsort(values(own[None], all_rows)[0])[:_FIRST]
    blocks = [values(pairings[k : k + 1024], first).min(axis=1) for k in range(0, len(pairings), 1024)]
    bounds = np.concatenate(blocks)
    order, best, value = np.argsort(-bounds), own, -np.inf
    for start in range(0, len(order), _AT_ONCE):
        some = order[start : start + _AT_ONCE]
        some = some[bounds[some] > value]
        if not some.size:
            break
        least = values(pairings[some], all_rows).min(axis=1)
        for k in np.argsort(-least):
            if least[k] <= value:
                break
            paired = variables_of(with_attachments(robot, pairings[some[k]]), requirements)
            if Evaluation(paired, rows, room).missing(np.zeros(0)) <= 0.0:
                best, value = pairings[some[k]], float(least[k])
                break
    return best, len(pairings)
