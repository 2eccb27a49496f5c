"""Paper F's rotations: Eqs. 1, 9, 27, 28, 30, 31 and 32, compared with derivatives of rotation matrices."""

from itertools import product

import casadi as ca
import numpy as np

from ...models import rotation
from ..accounts.claim import Chapter, Claim
from .claims import claim
from .instants import Instants, instants, relative_error, turn

ROUNDING = 1e-12
SMALL = 1e-4  # [rad], a small rotation for Eq. 9


def chapter() -> Chapter:
    """Check the equations that give angular velocity and acceleration from angles."""
    samples = instants()
    return Chapter([_matrix(samples), *_small_angles(), *_rates(samples)])


def _matrix(samples: Instants) -> Claim:
    """Check row three, printed (-S theta, S phi C phi, C phi S phi), with each phi read as roll or as yaw."""
    roll, pitch, yaw = samples.base.pose[:, 3:].T
    lengths = [
        np.sin(pitch) ** 2 + (np.sin(a) * np.cos(b)) ** 2 + (np.cos(c) * np.sin(d)) ** 2
        for a, b, c, d in product((roll, yaw), repeat=4)
    ]
    off, R = min(np.abs(np.sqrt(squares) - 1).max() for squares in lengths), samples.R_A.R
    return claim("eq-1").stated(off, off < ROUNDING, ours=np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max())


def _small_angles() -> list[Claim]:
    """Form R - 1 with the sines and cosines that are printed for small angles, and check R = 1 + [dTheta]x."""
    angles = SMALL * np.array([0.6, -0.8, 1.0])
    sizes = []
    for sines in (np.zeros(3), angles):  # as printed, and as Eq. 9 has them
        Rx, Ry, Rz = (np.eye(3) + ca.skew(ca.DM(about_axis)).full() for about_axis in np.diag(sines))
        sizes.append(np.abs(Rz @ Ry @ Rx - np.eye(3)).max())
    turned = rotation.rotation(ca.DM(angles)).full()
    off = np.abs(turned - np.eye(3) - ca.skew(ca.DM(angles)).full()).max()
    return [
        claim("eq-9-small").compared(sizes[1], printed=sizes[0], within=SMALL**2, small=SMALL),
        claim("eq-9").stated(off, off < SMALL**2, small=SMALL),
    ]


def printed_acceleration(pose: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Return Eqs. 31 and 32 as printed, dP dTheta + ddTheta, (n, 3) [rad/s^2], of motions (n, 6) each."""
    bent = _each(lambda a, r: rotation.rate_matrix_derivative(a, r) @ r, pose, velocity[:, 3:])
    return bent + acceleration[:, 3:]


def body_rates(pose: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Return P dTheta of angles in `pose` (n, 6) and rates of them (n, 3), (n, 3) [rad/s]."""
    return _each(rotation.body_rate, pose, rates)


def _rates(samples: Instants) -> list[Claim]:
    A, B, (pose, velocity, acceleration) = samples.R_A, samples.R_B, samples.base
    printed = printed_acceleration(*samples.base)
    ours = printed - acceleration[:, 3:] + body_rates(pose, acceleration[:, 3:])
    off = relative_error(printed, A.acceleration)
    # R_A (alpha_A + R alpha_B + omega_A x R Omega) compared with the second derivative of R_A R.
    whole = A.then(B)  # {B} in {G}; both accelerations of Eq. 32 are in {B}
    inner = A.acceleration + turn(B.R, B.acceleration) + np.cross(A.rate, turn(B.R, B.rate))
    composed = np.abs(turn(A.R, inner) - turn(whole.R, whole.acceleration)).max()
    return [
        claim("eq-27-28").compared(np.abs(body_rates(pose, velocity[:, 3:]) - A.rate).max(), within=ROUNDING),
        claim("eq-31-32").compared(
            np.median(off),
            within=ROUNDING,
            rounding=relative_error(ours, A.acceleration).max(),
            angle=np.abs(pose[:, 3:]).max(),
            off=off.max(),
        ),
        claim("eq-30").compared(composed, within=ROUNDING),
        claim("eq-32-frame").compared(np.median(relative_error(B.acceleration, whole.acceleration)), within=ROUNDING),
    ]


def _each(function, pose: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Evaluate a CasADi expression of angles and rates, (3, 1) each, at every row of (n, 6) and (n, 3): (n, 3)."""
    angles, speeds = ca.SX.sym("angles", 3), ca.SX.sym("rates", 3)
    f = ca.Function("each", [angles, speeds], [function(angles, speeds)])
    return np.asarray(f(pose[:, 3:].T, rates.T)).T
