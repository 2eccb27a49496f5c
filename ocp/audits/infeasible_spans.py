"""`infeasible_spans`: when a motion requires more than the cables can give, and along which direction."""

from dataclasses import replace

import numpy as np

from ...solvers import Certificate
from ..tasks.paths import Motion
from ..tasks.scenario import Scenario
from .audit import Audit
from .by_phase import worst_certificate

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
        time, platform = float(audit.times[row]), Motion(*(part[row] for part in audit.motion))
        certificate = worst_certificate(scenario, time, platform, audit.carriers.pose[row])
        if certificate is not None:
            span = (float(audit.times[first]), float(audit.times[after - 1]))
            certificates.append(replace(certificate, time=time, span=span))
    return tuple(certificates)
