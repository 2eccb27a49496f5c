"""`Trajectory`: motions of platform and carriers over time, as controllers and stops follow them."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from .rigid_load import RigidLoad

ROUNDING = 1e-9  # [s]
Motion = tuple[np.ndarray, np.ndarray, np.ndarray]


def moved_on(motion: Motion, time: float | np.ndarray) -> Motion:
    """Return a motion some time [s] later, or earlier, with its acceleration."""
    pose, velocity, acceleration = motion
    return pose + time * (velocity + 0.5 * time * acceleration), velocity + time * acceleration, acceleration


class Trajectory(NamedTuple):
    """A reference over time."""

    duration: float | None  # duration [s]; None for a pose to hold
    # Function of times (n,) [s] that returns pose, velocity and acceleration of the platform, (n, 6) each, and of the
    # carriers, (n, c, 6) each.
    at: Callable[[np.ndarray], tuple[Motion, Motion]]
    # Function of times that returns the planned tensions, (n, m) [N]; None if none are planned.
    tensions: Callable[[np.ndarray], np.ndarray] | None = None
    # For each keep-out region of a plan, the lines that outline it, (n, 3) each in {G} [m].
    keep_out: Sequence[Sequence[np.ndarray]] = ()
    doubt: str = ""  # row of the report that says that the reference is a plan with a broken limit; empty if it is not
    wind: np.ndarray | None = None  # velocity of the air in {G} for which it is planned, (3,) [m/s]; None without air
    # Load of the platform from a time on [s]; None for no load.
    loads: Sequence[tuple[float, RigidLoad | None]] = ()

    def load_at(self, time: float) -> RigidLoad | None:
        """Return what the platform carries at a time [s], or None."""
        return next((load for begins, load in reversed(self.loads) if begins <= time + ROUNDING), None)
