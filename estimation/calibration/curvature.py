"""`curvature`: second derivatives of the lengths by the poses, which the usual normal equations neglect.

Where two poses with the same lengths are about to merge, first derivatives say little about how far to go, and one such
sample would make all steps of a fit short. With u the unit vector along a cable of length L and a the arm R b of its
attachment, the second-order change of the length by a shift d and a rotation w is half of

    v' (I - u u') v / L + (u . w) (a . w) - (u . a) w'w        v = d + w x a

as for a cable between points; with a pulley it hardly differs.
"""

import numpy as np

from .model import Derivatives, Residuals


def curvature(residuals: Residuals, derivatives: Derivatives) -> np.ndarray:
    """Return the sum over the cables of residuals times their second derivatives by the pose, (N, 6 + d, 6 + d)."""
    arms, along = derivatives.arms, derivatives.poses[..., :3]
    M = np.zeros((*arms.shape, 6))  # v = M (d, w), (m, N, 3, 6)
    M[..., :3] = np.eye(3)
    M[..., 3:] = -np.cross(np.eye(3), arms[..., None, :], axisc=-1)
    gain = np.linalg.norm(along, axis=2)  # of residuals by lengths [1/m], 0 of readings left out
    unit = np.divide(along, gain[..., None], out=np.zeros_like(along), where=gain[..., None] > 0)
    across = M - unit[..., None] * np.matmul(unit[..., None, :], M)
    weight = residuals.readings * gain
    by_length = (weight / derivatives.lengths)[..., None, None]
    rows = [part.swapaxes(0, 1).reshape(arms.shape[1], -1, 6) for part in (by_length * M, across)]  # (N, 3 m, 6)
    result = rows[0].swapaxes(1, 2) @ rows[1]
    both = ((weight / 2)[..., None] * unit).transpose(1, 2, 0) @ arms.swapaxes(0, 1)  # (N, 3, 3)
    both -= np.eye(3) * np.einsum("nii->n", both)[:, None, None]
    result[:, 3:, 3:] += both + np.swapaxes(both, 1, 2)
    more = (0, derivatives.poses.shape[2] - 6)
    return np.pad(result, ((0, 0), more, more))
