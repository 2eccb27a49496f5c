"""`find_global_path`: a path past obstacles from the start of a motion to its end, from which the program starts.

A nonlinear program that starts inside an obstacle, or on its wrong side, stays there. Where the usual guess exceeds a
limit at rest (`need`), two trees of configurations grow from start and end (`tree`), over the platform's coordinates
and the shape of its formation (`space`). A configuration is clear if tensions exist there at rest and all limits are
kept by a reserve (`at_rest`). A straight piece between two is clear if no distance can be exceeded between the
configurations that are checked (`clear_space`). Motion is left to the program.

In a narrow gap hardly any formation is clear, and trees that change position and formation together rarely find the way
to it. A formation that passes the gap is found there; with it, only positions are searched.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.random import Generator

from ...base.display import Displayed
from ...base.text import quantity
from ..nlp.guess import guess_through
from ..tasks.deviation import Deviation
from ..tasks.paths.rest_to_rest import rest_to_rest
from ..tasks.scenario import Scenario
from .at_rest import AtRest
from .clear_space import ClearSpace
from .end_formations import with_clear_ends
from .need import STILL, limit_name
from .smoothing import rounded, shortened
from .space import Space
from .tree import connect

RESERVES = (0.02, 0.004)  # of the robot's size, in the order in which they are tried
MOST_RESERVE = 0.05  # [m]
MOST, MOST_OF_TEAM = (20_000, 30_000), (5_000, 80_000)  # configurations that are evaluated with each reserve
IN_ONE_FORMATION = 0.15  # of the configurations
TREES_OF_TEAM = 20_000  # configurations after which the search of a team restarts with two new trees
AGAIN = 1.0  # of what the first path took: what is spent on a shorter one, past other sides of obstacles
PEAK_SPEED, PEAK_ACCELERATION = 2.2, 7.6  # of the law from rest to rest over a unit of length in a unit of time
ON_THE_WAY, IN_PLACE = 3_000, 2_000  # configurations for one formation's way, and for its change at an end


@dataclass(frozen=True)
class GlobalPath(Displayed):
    """Configurations from start to end of a motion, each to be reached straight from the one before."""

    space: Space
    corners: np.ndarray  # (k, count)

    @cached_property
    def _places(self) -> np.ndarray:
        lengths = np.linalg.norm(np.diff(self.corners, axis=0) * self.space.scale, axis=1)
        return np.concatenate([[0.0], np.cumsum(lengths)])

    @property
    def length(self) -> float:
        """Return its length, where turns and changes of formation count as what they move [m]."""
        return float(self._places[-1])

    def at(self, shares: np.ndarray) -> np.ndarray:
        """Return the configurations at shares of its length, (n, count)."""
        return np.stack([np.interp(shares * self.length, self._places, column) for column in self.corners.T], axis=1)

    def guess(self, scenario: Scenario) -> Deviation:
        """Return the motion along it from rest to rest."""
        seconds = self._seconds(scenario)
        nodes = np.linspace(0.0, seconds, scenario.task.steps + 1)
        configurations = self.at(rest_to_rest(nodes / seconds)[0])
        return guess_through(scenario.lasting(seconds), self.space.poses(configurations), nodes)

    def _seconds(self, scenario: Scenario) -> float:
        """Return a duration of the task's range in which speeds and accelerations along it are moderate."""
        span, task = scenario.duration_range, scenario.task
        if span is None:
            return scenario.duration
        own = [carrier.motion_limits for carrier in scenario.robot.carriers]
        speeds = [task.limits.platform_speed, task.limits.carrier_speed, *(limits.speed for limits in own)]
        rates = [
            task.limits.platform_acceleration,
            task.limits.carrier_acceleration,
            *(one.acceleration for one in own),
        ]
        by_speed = [PEAK_SPEED * self.length / speed for speed in speeds if speed]
        by_rate = [np.sqrt(PEAK_ACCELERATION * self.length / rate) for rate in rates if rate]
        return float(np.clip(max([scenario.duration, *by_speed, *by_rate]), span.min, span.max))


def find_global_path(
    scenario: Scenario, seconds: float = np.inf, most: tuple[int, int] | None = None
) -> tuple[GlobalPath | None, str]:
    """Return a path, or None, and a message: its length, or why there is none.

    The same scenario has the same path, unless the time of `seconds` ends first. At `most` so many configurations are
    evaluated with each reserve; default: as many as a plan deserves.
    """
    space, deadline = Space(scenario), time.perf_counter() + seconds
    rest = AtRest(scenario, space.size)
    space = with_clear_ends(space, rest, min(RESERVES[0] * space.size, MOST_RESERVE))
    kept = rest(*space.poses(space.ends))
    for end, slack, worst in zip(("start", "end"), kept.slack, kept.worst, strict=True):
        if slack < -STILL:
            return None, f"no path, since the {end} exceeds {limit_name(scenario, int(worst))} too"
    budgets = most or (MOST_OF_TEAM if space.shaped else MOST)
    for part, budget in zip(RESERVES, budgets, strict=True):
        rng = np.random.default_rng(0)
        clear = ClearSpace(space, rest, min(part * space.size, MOST_RESERVE), budget, deadline)
        found = _connected(clear, rng)
        if found is not None and not space.shaped:
            clear.most = clear.evaluated + min(AGAIN * clear.evaluated, budget)
            shorter = _connected(clear, rng, found.length)
            if shorter is not None and shorter.length < found.length:
                found = shorter
        if found is not None:
            inside = f"all limits kept by {quantity(1e3 * clear.reserve, 'mm', 3)}"
            return found, f"a path of {quantity(found.length, 'm', 3)}, {inside}"
        if not clear.in_time:
            return None, "no path found in its share of the time limit"
    return None, f"no path found among {sum(budgets)} configurations"


def _connected(clear: ClearSpace, rng: np.random.Generator, longest: float = np.inf) -> GlobalPath | None:
    """Return a path, made shorter and smoother, from configurations which one of this length may pass."""
    path, (start, end) = None, clear.space.ends
    if clear.space.shaped:
        path = in_one_formation(clear, rng, IN_ONE_FORMATION * (clear.most - clear.evaluated))
    # The search time of two trees has a heavy tail: new trees often find a path for a team before the old ones do.
    each, slides = (TREES_OF_TEAM, rng) if clear.space.shaped else (np.inf, None)
    while path is None and clear.evaluated < clear.most and clear.in_time:
        path = connect(clear, start, end, clear.targets(rng, longest), each, slides)
    return None if path is None else GlobalPath(clear.space, rounded(shortened(path, clear, rng), clear))


def in_one_formation(clear: ClearSpace, rng: Generator, most: float) -> np.ndarray | None:
    """Return clear configurations (k, count) from start to end, or None if at `most` so many do not show them."""
    start, end = clear.space.ends
    formation, most = clear.space.groups[-1], min(clear.evaluated + most, clear.most)
    while clear.evaluated < most and clear.in_time:
        fitting = clear.fitting(rng)
        if fitting is None:
            continue
        first, last = (np.where(formation, fitting, each) for each in (start, end))
        if not clear.are_clear(np.stack([first, last])):
            continue
        way = connect(clear, first, last, _positions(clear, rng, fitting), ON_THE_WAY)
        before = None if way is None else connect(clear, start, first, _formations(clear, rng, start), IN_PLACE)
        after = None if before is None else connect(clear, last, end, _formations(clear, rng, end), IN_PLACE)
        if way is not None and before is not None and after is not None:
            return np.vstack([before, way[1:], after[1:]])
    return None


def _positions(clear: ClearSpace, rng: Generator, fitting: np.ndarray) -> Iterator[np.ndarray]:
    """Yield random positions and attitudes with one formation."""
    while True:
        yield np.where(clear.space.groups[-1], fitting, clear.space.sample(rng))


def _formations(clear: ClearSpace, rng: Generator, at: np.ndarray) -> Iterator[np.ndarray]:
    """Yield random formations in place."""
    while True:
        target = at.copy()
        target[clear.space.groups[-1]] = clear.space.sample_shape(rng)
        yield target
