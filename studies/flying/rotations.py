"""Paper F's rotations: Eqs. 1, 9, 27, 28, 30, 31 and 32, compared with derivatives of rotation matrices."""

from itertools import product

import casadi as ca
import numpy as np

from ...models import rotation
from ..accounts.account import Chapter
from ..accounts.claim import Claim
from .claims import claim
from .instants import Instants, instants, relative_error, turn

ROUNDING = 1e-12
SMALL = 1e-4  # [rad], a small rotation for Eq. 9


def chapter() -> Chapter:
    """Check the equations that give angular velocity and acceleration from angles."""
    samples = instants()
    rate = body_rates(samples.base.pose, samples.base.velocity[:, 3:])
    whole, own = samples.R_A.then(samples.R_B), samples.R_B  # {B} in {G} and in {A}; both accelerations are in {B}
    off = relative_error(own.acceleration, whole.acceleration)
    return Chapter(
        [
            _matrix(samples),
            _small_angle(),
            _small_turn(),
            claim("eq-27-28").compared(np.abs(rate - samples.R_A.rate).max(), within=ROUNDING),
            _acceleration(samples),
            _composed(samples),
            claim("eq-32-frame").compared(np.median(off), within=ROUNDING),
        ]
    )


def _matrix(samples: Instants) -> Claim:
    """Check row three, printed (-S theta, S phi C phi, C phi S phi), with each phi read as roll or as yaw."""
    roll, pitch, yaw = samples.base.pose[:, 3:].T
    lengths = [
        np.sin(pitch) ** 2 + (np.sin(a) * np.cos(b)) ** 2 + (np.cos(c) * np.sin(d)) ** 2
        for a, b, c, d in product((roll, yaw), repeat=4)
    ]
    off, R = min(np.abs(np.sqrt(squares) - 1).max() for squares in lengths), samples.R_A.R
    return claim("eq-1").stated(off, off < ROUNDING, ours=np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max())


def _small_angle() -> Claim:
    """Form R - 1 of Rz Ry Rx with the sines and cosines that are printed for small angles, and with sin u = u."""
    angles = SMALL * np.array([0.6, -0.8, 1.0])
    sizes = []
    for sines in (np.zeros(3), angles):  # as printed, and as Eq. 9 has them
        Rx, Ry, Rz = (np.eye(3) + ca.skew(ca.DM(about_axis)).full() for about_axis in np.diag(sines))
        sizes.append(np.abs(Rz @ Ry @ Rx - np.eye(3)).max())
    printed, meant = sizes
    return claim("eq-9-small").compared(meant, printed=printed, within=SMALL**2, small=SMALL)


def _small_turn() -> Claim:
    """Check R = 1 + [dTheta]x + O(dTheta^2)."""
    angles = SMALL * np.array([0.6, -0.8, 1.0])
    turned = rotation.rotation(ca.DM(angles)).full()
    off = np.abs(turned - np.eye(3) - ca.skew(ca.DM(angles)).full()).max()
    return claim("eq-9").stated(off, off < SMALL**2, small=SMALL)


def printed_acceleration(pose: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Return Eqs. 31 and 32 as printed, dP dTheta + ddTheta, (n, 3) [rad/s^2], of motions (n, 6) each."""
    bent = _each(lambda a, r: rotation.rate_matrix_derivative(a, r) @ r, pose, velocity[:, 3:])
    return bent + acceleration[:, 3:]


def body_rates(pose: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Return P dTheta of angles in `pose` (n, 6) and rates of them (n, 3), (n, 3) [rad/s]."""
    return _each(rotation.body_rate, pose, rates)


def _acceleration(samples: Instants) -> Claim:
    (pose, _, acceleration), true = samples.base, samples.R_A.acceleration
    printed = printed_acceleration(*samples.base)
    ours = printed - acceleration[:, 3:] + body_rates(pose, acceleration[:, 3:])
    off = relative_error(printed, true)
    return claim("eq-31-32").compared(
        np.median(off),
        within=ROUNDING,
        rounding=relative_error(ours, true).max(),
        angle=np.abs(pose[:, 3:]).max(),
        off=off.max(),
    )


def _composed(samples: Instants) -> Claim:
    """Compare R_A (alpha_A + R alpha_B + omega_A x R Omega) with the second derivative of R_A R."""
    A, B = samples.R_A, samples.R_B
    whole = A.then(B)
    inner = A.acceleration + turn(B.R, B.acceleration) + np.cross(A.rate, turn(B.R, B.rate))
    off = np.abs(turn(A.R, inner) - turn(whole.R, whole.acceleration)).max()
    return claim("eq-30").compared(off, within=ROUNDING)


def _each(function, pose: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Evaluate a CasADi expression of angles and rates, (3, 1) each, at every row of (n, 6) and (n, 3): (n, 3)."""
    angles, speeds = ca.SX.sym("angles", 3), ca.SX.sym("rates", 3)
    f = ca.Function("each", [angles, speeds], [function(angles, speeds)])
    return np.asarray(f(pose[:, 3:].T, rates.T)).T
