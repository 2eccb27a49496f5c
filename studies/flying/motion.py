"""Paper F's circle relative to the quadrotor, and the steady tensions of a motion, inside their limits or not."""

import numpy as np

from ...models import Dynamics
from ...ocp.tasks.paths import CirclePath, Motion
from .plans import BELOW, RATE, SECONDS

RADIUS = 1.0  # of the circle in VI.A and VI.B [m]
FEASIBLE = 0.15  # [m], assumed where no tensions of the paper's own circle are inside their limits
TIMES = np.linspace(0.0, SECONDS, 1001)


def circle(radius: float, times: np.ndarray = TIMES, below: float = BELOW) -> Motion:
    """Return the circle in {A} about a point `below` [m] under the quadrotor, level; its three parts are (n, 6)."""
    return CirclePath(kind="circle", centre=(0.0, 0.0, -below), radius=radius, rate=RATE).at(times, SECONDS)


def steady_tensions(dynamics: Dynamics, motion: Motion, base: Motion | None = None) -> np.ndarray:
    """Return T = A^-1 w of a robot with six cables and one carrier, (n, 6) [N]: negative where a cable would push.

    The platform's motion is in {A}, the carrier's, `base`, in {G}; default: hovering, level.
    """
    w = dynamics.relative.required_wrench(*motion, *(base or ()))
    return solved(dynamics.relative.wrench_matrix(motion.pose), w)


def solved(A: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return A^-1 w of matrices (..., 6, 6) and wrenches (..., 6), (..., 6)."""
    return np.linalg.solve(A, w[..., None])[..., 0]
