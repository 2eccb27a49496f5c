"""How cables run over swivelling pulleys, in NumPy for many poses: the geometry of `pulley` without its expressions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

__all__ = ["Sheaves", "sheaves"]


class Sheaves(NamedTuple):
    """The names of `pulley`; nan where no cable is tangent to its sheave.

    Attributes
    ----------
    e
        Across the swivel axis towards the attachment, (..., 3).
    along
        T, in which the free part runs towards the attachment, (..., 3).
    wrap
        Theta, the angle of the sheave that the cable touches [rad], (...).
    straight
        S, the length of the free part [m], (...).
    distance
        Of the attachment from the swivel axis [m], (...).
    """

    e: np.ndarray
    along: np.ndarray
    wrap: np.ndarray
    straight: np.ndarray
    distance: np.ndarray


def sheaves(offset: np.ndarray, axes: np.ndarray, radii: np.ndarray) -> Sheaves:
    """Return how cables run over their pulleys.

    Parameters
    ----------
    offset
        From the anchor to the attachment [m], (..., 3).
    axes
        Swivel axes of unit length in the same frame, (..., 3).
    radii
        (...) [m].
    """
    up = np.einsum("...i,...i->...", offset, axes)
    across = offset - up[..., None] * axes
    distance = np.linalg.norm(across, axis=-1)
    e = across / distance[..., None]
    straight = np.sqrt(distance**2 - 2 * distance * radii + up**2)
    wrap = np.pi - np.arctan2(straight, radii) - np.arctan2(up, distance - radii)
    along = np.sin(wrap)[..., None] * e + np.cos(wrap)[..., None] * axes
    return Sheaves(e, along, wrap, straight, distance)
