"""`distribution`: the tensions of a motion in phases, of which each has limits and a ground of its own.

On the ground the support forces are further unknowns of each instant: columns in addition to those of the cables, with
the lower limit 0.
"""

from dataclasses import replace

import numpy as np
from typing_extensions import override

from ...solvers import Certificate, certify
from ...statics.distribution import wrench_problem
from ..tasks.lay_out_phases import end_tensions, largest_support, support_forces
from ..tasks.paths import Motion
from ..tasks.phase import LaidPhase
from ..tasks.scenario import Scenario
from .tensions import AuditedTensions, Distribution


def distribution(scenario: Scenario, times: np.ndarray, A: np.ndarray) -> Distribution:
    """Return the distribution of the tensions at `times` (n,) with wrench matrices A (n, 6, m)."""
    return _ByPhase(scenario, times, A) if scenario.phases.all else Distribution(scenario, A)


class _ByPhase(Distribution):
    """Distribute the tensions of each phase on its own; those without limits are without ground too."""

    def __init__(self, scenario: Scenario, times: np.ndarray, A: np.ndarray):
        super().__init__(scenario, A)
        self._parts = scenario.phases.rows(times)

    @override
    def __call__(self, w: np.ndarray, preferred: np.ndarray | None) -> AuditedTensions:
        scenario, m, count = self.scenario, self.scenario.robot.m, len(w)
        tensions, violation = np.empty((count, m)), np.empty(count)
        supports = np.zeros((count, scenario.phases.supports))
        worst, row, beyond = None, None, 0.0
        for phase, rows in self._parts:
            near = np.zeros((len(rows), m)) if preferred is None else preferred[rows]
            A, limits, near = _extended(scenario, phase, self.A[rows], w[rows], near)
            result = Distribution(scenario, A, limits)(w[rows], near)
            tensions[rows], violation[rows] = result.tensions[:, :m], result.violation
            supports[rows, : A.shape[2] - m] = result.tensions[:, m:]
            beyond = max(beyond, result.beyond)
            found = result.certificate
            if found is not None and result.row is not None and (worst is None or found.shortfall > worst.shortfall):
                worst, row = _of_cables(found, m), int(rows[result.row])
        return AuditedTensions(tensions, violation, worst, row, beyond, supports)


def worst_certificate(scenario: Scenario, time: float, platform: Motion, carriers: np.ndarray) -> Certificate | None:
    """Return the proof that no tensions at a time give the required wrench, of the worst wind; None if some do.

    `platform` is its motion in {G}, (6,) each, `carriers` are the poses of all, (c, 6). Of a box of winds the proof has
    its wind, of extreme loads its load.
    """
    robot, phase = scenario.robot, scenario.phases.at(time)
    A = scenario.dynamics.wrench_matrix(platform.pose, carriers)
    proofs: list[Certificate] = []
    for wind, extreme in scenario.cases_at(platform.pose, platform.velocity):
        motion = platform.at(None)
        w = scenario.required_wrench(np.array([time]), motion, wind=wind, extreme=extreme)
        extended, limits, _ = _extended(scenario, phase, A[None], w, np.zeros((1, robot.m)))
        found = certify(wrench_problem(robot, extended[0], w[0], *limits))
        if found is not None:
            about = None if scenario.wind_set is None else wind
            proofs.append(replace(_of_cables(found, robot.m), wind=about, load=scenario.load_of(time, extreme)))
    return max(proofs, key=lambda proof: proof.shortfall, default=None)


def taken_up(scenario: Scenario, times: np.ndarray) -> np.ndarray | None:
    """Return tensions (n, m) [N] to prefer in a motion that is given: linear in time on the ground, else zero.

    The other end's tensions are kept if a phase on the ground has none at one end. The result is None without ground.
    """
    if not scenario.phases.rest:
        return None
    preferred = np.zeros((len(times), scenario.robot.m))
    for phase, rows in scenario.phases.rows(times):
        ends = [end_tensions(scenario, phase, end) for end in (0, 1)] if phase.rests else []
        known = [tensions for tensions in ends if tensions is not None]
        if known:
            share = ((times[rows] - phase.start) / (phase.end - phase.start))[:, None]
            preferred[rows] = (1 - share) * known[0] + share * known[-1]
    return preferred


def _extended(
    scenario: Scenario, phase: LaidPhase | None, A: np.ndarray, w: np.ndarray, near: np.ndarray
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Return A, limits and preferred tensions of k instants of a phase, with those of its support forces at the end."""
    low, high = scenario.bounds_in(phase)
    if phase is None or not phase.rests:
        return A, (low, high), near
    S = phase.columns
    forces, _ = support_forces(scenario, S, w - np.einsum("nij,nj->ni", A, near))
    columns = np.broadcast_to(S, (len(A), *S.shape))
    most = np.full(S.shape[1], largest_support(scenario, w, high))
    limits = np.append(low, np.zeros(len(most))), np.append(high, most)
    return np.concatenate([A, columns], axis=2), limits, np.hstack([near, forces])


def _of_cables(certificate: Certificate, m: int) -> Certificate:
    """Return a certificate with its cables alone: it is known that the ground only pushes."""
    at_max, at_min = (indices[indices < m] for indices in (certificate.at_max, certificate.at_min))
    return replace(certificate, at_max=at_max, at_min=at_min, closest=certificate.closest[:m])
