"""The records and rows that the plant reads: their layout, and settings and motions in it, with missing derivatives."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..base.inputs import leading
from ..models import points
from ..models.batch import as_array

SETTINGS = np.dtype(  # `towline_plant` of core/plant/plant.h
    [
        ("drive", "i4"),
        ("located", "i4"),
        *((name, "f8") for name in ("carrier_bandwidth", "winch_bandwidth", "tension_lag")),
    ]
)
# A body in a state: position [m], quaternion (w, x, y, z), velocity in {G} [m/s], rate in its own axes [rad/s].
BODY = 13
QUATERNION, VELOCITY, RATE = 3, 7, 10
# Blocks of cables in a state: unstrained length [m] (or tension [N] where that is commanded), its rate, the length
# last commanded, and the condition.
CABLE_BLOCKS = 4
LENGTH, LENGTH_RATE, REFERENCE, CONDITION = 0, 1, 2, 3
STUCK, CUT = 1.0, 2.0  # values of CONDITION; 0: the winch works

# What the cables are commanded.
LENGTHS, RATES, FORCES, TENSIONS = 0, 1, 2, 3

# A command: whether there is air, its velocity, force and moment on the platform, a number for each cable, and a block
# for each carrier, of the commands of its actuators, force and moment on it, and its reference (pose, velocity,
# acceleration).
AIR, WIND, WRENCH, COMMANDS, CARRIER, CARRIER_WRENCH, REFERENCE_POSE = 0, 1, 4, 10, 30, 6, 12

SUDDEN = 100.0  # [m/s^2, rad/s^2] that a polynomial would need beyond its reference's: the carrier then jumps to it
SHORTEST = 1e-3  # [m] of cable that a winch leaves out


def place(block: np.ndarray, pose: np.ndarray, velocity: np.ndarray, com: np.ndarray) -> None:
    """Write blocks (..., 13) of bodies with the CoM at `com` in their frame, whose motion is given."""
    R = points.rotations(pose[..., 3:])
    (sr, sp, _), (cr, cp, _) = np.moveaxis(np.sin(pose[..., 3:]), -1, 0), np.moveaxis(np.cos(pose[..., 3:]), -1, 0)
    d_roll, d_pitch, d_yaw = np.moveaxis(velocity[..., 3:], -1, 0)
    rate = np.stack(
        np.broadcast_arrays(d_roll - sp * d_yaw, cr * d_pitch + sr * cp * d_yaw, cr * cp * d_yaw - sr * d_pitch),
        axis=-1,
    )
    block[..., :3] = pose[..., :3] + R @ com
    quaternions = Rotation.from_euler("ZYX", pose[..., :2:-1].reshape(-1, 3)).as_quat(scalar_first=True)
    block[..., QUATERNION:VELOCITY] = quaternions.reshape(*pose.shape[:-1], 4)
    block[..., VELOCITY:RATE] = velocity[..., :3] + np.einsum("...ij,...j->...i", R, np.cross(rate, com))
    block[..., RATE:] = rate


def given_or(name: str, value: Any, default: np.ndarray) -> np.ndarray:
    """Return an argument as an array of numbers with the shape of its default after the batch dimensions."""
    return default if value is None else as_array(name, value, default.shape)


def leading_of(vectors: dict[str, np.ndarray], tables: dict[str, np.ndarray]) -> tuple[int, ...]:
    """Return the batch dimensions of vectors (..., n) and tables (..., c, n)."""
    shapes = {name: value.shape[:-1] for name, value in vectors.items()}
    return leading(shapes | {name: value.shape[:-2] for name, value in tables.items()})


def command_rows(
    batch: tuple[int, ...], parts: dict[str, np.ndarray], of_carriers: dict[str, np.ndarray], air: bool
) -> np.ndarray:
    """Return commands as rows, (..., k), from the arguments of `Plant.command`; without `air` there is no wind."""
    cables, actuation = parts["cables"], of_carriers["actuation"]
    m, (count, actuators) = cables.shape[-1], actuation.shape[-2:]
    row = np.zeros((*batch, COMMANDS + m + CARRIER * count))
    row[..., AIR] = float(air)
    row[..., WIND:WRENCH] = parts["wind"]
    row[..., WRENCH:COMMANDS] = parts["wrench"]
    row[..., COMMANDS : COMMANDS + m] = cables
    carriers = np.zeros((*batch, count, CARRIER))
    carriers[..., :actuators] = actuation
    carriers[..., CARRIER_WRENCH:REFERENCE_POSE] = of_carriers["carrier_wrench"]
    for order, name in enumerate(("pose", "velocity", "acceleration")):
        at = REFERENCE_POSE + 6 * order
        carriers[..., at : at + 6] = of_carriers[f"carrier_{name}"]
    row[..., COMMANDS + m :] = carriers.reshape(*batch, -1)
    return row


def complete(rows: np.ndarray, cables: int, carriers: int, period: float) -> np.ndarray:
    """Return commands, (..., K, k), with values for the velocities and accelerations that are nan.

    They are central differences of the poses and of the velocities. Where these would exceed `SUDDEN`, the reference
    jumps from rest to rest. A single command is at rest.
    """
    if rows.dtype.kind != "f" or not np.isnan(rows.sum()):
        return rows
    rows, K = rows.copy(), rows.shape[-2]
    of_carriers = rows[..., COMMANDS + cables :].reshape(*rows.shape[:-1], carriers, CARRIER)
    motion = of_carriers[..., REFERENCE_POSE:].reshape(*of_carriers.shape[:-1], 3, 6).swapaxes(-2, -3)
    motion = np.moveaxis(motion, (-4, -3), (0, 1))  # (K, 3, ..., c, 6)
    pose = motion[:, 0].copy()
    pose[..., 3:] = np.unwrap(pose[..., 3:], axis=0)
    sudden = np.zeros(pose.shape, dtype=bool)
    sudden[1:-1] = np.abs(np.diff(pose, 2, axis=0)) > SUDDEN * period**2
    for before, order in ((pose, 1), (motion[:, 1], 2)):
        change = before - before[:1]  # exactly 0 of what rests
        slope = np.gradient(change, period, axis=0, edge_order=2 if K > 2 else 1) if K > 1 else change
        slope[sudden | ~(np.abs(slope) <= SUDDEN)] = 0.0
        motion[:, order] = np.where(np.isnan(motion[:, order]), slope, motion[:, order])
    return rows
