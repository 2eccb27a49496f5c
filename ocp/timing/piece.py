"""`solved_piece`: the fastest time law from one rest of a path to the next, also under limits of winch motors."""

from typing import Any, NamedTuple

import numpy as np

from ...base.errors import SolverError
from .parametrised_path import ParametrisedPath, PathLimits
from .phase_plane import PhasePlane, joined, phase_plane

RESERVE = 1e-7  # of the weight, kept from the tension limits against rounding
MOST_CUTS = 24  # times that half-planes of motors are added
SETTLED = 1e-3  # of the largest (ds/dt)^2: if it changes by no more, the tangents of powers are those of the law
SLOWER = 0.25  # times (ds/dt)^2, where tangents exclude all laws


class Piece(NamedTuple):
    """A piece of the path from one rest to the next."""

    s: np.ndarray
    inside: np.ndarray  # the same places, the last one taken as the end of this piece, not as the start of the next
    plane: PhasePlane
    law: Any


def solved_piece(
    parametrised: ParametrisedPath, limits: PathLimits, s: np.ndarray, margin: float, reserve: np.ndarray, shrink: float
) -> Piece:
    """Return the fastest law on the grid s of one piece; the arguments are those of `phase_plane`.

    A motor limits a tension by less than the cable does only while it accelerates its winch. Which motors do that is
    not known beforehand: those half-planes of theirs that a law exceeds somewhere are added until it exceeds none. A
    limit of power allows the less tension the faster the motion is. Its half-planes are tangents at the last law, in
    whose place those at the next law come, until the law changes no more (the concave-convex procedure, which ends in
    a local optimum); where tangents exclude all motions, they are taken at a slower law.

    Source: Yuille and Rangarajan, The concave-convex procedure, Neural Computation 15(4), 2003.
    """
    fastest, Rows = _toppra()
    inside = s if s[-1] == 1 else np.append(s[:-1], np.nextafter(s[-1], 0.0))
    plane, weight = phase_plane(parametrised, limits, inside, margin, reserve, shrink), parametrised.robot.force_scale
    rows = plane.rows(weight)
    law = fastest(s - s[0], Rows(*rows, plane.x_max))
    x, before, kept, limited = law.x, None, False, np.isfinite(limits.power)
    for _ in range(MOST_CUTS):
        if plane.winches is None or x is None or law.unlimited:
            break
        known, u, tangents = rows[0].shape[1], np.diff(x) / (2 * np.diff(s)), []
        for each in (np.append(u, u[-1]), np.append(u[0], u)):  # those after and before each point
            cuts = plane.winch_rows(plane.winches, plane.winches.short(each, x), weight)
            rows = joined(rows, cuts, _exceeded(cuts, each, x))
            if limited:
                cuts = plane.power_rows(plane.winches, each, x, weight)
                tangents.append((cuts, _exceeded(cuts, each, x)))
        exceeded = np.array([its for _, its in tangents], bool)
        settled = not limited or (before is not None and np.abs(x - before).max() <= SETTLED * x.max())
        if settled and law.x is not None and rows[0].shape[1] == known and not exceeded.any():
            break
        before, kept, cuts = x, kept | exceeded, rows
        for (its, _), chosen in zip(tangents, kept, strict=True):
            cuts = joined(cuts, its, chosen)
        law = fastest(s - s[0], Rows(*cuts, plane.x_max))
        x = SLOWER * x if law.x is None else law.x
    return Piece(s, inside, plane, law)


def _exceeded(rows: tuple[np.ndarray, np.ndarray, np.ndarray], u: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return which half-planes a law exceeds at some point, (K,)."""
    a, b, c = rows
    return np.any(a * u[:, None] + b * x[:, None] + c > RESERVE, axis=0)


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
