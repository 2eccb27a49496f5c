"""What would make an infeasible task feasible: `feasible_changes`, each change with an audited plan.

Nearest to the task are another duration and limits that the closest motion just keeps. Only where these do not help
other changes are tried, of regions, path, loads and cables: first each alone, then several together.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ...base.text import quantity
from ..audits.audit import Audit
from ..audits.excess import TENSIONS
from ..proofs.durations import durations
from ..result import Offers, Relaxed
from ..tasks.deviation import Deviation
from ..tasks.lay_out import with_task
from ..tasks.paths import CirclePath
from ..tasks.scenario import Scenario
from ..tasks.task import Tube
from .largest_share import Change, Maker, at_ease, by_programs, exceeds, largest_share, rests, together
from .looser_limits import looser_limits
from .other_forces import (
    larger_t_max,
    less_margin,
    less_wind,
    lighter_load,
    lighter_platform,
    smaller_t_min,
    surer_load,
)
from .other_paths import (
    as_wide_as_states,
    near_home,
    nearer_end,
    other_yaws,
    shifted_path,
    shortest_shift,
    smaller_circle,
    tilting_platform,
)
from .other_plans import rounded
from .past_regions import IN_THE_WAY, fewer_regions, past_regions
from .search import Search
from .slower import LONGER, longer, longer_duration, longer_phases, other_duration, slower, slower_rate, slower_states


def _shifted(scenario: Scenario) -> Change | None:
    """Return the shift of a path to where tensions hold the platform."""
    return shifted_path(scenario, shortest_shift(scenario))


# For a motion exactly on its path each is tried, since this takes little time; for others each solves programs.
OF_PATHS = (
    *(nearer_end, smaller_circle, other_yaws, less_wind, lighter_load, surer_load, lighter_platform),
    *(larger_t_max, smaller_t_min, _shifted),
)
BY_PROGRAMS = less_wind, lighter_load, lighter_platform, nearer_end
# When tried together, the first are left out first. Stronger cables permit what a lighter platform does, at any t_min.
OF_CABLES = smaller_t_min, larger_t_max
OTHERS = lighter_load, less_wind, nearer_end, less_margin, slower_rate, longer


def feasible_changes(search: Search, scenario: Scenario, deviation: Deviation | None, audit: Audit) -> Offers:
    """Return changes that make a scenario feasible; `audit` is its closest motion's, with a `deviation`."""
    return Offers(_changes(search, scenario, deviation, audit), search.cut_short)


def _changes(search: Search, scenario: Scenario, deviation: Deviation | None, audit: Audit) -> list[Relaxed]:
    chosen, missing = by_programs(scenario), audit.certificate
    # No cable pulls as is necessary, however strong it is, and slower motions hardly need less.
    direction = missing is not None and not (audit.excess or missing.at_max.size or missing.at_min.size)
    slow = at_ease(scenario) <= scenario.duration
    if chosen and direction and slow and (found := tilting_platform(search, scenario)):
        return found
    phases = longer_phases(search, scenario, audit)
    # Where the robot cannot rest at the ends, no duration and no limit helps.
    held = not chosen or scenario.task.tube.position == "free" or rests(scenario)
    if held and (found := _near(search, scenario, deviation, audit)):
        return phases + found
    if scenario.count and not chosen:  # else what the platform could do exactly on its path
        audit = search.audit_motion(scenario, None, "audit of the path")
        if found := other_duration(search, scenario, durations(with_task(scenario, tube=Tube())), audit):
            return phases + found
    return phases + _farther(search, scenario, audit)


def _near(search: Search, scenario: Scenario, deviation: Deviation | None, audit: Audit) -> list[Relaxed]:
    """Return other durations, and looser limits, at which a motion near the closest one is feasible.

    If the planner chooses the motion, a longer duration is tried first where the motion is fast, and last where not.
    """
    if not scenario.count:
        found = other_duration(search, scenario, search.timing.durations, audit)
        found += looser_limits(search, scenario, deviation, audit)
        return found and largest_share(search, slower_rate(scenario)) + found
    if scenario.task.tube.position == "free" and (found := _past_what_is_in_the_way(search, scenario, audit)):
        return found
    if at_ease(scenario) > scenario.duration or any(slower(excess) > 1 for excess in audit.excess):
        found = longer_duration(search, audit) + looser_limits(search, scenario, deviation, audit)
    else:
        found = looser_limits(search, scenario, deviation, audit) or longer_duration(search, audit)
    return found or as_wide_as_states(search, scenario, audit) or slower_states(search, scenario)


def _past_what_is_in_the_way(search: Search, scenario: Scenario, audit: Audit) -> list[Relaxed]:
    """Return what leads a platform with a free position past regions, or how many of these can stay."""
    found = past_regions(search, scenario) if _in_the_way(audit) else []
    blocking = (audit, None) if _blocked(audit) else ()
    return found or _first(search, scenario, [partial(fewer_regions, audit=each) for each in blocking])


def _farther(search: Search, scenario: Scenario, audit: Audit) -> list[Relaxed]:
    """Return changes of regions, path, loads, platform and cables: each alone, or else several together.

    `audit` is for the motion exactly on the path.
    """
    chosen = by_programs(scenario)
    fewer = (partial(fewer_regions, audit=audit),) * _blocked(audit)
    found = past_regions(search, scenario) if _in_the_way(audit) else []
    if chosen:  # a smaller t_min alone helps where the formation does not rest
        singles = (*((smaller_t_min,) * (not rests(scenario))), *BY_PROGRAMS, *fewer, near_home)
        found = found or _first(search, scenario, singles)
    else:
        found += _each(search, scenario, audit)
        others = (nearer_end, *fewer) if fewer else (near_home,)
        found = found or [each for make in others for each in largest_share(search, make(scenario))]
    found = found or together(search, scenario, (*fewer, *OF_CABLES, near_home, *OTHERS))
    if found or chosen:  # a lighter platform needs a smaller t_min too
        return found or together(search, scenario, (*fewer, lighter_platform, smaller_t_min, *OTHERS))
    shift = partial(shifted_path, shortest=shortest_shift(scenario, balance=False))
    return together(search, scenario, (*fewer, *OF_CABLES, shift, *OTHERS))


def _first(search: Search, scenario: Scenario, makers: Sequence[Maker]) -> list[Relaxed]:
    """Return the first of some changes that makes a motion feasible."""
    return next(filter(None, (largest_share(search, make(scenario)) for make in makers)), [])


def _each(search: Search, scenario: Scenario, audit: Audit) -> list[Relaxed]:
    """Return all changes with which a motion exactly on its path is feasible.

    If speeds or accelerations are exceeded too, each may also need a longer duration, which is not tried in phases.
    """
    found = largest_share(search, slower_rate(scenario))
    factors = [slower(excess) for excess in audit.excess if excess.limit != TENSIONS]
    if min(factors, default=2.0) <= 1.0 or (factors and not scenario.stretches):
        if _blocked(audit) and not isinstance(scenario.task.path, CirclePath):
            inside = exceeds(scenario, np.array([scenario.duration]), rates=False).any()
            return found + (largest_share(search, nearer_end(scenario)) if inside else [])
        return found + _first(search, scenario, (_shifted, nearer_end))
    found += tilting_platform(search, scenario)
    seconds, with_it = rounded(LONGER * max(factors, default=1.0) * scenario.duration, up=True), ""
    if factors and scenario.task.phases is None and seconds <= scenario.longest:
        scenario, with_it = with_task(scenario, duration=seconds), f", with a duration of {quantity(seconds, 's')}"
    for make in OF_PATHS:
        found += [replace(each, detail=each.detail + with_it) for each in largest_share(search, make(scenario))]
    return found


def _blocked(audit: Audit) -> bool:
    return any(excess.limit == "keep_out" for excess in audit.excess)


def _in_the_way(audit: Audit) -> bool:
    return any(excess.limit in IN_THE_WAY for excess in audit.excess)
