"""Offer longer durations of the phases in which a motion exceeds something: `longer_phases`."""

import numpy as np

from ...base.text import quantity
from ..audits.audit import Audit
from ..result import Relaxed
from ..tasks.lay_out import lay_out
from ..tasks.paths import RestPath, SequencePath
from ..tasks.scenario import Scenario
from .largest_share import Change, Variation, largest_share
from .relaxations import LONGEST, rounded
from .search import Search


def longer_phases(search: Search, scenario: Scenario, audit: Audit) -> list[Relaxed]:
    """Return the shortest feasible durations of the phases that exceed something, all longer by one factor.

    `audit` says which phases these are. Other phases keep their durations; the motion is that of the paths.
    """
    path, phases = scenario.path, list(scenario.task.phases or ())
    times = [excess.time for excess in audit.excess if excess.time is not None]
    times += audit.times[audit.violation > audit.tolerance].tolist()
    if not phases or not times or scenario.carrier_free or not isinstance(path, SequencePath):
        return []
    longer = [
        k
        for k, (phase, part) in enumerate(zip(scenario.phases.all, path.parts, strict=True))
        if scenario.phases.within(phase, np.array(times)).any()
        and part.path.stretches
        and not isinstance(part.path, RestPath)
    ]
    if not longer:
        return []
    given = [path.parts[k].seconds for k in longer]

    def lasting(share: float) -> Variation:
        changed, factor = phases.copy(), LONGEST ** (1 - share)
        values = [rounded(factor * seconds, up=True) for seconds in given]
        for k, seconds in zip(longer, values, strict=True):
            changed[k] = phases[k].model_copy(update={"duration": seconds})
        varied = lay_out(scenario.robot, scenario.task.model_copy(update={"phases": tuple(changed)}))
        others = [f"phases[{k}].duration {quantity(seconds, 's')}" for k, seconds in zip(longer, values, strict=True)]
        return varied, values[0], ", ".join([f"instead of {quantity(given[0], 's')}", *others[1:]])

    return largest_share(search, Change(f"phases[{longer[0]}].duration", "s", lasting, up=True), rates=True)
