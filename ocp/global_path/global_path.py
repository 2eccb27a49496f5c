"""`motion_past`: a motion past obstacles, from which the program starts; `find_global_path`: the path of it.

A nonlinear program that starts inside an obstacle, or on its wrong side, stays there. Where the usual guess exceeds a
limit at rest (`need`), two trees of configurations grow from start and end (`tree`), over the platform's coordinates
and the shape of its formation (`space`). A configuration is clear if tensions exist there at rest and all limits are
kept by a reserve (`at_rest`). A straight piece between two is clear if no distance can be exceeded between the
configurations that are checked (`clear_space`). Motion is left to the program.

In a narrow gap hardly any formation is clear, and trees that change position and formation together rarely find the way
to it. A formation that passes the gap is found there; with it, only positions are searched. A formation that starts at
home may stand in the way of an obstacle, although its task lets it start with any other. So may a platform with the
attitude of its path (`with_clear_ends`).
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from ...base.display import Displayed
from ...base.text import quantity
from ..nlp.guess import formation_guess, guess_through, usual_guess
from ..search.search import Search
from ..tasks.deviation import Deviation
from ..tasks.ends import carrier_ends, fixed_values
from ..tasks.paths.line import rest_to_rest
from ..tasks.scenario import ATTITUDE, Scenario
from .at_rest import AtRest
from .clear_space import FORMATIONS, ClearSpace, grown
from .space import Space
from .tree import STILL, connect, guess_exceeds, is_open, limit_name

RESERVES = (0.02, 0.004)  # of the robot's size, in the order in which they are tried
MOST_RESERVE = 0.05  # [m]
MOST, MOST_OF_TEAM = (20_000, 30_000), (5_000, 80_000)  # configurations that are evaluated with each reserve
IN_ONE_FORMATION = 0.15  # of the configurations
TREES_OF_TEAM = 20_000  # configurations after which the search of a team restarts with two new trees
AGAIN = 1.0  # of what the first path took: what is spent on a shorter one, past other sides of obstacles
PEAK_SPEED, PEAK_ACCELERATION = 2.2, 7.6  # of the law from rest to rest over a unit of length in a unit of time
ON_THE_WAY, IN_PLACE = 3_000, 2_000  # configurations for one formation's way, and for its change at an end
SHORTCUTS = 150
SHORT = 1.02  # times the straight way: a path that is as short is not made shorter
ROUNDS = 2  # of cutting corners
CUT = 0.25  # of the two sides of a corner
YAW = 5
MOST_TURN = 0.4  # [rad], by which the platform starts or ends turned
SPARE = 2.0  # times the reserve, which is kept if there is space
AWAY = 0.02  # metres of slack that a metre away from the usual formation is worth
GLOBAL_SHARE = 0.2  # of the time limit


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
        straight = float(np.linalg.norm((space.ends[1] - space.ends[0]) * space.scale))
        if found is not None and not space.shaped and found.length > SHORT * straight:
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


def shortened(path: np.ndarray, clear: ClearSpace, rng: Generator) -> np.ndarray:
    """Return a path with straight pieces instead of detours, wherever random places of it can be joined.

    A group of coordinates is made straight at once, while the others stay as they are.
    """
    scale, groups = clear.space.scale, clear.space.groups
    for _ in range(SHORTCUTS):
        if len(path) < 3 or not clear.in_time:
            break
        at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0) * scale, axis=1))])
        if at[-1] <= SHORT * np.linalg.norm((path[-1] - path[0]) * scale):
            break
        ends = np.sort(rng.uniform(0.0, at[-1], 2))
        group = groups[rng.integers(len(groups))]
        i, j = np.searchsorted(at, ends, side="right")
        if i == j or ends[0] == ends[1]:
            continue
        p, q = (np.array([np.interp(place, at, column) for column in path.T]) for place in ends)
        piece = np.vstack([p, *([] if group.all() else path[i:j]), q])
        share = (np.r_[ends[0], at[i:j] if len(piece) > 2 else [], ends[1]] - ends[0]) / (ends[1] - ends[0])
        piece[:, group] = p[group] + share[:, None] * (q - p)[group]
        if clear.is_clear(piece):
            path = _without_idle(np.vstack([path[:i], piece, path[j:]]), scale)
    return path


def _without_idle(path: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Return a path without the places between which it goes straight on."""
    kept = [path[0]]
    for place, after in pairwise(path[1:]):
        there, on = (place - kept[-1]) * scale, (after - kept[-1]) * scale
        along = there @ on / max(on @ on, 1e-300)
        if not (0.0 <= along <= 1.0 and np.linalg.norm(there - along * on) < 1e-9):
            kept.append(place)
    return np.vstack([*kept, path[-1]])


def rounded(path: np.ndarray, clear: ClearSpace) -> np.ndarray:
    """Return a path whose corners are cut where that is possible, again and again (Chaikin)."""
    for _ in range(ROUNDS):
        new = [path[0]]
        for before, corner, after in zip(path[:-2], path[1:-1], path[2:], strict=True):
            p, q = corner + CUT * (before - corner), corner + CUT * (after - corner)
            new += [p, q] if clear.is_clear(np.stack([p, q])) else [corner]
        path = np.vstack([*new, path[-1]])
    return path


def with_clear_ends(space: Space, rest: AtRest, reserve: float) -> Space:
    """Return the space with ends near the usual ones that keep all limits by the reserve [m], if they are found."""
    if carrier_ends(space.scenario.task) == "periodic":
        return space
    rng, ends = np.random.default_rng(0), space.ends.copy()
    for k, slack in enumerate(rest(*space.poses(ends)).slack):
        free = _free(space, k)
        if slack < reserve and free is not None:
            ends[k] = _clear_end(space, rest, ends[k], free, reserve, rng)
    return replace(space, given_ends=ends)


def _free(space: Space, end: int) -> np.ndarray | None:
    """Return by how much each coordinate may change at an end, (count,); None if its formation may not."""
    scenario, platform = space.scenario, space.scenario.platform_free
    fixed = {each.column for each in fixed_values(scenario) if each.order == 0 and each.end == -end}
    owners = scenario.owners()
    if any(owners[column][0] is not None for column in fixed):
        return None
    free = np.zeros(space.count)
    free[len(platform) :] = np.inf if space.shaped else 0.0
    turning = (YAW,) if space.shaped else ATTITUDE  # a formation carries its load level
    for column, coordinate in enumerate(platform):
        if coordinate in turning and column not in fixed:
            free[column] = min(scenario.task.tube.turn, MOST_TURN)
    return free if free.any() else None


def _clear_end(
    space: Space, rest: AtRest, end: np.ndarray, free: np.ndarray, reserve: float, rng: np.random.Generator
) -> np.ndarray:
    """Return the configuration nearest to `end` that keeps the reserve, or the one that misses it by least."""

    def inside(tried: np.ndarray) -> np.ndarray:
        return np.clip(tried, end - free, end + free)

    def score(tried: np.ndarray) -> np.ndarray:
        slack = rest(*space.poses(inside(tried))).slack
        away = np.linalg.norm((inside(tried) - end) * space.scale, axis=1)
        return np.minimum(slack, SPARE * reserve) - np.where(slack >= reserve, AWAY * away, AWAY * space.size)

    formation = np.isinf(free)
    first = np.repeat(end[None], FORMATIONS, axis=0)
    first[1:] += rng.uniform(-1.0, 1.0, first[1:].shape) * np.where(formation, 0.0, free)
    if formation.any():
        first[1:, formation] = [space.sample_shape(rng) for _ in range(FORMATIONS - 1)]
    return inside(grown(space, first, score, np.minimum(free, 1.0), rng)[0])


class Start(NamedTuple):
    """The motion from which the programs of a task start, None for the usual guess; see `motion_past`."""

    motion: Deviation | None
    collides: bool  # whether the usual guess does
    shifted: bool = False  # whether the motion is the usual guess with another formation or attitude


def motion_past(search: Search, balance: bool, most: tuple[int, int] | None = None, shifting: bool = True) -> Start:
    """Return a motion past what the usual guess collides with, or else the best guess.

    With `balance` a configuration without tensions at rest is a collision. `most` is as for `find_global_path`. Without
    `shifting` a path is searched for even where another formation or attitude keeps all limits.
    """
    scenario = search.scenario
    if scenario.count == 0 or not is_open(scenario):
        return Start(None, False)
    with search.stage("global path") as stage:
        usual = partial(usual_guess, scenario)
        exceeded = guess_exceeds(scenario, usual, balance)
        nodes = np.linspace(0.0, scenario.duration, scenario.task.steps + 1)
        formation = formation_guess(scenario) if search.seconds_left > 0 else None
        clear = shifting and formation is not None and not guess_exceeds(scenario, formation, balance)
        if not exceeded:
            # A formation keeps more distance, but not between the places at which it was chosen.
            return Start(None if formation is None else (formation if clear else usual)(nodes), False)
        if formation is not None and clear:
            stage.message = f"the direct motion exceeds {exceeded}: a shifted or turned one keeps all limits"
            return Start(formation(nodes), True, shifted=True)
        seconds = min(GLOBAL_SHARE * scenario.task.time_limit, search.seconds_left)
        path, message = find_global_path(scenario, seconds, most)
        stage.message = f"the direct motion exceeds {exceeded}: {message}"
        if path is not None:
            return Start(path.guess(scenario), True)
        return Start(None if formation is None else formation(nodes), True)
