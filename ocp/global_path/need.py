"""Whether a motion needs a global path, and whether its task leaves one: `guess_exceeds`, `is_open`."""

from collections.abc import Callable

import numpy as np

from ..tasks.deviation import Deviation
from ..tasks.ends import carrier_ends, platform_ends
from ..tasks.paths import WaypointPath
from ..tasks.scenario import POSITION, Scenario
from .at_rest import AtRest, Kept, unsure

PLACES = 61  # along the usual guess, the first time
STILL = 1e-9  # [m, rad]: nothing moves, nothing is exceeded


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
