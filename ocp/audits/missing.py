"""What a motion lacks, when, and along which direction of the wrench: `missing`."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...distribution import wrench_problem
from ...models.robot import Vector3
from ...solvers import Certificate, certify
from ..tasks.scenario import Scenario
from .audit import Audit

__all__ = ["Missing", "missing"]

MOST = 8  # spans that are told, the worst ones


class Missing(NamedTuple):
    """A span of time in which no tensions inside their limits give the wrench that the motion needs.

    Attributes
    ----------
    start, end
        First and last audited instant of it [s].
    at
        Its worst instant [s].
    certificate
        The proof of that instant: `demand` is needed along its direction, `support` is available.
    wind
        Of a task with a box of winds, that in which it holds [m/s].
    """

    start: float
    end: float
    at: float
    certificate: Certificate
    wind: Vector3 | None = None

    def to_dict(self) -> dict[str, Any]:
        """{"from", "to", "at" [s], and the keys of `Certificate.to_dict`} for JSON."""
        at = {"from": self.start, "to": self.end, "at": self.at}
        return at | ({} if self.wind is None else {"wind": list(self.wind)}) | self.certificate.to_dict()


def missing(scenario: Scenario, seen: Audit) -> tuple[Missing, ...]:
    """The worst `MOST` spans in which the audit missed wrench, in order of time."""
    short = np.concatenate([[False], seen.violation > seen.tolerance, [False]])
    edges = np.flatnonzero(short[1:] != short[:-1]).reshape(-1, 2)  # first row, and the one after the last
    edges = sorted(edges.tolist(), key=lambda edge: -seen.violation[slice(*edge)].max())[:MOST]
    found = []
    for first, after in sorted(edges):
        row = first + int(seen.violation[first:after].argmax())
        proven = _certificate(scenario, seen, row)
        if proven is not None:
            start, end, at = (float(seen.times[k]) for k in (first, after - 1, row))
            found.append(Missing(start, end, at, *proven))
    return tuple(found)


def _certificate(scenario: Scenario, seen: Audit, row: int) -> tuple[Certificate, Vector3 | None] | None:
    """Why there are no tensions at one instant of the audit, and in which wind of a box."""
    motions = [part[row] for part in (*seen.motion, *seen.carriers)]
    A = scenario.dynamics.wrench_matrix(motions[0], motions[3])
    proofs = []
    for wind in scenario.winds_at(*motions[:2]):
        w = scenario.dynamics.required_wrench(*motions, wind=wind)
        certificate = certify(wrench_problem(scenario.robot, A, w, *scenario.bounds()))
        if certificate is not None:
            proofs.append((certificate, None if scenario.wind_box is None else wind))
    return max(proofs, key=lambda proof: proof[0].shortfall, default=None)
