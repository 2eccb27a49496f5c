"""Check whether the methods that claim continuity keep it, along random smooth motions of random robots.

    python -m tests.soak continuity [--start 0] [--count 100] [--only min-norm,...]

Robots of 7, 8 and 9 cables, and 3 to 6 cables to one point (rank three); of five motions three stay inside the
available wrench set, one touches its boundary and one follows it for a while. Where a function is continuous with a
bounded slope, halving the step ten times leaves 2^-10 of a change; at a jump all of it, however often it is halved.
Methods that answer everywhere also go out of the set and back, and smooth ones give their derivative. More than 0.05 of
a change left is a jump.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from towline.solvers import TensionProblem, TensionSolution, methods, solve

__all__ = ["JUMP", "KINDS", "Leaving", "Motion", "Result", "continuity", "jump", "leaving", "smoothness"]

Array = NDArray[np.float64]

T_MIN, T_MAX = 0.5, 60.0
KINDS = ("inside", "inside", "touching", "inside", "following")
SIZES = ((7, 6), (8, 6), (9, 6), (3, 3), (4, 3), (5, 3), (6, 3))  # cables, rank
JUMP = 0.05

METHODS = tuple(name for name, method in methods().items() if method.continuous or method.always_answers)
SMOOTH: dict[str, dict[str, Any]] = {"log-barrier": {"barrier": 0.05}, "analytic-centre": {}}

# Steps of the differences that stand for the derivative, and how often the interval may be halved until it is no longer
# than they are. The finer ones are for steep derivatives: a kink is a kink with all of them.
_STEPS = ((1e-5, 12), (1e-7, 18))


class Motion:
    """Attachments, cable directions and a wrench that move smoothly over time 0 to 2; feasible throughout.

    Args:
        seed: Each seed is another motion; the robot's size goes through `SIZES`.
        kind: "inside": at least 1 N to all limits. "touching": w comes to the boundary of the available wrench set at
            time 1 and goes back in. "following": w comes to the boundary at time 0.7 and follows it until 1.3.
    """

    def __init__(self, seed: int, kind: str = "inside") -> None:
        rng = np.random.default_rng(seed)
        self.kind = kind
        m, rank = SIZES[seed % len(SIZES)]
        points = rng.uniform(-1, 1, (2, 3, m))
        self.points = points if rank == 6 else np.repeat(points[:, :, :1], m, axis=2)
        self.directions = rng.normal(size=(2, 3, m))
        self.levels = rng.uniform(5, 50, m), rng.uniform(-4, 4, m)
        self.phases = rng.uniform(0, 2 * np.pi, m)
        # The direction to the boundary along which no cable changes sides: the corner then moves smoothly.
        times = np.linspace(0, 2, 41)
        self.rate, best = (1.0 if kind == "inside" else 0.3), 0.0
        matrices = np.array([self.matrix(moment) for moment in times])  # (times, 6, m)
        for d in rng.normal(size=(50, 6)):
            pulls = d @ matrices  # (times, m)
            apart = float(np.abs(pulls).min() / np.abs(pulls).max()) * float((pulls.min(0) * pulls.max(0) > 0).all())
            if apart >= best:
                best, self.corner = apart, np.where(pulls[0] > 0, T_MAX, T_MIN)
        if kind != "inside" and best == 0.0:
            # No such direction: the robot stands still while w moves.
            self.rate, self.corner = 0.0, np.where(rng.normal(size=6) @ self.matrix(0.0) > 0, T_MAX, T_MIN)

    def matrix(self, moment: float) -> Array:
        """Return the wrench matrix at a time, shape (6, m)."""
        (r0, r1), (u0, u1) = self.points, self.directions
        r = r0 + 0.2 * self.rate * np.sin(moment) * r1
        u = u0 + 0.4 * self.rate * np.sin(moment + 1.0) * u1
        u = u / np.linalg.norm(u, axis=0)
        return np.vstack([u, np.asarray(np.cross(r, u, axis=0), dtype=np.float64)])

    def at(self, moment: float) -> TensionProblem:
        """Return the problem at a time."""
        A = self.matrix(moment)
        t = self.levels[0] + self.levels[1] * np.sin(2 * moment + self.phases)
        if self.kind == "touching":
            t = t + np.sin(0.5 * np.pi * moment) ** 2 * (self.corner - t)
        elif self.kind == "following":
            away = max(0.0, abs(moment - 1.0) - 0.3) / 0.7
            t = t + np.cos(0.5 * np.pi * away) ** 2 * (self.corner - t)
        return TensionProblem(A, A @ t, T_MIN, T_MAX)


class Leaving(Motion):
    """The robot stands still while the wrench leaves the available wrench set and comes back."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        rng = np.random.default_rng([seed, 1])
        self.rate = 0.0
        A = self.matrix(0.0)
        self.outward = 3.0 * A @ rng.uniform(-T_MAX, T_MAX, A.shape[1])

    def at(self, moment: float) -> TensionProblem:
        """Return the problem at a time."""
        A = self.matrix(0.0)
        w = A @ self.levels[0] + np.sin(0.5 * np.pi * moment) ** 2 * self.outward
        return TensionProblem(A, w, T_MIN, T_MAX)


class Result(NamedTuple):
    """The result of one method.

    Attributes:
        motions: How many.
        worst: Largest change left by halving, relative to the largest step of the motion.
        worst_seed: The motion that it belongs to.
        inaccurate, unanswered: At how many instants the tensions missed w (as they must beyond the available wrench
            set), and at how many there were none.
        seconds: How long it took.
    """

    motions: int
    worst: float
    worst_seed: int
    inaccurate: int
    unanswered: int
    seconds: float


def jump(function: Callable[[float], Array], instants: int = 33, halvings: int = 10, more: int = 10) -> float:
    """Return the largest change of a function that halving the step does not halve, relative to the largest step.

    The three steps with the largest change are bisected, always into the half that changes more: about 1 at a jump,
    about 2^-halvings where the function is continuous with a slope no steeper than elsewhere. What looks like a jump
    is bisected `more` times more, for the steep slopes that there are.
    """
    times = np.linspace(0, 2, instants)
    values = [function(float(moment)) for moment in times]
    changes = [float(np.abs(b - a).max()) for a, b in pairwise(values)]
    size = max(max(changes), 1e-6 * T_MAX)
    worst = 0.0
    for k in np.argsort(changes)[-3:]:
        (a, fa), (b, fb) = (float(times[k]), values[k]), (float(times[k + 1]), values[k + 1])
        for halving in range(halvings + more):
            if halving >= halvings and np.abs(fb - fa).max() <= JUMP * size:
                break
            middle = (a + b) / 2
            value = function(middle)
            if np.abs(value - fa).max() > np.abs(fb - value).max():
                b, fb = middle, value
            else:
                a, fa = middle, value
        worst = max(worst, float(np.abs(fb - fa).max()) / size)
    return worst


def continuity(method: str, seeds: range) -> Result:
    """Take a method along one motion a seed."""
    return _taken(method, [Motion(seed, KINDS[seed % len(KINDS)]) for seed in seeds], seeds)


def leaving(method: str, seeds: range, **options: Any) -> Result:
    """Take a method out of the available wrench set and back."""
    return _taken(method, [Leaving(seed) for seed in seeds], seeds, options)


def smoothness(method: str, seeds: range, **options: Any) -> Result:
    """Do the same with the derivative of the tensions by time, inside the set."""
    start, worst, at = time.perf_counter(), 0.0, seeds.start
    for seed in seeds:
        motion = Motion(seed)

        left = 1.0
        for step, halvings in _STEPS:

            def slope(moment: float, motion: Motion = motion, step: float = step) -> Array:
                ahead, behind = (
                    _tensions(solve(motion.at(moment + apart), method, **options), motion) for apart in (step, -step)
                )
                return (ahead - behind) / (2 * step)

            left = jump(slope, instants=21, halvings=halvings, more=0)
            if left <= JUMP:
                break
        if left > worst:
            worst, at = left, seed
    return Result(len(seeds), worst, at, 0, 0, time.perf_counter() - start)


def _taken(method: str, motions: Sequence[Motion], seeds: range, options: dict[str, Any] | None = None) -> Result:
    start, worst, at = time.perf_counter(), 0.0, seeds.start
    statuses: Counter[str] = Counter()
    for seed, motion in zip(seeds, motions, strict=True):

        def tensions(moment: float, motion: Motion = motion) -> Array:
            solution = solve(motion.at(moment), method, **(options or {}))
            statuses[solution.status] += 1
            return _tensions(solution, motion)

        left = jump(tensions)
        if left > worst:
            worst, at = left, seed
    inaccurate, solved = statuses["inaccurate"], statuses["optimal"]
    unanswered = statuses.total() - solved - inaccurate
    return Result(len(seeds), worst, at, inaccurate, unanswered, time.perf_counter() - start)


def _tensions(solution: TensionSolution, motion: Motion) -> Array:
    """Return the tensions; where there are none, something so far away that it is a jump."""
    return np.full(motion.corner.size, 1e3 * T_MAX) if solution.tensions is None else solution.tensions


def soak(start: int, count: int, names: Sequence[str]) -> bool:
    """Take each method along `count` motions, print a line for each of its claims, and return whether all hold."""
    seeds, well = range(start, start + count), True
    for name in names:
        method, claims = methods()[name], dict[str, Result]()
        if method.continuous:
            claims["tensions"] = continuity(name, seeds)
        if method.always_answers:
            claims["out of the set and back"] = leaving(name, seeds)
            claims["the same with rho = 1"] = leaving(name, seeds, rho=1.0)
        if name in SMOOTH:
            claims["derivative"] = smoothness(name, seeds, **SMOOTH[name])
        for claim, result in claims.items():
            well &= result.worst <= JUMP and not result.unanswered
            left = f"{result.worst:.1e} of a change left (seed {result.worst_seed})"
            off = f"{result.inaccurate} instants inaccurate, {result.unanswered} without an answer"
            print(f"{name}: {claim}: {result.motions} motions, {left}, {off}, {result.seconds:.1f} s", flush=True)
    return well
