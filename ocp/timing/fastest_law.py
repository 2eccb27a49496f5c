"""`FastestLaw`: the fastest time law along a path, or the point where none exists.

Along the fastest time law some limit is always active: a speed, a carrier's acceleration, or tensions, where the needed
wrench lies on a facet of the available wrench set and the cables across that facet are at their limits.
"""

from dataclasses import dataclass, field
from functools import cached_property
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from ...base.display import Displayed
from ...base.inputs import required
from ...base.text import numbered
from ...solvers import Certificate, TensionProblem, capacity_margin
from ...statics.distribution import wrench_problem
from ..tasks.paths import AnyPath, Curve, PathBase, TimedPath
from .parametrised_path import ParametrisedPath, PathLimits, relative

LOOKS = 120  # intervals of equal duration, divided where the motion dwells
REACHED = 0.995  # of a limit of speed or acceleration
PULLS = 1e-6  # of the largest pull along a facet's normal: less lies in the facet
LARGEST = "t_max", "winch_force", "winch_power"  # what limits largest tensions
SHOWN = 10.0  # [s], of a path without a time law: how long the motion lasts that shows it


class Bottleneck(NamedTuple):
    """A stretch of the path and the limit that is active on it."""

    start: float  # fractions s of the path
    end: float  # likewise
    seconds: float  # time that the motion takes there
    limit: str  # the active limit: "t_max of cables 2, 5", "speed of platform"

    def describe(self) -> str:
        """Return one line for a person."""
        return f"s = {self.start:.3f} to {self.end:.3f} (for {self.seconds:.3f} s): {self.limit}"

    def to_dict(self) -> dict[str, Any]:
        """Return {"from", "to", "seconds" [s], "limit"} for JSON."""
        return {"from": self.start, "to": self.end, "seconds": self.seconds, "limit": self.limit}


def bottlenecks(parametrised: ParametrisedPath, limits: PathLimits, margin: float, path: TimedPath) -> list[Bottleneck]:
    """Return the stretches of a time law along a path, with tensions `margin` [N] inside their limits."""
    duration, dwell = path.natural_duration or 0.0, np.array(path.dwell or ())
    at_rest = np.flatnonzero(dwell)
    begins = path.times[at_rest]
    edges = np.concatenate([np.linspace(0.0, duration, LOOKS + 1), begins, begins + dwell[at_rest]])
    edges = np.unique(np.clip(edges.round(9), 0.0, duration))
    s, sd, sdd = path.law((edges[1:] + edges[:-1]) / 2)
    curves = parametrised.at(s)
    platform, carriers = (motion.timed(sd, sdd) for motion in curves)
    names, shares = [], []
    for each in (limits.speeds, limits.accelerations):
        names += [
            f"{limit.name.partition('_')[2].replace('_', ' ')} of {label}" for limit in each for label in limit.labels
        ]
        shares.append(relative(each, platform, carriers))
    reached = np.hstack(shares)
    A = parametrised.dynamics.wrench_matrix(platform.pose, carriers.pose)
    w = parametrised.dynamics.required_wrench(*platform, wind=parametrised.wind)
    low, high = parametrised.robot.t_min + margin, parametrised.robot.t_max - margin
    force = parametrised.motor_force
    if np.isfinite(force).any():
        P, Q = parametrised.reflected(*curves)
        force = force + P * sdd[:, None] + Q * np.square(sd)[:, None]
    with np.errstate(divide="ignore"):
        power = parametrised.pull_per_speed(*curves, limits.power) / sd[:, None]
    largest = np.stack(np.broadcast_arrays(high, force, power))  # (3, n, m)
    reached_limits = []
    for k in range(s.size):
        if sd[k] == sdd[k] == 0:
            reached_limits.append("dwell")
        elif reached[k].max(initial=0.0) >= REACHED:
            reached_limits.append(names[int(reached[k].argmax())])
        else:
            problem = wrench_problem(parametrised.robot, A[k], w[k], low, np.clip(largest[:, k].min(axis=0), low, high))
            reached_limits.append(_tensions(problem, largest[:, k].argmin(axis=0)))
    at, stretches, first = path.law(edges)[0], [], 0
    for limit, run in groupby(reached_limits):
        after = first + len(list(run))
        stretches.append(Bottleneck(float(at[first]), float(at[after]), float(edges[after] - edges[first]), limit))
        first = after
    return stretches


def _tensions(problem: TensionProblem, limits: np.ndarray) -> str:
    """Return which cables are at which limit on the facet nearest to the needed wrench.

    `limits`, (m,), are the indices among `LARGEST` of what limits each cable's largest tension.
    """
    pull = capacity_margin(problem).direction @ problem.A
    size = np.abs(pull).max(initial=0.0)
    high = pull > PULLS * size
    at = {"t_min": pull < -PULLS * size} | {name: high & (limits == k) for k, name in enumerate(LARGEST)}
    names = [f"{name} of {numbered('cable', np.flatnonzero(cables))}" for name, cables in at.items() if cables.any()]
    return "; ".join(names) or "tensions"


@dataclass(frozen=True, eq=False)
class FastestLaw(Displayed):
    """Result of `time_along`: the fastest time law, or the point where none exists.

    Attributes:
        parametrised: The robot and the geometry that was timed.
        limits: The limits besides the tension limits.
        margin: Distance of every tension from its limits [N].
        s: Grid, (n,), the fraction of the path's own time, from 0 to 1.
        sd: ds/dt on the grid, (n,) [1/s]; nan without a time law.
        at: Without a feasible time law: s of the certificate, where the path itself exceeds a limit, or where the
            search ended.
        certificate: If infeasible: proof that at `at` no tensions inside their limits give the required wrench at any
            speed and acceleration (at the ends: at rest). It belongs to `problem` and has the largest shortfall along
            the grid.
        problem: The tension problem at `at` for the speed and acceleration that are closest to feasible; at the ends,
            for rest.
        blocked: All grid points s with such a proof.
    """

    parametrised: ParametrisedPath
    limits: PathLimits
    margin: float
    s: np.ndarray
    sd: np.ndarray
    at: float | None = None
    certificate: Certificate | None = None
    problem: TensionProblem | None = None
    blocked: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def exists(self) -> bool:
        """Return whether a time law exists; the audit of the plan decides whether it is feasible."""
        return not np.isnan(self.sd).any()

    @cached_property
    def path(self) -> TimedPath:
        """Return the platform's path with the time law; without one, with a time law that shows the path in 10 s."""
        return self.timed(self.parametrised.path)

    @cached_property
    def carrier_paths(self) -> dict[int, AnyPath]:
        """Return the paths of the carriers by their index; moving ones have the same time law."""
        moving, paths = self.parametrised.moving, self.parametrised.carriers
        return {index: self.timed(path) if index in moving else path for index, path in paths.items()}

    @cached_property
    def bottlenecks(self) -> list[Bottleneck]:
        """Return the stretches of the path, in order, with the active limit of each.

        The list is empty without a time law.
        """
        return bottlenecks(self.parametrised, self.limits, self.margin, self.path) if self.exists else []

    def timed(self, path: Curve) -> TimedPath:
        """Return a path of the platform or of a carrier with the time law.

        Raises `InputError` if `path` is not a path.
        """
        required("path", path, PathBase)
        law: dict[str, Any] = {
            "s": tuple(self.s.tolist()),
            "speeds": tuple((self.sd if self.exists else self._shown()).tolist()),
        }
        dwell = self.parametrised.dwell
        if any(dwell.values()):
            law["dwell"] = tuple(dwell.get(s, 0.0) for s in law["s"])
        return TimedPath(kind="timed", frame=path.frame, along=path, until=self.parametrised.until(path), **law)

    def _shown(self) -> np.ndarray:
        """Return ds/dt of a motion that only shows the path, from rest to rest at constant accelerations, (n,)."""
        rests = np.unique([0.0, 1.0, *self.parametrised.dwell])
        speeds = np.sqrt(np.abs(self.s[:, None] - rests).min(axis=1))
        return speeds * np.sum(2 * np.diff(self.s) / (speeds[1:] + speeds[:-1])) / SHOWN

    def to_dict(self) -> dict[str, Any]:
        """Return "bottlenecks", "at" and "blocked" for JSON; numbers that do not exist are None."""
        return {
            "bottlenecks": [each.to_dict() for each in self.bottlenecks],
            "at": self.at,
            "blocked": self.blocked.tolist(),
        }
