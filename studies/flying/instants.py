"""Random instants of both bodies of paper F, with rotations and their time derivatives from CasADi.

Angular velocity and acceleration follow from these alone, R^T dR = [omega]x and R^T ddR = [alpha]x + [omega]x^2, so
that the formulas of the paper and of this toolkit are compared with an independent result.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np

from ...models import points
from ...models.rotation import rotation
from ...ocp.tasks.paths import Motion

COUNT = 200
ANGLES, RATES, ACCELERATIONS = 0.3, 0.6, 1.0  # largest of each [rad, rad/s, rad/s^2], and of positions in metres


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
    R = ca.vec(rotation(angles + t * rates + t**2 / 2 * accelerations))
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
