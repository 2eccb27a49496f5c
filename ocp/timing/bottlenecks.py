"""Find the active limits along the fastest time law: `bottlenecks`.

Along the fastest time law some limit is always active: a speed, a carrier's acceleration, or tensions, where the needed
wrench lies on a facet of the available wrench set and the cables across that facet are at their limits.
"""

from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from ...solvers import TensionProblem, capacity_margin
from ...statics.distribution import wrench_problem
from ..tasks.paths import TimedPath
from .parametrised_path import ParametrisedPath, PathLimits, relative

LOOKS = 120  # instants, at equal times
REACHED = 0.995  # of a limit of speed or acceleration
PULLS = 1e-6  # of the largest pull along a facet's normal: less lies in the facet


class Bottleneck(NamedTuple):
    """A stretch of the path and the limit that is active on it.

    Attributes
    ----------
    start, end
        Fractions s of the path.
    seconds
        Time that the motion takes there.
    limit
        The active limit: "t_max of cables 2, 5", "speed of platform".
    """

    start: float
    end: float
    seconds: float
    limit: str

    def describe(self) -> str:
        """Return one line for a person."""
        return f"s = {self.start:.3f} to {self.end:.3f} (for {self.seconds:.3f} s): {self.limit}"

    def to_dict(self) -> dict[str, Any]:
        """Return {"from", "to", "seconds" [s], "limit"} for JSON."""
        return {"from": self.start, "to": self.end, "seconds": self.seconds, "limit": self.limit}


def bottlenecks(parametrised: ParametrisedPath, limits: PathLimits, margin: float, path: TimedPath) -> list[Bottleneck]:
    """Return the stretches of a time law along a path, with tensions `margin` [N] inside their limits."""
    edges = np.linspace(0.0, path.natural_duration or 0.0, LOOKS + 1)
    s, sd, sdd = path.law((edges[1:] + edges[:-1]) / 2)
    platform, carriers = (motion.timed(sd, sdd) for motion in parametrised.at(s))
    names, shares = [], []
    for each in limits:
        names += [
            f"{limit.name.partition('_')[2].replace('_', ' ')} of {label}" for limit in each for label in limit.labels
        ]
        shares.append(relative(each, platform, carriers))
    reached = np.hstack(shares)
    A = parametrised.dynamics.wrench_matrix(platform.pose, carriers.pose)
    w = parametrised.dynamics.required_wrench(*platform, wind=parametrised.wind)
    low, high = parametrised.robot.t_min + margin, parametrised.robot.t_max - margin
    reached_limits = []
    for k in range(LOOKS):
        if sd[k] == sdd[k] == 0:
            reached_limits.append("dwell")
        elif reached[k].max(initial=0.0) >= REACHED:
            reached_limits.append(names[int(reached[k].argmax())])
        else:
            reached_limits.append(_tensions(wrench_problem(parametrised.robot, A[k], w[k], low, high)))
    at, stretches, first = path.law(edges)[0], [], 0
    for limit, run in groupby(reached_limits):
        after = first + len(list(run))
        stretches.append(Bottleneck(float(at[first]), float(at[after]), float(edges[after] - edges[first]), limit))
        first = after
    return stretches


def _tensions(problem: TensionProblem) -> str:
    """Return which cables are at which limit on the facet nearest to the needed wrench."""
    pull = capacity_margin(problem).direction @ problem.A
    size = np.abs(pull).max(initial=0.0)
    at = {"t_min": np.flatnonzero(pull < -PULLS * size), "t_max": np.flatnonzero(pull > PULLS * size)}
    cables_at_limits = [
        f"{name} of cable{'s' * (cables.size > 1)} {', '.join(str(cable + 1) for cable in cables)}"
        for name, cables in at.items()
        if cables.size
    ]
    return "; ".join(cables_at_limits) or "tensions"
