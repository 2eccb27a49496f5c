"""Paper F's 720 pairings of anchors and attachments: which hold the platform, and a bound that all of them share.

The printed pairing has no inverse (`pairing`), so the other chapters choose crossed pairs. What is impossible with
these might be possible with others. `hold` tries all of them. `pull_inward` is independent of them: the platform is
level and outside the ring of anchors, so each cable, whichever points it joins, pulls it back by a share of what it
carries upwards.
"""

from functools import cache
from itertools import permutations
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from ...models import load
from ...models.diagnosis import RANK_TOLERANCE
from ...ocp.tasks.paths import Motion
from .plans import BELOW, SECONDS, circle, solved

PRINTED = "wang-flying-printed"  # the robot as printed
PAIRINGS = np.array(list(permutations(range(6))))
"""Attachment of each anchor's cable, (720, 6)."""
BALANCED = 1e-9  # of the weight: the largest residual of a balance
TURN = np.linspace(0.0, SECONDS, 24, endpoint=False)  # [s], an instant every 15 degrees of one turn


class Inward(NamedTuple):
    """The horizontal force towards the axis of the circle [N]."""

    least: float  # what cables that carry the platform give at least, with any pairing
    needed: float  # what the circle requires


class AtCentre(NamedTuple):
    """At the centre of the circle, by pairing: whether J has an inverse, and whether then all cables pull, (720,)."""

    full_rank: np.ndarray
    taut: np.ndarray


def wrench_matrices(positions: np.ndarray, pairs: np.ndarray = PAIRINGS) -> np.ndarray:
    """Return J of a level platform at `positions` (n, 3) in {A}, of the pairings (k, 6): (n, k, 6, 6)."""
    robot = load(PRINTED)
    arms = robot.attachments[pairs]
    lines = robot.anchors - arms - positions[:, None, None]
    units = lines / np.linalg.norm(lines, axis=-1, keepdims=True)
    return np.concatenate([units, np.cross(np.broadcast_to(arms, units.shape), units)], axis=-1).swapaxes(-1, -2)


def required(motion: Motion) -> np.ndarray:
    """Return the wrench that a level motion (n, 6) under a hovering quadrotor requires, (n, 6)."""
    robot = load(PRINTED)
    force = robot.platform.mass * (motion.acceleration[:, :3] - np.array(robot.gravity))
    return np.hstack([force, np.zeros_like(force)])


@cache
def at_centre() -> AtCentre:
    """Check all pairings at the centre of the circle."""
    still = circle(0.0, TURN[:1])
    J, w = wrench_matrices(still.pose[:, :3])[0], required(still)[0]
    full = _full_rank(J)
    taut = np.zeros(len(PAIRINGS), dtype=bool)
    taut[full] = (solved(J[full], w) > BALANCED * w[2]).all(axis=-1)
    return AtCentre(full, taut)


def tensions(motion: Motion, pairs: np.ndarray) -> np.ndarray:
    """Return the only tensions of pairings (k, 6) whose J has an inverse, (n, k, 6) [N]: negative if a cable pushes."""
    return solved(wrench_matrices(motion.pose[:, :3], pairs), required(motion)[:, None])


def hold(radius: float, pairs: np.ndarray = PAIRINGS) -> np.ndarray:
    """Return which of the pairings (k, 6) hold the platform on the circle, with cables that pull, at all of `TURN`.

    Where J has no inverse, the balance is solved by non-negative least squares.
    """
    motion, left = circle(radius, TURN), pairs
    for position, w in zip(motion.pose[:, None, :3], required(motion), strict=True):
        J = wrench_matrices(position, left)[0]
        full = _full_rank(J)
        held = np.zeros(len(left), dtype=bool)
        held[full] = (solved(J[full], w) >= 0).all(axis=-1)
        held[~full] = [nnls(one, w)[1] <= BALANCED * w[2] for one in J[~full]]
        left = left[held]
    return left


def pull_inward(radius: float) -> Inward:
    """Compare the pull towards the axis that carrying the weight implies with what the circle requires.

    Of each of the 36 lines from an anchor to an attachment, the horizontal part towards the axis over the vertical part
    is at least q, at all instants. Cables that pull and carry the weight m g then pull inward with q m g at least.
    """
    robot, motion = load(PRINTED), circle(radius, TURN)
    places = motion.pose[:, :3]
    inward = np.array([0.0, 0.0, -BELOW]) - places
    lines = robot.anchors[:, None] - robot.attachments - places[:, None, None]
    shares = np.einsum("nabi,ni->nab", lines, inward) / radius / lines[..., 2]
    acceleration = np.einsum("ni,ni->n", motion.acceleration[:, :3], inward) / radius
    return Inward(float(shares.min() * robot.weight), float(robot.platform.mass * acceleration.max()))


def _full_rank(J: np.ndarray) -> np.ndarray:
    values = np.linalg.svd(J, compute_uv=False)
    return values[..., -1] > RANK_TOLERANCE * values[..., 0]
