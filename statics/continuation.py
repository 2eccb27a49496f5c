"""Continue a plan that ends while the robot moves: `continued`; `faded` for what changes at its end."""

from collections.abc import Sequence

import numpy as np
from numpy.polynomial.polynomial import polyder, polyint

from ..models.trajectory import Motion, Trajectory

RESTS = 1e-4  # [m/s, rad/s], at the end of a plan
FADED = 1.0  # time after the end of a plan in which its last accelerations fade [s]
SHORT = 1e-3  # [s], for differences
JERK = 20.0  # times the last acceleration and speed, divided by powers of FADED: larger jerks are noise
# Polynomials on [0, 1], a column each, that begin with value, slope or curvature 1, and end with all three zero.
FADES = np.array([[1, 0, 0, -10, 15, -6], [0, 1, 0, -6, 8, -3], [0, 0, 0.5, -1.5, 1.5, -0.5]]).T
OF_ORDER = {order: polyint(FADES, order) if order >= 0 else polyder(FADES) for order in range(-1, 3)}
POSITION = np.arange(6) < 3  # coordinates of a pose
CLOSED = 1e-6  # largest difference of the states at both ends of a periodic plan, in SI units
ENDLESS = 1e6  # [s], duration of a periodic plan that is repeated


def continued(trajectory: Trajectory, together: bool) -> Trajectory:
    """Return a trajectory that continues after its end, unless the robot rests there.

    A periodic one, which ends in the state in which it begins, is repeated. Of others the last accelerations and
    rotations fade, and so do the motions of carriers relative to the platform if they stay `together` with it.
    """
    end = trajectory.duration or 0.0
    last = trajectory.at(before(end))
    if max(np.abs(motion[1][2]).max() for motion in last) < RESTS:
        return trajectory
    changes = [[np.diff(part, axis=0)[0] for part in motion] for motion in trajectory.at(np.array([0.0, end]))]
    gaps = [np.abs([np.where(POSITION, pose, np.sin(pose / 2)), *rates]).max() for pose, *rates in changes]
    if max(gaps) < CLOSED:
        return _repeated(trajectory, end, [pose for pose, *_ in changes])
    jerks = [slopes(motion[2])[1] for motion in last]
    for jerk, motion in zip(jerks, last, strict=True):
        for part in (slice(0, 3), slice(3, 6)):
            speed, acceleration = (float(np.abs(motion[order][2][..., part]).max()) for order in (1, 2))
            most = JERK / FADED * (acceleration + speed / FADED)
            jerk[..., part] = np.clip(jerk[..., part], -most, most)

    def at(times: np.ndarray) -> tuple[Motion, Motion]:
        motions, after = trajectory.at(np.minimum(times, end)), np.maximum(times - end, 0.0)
        if not after.any():
            return motions
        platform, carriers = ([*motion, jerk] for motion, jerk in zip(motions, jerks, strict=True))
        first = faded(platform, after, POSITION)
        if not together:
            return first, faded(carriers, after, POSITION)
        places = [np.where(POSITION, part, 0.0)[:, None] for part in platform]
        relative = faded([part - place for part, place in zip(carriers, places, strict=True)], after)
        a, b, c = (part + np.where(POSITION, own, 0.0)[:, None] for part, own in zip(relative, first, strict=True))
        return first, (a, b, c)

    return trajectory._replace(at=at)


def _repeated(trajectory: Trajectory, period: float, turns: Sequence[np.ndarray]) -> Trajectory:
    """Return a periodic trajectory that is repeated; in each period its angles increase by those of `turns` [rad]."""
    planned = trajectory.tensions

    def complete(times: np.ndarray) -> np.ndarray:
        return np.maximum(np.ceil(times / period) - 1, 0)

    def at(times: np.ndarray) -> tuple[Motion, Motion]:
        number = complete(times)
        (a, b, c), (d, e, f) = trajectory.at(times - period * number)
        return (a + np.multiply.outer(number, turns[0]), b, c), (d + np.multiply.outer(number, turns[1]), e, f)

    tensions = planned and (lambda times: planned(times - period * complete(times)))
    return trajectory._replace(duration=ENDLESS, at=at, tensions=tensions)


def before(time: float) -> np.ndarray:
    """Return three times up to this one, (3,) [s], for `slopes`."""
    return time + SHORT * np.arange(-2, 1)


def slopes(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return values at the last of three times, (1, ...), and their two derivatives there."""
    bend = (values[:1] - 2 * values[1:2] + values[2:]) / SHORT**2
    return values[2:], (values[2:] - values[1:2]) / SHORT + SHORT / 2 * bend, bend


def faded(motion: Sequence[np.ndarray], after: np.ndarray, moves: np.ndarray | bool = False) -> Motion:
    """Return values, rates and accelerations at times `after` the end of a motion, (n,) [s], while its rates fade.

    `motion` has values and two or three derivatives. Of the coordinates in `moves` only the accelerations fade.
    """
    values, rate, *others = motion
    share = np.minimum(after / FADED, 1.0)[:, None]
    after = after.reshape(-1, *[1] * (values.ndim - 1))

    def fading(parts: Sequence[np.ndarray], order: int) -> np.ndarray:
        """Return the integral of order -1 to 2 of a function that fades from the derivatives `parts`."""
        shapes = (share ** np.arange(6 + order) @ OF_ORDER[order]).T.reshape(-1, *after.shape)
        return np.asarray(sum(FADED ** (k + order) * shapes[k] * part for k, part in enumerate(parts)))

    faster = fading(others, 1)
    on = values + after * rate + fading(others, 2) + np.maximum(after - FADED, 0.0) * faster
    of_rate = [rate, *others]
    return (
        np.where(moves, on, values + fading(of_rate, 1)),
        np.where(moves, rate + faster, fading(of_rate, 0)),
        np.where(moves, fading(others, 0), fading(of_rate, -1)),
    )
