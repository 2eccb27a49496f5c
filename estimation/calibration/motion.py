"""`motion_of`: accelerations and signs of cable speeds over a log, by polynomials through neighbouring samples.

Parabolas over 0.4 s make accelerations of 1.4 Hz 21 % too small, polynomials of degree 8 over 1.2 s 1.6 %, with less
noise than a third of those of degree 4 over 0.4 s. Where forces on four cables tell attachments, CoM and stretch, those
would adapt to such errors, and the CoM to the noise: where it is lets a part of the noise make no moment.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ...models import points
from ...models.robot import Robot
from ..logs.measurements import Measurements, measured_poses
from ..logs.smoothing import FEWEST, Polynomials, continuous, widest_parabola, within
from .parameters import Parameters

FEWEST_MOVING = 50  # samples without times; fewer are always taken to be at rest
SMALL, SMOOTH = 0.05, 0.7  # steps of a motion over its extent, and their changes over the steps
DEGREE, WIDER = 8, 3  # of polynomials, through so many times the neighbours of parabolas
FEWEST_NEIGHBOURS = 9  # of parabolas: where there are fewer, wider polynomials are far noisier near ends of a log
HOLLOW = 11  # samples that accelerations leave out; poses are smoothed over as many
MOST_NEIGHBOURS = 250  # of parabolas, to each side: with 25 at 1 kHz, noise of the accelerations hides the mass
SLOWEST = 0.2  # [s] between samples of a motion; if they are farther apart, the platform is taken to be at rest


class Motion(NamedTuple):
    """Motion at N samples; zeros of a log without times, whose samples are at rest.

    Attributes:
        signs: Expected signs of the cable speeds, 1: paid out, 0 where either is as likely, (N, m).
        gravity: Gravity less the acceleration of the platform frame, (N, 3) [m/s^2].
        rate, spin: Angular velocity [rad/s] and acceleration [rad/s^2] in {G}, (N, 3).
        turning: Rate of the angular momentum about the CoM in {G}, (N, 3) [N m].
        sigma: Standard deviation of the acceleration, 0 where the platform rests, (N,) [m/s^2].
        turning_sigma: Standard deviation of `turning`, 0 where accelerations are unknown, (N,) [N m].
        smooth: Smoothing of values (N, d) by parabolas, None without times.
        is_known: Whether the poses show how the platform accelerates, or it is at rest, also by poses without times.
    """

    signs: np.ndarray
    gravity: np.ndarray
    rate: np.ndarray
    spin: np.ndarray
    turning: np.ndarray
    sigma: np.ndarray
    turning_sigma: np.ndarray
    smooth: Polynomials | None = None
    is_known: bool = True

    def ahead(self, times: np.ndarray | None, clock: float, rows: np.ndarray | slice) -> Motion:
        """Return the motion at some samples, with the platform's motion `clock` [s] later; its ends stay as they are.

        `times` (N,) [s] are the times of all samples.
        """
        moved: dict[str, Any] = {}
        for name in ("gravity", "rate", "spin", "turning"):
            values = getattr(self, name)
            if times is None or clock == 0.0:
                moved[name] = values[rows]
            else:
                moved[name] = np.stack([np.interp(times[rows] + clock, times, one) for one in values.T], axis=1)
        return self._replace(**moved, signs=self.signs[rows], sigma=self.sigma[rows], smooth=None)

    @property
    def by_arm(self) -> np.ndarray:
        """Return the derivative of gravity less acceleration by the arm from the platform frame, (N, 3, 3) [1/s^2]."""
        return -points.skew(self.spin) - points.skew(self.rate) @ points.skew(self.rate)


def motion_of(robot: Robot, measurements: Measurements) -> Motion:
    """Return the motion of a log: of the cables by their readings, of the platform by its poses if these are known."""
    count, times = len(measurements), measurements.times
    gravity, zero = np.tile(robot.gravity, (count, 1)), np.zeros((count, 3))
    rest = Motion(np.zeros((count, robot.m)), gravity, zero, zero, zero, still := np.zeros(count), still)
    if times is None:
        return rest._replace(is_known=not _seems_to_move(robot, measurements))
    if count < 2 * FEWEST + 1 or np.median(np.diff(times)) > SLOWEST:
        return rest
    from scipy.special import erf

    position, rotation, known = measured_poses(robot, measurements)
    quaternions, width = Rotation.from_matrix(rotation).as_quat(), within(times)
    known = np.asarray(known[:, robot.dof_mask > 0].all(axis=1))  # (N,)
    is_known = bool(known[[0, -1]].all()) and np.diff(np.flatnonzero(known)).max() <= width // 2 + 1
    if is_known:
        position, quaternions = (_filled(times, one, known) for one in (position, quaternions))
        rotation = Rotation.from_quat(quaternions).as_matrix()
    # Errors of accelerations would let the mass that they tell appear too small.
    of_poses = max(width, widest_parabola(times, np.hstack([position, quaternions]))) if is_known else width
    if measurements.tensions is None:
        # Such tensions stretch cables. Noise of the poses, in them and in lengths, would look like stretch.
        width = of_poses
    of, local = Parameters(robot, ()), Polynomials(times, width)
    lengths = local.fitted(measurements.lengths * of.table(of.first)[:, 7])
    signs = erf(lengths.slopes / np.maximum(np.sqrt(2) * lengths.noise[1], 1e-12))
    rest = rest._replace(signs=signs, smooth=local)
    if not is_known:
        bends = [np.abs(lengths.bends).max(axis=1)]
        if measurements.carrier_poses is not None:  # a load follows its carriers, also on cables of fixed length
            carriers = measurements.carrier_poses[..., :3]
            bends += [np.linalg.norm(local.fitted(one).bends, axis=1) for one in np.swapaxes(carriers, 0, 1)]
        return rest._replace(sigma=np.max(bends, axis=0), is_known=False)
    narrow = max(of_poses, within(times, most=MOST_NEIGHBOURS))
    wide = WIDER * (narrow - 1) + 1
    smooths = narrow >= FEWEST_NEIGHBOURS and wide <= count / 4
    # Noise of a pose in the tensions at that pose would look like stretch.
    hollow = HOLLOW if measurements.tensions is None and wide >= 5 * HOLLOW else 0
    local = Polynomials(times, wide, DEGREE, hollow=hollow) if smooths else Polynomials(times, of_poses)
    moved, inverse = local.fitted(np.hstack([position, quaternions])), quaternions * [-1, -1, -1, 1]
    rate, spin = (2 * _vector_of_product(part[:, 3:], inverse) for part in (moved.slopes, moved.bends))
    sigma = moved.noise[2, :, :3].max(axis=1)
    if robot.platform.inertia is not None:
        inertia = rotation @ robot.inertia @ np.swapaxes(rotation, 1, 2)
        momentum, change = (np.einsum("nij,nj->ni", inertia, part) for part in (rate, spin))
        noise = 2 * moved.noise[2, :, 3:].max(axis=1) * float(np.linalg.eigvalsh(robot.inertia)[-1])
        rest = rest._replace(turning=change + np.cross(rate, momentum), turning_sigma=noise)
    return rest._replace(gravity=gravity - moved.bends[:, :3], rate=rate, spin=spin, sigma=sigma)


def _seems_to_move(robot: Robot, measurements: Measurements) -> bool:
    """Return whether successive positions are close to each other and turn slowly, as only in a motion."""
    position, _, known = measured_poses(robot, measurements)
    if len(position) < FEWEST_MOVING or not known[:, robot.dof_mask > 0].all():
        return False
    steps = np.diff(position, axis=0)
    usual, turns = (float(np.median(np.linalg.norm(one, axis=1))) for one in (steps, np.diff(steps, axis=0)))
    return turns < SMOOTH * usual < SMOOTH * SMALL * float(np.linalg.norm(np.ptp(position, axis=0)))


def _filled(times: np.ndarray, values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return values (N, d), quaternions of one sign; values without a pose are between their neighbours."""
    from scipy.interpolate import CubicSpline

    seen = continuous(values[known]) if values.shape[1] == 4 else values[known]
    return seen if known.all() else np.asarray(CubicSpline(times[known], seen)(times))


def _vector_of_product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the vector part of the products p q of quaternions (x, y, z, w), (N, 3)."""
    return p[:, 3:] * q[:, :3] + q[:, 3:] * p[:, :3] + np.cross(p[:, :3], q[:, :3])
