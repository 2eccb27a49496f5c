r"""A swivelling pulley: where the cable leaves it, in which direction it pulls, how long it is.

The cable comes up the swivel axis k, touches the sheave at the anchor A and runs on along +k over the sheave. The
sheave, of radius r, turns about the axis so that its plane holds the attachment B. With e the unit vector across the
axis towards B, the sheave's centre is M = A + r e. Wrapped by the angle theta from A, the cable is at

    C = M + r (-cos(theta) e + sin(theta) k)     and runs along     t = sin(theta) e + cos(theta) k

and leaves where that points at B: B = C + s t, s >= 0. So theta is 0 for a B straight along +k, 90 degrees for one far
out level with M, 180 degrees straight below the sheave's far rim (with k up), and more for a B between there and the
axis. With d = B - M and D = |d|,

    s = sqrt(D^2 - r^2)      theta = pi - atan2(s, r) - atan2(d . k, d . e)      l = r theta + s      u = -t

From A to B the cable is l long, and dl/dB = t = -u: what the wrap gains or loses, the straight part makes up for. With
r = 0 it is a point anchor.

Domain: B off the swivel axis and outside the sheave, D > r. Turned about the axis, the sheave sweeps a torus that
touches the axis at A; inside it no cable is tangent, and everything is nan. On the axis the sheave has no
direction to turn to: point and direction are nan there, and close to it, below A, they jump when B passes to the other
side.

Source: the usual model of a swivel pulley, as in A. Pott, Cable-Driven Parallel Robots, Springer, 2018, derived anew.
"""

from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ...base.errors import InputError
from ..batch import as_array
from ..rotation import Matrix


class Exit(NamedTuple):
    """The points and directions in which m cables leave their pulleys, in the frame of pulleys and attachments."""

    points: Matrix  # C, at which the cables leave their sheaves [m], (3, m)
    directions: Matrix  # unit vectors u along which the cables pull at their attachments, (3, m)
    lengths: Matrix  # l from the anchors over the sheaves to the attachments [m], (m, 1)
    wraps: Matrix  # angles theta on the sheaves [rad], (m, 1), from 0 to 2 pi; 0 for a point anchor


def exit_points(anchor: Matrix, axis: Matrix, radius: Any, attachment: Matrix) -> Exit:
    """Compute where m cables leave their pulleys, for CasADi SX, MX or DM in any frame that all arguments share.

    - `anchor`: points A at which the cables come up the swivel axes [m], (3, m).
    - `axis`: swivel axes k, unit vectors in the direction in which the cables come up, (3, m).
    - `radius`: radii r of the sheaves [m], numbers, (m,); zero: a point anchor, whose axis has no effect.
    - `attachment`: attachments B [m], (3, m).

    Raises `InputError` if a radius is below zero.
    """
    radii = as_array("radius", radius, ()).ravel()
    if not (radii >= 0).all():
        raise InputError(f"radius must have numbers >= 0, got {radii.min():g}")
    each = enumerate(np.broadcast_to(radii, attachment.shape[1]))
    columns = [_exit(anchor[:, i], axis[:, i], attachment[:, i], float(r)) for i, r in each]
    points, directions, lengths, wraps = zip(*columns, strict=True)
    return Exit(ca.horzcat(*points), ca.horzcat(*directions), ca.vertcat(*lengths), ca.vertcat(*wraps))


def _exit(anchor: Matrix, axis: Matrix, attachment: Matrix, radius: float) -> Exit:
    if radius == 0:
        vector = anchor - attachment
        length = ca.norm_2(vector)
        return Exit(anchor, vector / length, length, 0 * length)
    offset = attachment - anchor
    up = ca.dot(offset, axis)  # d . k
    across = offset - up * axis
    distance = ca.norm_2(across)
    e = across / distance
    out = distance - radius  # d . e
    D_squared = out**2 + up**2
    s = ca.sqrt(distance**2 - 2 * distance * radius + up**2)  # D^2 - r^2, without the cancellation of r^2
    # d = r n + s t with n = (C - M) / r and t a quarter turn from it: solved for both
    n = ((radius * out - s * up) * e + (radius * up + s * out) * axis) / D_squared
    t = (s * out + radius * up) / (D_squared * distance) * across + (s * up - radius * out) / D_squared * axis
    wrap = np.pi - ca.atan2(s, radius) - ca.atan2(up, out)
    return Exit(anchor + radius * (e + n), -t, radius * wrap + s, wrap)
