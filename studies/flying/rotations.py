"""Paper F's rotations: Eqs. 1, 9, 27, 28, 30, 31 and 32, compared with derivatives of rotation matrices."""

from itertools import product

import casadi as ca
import numpy as np

from ...models import rotation
from ..accounts.account import Chapter
from ..accounts.claim import Claim
from .claims import claim
from .instants import Instants, Turning, instants

ROUNDING = 1e-12
SMALL = 1e-4  # [rad], a small rotation for Eq. 9


def chapter() -> Chapter:
    """Check the equations that give angular velocity and acceleration from angles."""
    samples = instants()
    claims = [_matrix(samples), _small_angle(), _small_turn(), _rate(samples), _acceleration(samples)]
    return Chapter([*claims, _composed(samples), _relative_to(samples)])


def _matrix(samples: Instants) -> Claim:
    """Check row three, printed (-S theta, S phi C phi, C phi S phi), with each phi read as roll or as yaw."""
    roll, pitch, yaw = samples.base.pose[:, 3:].T
    lengths = [
        np.sin(pitch) ** 2 + (np.sin(a) * np.cos(b)) ** 2 + (np.cos(c) * np.sin(d)) ** 2
        for a, b, c, d in product((roll, yaw), repeat=4)
    ]
    off = min(float(np.abs(np.sqrt(squares) - 1).max()) for squares in lengths)
    R = samples.R_A.R
    ours = float(np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max())
    return claim("eq-1").stated(off, off < ROUNDING, ours=ours)


def _small_angle() -> Claim:
    """Form R - 1 of Rz Ry Rx with the sines and cosines that are printed for small angles, and with sin u = u."""
    angles = SMALL * np.array([0.6, -0.8, 1.0])
    sizes = []
    for sines in (np.zeros(3), angles):  # as printed, and as Eq. 9 has them
        (sr, sp, sy), identity = sines, np.eye(3)
        Rx = identity + sr * np.array([[0, 0, 0], [0, 0, -1], [0, 1, 0]])
        Ry = identity + sp * np.array([[0, 0, 1], [0, 0, 0], [-1, 0, 0]])
        Rz = identity + sy * np.array([[0, -1, 0], [1, 0, 0], [0, 0, 0]])
        sizes.append(float(np.abs(Rz @ Ry @ Rx - identity).max()))
    printed, meant = sizes
    return claim("eq-9-small").compared(meant, printed=printed, within=SMALL**2, small=SMALL)


def _small_turn() -> Claim:
    """Check R = 1 + [dTheta]x + O(dTheta^2)."""
    angles = SMALL * np.array([0.6, -0.8, 1.0])
    turned = rotation.rotation(ca.DM(angles)).full()
    off = float(np.abs(turned - np.eye(3) - ca.skew(ca.DM(angles)).full()).max())
    return claim("eq-9").stated(off, off < SMALL**2, small=SMALL)


def _rate(samples: Instants) -> Claim:
    ours = _each(rotation.body_rate, samples.base.pose, samples.base.velocity)
    off = float(np.abs(ours - samples.R_A.rate).max())
    return claim("eq-27-28").compared(off, within=ROUNDING)


def printed_acceleration(motion_pose: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Return Eqs. 31 and 32 as printed, dP dTheta + ddTheta, (n, 3) [rad/s^2], of motions (n, 6) each."""
    bent = _each(lambda a, r: rotation.rate_matrix_derivative(a, r) @ r, motion_pose, velocity)
    return bent + acceleration[:, 3:]


def body_rates(pose: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Return P dTheta of angles in `pose` (n, 6) and rates of them (n, 3), (n, 3) [rad/s]."""
    return _each(rotation.body_rate, pose, np.hstack([np.zeros_like(rates), rates]))


def _acceleration(samples: Instants) -> Claim:
    true = samples.R_A.acceleration
    printed = printed_acceleration(*samples.base)
    size = np.linalg.norm(true, axis=1)
    off = np.linalg.norm(printed - true, axis=1) / size
    bent = _each(lambda a, r: rotation.rate_matrix_derivative(a, r) @ r, samples.base.pose, samples.base.velocity)
    ours = bent + _each(rotation.body_rate, samples.base.pose, samples.base.acceleration)
    rounding = float((np.linalg.norm(ours - true, axis=1) / size).max())
    return claim("eq-31-32").compared(
        float(np.median(off)),
        within=ROUNDING,
        rounding=rounding,
        angle=np.abs(samples.base.pose[:, 3:]).max(),
        off=off.max(),
    )


def _composed(samples: Instants) -> Claim:
    """Compare R_A (alpha_A + R alpha_B + omega_A x R Omega) with the second derivative of R_A R."""
    whole: Turning = samples.R_A.then(samples.R_B)
    in_world = _turn(whole.R, whole.acceleration)
    R = samples.R_B.R
    inner = (
        samples.R_A.acceleration
        + _turn(R, samples.R_B.acceleration)
        + np.cross(samples.R_A.rate, _turn(R, samples.R_B.rate))
    )
    off = float(np.abs(_turn(samples.R_A.R, inner) - in_world).max())
    return claim("eq-30").compared(off, within=ROUNDING)


def _relative_to(samples: Instants) -> Claim:
    """Compare the derivative of omega_BA with the angular acceleration of {B} relative to {G}, both in {B}."""
    whole, own = samples.R_A.then(samples.R_B).acceleration, samples.R_B.acceleration
    off = np.linalg.norm(whole - own, axis=1) / np.linalg.norm(whole, axis=1)
    return claim("eq-32-frame").compared(float(np.median(off)), within=ROUNDING)


def _each(function, pose: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Evaluate a CasADi expression of angles and rates, (3, 1) each, at every row of (n, 6) each: (n, 3)."""
    angles, speeds = ca.SX.sym("angles", 3), ca.SX.sym("rates", 3)
    f = ca.Function("each", [angles, speeds], [function(angles, speeds)])
    return np.asarray(f(pose[:, 3:].T, rates[:, 3:].T)).T


def _turn(R: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return np.einsum("nij,nj->ni", R, vectors)
