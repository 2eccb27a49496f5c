"""`thrust_gains`: how far the recorded thrusts of carriers differ from those that their motions need.

A cable pulls along itself only. So across it the thrust T alone balances weight and inertia of its carrier:

    P T R (g_x, g_y, g_z + d s) = P m (a - gravity)

with the projection P across the cable, the rotation R of the carrier, its mass m and acceleration a, the gain g_z and
its drift d (as of a battery; s rises from -1/2 to 1/2), and a tilt g_x, g_y of the thrust. It is linear least squares.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ...base.text import quantity
from ...models import points
from ...models.robot import Robot
from .measurements import Measurements, measured_poses
from .smoothing import FEWEST, Polynomials, within

BLOCKS = 25  # of the record; the scatter of their sums gives the standard deviations, also of autocorrelated residuals
CLEAR = 5.0  # standard deviations
LEAST, SURE = 0.005, 0.01  # from a gain of 1 and from no tilt, of what is named, and the largest standard deviation
LEAST_TILT = np.radians(1.0)  # of a direction of a cable, which is named
FAR = 0.5  # from 1, of a gain that other errors explain better


class ThrustGain(NamedTuple):
    """Factors (4,) by which thrusts of the carrier `index` become those that it needs: g_x, g_y, g_z, d."""

    index: int
    factors: np.ndarray

    def of(self, times: np.ndarray) -> np.ndarray:
        """Return the thrust for each recorded newton in the frame of the carrier, (N, 3), at `times` (N,) [s]."""
        result = np.tile(self.factors[:3], (len(times), 1))
        result[:, 2] += self.factors[3] * _along(times)
        return result


def _along(times: np.ndarray) -> np.ndarray:
    return (times - times[0]) / (times[-1] - times[0]) - 0.5


def thrust_gains(robot: Robot, measured: Measurements, poses: np.ndarray, thrusts: np.ndarray) -> list[ThrustGain]:
    """Return the gains that clearly differ from 1, of carriers with one cable and poses (N, c, 6), thrusts (N, c) [N].

    They need times and measured poses of the platform.
    """
    times, owner = measured.times, robot.carrier_of_cable
    if times is None or len(times) <= 4 * BLOCKS + 2 * FEWEST:
        return []
    position, rotation, known = measured_poses(robot, measured)
    there = (known | (robot.dof_mask == 0)).all(axis=1) & np.isfinite(poses).all(axis=(1, 2))
    if there.sum() <= 4 * BLOCKS:
        return []
    parabolas, found = Polynomials(times, within(times)), list[ThrustGain]()
    for cable, index in enumerate(owner):
        carrier = robot.carriers[index]
        used = there & np.isfinite(thrusts[:, index])
        if not carrier.actuators or np.count_nonzero(owner == index) > 1 or used.sum() <= 4 * BLOCKS:
            continue
        turn = points.rotations(poses[:, index, 3:])
        end = poses[:, index, :3] + turn @ np.array(robot.cables[cable].anchor)
        line = position + rotation @ np.array(robot.cables[cable].attachment) - end
        needed = carrier.mass * (parabolas.fitted(poses[:, index, :3]).bends - np.array(robot.gravity))
        # Noise would make gains too small, so lifts are as smooth as the accelerations.
        lift = thrusts[:, index, None, None] * turn
        lift = parabolas.values(lift.reshape(1, -1, 9)).reshape(lift.shape)
        lift = np.concatenate([lift, lift[:, :, 2:] * _along(times)[:, None, None]], axis=2)
        factors = _factors(*(part[used] for part in (line, needed, lift)))
        found += [] if factors is None else [ThrustGain(int(index), factors)]
    return found


def _factors(line: np.ndarray, needed: np.ndarray, lift: np.ndarray) -> np.ndarray | None:
    """Return the factors (4,) of lifts (N, 3, 4) [N] that give needed forces (N, 3) across lines (N, 3), if clear."""
    u = line / np.linalg.norm(line, axis=1, keepdims=True)
    across = np.eye(3) - u[:, :, None] * u[:, None, :]
    F, b = across @ lift, (across @ needed[..., None])[..., 0]
    normal = np.einsum("nik,nil->kl", F, F)
    if not np.linalg.cond(normal) < 1e10:
        return None
    inverse = np.linalg.inv(normal)
    factors = inverse @ np.einsum("nik,ni->k", F, b)
    slopes = np.einsum("nik,ni->nk", F, b - F @ factors)
    sums = np.array([part.sum(axis=0) for part in np.array_split(slopes, BLOCKS)])
    sigma = np.sqrt(np.diag(inverse @ (sums.T @ sums) @ inverse))
    away = np.abs(factors - [0, 0, 1, 0])
    clear = (away > np.maximum(CLEAR * sigma, LEAST)).any() and (sigma < SURE).all()
    return factors if clear and away.max() < FAR else None


def notes_of_tilts(robot: Robot, directions: np.ndarray, pulls: np.ndarray) -> Iterator[str]:
    """Yield a line for each cable whose direction differs on average from the pull by thrust, both (N, m, 3)."""
    for cable, index in enumerate(robot.carrier_of_cable):
        d, pull = directions[:, cable], -pulls[:, cable]
        turns = np.cross(pull / np.linalg.norm(pull, axis=1, keepdims=True), d)
        turns = turns[np.isfinite(turns).all(axis=1)]
        if len(turns) <= BLOCKS:
            continue
        means = np.array([part.mean(axis=0) for part in np.array_split(turns, BLOCKS)])
        sigma = float(np.linalg.norm(means.std(axis=0))) / np.sqrt(BLOCKS)
        tilt = float(np.linalg.norm(means.mean(axis=0)))
        if tilt > max(CLEAR * sigma, LEAST_TILT):
            name = robot.carriers[index].name
            size = quantity(np.degrees(tilt), "deg", 2)
            yield (
                f"the direction of cables[{cable}] differs by {size} (mean) from the pull that follows from thrust, "
                f"weight and motion of {name}; one of them is wrong, so lengths and mass may be too"
            )


def notes(robot: Robot, gains: list[ThrustGain], effect: str) -> Iterator[str]:
    """Yield a line for each gain, which ends with its effect."""
    for gain in gains:
        first, last = (1 / (gain.factors[2] + gain.factors[3] * s) for s in (-0.5, 0.5))
        size = quantity(first, digits=3)
        if abs(gain.factors[3]) > LEAST:
            size += f" (at the end {quantity(last, digits=3)})"
        tilt = np.degrees(np.arctan2(np.hypot(*gain.factors[:2]), gain.factors[2]))
        turned = f", tilted by {quantity(tilt, 'deg', 2)}," if tilt > np.degrees(LEAST) else ""
        yield (
            f"recorded thrusts of {robot.carriers[gain.index].name} are {size} times those that its mass and motion "
            f"need across its cable{turned or ','} {effect}"
        )
