"""`errors_of_file`: how wrong the file's anchors or attachments turn out to be, as a prior of what a log does not tell.

Poses in an unknown frame tell the anchors only up to a rigid motion of them all, and winches that hardly move tell an
offset only together with the anchor. How well the file's anchors tell the rest depends on how far they are from the
true ones, which the others of their changes show: with a variance s^2 of the file's errors, and v_k of the fit's along
principal axis k, the change c_k has the variance s^2 + v_k. A log determines few axes, so s^2 remains uncertain. With
Jeffreys' prior for s^2, errors along the other axes have a distribution with long tails (of Student, with as many
degrees of freedom as axes, where v_k is small). The prior is the normal distribution whose 95 % ellipsoid is the
ellipsoid of these errors.
"""

from collections.abc import Mapping

import numpy as np
from scipy.special import chdtr, chdtri

from ..logs.measurements import measured
from .considered import usual_error
from .geometry import length_of
from .normal_equations import metric
from .parameters import Parameters
from .solving import Solved, covariance_of

ENDS = {"frame": "anchors", "body": "attachments"}  # what an unknown frame moves together with
LOOSE, LOOSE_SHARE = 0.1, 0.03  # [m] of standard deviation, and share of the cables' length: files are usually better
NEARLY_LOOSE = 0.01  # of the variance, below which residuals are never large enough to make it so large
DETERMINED = 0.1  # of the variance of the first prior


def loose(length: float, groups: tuple[str, ...], prior: Mapping[str, float]) -> dict[str, float]:
    """Return standard deviations with loose ones for anchors and attachments that may move with unknown frames."""
    ends = [end for frame, end in ENDS.items() if frame in groups and end in groups and end not in prior]
    return dict(prior) | dict.fromkeys(ends, LOOSE_SHARE * length)


def undetermined(solved: Solved) -> dict[str, float]:
    """Return loose standard deviations for the ends of cables if a fit without a prior knows ends or offsets worse.

    If poses are estimated, too, this is so only if the fit went farther than that from the file. With orientations
    alone, offsets have one, too, if they are not accurate: else offsets that hardly change any reading move all poses.
    """
    of, scale = solved.model.parameters, metric(solved.model)
    lengths = np.flatnonzero(np.array(of.units)[of.varies] == "m")
    lengths = lengths[np.flatnonzero(of.varies)[lengths] < of.clock]
    block, length = np.ix_(lengths, lengths), length_of(of.robot)
    limit, seen = min(LOOSE, LOOSE_SHARE * length) ** 2, solved.observability.covariance
    if solved.model.prior or not lengths.size or np.linalg.eigvalsh(seen[block])[-1] < NEARLY_LOOSE * limit:
        return {}
    loosely = {}
    if solved.model.size_is_open and "offsets" in of.groups and measured(solved.model.measurements).any():
        v, change = _along_axes(solved, "offsets", solved.noise.covariance)
        known, loosest = v < DETERMINED * (LOOSE_SHARE * length) ** 2, (LOOSE_SHARE * length) ** 2
        # Larger offsets are no errors of a file: the winches count from elsewhere.
        if v[-1] > usual_error(solved.model) ** 2 and (change[known] ** 2).sum() <= known.sum() * loosest:
            loosely["offsets"] = LOOSE_SHARE * length
    values, vectors = np.linalg.eigh(solved.noise.covariance[block])
    away = ((solved.fit.state.x - of.first) * scale)[of.varies][lengths] @ vectors
    if values[-1] <= limit or (solved.model.has_unknown_poses and (away[values > limit] ** 2).sum() <= limit):
        return loosely
    return loosely | dict.fromkeys([end for end in ENDS.values() if end in of.groups], LOOSE_SHARE * length)


def errors_of_file(solved: Solved, prior: Mapping[str, float]) -> dict[str, float]:
    """Return the model's prior with standard deviations of the file's errors, from a fit with a `loose` prior."""
    result, covariance = dict(solved.model.prior), covariance_of(solved)
    for name in set(solved.model.prior) - set(prior):
        variances, change = _along_axes(solved, name, covariance)
        known = variances < DETERMINED * result[name] ** 2
        if not known.any():
            continue
        v, squares = variances[known], change[known] ** 2
        s2 = result[name] ** 2 * np.geomspace(1e-9, 1.0, 300)
        total = s2[:, None] + v
        logs = np.log(s2 * np.sqrt((total**-2).sum(axis=1))) - (np.log(total) + squares / total).sum(axis=1) / 2
        likely = np.exp(logs - logs.max())
        covered = chdtr(3, chdtri(3, 0.05) * s2[:, None] / s2) @ likely / likely.sum()
        result[name] = float(np.sqrt(np.interp(0.95, covered, s2)))
    return result


def offsets_are_open(solved: Solved, prior: Mapping[str, float]) -> bool:
    """Return whether a fit to orientations alone shows of no axis of the offsets how wrong the file is."""
    return prior.get("offsets") == LOOSE_SHARE * length_of(solved.model.robot)


def _along_axes(solved: Solved, group: str, covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return variances of a group of parameters along principal axes, rising, and changes from the file along them."""
    of = solved.model.parameters
    own = np.isin(np.flatnonzero(of.varies), np.flatnonzero(Parameters(of.robot, (group,)).varies))
    variances, axes = np.linalg.eigh(covariance[np.ix_(own, own)])
    return variances, (solved.fit.state.x - of.first)[of.varies][own] @ axes
