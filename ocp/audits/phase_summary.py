"""`summaries`: load, tensions and ground reaction of each phase of a motion, for reports and files."""

from typing import NamedTuple

import numpy as np

from ..tasks.scenario import Scenario
from .audit import Audit


class PhaseSummary(NamedTuple):
    """A phase of a motion."""

    name: str
    start: float  # [s]
    end: float
    load: float  # the mass that the platform carries [kg]
    # smallest and largest audited tension [N]; None if none exist at some time, or none were evaluated
    tension_min: float | None
    tension_max: float | None
    # the largest sum of the forces of the ground [N]; None for a phase without ground, or without tensions
    reaction_max: float | None


def summaries(scenario: Scenario, audit: Audit) -> tuple[PhaseSummary, ...]:
    """Return the summaries of all phases of an audited motion; empty for a task without phases."""
    result = []
    for phase in scenario.phases.all:
        tensions = audit.tensions[rows := scenario.phases.index_at(audit.times) == scenario.phases.all.index(phase)]
        there = bool(tensions.size and np.isfinite(tensions).all())  # what is only shown may step over a short phase
        extremes = (float(tensions.min()), float(tensions.max())) if there else (None, None)
        reaction = None
        if phase.rests and there and audit.supports is not None:
            reaction = float(audit.supports[rows].sum(axis=1).max())
        result.append(PhaseSummary(phase.name, phase.start, phase.end, float(phase.load[0]), *extremes, reaction))
    return tuple(result)
