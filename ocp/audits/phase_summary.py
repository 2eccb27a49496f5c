"""Summaries of a plan's phases, and the spans of time in which it is infeasible."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...solvers import Certificate
from ..tasks.scenario import Scenario
from .audit import Audit
from .by_phase import worst_certificate

MOST_SPANS = 8


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


def infeasible_spans(scenario: Scenario, audit: Audit) -> tuple[Certificate, ...]:
    """Return a certificate of the worst instant of each span without tensions, in order of time.

    The certificate's `span` holds the first and the last audited instant of the span [s], its `time` the worst one.
    If there are more than `MOST_SPANS` spans, the worst are returned.
    """
    short = np.concatenate([[False], audit.violation > audit.tolerance, [False]])
    edges = np.flatnonzero(short[1:] != short[:-1]).reshape(-1, 2)  # first row, and the one after the last
    edges = sorted(edges.tolist(), key=lambda edge: -audit.violation[slice(*edge)].max())[:MOST_SPANS]
    certificates = []
    for first, after in sorted(edges):
        row = first + int(audit.violation[first:after].argmax())
        time, platform = float(audit.times[row]), audit.motion.at(row)
        certificate = worst_certificate(scenario, time, platform, audit.carriers.pose[row])
        if certificate is not None:
            span = (float(audit.times[first]), float(audit.times[after - 1]))
            certificates.append(replace(certificate, time=time, span=span))
    return tuple(certificates)
