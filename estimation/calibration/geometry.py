"""Lengths of cables and their derivatives for many poses at once, in NumPy alone.

With B the attachment and A the anchor in {G}, t the unit vector along which the cable arrives at B, and theta the angle
of the sheave that it touches,

    dl/dB = t        dl/dA = -t  (the swivel axis keeps its direction)        dl/dr = theta - sin(theta)

The last follows from the first two: the centre M = A + r e moves by e dr, which changes the length by -(t . e) dr =
-sin(theta) dr, and an arc of angle theta about a centre at rest becomes longer by theta dr; where the cable leaves the
sheave may vary freely, since the length is stationary there. `models.cables.pulley` has the angles.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...models.cables.sheaves import sheaves

__all__ = ["Runs", "runs"]


class Runs(NamedTuple):
    """Lengths and directions of m cables at N samples.

    Attributes
    ----------
    lengths
        From the anchor over the pulley to the attachment [m], (m, N).
    directions
        T, along the cable towards the attachment, (m, N, 3).
    d_radius
        Derivative of the length by the radius of the pulley [-], (m, N); 0 for a point anchor.
    """

    lengths: np.ndarray
    directions: np.ndarray
    d_radius: np.ndarray


def runs(anchors: np.ndarray, axes: np.ndarray, radii: np.ndarray, attachments: np.ndarray) -> Runs:
    """Return how cables run from anchors (m, 3) over pulleys to attachments (m, N, 3), all in {G} [m].

    Parameters
    ----------
    axes
        Swivel axes in {G}, of unit length, (m, 3).
    radii
        Of the pulleys [m], (m,); 0: a point anchor.

    Lengths are nan where no cable is tangent to its sheave, as none is to a radius below 0.
    """
    offset = attachments - anchors[:, None]
    lengths = np.sqrt(np.einsum("mni,mni->mn", offset, offset))
    lengths[radii < 0] = np.nan
    d_radius = np.zeros_like(lengths)
    over = np.flatnonzero(radii > 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        directions = offset / lengths[..., None]
        if over.size:
            run = sheaves(offset[over], axes[over, None], radii[over, None])
            lengths[over] = radii[over, None] * run.wrap + run.straight
            directions[over], d_radius[over] = run.along, run.wrap - np.sin(run.wrap)
    return Runs(lengths, directions, d_radius)
