"""`errors_of_file`: how wrong the file's anchors or attachments turn out to be, as a prior where frames are unknown.

Poses in an unknown frame tell the anchors only up to a rigid motion of them all. How well the file's anchors tell that
depends on how far they are from the true ones, which the others of their changes show: with a variance s^2 of the
file's errors, and v_k of the fit's along principal axis k, the change c_k has the variance s^2 + v_k. Of the K axes
that the log determines, s^2 is the mean of c_k^2 - v_k. It is multiplied by K / (K - 2), the variance of Student's t.
"""

from collections.abc import Mapping

import numpy as np

from .parameters import COLUMNS
from .solving import LOOSE, LOOSE_SHARE, Solved, covariance_of, noise_of

ENDS = {"frame": "anchors", "body": "attachments"}  # what an unknown frame moves together with
DETERMINED = 0.1  # of the variance of the first prior


def loose(length: float, groups: tuple[str, ...], prior: Mapping[str, float]) -> dict[str, float]:
    """Return standard deviations with loose ones for anchors and attachments that may move with unknown frames."""
    ends = [end for frame, end in ENDS.items() if frame in groups and end in groups and end not in prior]
    return dict(prior) | dict.fromkeys(ends, min(LOOSE, LOOSE_SHARE * length))


def errors_of_file(solved: Solved, prior: Mapping[str, float]) -> dict[str, float]:
    """Return standard deviations with those of the file's errors, from a fit with `loose` ones in place of them."""
    of, result = solved.model.parameters, dict(prior)
    covariance, change = covariance_of(solved, noise_of(solved)), (solved.fit.state.x - of.first)[of.varies]
    for name in set(solved.model.prior) - set(prior):
        columns = np.zeros(of.count, dtype=bool)
        of.table(columns)[:, COLUMNS[name]] = True
        own, first = columns[of.varies], solved.model.prior[name]
        variances, axes = np.linalg.eigh(covariance[np.ix_(own, own)])
        known = variances < DETERMINED * first**2
        v, squares, count = variances[known], (change[own] @ axes[:, known]) ** 2, int(known.sum())
        if count < 3:
            result[name] = first
            continue
        found = max(float((squares - v).mean()), float(v.mean()) * np.sqrt(2 / count))
        result[name] = float(np.sqrt(found * count / (count - 2)))
    return result
