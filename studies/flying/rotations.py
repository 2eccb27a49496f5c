"""Paper F's rotations: Eqs. 1, 9, 27, 28, 30, 31 and 32, compared with derivatives of rotation matrices.

Angular velocity and acceleration of random instants of both bodies follow from the time derivatives of rotations by
CasADi alone, R^T dR = [omega]x and R^T ddR = [alpha]x + [omega]x^2, so that the formulas of the paper and of this
toolkit are compared with an independent result.
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import casadi as ca
import numpy as np

from ...models import points, rotation
from ...ocp.tasks.paths import Motion
from ..accounts.claim import Chapter, Claim
from .claims import claim

ROUNDING = 1e-12
SMALL = 1e-4  # [rad], a small rotation for Eq. 9
COUNT = 200
ANGLES, RATES, ACCELERATIONS = 0.3, 0.6, 1.0  # largest of each [rad, rad/s, rad/s^2], and of positions in metres


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


class Turning(NamedTuple):
    """A rotation and its derivatives, (n, 3, 3) each."""

    R: np.ndarray
    dR: np.ndarray  # noqa: N815
    ddR: np.ndarray  # noqa: N815

    def then(self, other: Turning) -> Turning:
        """Return the product self.R other.R and its derivatives."""
        R, dR, ddR = self
        S, dS, ddS = other
        return Turning(R @ S, dR @ S + R @ dS, ddR @ S + 2 * dR @ dS + R @ ddS)

    @property
    def rate(self) -> np.ndarray:
        """Return the angular velocity in the rotated frame, (n, 3) [rad/s]."""
        return points.axial(self.R.transpose(0, 2, 1) @ self.dR)

    @property
    def acceleration(self) -> np.ndarray:
        """Return the time derivative of `rate`, (n, 3) [rad/s^2]."""
        return points.axial(self.R.transpose(0, 2, 1) @ self.ddR)


class Instants(NamedTuple):
    """Motions at n independent instants, and their rotations."""

    body: Motion  # of the platform relative to {A}
    base: Motion  # of {A} in {G}
    R_B: Turning  # of `body`
    R_A: Turning  # of `base`


def instants(seed: int = 0) -> Instants:
    """Return random instants: both bodies translate and rotate, the platform about 1 m below the base."""
    rng = np.random.default_rng(seed)
    sizes = (ANGLES, RATES, ACCELERATIONS)
    body, base = (Motion(*(rng.uniform(-size, size, (COUNT, 6)) for size in sizes)) for _ in range(2))
    body.pose[:, 2] -= 1.0
    return Instants(body, base, turning(body), turning(base))


def turning(motion: Motion) -> Turning:
    """Return the rotations of a motion and their time derivatives, by differentiating R(angles(t)) at t = 0."""
    angles, rates, accelerations = (ca.SX.sym(name, 3) for name in ("angles", "rates", "accelerations"))
    t = ca.SX.sym("t")
    R = ca.vec(rotation.rotation(angles + t * rates + t**2 / 2 * accelerations))
    dR = ca.jacobian(R, t)
    ddR = ca.jacobian(dR, t)
    f = ca.Function("turning", [t, angles, rates, accelerations], [R, dR, ddR])
    columns = f(0, *(part[:, 3:].T for part in motion))  # CasADi's columns are a row's three columns in turn
    return Turning(*(np.asarray(part).T.reshape(-1, 3, 3).transpose(0, 2, 1) for part in columns))


def turn(R: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return R v, (n, 3)."""
    return np.einsum("nij,nj->ni", R, vectors)


def turn_back(R: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return R^T v, (n, 3)."""
    return np.einsum("nji,nj->ni", R, vectors)


def relative_error(vectors: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Return how far vectors (..., 3) are from the true ones, over the length of these, (...)."""
    return np.linalg.norm(vectors - true, axis=-1) / np.linalg.norm(true, axis=-1)
