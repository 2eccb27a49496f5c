"""`with_stretch` and `is_elastic`: whether cables of unknown stiffness stretch under their tensions.

Tensions were measured, or weight and inertia determine them where a platform `hangs`. Errors of the attachments, for
example, may look like cables of different stiffness, so these are taken to be equal, and attachments to be wrong by a
few millimetres. Without measured tensions the CoM, by which the cables share the weight, is taken to be wrong by a
tenth of the attachments' distances. Only then do the tensions tell which cables are slack.
"""

from dataclasses import replace

import numpy as np

from ...models.part import LARGEST
from .balance import hangs, is_carried
from .considered import from_thrusts, usual_error
from .fit import held
from .geometry import length_of
from .hanging import carrying
from .left_out import hardly_pull
from .normal_equations import NormalEquations, metric
from .parameters import COMMON, GROUPS
from .solving import Solved, covariance_of
from .turning import turning

POSSIBLE, CERTAIN = 3.0, 4.0  # standard deviations of a compliance: of independent errors, and of all
UNEXPLAINED = 1.5  # times the stated standard deviation, of residuals that the model does not explain
OF_COM = 0.1  # of the attachments' distances from each other: error of the CoM in files
LOOSE = 1e-3  # of the readings, which may be of cables that hardly pull


def with_elasticity(solved: Solved) -> tuple[tuple[str, ...], dict[str, float]]:
    """Return parameters and standard deviations about the file's values with attachments, CoM and elasticity of cables.

    The elasticity is free unless the file has stiffnesses, and the CoM unless tensions were measured.
    """
    of, groups, prior = solved.model, solved.model.parameters.groups, dict(solved.model.prior)
    turns = turning(of.robot, of.measurements)
    # Unknown poses would adapt to errors of the attachments, too.
    if turns is not None and turns.enough and not of.has_unknown_poses and "attachments" not in groups:
        groups = (*groups, "attachments")
        prior["attachments"] = usual_error(of)
    arms = of.robot.attachments.std(axis=0)
    hung = of.measurements.tensions is None
    if hung and "com" not in groups and of.forces is not None and of.forces.equations.any() and arms.any():
        groups, prior["com"] = (*groups, "com"), OF_COM * float(np.linalg.norm(arms))
    known = of.parameters.compliances(of.parameters.first).any()
    return tuple(name for name in GROUPS if name in groups or (name == "elasticity" and not known)), prior


def with_stretch(solved: Solved) -> Solved | None:
    """Return a fit after one step with elasticity, if stretch reduces the residuals more than errors do by chance.

    Where residuals are far larger than stated, one step may not show it, and an elastic fit must be tried. None also if
    tensions are unknown, or were computed from thrusts, which have errors of their own. If the file has stiffnesses of
    a platform that hangs, the step has CoM and attachments instead, and is only taken where residuals are so large.
    """
    of, state = solved.model, solved.fit.state
    groups, (more, prior) = of.parameters.groups, with_elasticity(solved)
    measured = of.measurements.tensions is not None and not from_thrusts(of.robot)
    if not groups or {"elasticity", "stiffness"} & {*groups} or not (measured or hangs(of.robot, of.measurements)):
        return None
    if of.forces is None or not (measured or of.forces.motion_is_known):  # which takes longer to know
        return None
    excess = max(1.0, float(np.nan_to_num(solved.noise.excess)))
    known = "elasticity" not in more
    if known and (measured or excess < UNEXPLAINED or "com" in groups or "com" not in more):
        return None
    of = replace(of, felt=carrying(of, state))
    model = replace(of, parameters=replace(of.parameters, groups=more if known else (*groups, "elasticity")))
    model = replace(model, prior=prior) if known else model
    equations, varies = NormalEquations.at(model, state, scale := metric(model)), model.parameters.varies
    covariance = np.linalg.inv(held(equations.S, length_of(model.robot)))
    step, own = -covariance @ equations.b, np.flatnonzero(varies) == model.parameters.clock + COMMON
    if excess < UNEXPLAINED and not (step[own] > POSSIBLE * excess * np.sqrt(covariance[own, own])).all():
        return None
    x = state.x.copy()
    x[varies] += step / scale[varies]
    return replace(solved, fit=solved.fit._replace(state=state._replace(x=x)))


def certainty(solved: Solved) -> float:
    """Return by how many standard deviations cables are more elastic than in the file, or else the CoM is elsewhere.

    0 if that is unknown.
    """
    of, elastic = solved.model.parameters, "elasticity" in solved.model.parameters.groups
    places = of.clock + np.array([COMMON] if elastic else [2, 3, 4])
    own = np.flatnonzero(np.isin(np.flatnonzero(of.varies), places))
    if not own.size or not solved.observability.determined[own].all():
        return 0.0
    sigmas = np.sqrt(np.diag(covariance_of(solved))[own])
    change = (solved.fit.state.x - of.first)[places]
    change[np.abs(change) < 1 / LARGEST] = 0.0  # no file has a cable that is so stiff
    return float(((change if elastic else np.abs(change)) / np.maximum(sigmas, 1e-300)).max())


def is_elastic(solved: Solved) -> bool:
    """Return whether a fit with elasticity shows that cables stretch, or that their stretch shows another CoM.

    With measured tensions it must explain the residuals, too, because errors of load cells may look like stretch.
    """
    explained = solved.model.measurements.tensions is None or solved.noise.excess < UNEXPLAINED
    return solved.fit.converged and explained and certainty(solved) > CERTAIN


def uses_slack(solved: Solved) -> bool:
    """Return whether a fit uses readings of cables that hardly pull by its own tensions, with those of inertia."""
    of = solved.model
    if of.forces is None or of.has_unknown_poses or not is_carried(of.robot, of.measurements):
        return False
    felt = carrying(of, solved.fit.state) if of.forces.motion_is_known else None
    return felt is not None and bool((of.weights & hardly_pull(felt.tensions).T).mean() > LOOSE)
