"""Describe the limits of a motion along a path as half-planes in its phase plane, and prove where they exclude all.

With u = d2s/dt2 and x = (ds/dt)^2 the needed wrench is a u + b x + c (`parametrised_path`), so each facet of the
available wrench set (`solvers.available_wrench`) is a half-plane, as is each limit of a speed or an acceleration.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ...base.display import Displayed
from ...base.errors import InputError, SolverError
from ...solvers import Certificate, TensionProblem, certify
from ...solvers.available_wrench import Facets, facets
from ...solvers.certificate import certificate_along
from ...statics.distribution import wrench_problem
from .parametrised_path import ParametrisedPath, PathLimits, Wrench

FLAT = 1e-9  # relative: a wrench that lies so near to the span of the cables lies in it


Rows = tuple[np.ndarray, np.ndarray, np.ndarray]  # a, b and c of half-planes a u + b x + c <= 0, (N, K) each
RESERVE = 1e-7  # of the weight, kept from the tension limits against rounding
MOST_CUTS = 24  # times that half-planes of motors are added
SETTLED = 1e-3  # of the largest (ds/dt)^2: if it changes by no more, the tangents of powers are those of the law
SLOWER = 0.25  # times (ds/dt)^2, where tangents exclude all laws


def joined(rows: Rows, others: Rows, chosen: np.ndarray | slice = slice(None)) -> Rows:
    """Return half-planes and those chosen of others, of the same points."""
    a, b, c = (np.hstack([part, its[:, chosen]]) for part, its in zip(rows, others, strict=True))
    return a, b, c


@dataclass(frozen=True)
class PhasePlane(Displayed):
    """The limits of a motion along a path, at N points of it.

    Wrenches are those of the coordinates that can move, moments over `Robot.length`, all in newtons.
    """

    # the wrench that the motion needs, (N, n) each, and the facets of the available wrench set
    wrench: Wrench
    available: Facets
    x_max: np.ndarray  # the largest x that the limits of speed allow, (N,) [1/s^2]
    # limits of accelerations, also of the winches that a motor can just accelerate, a u + b x + c <= 0 with (N, k) each
    acceleration_rows: list[tuple[np.ndarray, np.ndarray, np.ndarray]]
    winches: "Winches | None"  # None if none has a motor of its own or a limit of its power

    def rows(self, weight: float) -> Rows:
        """Return all limits but x_max as a u + b x + c <= 0, (N, K) each, without units.

        Rows of tensions are in parts of the weight, the others in parts of their limits. The last row is 1 <= 0 where
        even rest needs a wrench outside the span of the cables.
        """
        a, b, c = self.tension_rows(weight)
        beside = np.einsum("nij,nj->ni", self.available.outside, self.wrench.c - self.available.offset)
        out = np.linalg.norm(beside, axis=1) > FLAT * (weight + np.linalg.norm(self.wrench.c, axis=1))
        never = np.where(out, 1.0, -1.0)[:, None]
        rows = [(a, b, c), *self.acceleration_rows, (np.zeros_like(never), np.zeros_like(never), never)]
        a, b, c = (np.hstack(parts) for parts in zip(*rows, strict=True))
        return a, b, c

    def rests_at_ends(self, weight: float) -> bool:
        """Return whether the platform can rest at the first and the last point."""
        return bool((self.rows(weight)[2][[0, -1]] <= 0).all())

    def tension_rows(self, weight: float) -> Rows:
        """Return the facets' half-planes alone: first those of `available.high`, then those of `available.low`."""
        normals, low, high = self.available.normals, self.available.low, self.available.high
        a, b, c = ((normals @ part[:, :, None])[..., 0] / weight for part in self.wrench)
        return np.hstack([a, -a]), np.hstack([b, -b]), np.hstack([c - high / weight, low / weight - c])

    def winch_rows(self, winches: "Winches", short: "Short", weight: float) -> Rows:
        """Return the half-planes of `tension_rows` where motors that are too `short` for a limit replace it."""
        pulls, (P, Q) = winches.pulls, winches.reflected
        pulls = np.concatenate([pulls, -pulls], axis=1)
        hauled, eased = np.maximum(pulls, 0.0), np.maximum(-pulls, 0.0)
        moved = hauled * short.at_max[:, None] - eased * short.at_min[:, None]
        gap = np.einsum("nkm,nm->nk", hauled, np.where(short.at_max, winches.force - winches.high, 0.0))
        gap += np.einsum("nkm,nm->nk", eased, np.where(short.at_min, winches.force + winches.low, 0.0))
        a, b, c = self.tension_rows(weight)
        a, b = (part - np.einsum("nkm,nm->nk", moved, its) / weight for part, its in ((a, P), (b, Q)))
        return a, b, c - gap / weight

    def power_rows(self, winches: "Winches", u: np.ndarray, x: np.ndarray, weight: float) -> Rows:
        """Return half-planes of powers and motors: of those too weak for a limit at u and x, then of all powers."""
        winches, limited = winches.with_powers(u, x)
        short = winches.short(u, x)
        every = short._replace(at_max=short.at_max | limited)
        return joined(self.winch_rows(winches, short, weight), self.winch_rows(winches, every, weight))


class Short(NamedTuple):
    """The motors that are weaker than their cables at some speeds and accelerations, (N, m) of bool each."""

    at_max: np.ndarray  # cannot pull with t_max, because they accelerate their winches that haul in
    at_min: np.ndarray  # cannot pay out so fast that the tension is t_min


@dataclass(frozen=True)
class Winches(Displayed):
    """Limits of the motors of winches, whose forces are the tensions less those that pay out cables, P u + Q x."""

    pulls: np.ndarray  # of all cables along the normals of the facets, (N, K, m)
    reflected: tuple[np.ndarray, np.ndarray]  # P and Q, (N, m) each [N]
    force: np.ndarray  # the largest of each motor less friction, (N, m) [N]; infinite without a motor
    powers: np.ndarray  # the largest tensions, times ds/dt, that the limit of power allows, (N, m) [N/s]
    low: np.ndarray  # tension limits, (m,) [N]
    high: np.ndarray  # likewise

    def short(self, u: np.ndarray, x: np.ndarray) -> Short:
        """Return which motors are too weak for the limits of their cables at u and x, (N,) each."""
        P, Q = self.reflected
        moved = P * u[:, None] + Q * x[:, None]
        return Short(self.force + moved < self.high, moved - self.force > self.low)

    def with_powers(self, u: np.ndarray, x: np.ndarray) -> tuple["Winches", np.ndarray]:
        """Return winches whose motors keep the limit of power where they are strong enough at u and x, (N, m) of bool.

        The tension that a power allows, in proportion to 1 / sqrt(x), is convex in x: its tangent is nowhere above it.
        The tangent is that at x or, where the cable's own limit is tighter, at the x from which the power is.
        """
        P, Q = self.reflected
        at = np.maximum(x[:, None], np.square(self.powers / self.high))
        pull = self.powers / np.sqrt(at)
        limited = pull < self.force + P * u[:, None] + Q * x[:, None]
        reflected = np.where(limited, 0.0, P), np.where(limited, -pull / (2 * at), Q)
        return replace(self, reflected=reflected, force=np.where(limited, 1.5 * pull, self.force)), limited


@dataclass(frozen=True)
class Proof(Displayed):
    """A proof that at one point of the path no allowed speed and acceleration has tensions inside their limits."""

    s: float  # the place
    problem: TensionProblem  # the tension problem of the speed and acceleration that come nearest
    # Along its direction every other allowed speed and acceleration misses at least as much.
    certificate: Certificate


def phase_plane(
    parametrised: ParametrisedPath,
    limits: PathLimits,
    s: np.ndarray,
    margin: float,
    reserve: np.ndarray | float = 0.0,
    shrink: float = 0.0,
) -> PhasePlane:
    """Return the limits at the points s (N,).

    Tensions are less `margin` [N], wrenches `reserve` (N,) [N] inside what these tensions give, and the other limits
    reduced by the share `shrink`. Raises `InputError` if motion along the path needs wrenches outside the span of the
    cables.
    """
    robot = parametrised.robot
    platform, carriers = parametrised.at(s)
    rows = np.flatnonzero(robot.dof_mask)
    scale = robot.wrench_scale[rows]
    A = parametrised.dynamics.wrench_matrix(platform.pose, carriers.pose)[:, rows] * scale[:, None]
    wrench = Wrench(*(part[:, rows] * scale for part in parametrised.wrench(platform)))
    low, high = robot.t_min + margin, np.maximum(robot.t_max - margin, robot.t_min + margin)
    available = facets(A, low, high)
    _check_span(s, wrench, available)
    force, winches = parametrised.motor_force, None
    powers = parametrised.pull_per_speed(platform, carriers, limits.power * (1 - shrink))
    accelerations = parametrised.acceleration_rows(platform, carriers, limits, shrink)
    if (own := np.isfinite(force)).any() or np.isfinite(limits.power):
        each = np.broadcast_to(force, powers.shape)
        winches = Winches(available.normals @ A, parametrised.reflected(platform, carriers), each, powers, low, high)
        P, Q = (part[:, own] / force[own] for part in winches.reflected)
        c = np.append(low[own] / force[own] - 1, -high[own] / force[own] - 1)
        accelerations.append((np.hstack([-P, P]), np.hstack([-Q, Q]), np.broadcast_to(c, (len(s), len(c)))))
    # The reserve must not turn the only wrench into none.
    low, high, inside = available.low, available.high, np.reshape(reserve, (-1, 1))
    middle = (low + high) / 2
    available = replace(available, low=np.minimum(low + inside, middle), high=np.maximum(high - inside, middle))
    x_max = (parametrised.speed_limit(platform, carriers, limits) * (1 - shrink)) ** 2
    return PhasePlane(wrench, available, x_max, accelerations, winches)


def proofs(parametrised: ParametrisedPath, limits: PathLimits, s: np.ndarray, margin: float) -> list[Proof]:
    """Return proofs for the points among s, (N,), at which no speed and acceleration is allowed.

    At the first and the last that is rest, which lasts, so that the platform does not accelerate there either.
    """
    robot, weight = parametrised.robot, parametrised.robot.force_scale
    plane = phase_plane(parametrised, limits, s, margin)
    low, high = robot.t_min + margin, robot.t_max - margin
    platform, carriers = parametrised.at(s)
    A = parametrised.dynamics.wrench_matrix(platform.pose, carriers.pose)
    whole = parametrised.wrench(platform)
    at_rest = plane.rows(weight)[2][:, -1] > 0  # outside the span of the cables whatever the speed
    at_rest[[0, -1]] = True
    rows = plane.tension_rows(weight)
    in_rows = robot.dof_mask * robot.wrench_scale
    proven = []
    for k in np.flatnonzero(at_rest | (rows[2] > 0).any(axis=1)):  # at the others the platform can rest
        if at_rest[k]:
            problem = wrench_problem(parametrised.robot, A[k], whole.c[k], low, high)
            certificate = certify(problem)
        else:
            (u, x), weights = _nearest(rows[0][k], rows[1][k], rows[2][k], plane.x_max[k])
            w = whole.a[k] * u + whole.b[k] * x + whole.c[k]
            problem = wrench_problem(parametrised.robot, A[k], w, low, high)
            direction = np.zeros(6)
            normals = plane.available.normals[k]
            direction[robot.dof_mask > 0] = weights @ np.concatenate([normals, -normals])
            certificate = certificate_along(problem, direction * in_rows)
        if certificate is not None:
            proven.append(Proof(float(s[k]), problem, certificate))
    return proven


def _nearest(a: np.ndarray, b: np.ndarray, c: np.ndarray, x_max: float) -> tuple[tuple[float, float], np.ndarray]:
    """Return the u and x in [0, x_max] that violate a u + b x + c <= 0 least, and the multipliers of the rows, (K,).

    The multipliers add up to one. Weighted by them the rows become one that no allowed u and x violates less (duality).
    """
    from scipy.optimize import linprog

    unit = max(np.abs(a).max(), np.abs(b).max(), 1e-12)
    rows = np.stack([a / unit, b / unit, -np.ones_like(a)], axis=1)
    bounds = [(None, None), (0, x_max * unit if np.isfinite(x_max) else None), (None, None)]
    nearest = linprog([0, 0, 1], rows, -c, bounds=bounds, method="highs")
    if not nearest.success:
        raise SolverError(f"time_along: HiGHS could not solve a linear program: {nearest.message}")
    u, x = nearest.x[:2] / unit
    return (float(u), float(x)), -nearest.ineqlin.marginals


def _check_span(s: np.ndarray, wrench: Wrench, available: Facets) -> None:
    """Refuse a path along which the motion itself needs wrenches outside the span of the cables."""
    if not available.outside.any():
        return
    for part in (wrench.a, wrench.b):
        off = np.linalg.norm(np.einsum("nij,nj->ni", available.outside, part), axis=1)
        bad = off > FLAT * np.linalg.norm(part, axis=1).max()
        if bad.any():
            at = int(np.argmax(bad))
            n = part.shape[1]
            rank = n - round(float(np.trace(available.outside[at])))
            raise InputError(
                f"path must need only wrenches in the span of the cables, got one outside at s = {s[at]:.4g}, where "
                f"the wrench matrix has rank {rank} of {n}"
            )


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
