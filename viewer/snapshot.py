"""Describe a robot at one instant: its points, and its tensions or a certificate."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..base.display import Displayed
from ..models import Dynamics
from ..solvers import Certificate, capacity_margin, solve
from ..statics.distribution import pose_problem
from .geometry import Geometry, Points

ARROW = 0.3  # of the robot's size, for a certificate that is all force, and a large shortfall
SHORTEST = 0.25  # of that, for a small one
FORCELESS = 0.05  # shorter force parts are no arrow: the certificate is about moments


@dataclass(frozen=True)
class Snapshot(Displayed):
    """A robot at one instant."""

    # in {G}, (6,) and (c, 6) [m, rad]
    pose: np.ndarray
    carriers: np.ndarray
    points: Points  # see `Points`
    tensions: np.ndarray  # (m,) [N], nan where there are none
    status: str  # the status of the tensions
    # smallest distance of a tension from its limits [N], and the index of that cable; nan and -1 without tensions
    margin: float
    nearest: int
    # capacity margin at rest [N]: the distance of the wrench from the boundary of the available wrench set, negative
    # outside; nan if it was not computed
    reserve: float = float("nan")
    certificate: Certificate | None = None  # the proof that no tensions exist; None if they do
    time: float | None = None  # [s]; None at rest
    cut: np.ndarray | None = None  # which cables have been cut, (m,); None if none have
    events: tuple[str, ...] = ()  # events of a simulation until now, as texts


Show = Callable[[Snapshot], None]


def at_rest(dynamics: Dynamics, geometry: Geometry, pose: np.ndarray, carriers: np.ndarray) -> Snapshot:
    """Return the robot at rest at `pose` (6,) with its carriers at (c, 6), and the tensions of least norm that hold it.

    Raises `InputError` if a cable has no length there, or cannot pass over its pulley.
    """
    robot = dynamics.robot
    problem = pose_problem(dynamics, pose, carrier_pose=carriers)
    answer = solve(problem)
    tensions = np.full(robot.m, np.nan) if answer.tensions is None else answer.tensions
    margin, nearest = least_distance(tensions, robot.t_min, robot.t_max)
    return Snapshot(
        pose=pose,
        carriers=carriers,
        points=geometry(pose, carriers),
        tensions=tensions,
        status=answer.status.value,
        margin=margin,
        nearest=nearest,
        reserve=capacity_margin(problem).value,
        certificate=answer.certificate,
    )


def least_distance(tensions: np.ndarray, t_min: np.ndarray, t_max: np.ndarray) -> tuple[float, int]:
    """Return the smallest distance of tensions (m,) from their limits [N], and the cable; nan and -1 if one is nan."""
    inside = np.minimum(tensions - t_min, t_max - tensions)
    if not np.isfinite(inside).all():
        return float("nan"), -1
    return float(inside.min()), int(inside.argmin())


def arrow(instant: Snapshot, size: float, typical: float) -> np.ndarray | None:
    """Return the force part of the certificate's direction as an arrow from the CoM, start and tip (2, 3) in {G} [m].

    Its length grows with the shortfall, and stays below `ARROW` of `size` [m] times the share of force in the
    direction, so that it stays in the picture: a quarter of that for a small shortfall, five eighths where it is a
    `typical` force [N]. Return None if there is no certificate, or almost no force in it.
    """
    if instant.certificate is None:
        return None
    force = instant.certificate.direction[:3]
    if np.linalg.norm(force) < FORCELESS:
        return None
    grown = SHORTEST + (1 - SHORTEST) * instant.certificate.shortfall / (instant.certificate.shortfall + typical)
    return np.stack([instant.points.com, instant.points.com + ARROW * size * grown * force])
