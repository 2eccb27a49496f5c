"""Which places have tensions for given wrenches: wrench matrices and tension problems of many places at once.

The wrench rows are those of the coordinates that can move, moments divided by `Robot.length`, so that all are in
newtons. A few thousand places are taken at a time: their matrices stay in the processor's cache.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..models import Robot
from ..models.batch import compiled
from ..models.dynamics import dynamics_of
from ..solvers import solve_batch
from .places import Places

__all__ = [
    "can_give",
    "lacking",
    "make_ready",
    "matrices",
    "rest_wrench",
    "rows_of",
]

PLACES_AT_ONCE = 8192


def make_ready(robot: Robot) -> None:
    """Compile or load now what asking about many places of a robot needs, instead of on the way."""
    compiled(dynamics_of(robot).functions["wrench_matrix"])
    can_give(robot, Places.at_home(robot, robot.home), rest_wrench(robot)[None])


def rest_wrench(robot: Robot) -> np.ndarray:
    """Wrench that holds the platform at rest, anywhere: against its weight, about the CoM, (6,) [N, N m]."""
    return dynamics_of(robot).required_wrench(robot.home, np.zeros(6), np.zeros(6))


def rows_of(robot: Robot, forces_only: bool = False) -> np.ndarray:
    """Indices of the wrench rows that count."""
    rows = np.flatnonzero(robot.dof_mask)
    return rows[rows < 3] if forces_only else rows


def matrices(robot: Robot, places: Places, rows: np.ndarray) -> Iterator[tuple[slice, np.ndarray]]:
    """Wrench matrices (k, rows, m) [N per N] of some thousand places at a time, and which places these are."""
    dynamics = dynamics_of(robot)
    scale = robot.wrench_scale[rows]
    for start in range(0, len(places), PLACES_AT_ONCE):
        part = slice(start, start + PLACES_AT_ONCE)
        A = dynamics.wrench_matrix(places.pose[part], places.carriers[part])
        if rows.size < 6:
            A = A[:, rows]
        if (scale != 1.0).any():
            A *= scale[:, None]
        yield part, A


def can_give(
    robot: Robot,
    places: Places,
    wrenches: np.ndarray,
    rows: np.ndarray | None = None,
    t_min: np.ndarray | float | None = None,
    t_max: np.ndarray | float | None = None,
) -> np.ndarray:
    """Whether tensions inside their limits give each of the wrenches, (n,) of bool.

    Parameters
    ----------
    wrenches
        (k, 6) for all places or (k, n, 6), about the CoM in {G} [N, N m].
    rows
        Wrench rows that count; None: those of the coordinates that can move.
    t_min, t_max
        Limits [N] instead of the robot's.
    """
    rows = rows_of(robot) if rows is None else rows
    low = robot.t_min if t_min is None else t_min
    high = robot.t_max if t_max is None else t_max
    given = np.zeros(len(places), dtype=bool)
    wanted = wrenches[..., rows] * robot.wrench_scale[rows]
    shared = wanted.ndim == 2
    for part, A in matrices(robot, places, rows):
        left = np.arange(len(A))
        for w in wanted if shared else wanted[:, part]:
            some = A if left.size == len(A) else A[left]
            left = left[solve_batch(some, w if shared else w[left], low, high, threads=1).feasible]
            if not left.size:
                break
        given[part.start + left] = True
    return given


def lacking(robot: Robot, places: Places, wrenches: np.ndarray, rows: np.ndarray | None = None) -> np.ndarray:
    """How far at least the wrenches (k, 6) are from what tensions inside their limits give: the farthest, (n,) [N].

    That is the shortfall of the proofs that the batch solver finds: zero exactly where `can_give` says yes.
    """
    rows = rows_of(robot) if rows is None else rows
    wanted = wrenches[:, rows] * robot.wrench_scale[rows]
    missing = np.zeros(len(places))
    for part, A in matrices(robot, places, rows):
        for w in wanted:
            solved = solve_batch(A, w, robot.t_min, robot.t_max, threads=1)
            short = np.where(solved.feasible, 0.0, np.nan_to_num(solved.shortfall, nan=np.inf))
            missing[part] = np.maximum(missing[part], short)
    return missing
