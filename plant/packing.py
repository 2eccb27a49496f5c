"""Settings and motions as the records and rows that the plant reads."""

from __future__ import annotations

import numpy as np

from ..models import points
from . import layout

__all__ = ["SETTINGS", "place"]

SETTINGS = np.dtype(  # `towline_plant` of core/plant/plant.h
    [
        ("drive", "i4"),
        ("located", "i4"),
        *((name, "f8") for name in ("carrier_bandwidth", "winch_bandwidth", "tension_lag")),
    ]
)


def place(block: np.ndarray, pose: np.ndarray, velocity: np.ndarray, com: np.ndarray) -> None:
    """Write blocks (..., 13) of bodies with the CoM at `com` in their frame, whose motion is given."""
    R = points.rotations(pose[..., 3:])
    (sr, sp, _), (cr, cp, _) = np.moveaxis(np.sin(pose[..., 3:]), -1, 0), np.moveaxis(np.cos(pose[..., 3:]), -1, 0)
    (hr, hp, hy), (kr, kp, ky) = (np.moveaxis(f(pose[..., 3:] / 2), -1, 0) for f in (np.sin, np.cos))
    d_roll, d_pitch, d_yaw = np.moveaxis(velocity[..., 3:], -1, 0)
    rate = np.stack(
        np.broadcast_arrays(d_roll - sp * d_yaw, cr * d_pitch + sr * cp * d_yaw, cr * cp * d_yaw - sr * d_pitch),
        axis=-1,
    )
    block[..., :3] = pose[..., :3] + R @ com
    quaternion = (
        kr * kp * ky + hr * hp * hy,
        hr * kp * ky - kr * hp * hy,
        kr * hp * ky + hr * kp * hy,
        kr * kp * hy - hr * hp * ky,
    )
    block[..., layout.QUATERNION : layout.VELOCITY] = np.stack(quaternion, axis=-1)
    block[..., layout.VELOCITY : layout.RATE] = velocity[..., :3] + np.einsum(
        "...ij,...j->...i", R, np.cross(rate, com)
    )
    block[..., layout.RATE :] = rate
