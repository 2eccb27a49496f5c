"""Derive missing velocities and accelerations of carriers from the poses of a sequence of commands."""

import numpy as np

from . import layout


def complete(rows: np.ndarray, cables: int, carriers: int, period: float) -> np.ndarray:
    """Return commands, (..., K, k), with values for the velocities and accelerations that are nan.

    They are central differences of the poses and of the velocities. Where these would exceed `SUDDEN`, the reference
    jumps from rest to rest. A single command is at rest.
    """
    if rows.dtype.kind != "f" or not np.isnan(rows.sum()):
        return rows
    rows, K = rows.copy(), rows.shape[-2]
    of_carriers = rows[..., layout.COMMANDS + cables :].reshape(*rows.shape[:-1], carriers, layout.CARRIER)
    motion = of_carriers[..., layout.REFERENCE_POSE :].reshape(*of_carriers.shape[:-1], 3, 6).swapaxes(-2, -3)
    motion = np.moveaxis(motion, (-4, -3), (0, 1))  # (K, 3, ..., c, 6)
    pose = motion[:, 0].copy()
    pose[..., 3:] = np.unwrap(pose[..., 3:], axis=0)
    sudden = np.zeros(pose.shape, dtype=bool)
    sudden[1:-1] = np.abs(np.diff(pose, 2, axis=0)) > layout.SUDDEN * period**2
    for before, order in ((pose, 1), (motion[:, 1], 2)):
        change = before - before[:1]  # exactly 0 of what rests
        slope = np.gradient(change, period, axis=0, edge_order=2 if K > 2 else 1) if K > 1 else change
        slope[sudden | ~(np.abs(slope) <= layout.SUDDEN)] = 0.0
        motion[:, order] = np.where(np.isnan(motion[:, order]), slope, motion[:, order])
    return rows
