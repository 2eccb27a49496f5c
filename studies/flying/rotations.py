"""Paper F's rotations: Eqs. 1, 9, 27, 28, 30, 31 and 32, compared with derivatives of rotation matrices."""

from __future__ import annotations

from itertools import product

import casadi as ca
import numpy as np

from ...models import rotation
from ..accounts.account import Chapter
from ..accounts.claim import Claim, compared, stated
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
    return stated(
        "eq-1",
        "Eqs. 1, 2",
        "R of roll, pitch and yaw, where phi stands for two of them (difference of the norm of its third row from 1).",
        0.0,
        off,
        holds=off < ROUNDING,
        agrees="One reading of the letters gives a rotation.",
        differs="Whether each phi is read as roll or as yaw, the third row is no unit vector (computed: the best "
        "reading "
        f"at its worst angles); R = Rz(yaw) Ry(pitch) Rx(roll) is meant, orthogonal to {ours:.0e}.",
    )


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
    return compared(
        "eq-9-small",
        "section III.B, above Eq. 9",
        "For a small u, sin u = 0 and cos u = 1 (largest entry of the matrix of Eq. 9, for angles up to "
        f"{SMALL:g} rad).",
        printed,
        meant,
        within=SMALL**2,
        agrees="The matrix is that of Eq. 9.",
        differs="With sin u = 0 there is no rotation and the matrix of Eq. 9 is zero; sin u = u is meant.",
    )


def _small_turn() -> Claim:
    """Check R = 1 + [dTheta]x + O(dTheta^2)."""
    angles = SMALL * np.array([0.6, -0.8, 1.0])
    turned = rotation.rotation(ca.DM(angles)).full()
    off = float(np.abs(turned - np.eye(3) - ca.skew(ca.DM(angles)).full()).max())
    return stated(
        "eq-9",
        "Eqs. 9, 10",
        "A small rotation moves B_i by [dTheta]x (R b_i), with the yaw in row one and the roll in row two of the "
        "matrix.",
        0.0,
        off,
        holds=off < SMALL**2,
        agrees=f"At {SMALL:g} rad the matrix is R - 1 up to terms of second order.",
        differs=f"At {SMALL:g} rad the matrix differs from R - 1 by more than terms of second order.",
    )


def _rate(samples: Instants) -> Claim:
    ours = _each(rotation.body_rate, samples.base.pose, samples.base.velocity)
    off = float(np.abs(ours - samples.R_A.rate).max())
    return compared(
        "eq-27-28",
        "Eqs. 27, 28",
        "omega = P dTheta (difference from the angular velocity in R^T dR).",
        0.0,
        off,
        within=ROUNDING,
        agrees="P as printed gives the angular velocity to rounding.",
        differs="P as printed does not give the angular velocity.",
        unit="rad/s",
    )


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
    return compared(
        "eq-31-32",
        "Eqs. 31, 32",
        "alpha = dP dTheta + ddTheta (median relative difference from the derivative of omega).",
        0.0,
        float(np.median(off)),
        within=ROUNDING,
        agrees="The printed form is the derivative of P dTheta.",
        differs=f"alpha = dP dTheta + P ddTheta holds to {rounding:.0e}; without the P the error grows with the angles "
        f"(here up to {np.abs(samples.base.pose[:, 3:]).max():.1f} rad) and reaches {off.max():.0%}.",
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
    return compared(
        "eq-30",
        "Eq. 30",
        "alpha of the platform in {G} from those of {A} and of {B} in {A} (difference from that of R_A R_B).",
        0.0,
        off,
        within=ROUNDING,
        agrees="Eq. 30 holds to rounding, with the correct alpha_A and alpha_B.",
        differs="Eq. 30 is not the angular acceleration of the product of both rotations.",
        unit="rad/s^2",
    )


def _relative_to(samples: Instants) -> Claim:
    """Compare the derivative of omega_BA with the angular acceleration of {B} relative to {G}, both in {B}."""
    whole, own = samples.R_A.then(samples.R_B).acceleration, samples.R_B.acceleration
    off = np.linalg.norm(whole - own, axis=1) / np.linalg.norm(whole, axis=1)
    return compared(
        "eq-32-frame",
        "text below Eq. 30, Eq. 32",
        "alpha_BA, the derivative of omega_BA, is the angular acceleration of {B} relative to {G} (median relative "
        "difference).",
        0.0,
        float(np.median(off)),
        within=ROUNDING,
        agrees="Both are the same.",
        differs="It is the one relative to {A}, with which Eq. 30 holds.",
    )


def _each(function, pose: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Evaluate a CasADi expression of angles and rates, (3, 1) each, at every row of (n, 6) each: (n, 3)."""
    angles, speeds = ca.SX.sym("angles", 3), ca.SX.sym("rates", 3)
    f = ca.Function("each", [angles, speeds], [function(angles, speeds)])
    return np.asarray(f(pose[:, 3:].T, rates[:, 3:].T)).T


def _turn(R: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return np.einsum("nij,nj->ni", R, vectors)
