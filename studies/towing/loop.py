"""Paper C's loop: figure 1, the set of Eq. 14, the box of Eq. 15, and steps (a), (b), (c), (e) and (f).

Step (d) is among the tensions (`tensions`), step (g) among the ranges that 60 000 loops give (`ranges`). Forces and
lengths are computed here from points and scipy's rotations, apart from the conditions that the loops use.
"""

from functools import cache

import numpy as np

from ...figures.drawing import Drawing
from ...figures.robot import draw
from ...models import Dynamics
from ...statics.equilibria import Equilibrium, equilibria
from ...statics.scene import scene_at
from ...workspace import ForceBalance, Places
from ..accounts.claim import Chapter, Claim, Verdict
from .claims import claim
from .equations import MEANT, SIZES, lines, rank
from .plans import DRIVES, FIXED, robot
from .workspace import POSTURE, PRINTED, loops, reach

SAMPLES = 6000
BESIDE = 0.2  # the box of Eq. 15 is sampled with so much more on each side [m]
STEP = 1e-6  # of differences [m, rad]
EQUATIONS = 17  # the last number of an equation
AT_REST = 1e-6  # of the weight: the largest residual of a balance


def chapter() -> Chapter:
    """Check the configuration, the constraints and the steps."""
    found, mover = rest(3), robot("wang-ctmrts", "both")
    poses, forces = around_the_ends()
    low, high = reach(mover)
    # x and y of the positions, in and around the box, where pulling cables balance the weight.
    ends, held = mover.carrier_home[:, :2], poses[(forces > 0).all(axis=1), :2]
    outside = np.maximum(ends.min(axis=0) - held, held - ends.max(axis=0)).max(axis=1)
    share, arm = (outside < 0).mean(), np.linalg.norm(mover.attachments, axis=1).max()
    claims = [
        _suspended({m: rest(m) for m in SIZES}),
        _dimension(found),
        claim("eq-15-xy").stated(share, share == 1.0, arm=arm, outside=outside.max()),
        _heights(),
        claim("step-a").undetermined((high - low).max(axis=0) / 2),
        *_steps(found.pose),
        *_bounded(poses, forces),
    ]
    scene = scene_at(mover, found.pose, found.tensions, "three robots, cables of 1.2 m, at rest")
    about = "Figure 1: robot-ends in their boxes (widths inferred), cables and load"
    return Chapter(claims, {"configuration": Drawing(about, draw(scene))})


@cache
def rest(m: int) -> Equilibrium:
    """Return where the load of m robots rests on cables of 1.2 m, with the robot-ends at home."""
    mover = robot(SIZES[m], "fixed-length")
    return equilibria(mover, np.full(m, FIXED), mover.carrier_home)[0]


def around_the_ends() -> tuple[np.ndarray, np.ndarray]:
    """Draw poses of W2 in and around the box of Eq. 15, and return them with the tensions that balance the forces.

    Three cables balance three components of force in one manner; (n, 6) and (n, 3) [N].
    """
    mover, rng = robot("wang-ctmrts", "variable-length"), np.random.default_rng(15)
    ends = mover.carrier_home[:, :3]
    low, high = ends.min(axis=0) - BESIDE, ends.max(axis=0) + BESIDE
    low[2] = 0.0
    poses = np.hstack([rng.uniform(low, high, (SAMPLES, 3)), rng.uniform(-POSTURE, POSTURE, (SAMPLES, 3))])
    vectors, _ = lines(mover, poses)
    units = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    weight = np.array([0.0, 0.0, mover.weight])
    return poses, np.linalg.solve(units.transpose(0, 2, 1), weight[:, None])[..., 0]


def _suspended(rests: dict[int, Equilibrium]) -> Claim:
    """Check the balance of force and moment at rest, and that the load is below the robot-ends."""
    left, pulling, below = [], [], []
    for m, found in rests.items():
        mover = robot(SIZES[m], "fixed-length")
        vectors, arms = lines(mover, found.pose)
        forces = (found.tensions / np.linalg.norm(vectors, axis=1))[:, None] * vectors
        force, moment = forces.sum(axis=0) - [0, 0, mover.weight], np.cross(arms, forces).sum(axis=0)
        left.append(np.abs(np.concatenate([force, moment])).max() / mover.weight)
        pulling.append((found.tensions > AT_REST * mover.weight).sum())
        below.append(found.pose[2] < mover.carrier_home[:, 2].min())
    holds = all(below) and max(left) < AT_REST and pulling == list(rests)
    return claim("figure-1").stated(pulling, holds, printed=list(rests), left=max(left))


def _dimension(found: Equilibrium) -> Claim:
    """Compute the dimension of the poses in balance: coordinates and tensions, less independent equations.

    Any set is {g_0 <= 0} of some g_0: of a balance, its residual.
    """
    dynamics = Dynamics(robot("wang-ctmrts", "both"))
    steps = STEP * np.eye(6)
    ahead, behind = (dynamics.wrench_matrix(found.pose + sign * steps) @ found.tensions for sign in (1, -1))
    slopes = np.hstack([(ahead - behind).T / (2 * STEP), dynamics.wrench_matrix(found.pose)])
    size = slopes.shape[1] - int(np.linalg.matrix_rank(slopes, rtol=1e-6))
    return claim("eq-14").stated(size, 0 < size <= 6)


def _heights() -> Claim:
    """Compute the shares of the printed ranges of z that the third row of Eq. 15 leaves."""
    mover = robot("wang-ctmrts", "both")
    (low, high), home = reach(mover), mover.carrier_home[:, 2]
    shares = []
    for drive in DRIVES:
        fixed = drive == "variable-length"  # then the robot-ends are at home
        least, most = (home.min(), home.max()) if fixed else (low[:, 2].min(), high[:, 2].max())
        start, end = PRINTED[drive][2]
        shares.append(max(min(most, end) - max(least, start), 0.0) / (end - start))
    return claim("eq-15-z").stated(
        shares,
        min(shares) == 1.0,
        otherwise=Verdict.IMPOSSIBLE,
        home=home[0],
        low=low[0, 2],
        fixed=PRINTED["fixed-length"][2][0],
        both=PRINTED["both"][2][0],
    )


def _steps(pose: np.ndarray) -> list[Claim]:
    """Count the coordinates that steps (b) and (c) determine at a pose, and check the matrix of step (e)."""
    mover, steps = robot("wang-ctmrts", "both"), STEP * np.eye(6)
    ahead, behind = (np.linalg.norm(lines(mover, pose + sign * steps)[0], axis=-1) for sign in (1, -1))
    fixed_by_lengths = rank((ahead - behind).T[:, :3] / (2 * STEP))  # of the position, where lengths are given
    given = [robot("wang-ctmrts", drive).fixed_lengths is not None for drive in DRIVES]
    # The lengths at the places of the loops of W1.
    samples = loops("fixed-length", count=SAMPLES)
    met = np.isfinite(samples.places.pose[:, 0])
    vectors, _ = lines(samples.robot, samples.places.pose[met], samples.places.carriers[met, :, :3])
    off = np.abs(np.linalg.norm(vectors, axis=-1) - FIXED).max()
    J = Dynamics(mover).wrench_matrix(pose)
    rows, columns = J.shape
    fields = {"rank": rank(J), "equations": EQUATIONS}
    return [
        claim("step-b").compared([3 - fixed_by_lengths if known else 3 for known in given]),
        claim("step-c").compared(off, fixed=FIXED, met=met.mean()),
        claim("step-e").stated(f"{rows} x {columns}", rows == columns, otherwise=Verdict.IMPOSSIBLE, **fields),
    ]


def _bounded(poses: np.ndarray, forces: np.ndarray) -> list[Claim]:
    """Compare the poses that the loops record with those whose tensions meet Eq. 11."""
    mover = robot("wang-ctmrts", "variable-length")
    pulling, meets = (np.all(inside, axis=1) for inside in (forces > 0, (forces > 0) & (forces < mover.t_max)))
    recorded = ForceBalance().holds(mover, Places.at_home(mover, poses))
    return [
        claim("step-f").compared(MEANT["the bounds of the tensions"]),
        claim("step-f-bounds").compared((meets == recorded).mean(), too_much=1 - meets[pulling].mean()),
    ]
