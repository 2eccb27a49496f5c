"""`connect`: a path between two configurations by two trees; `guess_exceeds`, `is_open`: whether one is needed.

Source: Kuffner and LaValle, RRT-Connect: an efficient approach to single-query path planning, ICRA 2000.
"""

from collections.abc import Callable, Iterator

import numpy as np

from ..tasks.deviation import Deviation
from ..tasks.ends import carrier_ends, platform_ends
from ..tasks.paths import WaypointPath
from ..tasks.scenario import POSITION, Scenario
from .at_rest import AtRest, Kept, unsure
from .clear_space import ClearSpace

SLIDES = 6  # past obstacles on the way to one target
LONGEST = 0.4  # of the distance of both ends: steps of the trees
PLACES = 61  # along the usual guess, the first time
STILL = 1e-9  # [m, rad]: nothing moves, nothing is exceeded


class _Tree:
    """Configurations, each with the one that it was reached from."""

    def __init__(self, root: np.ndarray, clear: ClearSpace):
        self._clear, self.nodes, self.parents = clear, root[None].copy(), [-1]

    def slide(self, index: int, target: np.ndarray, rng: np.random.Generator) -> int:
        """Return the node that is reached from node `index` towards the position of `target`, past what is in the way.

        Formation and position give way to each obstacle by a little.
        """
        formation = self._clear.space.groups[-1]
        for _ in range(SLIDES):
            at = self.nodes[index]
            beside = self._clear.beside(at, np.where(formation, at, target), rng)
            if beside is None or not np.array_equal(self._clear.advance(at, beside), beside):
                break
            index = self.add(beside, index)
            ahead = np.where(formation, beside, target)
            reached = self._clear.advance(beside, ahead)
            if not np.array_equal(reached, beside):
                index = self.add(reached, index)
            if np.array_equal(reached, ahead):
                break
        return index

    def nearest(self, target: np.ndarray) -> int:
        return int((((self.nodes - target) * self._clear.space.scale) ** 2).sum(axis=1).argmin())

    def add(self, node: np.ndarray, parent: int) -> int:
        self.nodes = np.vstack([self.nodes, node])
        self.parents.append(parent)
        return len(self.parents) - 1

    def grow(self, index: int, target: np.ndarray) -> int:
        """Return the node that is reached from node `index` towards `target`: straight, or else round a corner.

        At the corner the formation has changed, and nothing else.
        """
        at, advance = self.nodes[index], self._clear.advance
        reached = advance(at, target)
        if np.array_equal(reached, target):
            return self.add(reached, index)
        if self._clear.space.shaped:
            corner = np.where(self._clear.space.groups[-1], target, at)
            straight = np.array_equal(corner, at) or np.array_equal(corner, target)
            if not straight and np.array_equal(advance(at, corner), corner):
                farther = advance(corner, target)
                if np.array_equal(farther, target):
                    return self.add(farther, self.add(corner, index))
        return index if np.array_equal(reached, at) else self.add(reached, index)

    def to_root(self, index: int) -> list[np.ndarray]:
        path = []
        while index >= 0:
            path.append(self.nodes[index])
            index = self.parents[index]
        return path


def connect(
    clear: ClearSpace,
    start: np.ndarray,
    end: np.ndarray,
    targets: Iterator[np.ndarray],
    most: float = np.inf,
    slides: np.random.Generator | None = None,
) -> np.ndarray | None:
    """Return clear configurations (k, count), each reached straight from the one before; None if none are found.

    The trees grow from start and end to `targets`, until at `most` so many configurations have been evaluated. With
    `slides`, a source of random numbers, they go past what is in the way of a target too.
    """
    scale, most = clear.space.scale, min(clear.evaluated + most, clear.most)
    if np.array_equal(clear.advance(start, end), end):
        return np.stack([start, end])
    near, far, swapped = _Tree(start, clear), _Tree(end, clear), False
    longest = LONGEST * float(np.linalg.norm((end - start) * scale))
    formation = clear.space.groups[-1] & clear.space.shaped
    while clear.evaluated < most and clear.in_time:
        target = next(targets)
        parent = near.nearest(target)
        apart = float(np.linalg.norm((target - near.nodes[parent]) * scale))
        part = np.where(formation, 1.0, min(1.0, longest / max(apart, 1e-12)))  # of a way; a formation is good or not
        target = near.nodes[parent] + (target - near.nodes[parent]) * part
        new = near.grow(parent, target)
        if slides is not None and not np.array_equal(near.nodes[new], target):
            new = near.slide(new, target, slides)
        if new != parent:
            reached = near.nodes[new]
            other = far.grow(far.nearest(reached), reached)
            if np.array_equal(far.nodes[other], reached):
                path = near.to_root(new)[::-1] + far.to_root(other)
                return np.stack(path[::-1] if swapped else path)
        near, far, swapped = far, near, not swapped
    return None


def is_open(scenario: Scenario) -> bool:
    """Return whether a motion may take any way from its start to its end."""
    task = scenario.task
    if scenario.relative or np.isfinite(task.tube.radius) or platform_ends(task) not in ("rest", "exact"):
        return False
    if isinstance(task.path, WaypointPath) and task.tube.waypoints == "exact":
        return False
    if scenario.phases.rest:  # what it carries depends on the time
        return False
    if not {i for i in POSITION if scenario.robot.dof_mask[i]} <= set(scenario.platform_free):
        return False
    platform, carriers = scenario.references(np.linspace(0.0, scenario.duration, PLACES))
    loose = scenario.loose
    given = []
    if np.ptp(platform.pose[[0, -1], :3], axis=0).max() <= STILL:  # else they follow the place (`Space`)
        given += [np.delete(platform.pose, scenario.platform_free, axis=1)]
        given += [carrier.pose for i, carrier in enumerate(carriers) if i not in loose]
    if loose and carrier_ends(task) in ("exact", "periodic"):
        given += [carriers[i].pose[[0, -1]][:, :3] - platform.pose[[0, -1]][:, :3] for i in loose]
    return all(np.ptp(values, axis=0).max(initial=0.0) <= STILL for values in given)


def guess_exceeds(scenario: Scenario, guess_at: Callable[[np.ndarray], Deviation], balance: bool = True) -> str:
    """Return the name of the limit that a guess exceeds at rest, "tensions", or "" if it keeps all.

    Between the configurations that are checked no distance is exceeded either. `guess_at` returns the guess at times
    (n,) [s]. Without `balance` there need not be tensions.
    """
    times = np.linspace(0.0, scenario.duration, PLACES)
    guess, rest = guess_at(times), AtRest(scenario, 1.0, spare=0.0, balance=balance)

    def kept_at(times: np.ndarray) -> Kept:
        platform, carriers = scenario.motion(times, guess)
        return rest(platform.pose, carriers.pose, scenario.off_path(times, platform, carriers))

    kept = kept_at(times)
    while (least := int(kept.slack.argmin())) >= 0:
        if kept.slack[least] < -STILL:
            return limit_name(scenario, int(kept.worst[least]))
        between = unsure(kept.slack, kept.points)
        if not between.size:
            break
        middle = (times[between] + times[between + 1]) / 2
        more = kept_at(middle)
        times = np.insert(times, between + 1, middle)
        kept = Kept(*(np.insert(old, between + 1, new, axis=0) for old, new in zip(kept, more, strict=True)))
    return ""


def limit_name(scenario: Scenario, index: int) -> str:
    """Return what texts call the limit with this index, as `Kept.worst` has it."""
    return "tensions" if index < 0 else scenario.limits.all[index].name
