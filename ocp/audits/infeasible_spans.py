"""`infeasible_spans`: when a motion requires more than the cables can give, and along which direction."""

from dataclasses import replace

import numpy as np

from ...models.part import Vector3
from ...solvers import Certificate
from ..tasks.paths import Motion
from ..tasks.scenario import Scenario
from .audit import Audit
from .by_phase import certified

MOST_SPANS = 8


def infeasible_spans(scenario: Scenario, audit: Audit) -> tuple[Certificate, ...]:
    """Return a certificate of the worst instant of each span without tensions, in order of time.

    The certificate's `span` holds the first and the last audited instant of the span [s], its `time` the worst one.
    Of more than `MOST_SPANS` spans the worst are returned.
    """
    short = np.concatenate([[False], audit.violation > audit.tolerance, [False]])
    edges = np.flatnonzero(short[1:] != short[:-1]).reshape(-1, 2)  # first row, and the one after the last
    edges = sorted(edges.tolist(), key=lambda edge: -audit.violation[slice(*edge)].max())[:MOST_SPANS]
    certificates = []
    for first, after in sorted(edges):
        row = first + int(audit.violation[first:after].argmax())
        certificate = certificate_at(scenario, audit, row)
        if certificate is not None:
            span = (float(audit.times[first]), float(audit.times[after - 1]))
            certificates.append(replace(certificate, span=span))
    return tuple(certificates)


def certificate_at(scenario: Scenario, audit: Audit, row: int) -> Certificate | None:
    """Return the certificate of one audited instant, of the worst wind of a box; None if tensions exist there."""
    proofs: list[tuple[Certificate, Vector3 | None]] = []
    one = slice(row, row + 1)
    time = audit.times[one]
    platform, carriers = (Motion(*(part[one] for part in motion)) for motion in (audit.motion, audit.carriers))
    A = scenario.dynamics.wrench_matrix(platform.pose[0], carriers.pose[0])
    for wind in scenario.winds_at(platform.pose[0], platform.velocity[0]):
        w = scenario.required_wrench(time, platform, carriers, wind)[0]
        certificate = certified(scenario, float(time[0]), A, w)
        if certificate is not None:
            proofs.append((certificate, None if scenario.wind_box is None else wind))
    if not proofs:
        return None
    certificate, wind = max(proofs, key=lambda proof: proof[0].shortfall)
    return replace(certificate, time=float(time[0]), wind=wind)
