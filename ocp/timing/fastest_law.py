"""Find the fastest time law along a given path that keeps every tension inside its limits: `time_along`.

Along a path only s(t) is left to choose. The available wrench set at each s (`solvers.available_wrench`) and the wrench
that the motion needs (`parametrised_path`) make half-planes in d2s/dt2 and (ds/dt)^2 (`phase_plane`), and toppra finds
the fastest law inside all of them (`toppra_law`). It is called feasible only after an audit every millisecond with the
exact tension solver; violations between the grid points are removed by a finer grid and by a little distance from the
limits.
"""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ...base.errors import InputError, SolverError
from ...base.inputs import whole_number
from ...models import Robot
from ...models.files import as_robot
from ...solvers import certify, solve_batch
from ...statics.distribution import wrench_problem
from ..limits.limits import Limits
from ..tasks.carrier_paths import carrier_paths
from ..tasks.limit_list import limit_list
from ..tasks.paths import CirclePath
from ..tasks.scenario import AUDIT_RATE, LEAST_INTERVALS, MOST_SAMPLES
from ..tasks.status import MotionStatus
from ..tasks.task import FreeBase, Task, read_task
from ..tasks.task_checks import check_margin
from ..tasks.wind_set import WindBox
from .geometry import geometry
from .parametrised_path import ParametrisedPath, PathLimits, relative
from .phase_plane import PhasePlane, phase_plane, proofs
from .timing import Timing

__all__ = ["KNOWN_LIMITS", "time_along"]

KNOWN_LIMITS = ("platform_speed", "cable_speed", "carrier_speed", "carrier_acceleration")
TOLERANCE = 1e-6  # [N], as the audit of plans has it
LIMIT_TOLERANCE = 1e-6  # relative, of the other limits, as the audit of plans has it
ATTEMPTS = 8
MOST_INTERVALS = 6400
FINER_TRIES = 2  # after a grid on which the search ended without a law
RESERVE = 1e-7  # of the weight, kept from the tension limits against rounding
LARGEST_RESERVE = 0.01  # of the weight
LARGEST_SHRINK = 0.01
COARSE = 1e-4  # of the weight or of a limit: a larger violation needs a finer grid, a smaller one some distance


def time_along(
    robot: Robot | str | os.PathLike[str],
    task: Task | dict[str, Any] | str | os.PathLike[str],
    *,
    grid: int = 200,
) -> Timing:
    """Find the fastest motion along a task's path, from rest to lasting rest, with every tension inside its limits.

    Only the geometry of the path matters, not its own time law. Legs rest at their points where the path has a corner
    there (`blend: 0`), turns back or dwells; the time that it dwells is part of the duration. Circles end after the
    task's duration by their own rate, or after one turn; any other duration is ignored. Carriers rest or follow given
    paths, walked with the same s as the platform's.

    Of the task's limits those named in `KNOWN_LIMITS` hold, and the robot file's of mobile carriers that move. The
    tension limits, less the task's margin, are the facets of the available wrench set. The time law is that of TOPP-RA
    (H. Pham, Q.-C. Pham, "A new approach to time-optimal path parameterization based on reachability analysis", IEEE
    T-RO 34(3), 2018): d2s/dt2 is constant between grid points, so tensions jump there. The extra `timing` installs it.

    Parameters
    ----------
    robot
        A `Robot`, the name of one in the library, or the path of a robot file.
    task
        A `Task`, a mapping with its keys, or the path of a YAML file, as for `plan`.
    grid
        Intervals to start with, from 10 to `MOST_INTERVALS`; the audit may double them.

    Returns
    -------
    Timing
        Feasible only if in the audit at 1 kHz no tension exceeds its limits by more than 1e-6 N, and no other limit is
        exceeded.

    Raises
    ------
    InputError
        If an argument is not valid, the task does not fit the robot or requires what a time law along a path cannot
        do, or nothing limits the speed; in one line.
    SolverError
        If toppra is not installed; the message contains the command that installs it.
    """
    robot, task = as_robot(robot), read_task(task)
    grid = whole_number("grid", grid, 10, MOST_INTERVALS)
    _check(robot, task)
    paths = carrier_paths(robot, task)
    moving = {index: geometry(its, alone=False) for index, its in paths.items()}
    until = task.duration if isinstance(task.path, CirclePath) and isinstance(task.duration, float) else None
    still_air = None if task.wind is None else np.zeros(3)
    parametrised = ParametrisedPath(robot, geometry(task.path, alone=not moving), moving, until, still_air)
    return replace(_search(parametrised, _limits(robot, task, parametrised.moving), task.margin, grid), name=task.name)


def _check(robot: Robot, task: Task) -> None:
    """Refuse a task that does not fit the robot, or that requires more than a time law along its path.

    Raises
    ------
    InputError
        Naming the field and what is accepted.
    """
    where = f"task {task.name!r}"
    if task.phases is not None:
        raise InputError(
            f"{where}: phases must be left out to time a path, got {len(task.phases)} phases; plan the task instead"
        )
    if isinstance(task.base, FreeBase):
        raise InputError(f"{where}: base.kind must be hold or given to time a path, got 'free'")
    if task.tube.radius or task.tube.turn:
        raise InputError(f"{where}: tube must be left out to time a path, which is then followed exactly")
    for name in type(task.limits).model_fields:
        if name not in (*KNOWN_LIMITS, "soft") and getattr(task.limits, name):
            raise InputError(
                f"{where}: limits.{name} must be left out to time a path; a time law keeps {', '.join(KNOWN_LIMITS)}"
            )
    if task.limits.soft:
        raise InputError(f"{where}: limits.soft must be left out to time a path, whose limits are all hard")
    if task.robust is not None:
        raise InputError(f"{where}: robust must be left out to time a path, got {task.robust:g}; plan the task instead")
    if isinstance(task.wind, WindBox) or (task.wind is not None and any(task.wind)):
        raise InputError(f"{where}: wind must be [0, 0, 0], still air, or left out to time a path")
    if task.wind is not None and robot.platform.aero is None:
        raise InputError(f"{where}: wind must be left out, since robot {robot.name!r} has no platform.aero")
    check_margin(robot, task)


def _limits(robot: Robot, task: Task, moving: list[int]) -> PathLimits:
    """Return the limits of the task, and those of the carriers that move."""
    names = {robot.carriers[index].name for index in moving}
    kept = [
        limit
        for limit in limit_list(robot, task)
        if limit.name in KNOWN_LIMITS and (not limit.name.startswith("carrier") or limit.labels[0] in names)
    ]
    parts = [tuple(limit for limit in kept if limit.name.endswith(ending)) for ending in ("speed", "acceleration")]
    return PathLimits(*(Limits(robot, part) for part in parts))


def _search(parametrised: ParametrisedPath, limits: PathLimits, margin: float, intervals: int) -> Timing:
    """Solve and audit; after a violation again, on a finer grid or with more distance from the limits."""
    weight = parametrised.robot.force_scale
    reserve, shrink, failures = RESERVE * weight, 0.0, 0
    timing = _without_law(
        MotionStatus.NOT_FOUND, parametrised, limits, margin, np.linspace(0, 1, intervals + 1), at=0.0
    )
    for _ in range(ATTEMPTS):
        pieces = [_piece(parametrised, limits, s, margin + reserve, shrink) for s in parametrised.pieces(intervals)]
        s = np.concatenate([pieces[0].s[:1], *(piece.s[1:] for piece in pieces)])
        if failures == 0:
            proven = [
                proof
                for piece in pieces
                if piece.law.x is None or not piece.plane.rests_at_ends(weight)
                for proof in proofs(parametrised, limits, piece.inside, margin)
            ]
            if proven:
                worst = max(proven, key=lambda each: each.certificate.shortfall)
                proof = {"at": worst.s, "certificate": worst.certificate, "problem": worst.problem}
                blocked = np.array([each.s for each in proven])
                return _without_law(MotionStatus.INFEASIBLE, parametrised, limits, margin, s, blocked=blocked, **proof)
        if any(piece.law.unlimited for piece in pieces):
            raise InputError(
                f"limits must bound the speed along this path, by one of {', '.join(KNOWN_LIMITS)}, since its tensions "
                "do not, got none that does"
            )
        x = [piece.law.x for piece in pieces if piece.law.x is not None]
        if len(x) < len(pieces):
            stuck = next(piece for piece in pieces if piece.law.x is None)
            at = float(stuck.s[stuck.law.stuck or 0])
            timing = _without_law(MotionStatus.NOT_FOUND, parametrised, limits, margin, s, at=at)
            failures += 1
            if failures > FINER_TRIES:
                return timing
            intervals = min(2 * intervals, MOST_INTERVALS)
            continue
        square = np.concatenate([x[0][:1], *(each[1:] for each in x)])
        sd, sdd = np.sqrt(square), np.diff(square) / (2 * np.diff(s))
        timing = Timing(MotionStatus.FEASIBLE, parametrised, limits, margin, s, sd, sdd)
        missing, excess, at = _audit(timing, limits)
        if missing <= TOLERANCE and excess <= LIMIT_TOLERANCE:
            return replace(timing, violation=missing)
        timing = replace(timing, status=MotionStatus.NOT_FOUND, violation=missing, at=at)
        if missing > COARSE * weight or excess > COARSE:
            intervals = min(2 * intervals, MOST_INTERVALS)
        # A grid too coarse for a bend misses it by so much that as large a distance would leave no tension at all.
        reserve = min(reserve + 2 * missing * (missing > TOLERANCE), LARGEST_RESERVE * weight)
        shrink = min(shrink + 2 * excess * (excess > LIMIT_TOLERANCE), LARGEST_SHRINK)
    return timing


class _Piece(NamedTuple):
    """A piece of the path from one rest to the next."""

    s: np.ndarray
    inside: np.ndarray  # the same places, the last one taken as the end of this piece, not as the start of the next
    plane: PhasePlane
    law: Any


def _piece(parametrised: ParametrisedPath, limits: PathLimits, s: np.ndarray, margin: float, shrink: float) -> _Piece:
    """Solve one piece."""
    fastest, Rows = _toppra()
    inside = s if s[-1] == 1 else np.append(s[:-1], np.nextafter(s[-1], 0.0))
    plane = phase_plane(parametrised, limits, inside, margin, shrink)
    return _Piece(s, inside, plane, fastest(s - s[0], Rows(*plane.rows(parametrised.robot.force_scale), plane.x_max)))


def _without_law(
    status: MotionStatus,
    parametrised: ParametrisedPath,
    limits: PathLimits,
    margin: float,
    s: np.ndarray,
    **details: Any,
) -> Timing:
    return Timing(
        status, parametrised, limits, margin, s, np.full(len(s), np.nan), np.full(len(s) - 1, np.nan), **details
    )


def _audit(timing: Timing, limits: PathLimits) -> tuple[float, float, float]:
    """Return the largest missing wrench [N], the largest relative excess of another limit, and s of the worse one."""
    parametrised, robot, path = timing.parametrised, timing.parametrised.robot, timing.path
    duration = path.natural_duration or 0.0
    if duration * AUDIT_RATE > MOST_SAMPLES:
        raise InputError(
            f"limits must allow a motion of at most {MOST_SAMPLES / AUDIT_RATE:g} s, since the audit evaluates "
            f"{AUDIT_RATE:g} instants per second, got one of {duration:g} s"
        )
    times = np.linspace(0, duration, max(int(np.ceil(duration * AUDIT_RATE)), LEAST_INTERVALS) + 1)
    s, sd, sdd = path.law(times)
    platform, carriers = (motion.timed(sd, sdd) for motion in parametrised.at(s))
    mask = robot.dof_mask
    A = parametrised.dynamics.wrench_matrix(platform.pose, carriers.pose) * mask[:, None]
    w = parametrised.dynamics.required_wrench(*platform, wind=parametrised.wind) * mask
    low, high = robot.t_min + timing.margin, robot.t_max - timing.margin
    batch = solve_batch(A, w, low, high, length=robot.length)
    missing = np.where(batch.feasible, batch.residual, np.inf)
    for k in np.flatnonzero(~batch.feasible):
        proof = certify(wrench_problem(parametrised.robot, A[k], w[k], low, high))
        # Neither available nor proven not to be: so near to the boundary that rounding decides.
        missing[k] = 0.0 if proof is None else proof.shortfall
    shares = [relative(each, platform, carriers) for each in limits]
    excess = np.hstack(shares).max(axis=1, initial=0.0) - 1.0
    worst = int(missing.argmax() if missing.max() > TOLERANCE else excess.argmax())
    return float(missing.max()), float(excess.max()), float(s[worst])


def _toppra() -> tuple[Any, Any]:
    try:
        from .toppra_law import Rows, fastest
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "toppra":
            raise
        raise SolverError(
            "time_along: toppra is not installed; install the extra timing: pip install 'towline[timing]'"
        ) from None
    return fastest, Rows
