r"""Verify that tensions are optimal: the optimality conditions of the least squares, by multipliers.

With s in standard form, the point of least norm leaves no part of its gradient, s itself, in the null space of the
equations but for limits that it is at and that push against it:

$$
N s = N \mu, \qquad \mu_i \ge 0 \text{ at } lower_i, \quad \mu_i \le 0 \text{ at } upper_i, \quad
\mu_i = 0 \text{ elsewhere}
$$

Such a $\mu$ is a proof, whatever method proposed s. It proves nothing if it is so large that a limit moved by rounding
would change the cost.
"""

import numpy as np
from numpy.typing import NDArray

from ..tolerances import AT_LIMIT, OPTIMALITY
from .box_least_squares import box_least_squares
from .kernels.codes import DECISIVE, SLACK
from .standard_form import StandardForm

__all__ = ["is_optimal"]


def is_optimal(form: StandardForm, tensions: NDArray[np.float64]) -> bool:
    """Return whether multipliers prove that tensions, (m,) [N], which give w inside the limits, are the optimum."""
    s = (tensions - form.origin)[form.moving] / form.unit
    square = float(s @ s)
    gradient = form.N @ s
    if np.sqrt(gradient @ gradient) <= OPTIMALITY * np.sqrt(square):
        return True
    above, below = s - form.lower, form.upper - s
    near = AT_LIMIT * max(1.0, np.sqrt(square))
    held = (above <= near) | (below <= near)
    # A limit is known to rounding of its own size, that of an infinite one to rounding of everything.
    size = np.minimum(np.maximum(np.abs(form.lower), np.abs(form.upper)), 1.0)[held]
    most = DECISIVE / SLACK * square / np.maximum(size, SLACK)
    normals = form.N[:, held]
    low, high = np.where(below[held] <= near, -most, 0.0), np.where(above[held] <= near, most, 0.0)
    multipliers, _ = box_least_squares(normals, gradient, low, high)
    rest = gradient - normals @ multipliers
    distance = np.where(multipliers > 0.0, above[held], below[held])
    gap = np.abs(multipliers[multipliers != 0.0]) @ distance[multipliers != 0.0]
    return bool(np.sqrt(rest @ rest) <= OPTIMALITY * np.sqrt(square) and gap <= OPTIMALITY * square)
