"""`may_stretch` and `is_elastic`: whether cables of unknown stiffness stretch under the weight that hangs from them.

Weight and inertia determine the tensions where a platform `hangs`. Errors of the attachments, for example, may look
like cables of different stiffness, so these are taken to be equal, and attachments to be wrong by a few millimetres.
"""

from dataclasses import replace

import numpy as np

from .balance import hangs
from .fit import held
from .geometry import length_of
from .normal_equations import NormalEquations, metric
from .parameters import COMMON, GROUPS
from .solving import Solved, carrying, covariance_of, noise_of
from .turning import turning

POSSIBLE, CERTAIN = 3.0, 4.0  # standard deviations of a compliance: of independent errors, and of all
ACCURATE, ACCURATELY = 0.005, 0.001  # [m], and share of the cables' length: errors of attachments in files


def with_elasticity(solved: Solved) -> tuple[tuple[str, ...], dict[str, float]]:
    """Return parameters and standard deviations about the file's values with the elasticity of cables."""
    of, groups, prior = solved.model, solved.model.parameters.groups, dict(solved.model.prior)
    turns = turning(of.robot, of.measurements)
    if turns is not None and turns.enough and "attachments" not in groups:
        groups = (*groups, "attachments")
        prior["attachments"] = min(ACCURATE, ACCURATELY * length_of(of.robot))
    return tuple(name for name in GROUPS if name in (*groups, "elasticity")), prior


def may_stretch(solved: Solved) -> bool:
    """Return whether stretch would reduce the residuals of a fit by more than independent errors do by chance.

    One step of the fit shows that. False if the file has a stiffness, or weight does not determine the tensions.
    """
    of, state = solved.model, solved.fit.state
    groups, known = of.parameters.groups, of.parameters.compliances(of.parameters.first).any()
    if not groups or "elasticity" in groups or known or not hangs(of.robot, of.measurements):
        return False
    model = replace(of, parameters=replace(of.parameters, groups=(*groups, "elasticity")), felt=carrying(of, state))
    equations = NormalEquations.at(model, state, metric(model))
    covariance = np.linalg.inv(held(equations.S, length_of(model.robot)))
    own = np.flatnonzero(model.parameters.varies) == model.parameters.clock + COMMON
    excess = max(1.0, float(np.nan_to_num(noise_of(solved).excess)))
    return bool((-covariance[own] @ equations.b > POSSIBLE * excess * np.sqrt(covariance[own, own])).all())


def certainty(solved: Solved) -> float:
    """Return by how many standard deviations cables are more elastic than in the file; 0 if that is unknown."""
    of = solved.model.parameters
    own = np.flatnonzero(np.flatnonzero(of.varies) == of.clock + COMMON)
    if not own.size or not solved.observability.determined[own].all():
        return 0.0
    sigma = np.sqrt(covariance_of(solved, noise_of(solved))[own[0], own[0]])
    return float(solved.fit.state.x[of.clock + COMMON] / max(sigma, 1e-300))


def is_elastic(solved: Solved) -> bool:
    """Return whether a fit with elasticity shows that cables stretch."""
    return solved.fit.converged and certainty(solved) > CERTAIN
