"""A robot and its motion as the rows and records that the plant reads."""

from __future__ import annotations

import numpy as np

from ..base.errors import InputError
from ..models import points
from ..models.carriers import Carrier
from ..models.part import COORDINATES, inertia_matrix
from ..models.robot import Robot
from . import layout

__all__ = ["SETTINGS", "bodies_of", "cables_of", "place", "settings_of"]

SETTINGS = np.dtype(  # `towline_plant` of core/plant/plant.h
    [
        ("drive", "i4"),
        ("located", "i4"),
        *((name, "f8") for name in ("carrier_bandwidth", "winch_bandwidth", "tension_lag")),
    ]
)


def bodies_of(robot: Robot) -> np.ndarray:
    """Return platform and carriers, a row each, in the columns of `layout`."""
    rows = np.zeros((1 + len(robot.carriers), layout.BODY_COLUMNS))
    mask, turning = robot.dof_mask, [name for name in COORDINATES[3:] if name in robot.platform.dof]
    inverse = np.zeros((3, 3))
    if len(turning) == 3:
        inverse = np.linalg.inv(robot.inertia)
    elif turning:  # about one axis, which then is the same in {G} and in the platform
        axis = COORDINATES[3:].index(turning[0])
        inverse[axis, axis] = 1 / robot.inertia[axis, axis]
    _fill(rows[0], robot.platform.mass, mask[:3], robot.inertia, inverse)
    for row, carrier in zip(rows[1:], robot.carriers, strict=True):
        _fill_carrier(row, carrier, robot)
    return rows


def _fill(row: np.ndarray, mass: float, moves: np.ndarray, inertia: np.ndarray, inverse_inertia: np.ndarray) -> None:
    row[layout.MOTION] = layout.FREE
    row[layout.MASS : layout.INVERSE_MASS] = mass * moves
    row[layout.INVERSE_MASS : layout.INERTIA] = moves / mass
    row[layout.INERTIA : layout.INVERSE_INERTIA] = inertia.ravel()
    row[layout.INVERSE_INERTIA : layout.LIMITS] = inverse_inertia.ravel()


def _fill_carrier(row: np.ndarray, carrier: Carrier, robot: Robot) -> None:
    limits = carrier.motion_limits
    if carrier.body is not None:
        inertia = inertia_matrix(carrier.body.inertia)
        _fill(row, carrier.body.mass, np.ones(3), inertia, np.linalg.inv(inertia))
        if len(carrier.actuators) > layout.MOST_ACTUATORS:
            most = layout.MOST_ACTUATORS
            raise InputError(f"carrier {carrier.name} must have at most {most} actuators, got {len(carrier.actuators)}")
        for index, actuator in enumerate(carrier.actuators):
            first = layout.ACTUATORS + layout.ACTUATOR * index
            row[first : first + layout.ACTUATOR] = (*actuator.wrench, actuator.low, actuator.high)
    elif not carrier.free_coordinates(robot.drive):
        row[layout.MOTION] = layout.RESTS
    elif limits.acceleration is not None:
        row[layout.MOTION] = layout.LAGGED
        speed = np.inf if limits.speed is None else limits.speed
        row[layout.LIMITS : layout.LIMITS + 2] = speed, limits.acceleration
    else:
        row[layout.MOTION] = layout.IMPOSED


def cables_of(robot: Robot, stiffness: np.ndarray, damping: np.ndarray) -> np.ndarray:
    """Return the cables, a row each, in the columns of `layout`; those of stiffness 0 never stretch."""
    rows = np.zeros((robot.m, layout.CABLE_COLUMNS))
    rows[:, layout.OWNER] = 1 + robot.carrier_of_cable
    rows[:, layout.ANCHOR : layout.ATTACHMENT] = robot.anchors
    rows[:, layout.ATTACHMENT : layout.AXIS] = robot.attachments - np.array(robot.platform.com)
    rows[:, layout.AXIS : layout.RADIUS] = robot.pulley_axes
    rows[:, layout.RADIUS] = robot.pulley_radii
    rows[:, layout.STIFFNESS], rows[:, layout.DAMPING] = stiffness, damping
    for row, cable in zip(rows, robot.cables, strict=True):
        if cable.winch is not None:
            winch = cable.winch
            row[layout.INERTIA_OF_WINCH :] = winch.inertia, winch.friction, winch.speed_max, winch.force_max
    return rows


def settings_of(robot: Robot) -> np.ndarray:
    """Return gravity, air and scales in the places of `layout`; the others are 0."""
    settings = np.zeros(layout.SETTINGS)
    settings[layout.GRAVITY : layout.DRAG] = robot.gravity
    settings[layout.HAS_WINCHES] = float(any(cable.winch is not None for cable in robot.cables))
    settings[layout.FORCE_SCALE] = robot.force_scale
    settings[layout.LENGTH_SCALE] = max(np.abs(robot.home_anchors).max(), np.abs(robot.home_attachments).max(), 1.0)
    if aero := robot.platform.aero:
        area = 0.5 * aero.air_density * aero.area
        settings[layout.DRAG], settings[layout.LIFT] = area * aero.drag, area * aero.lift
        settings[layout.PRINTED] = float(aero.form == "printed")
    return settings


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
