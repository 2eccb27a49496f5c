"""Prove that carriers cannot hold the platform at an end, in any attitude or anywhere: `no_attitude`, `out_of_reach`.

Where the tube leaves a platform its attitude, but the task fixes the position where it rests, the attitudes are a box
of angles. A distance changes by no more than points of the platform move, so one that is short enough proves a whole
small box. So does a direction along which the cables cannot give the weight at any corner of the box, if they lack more
there than a bound on the curvature between the corners could add. A wind's force acts at the CoM and is the same in
every attitude; of a set of winds, one suffices for each box. Boxes that are not proven are halved along each angle,
until all are proven or an attitude keeps all distances and has tensions.

A cable pulls from its attachment towards an anchor in a box, so its force is a sum of pulls towards the corners of that
box: these span the cone of all its directions. If the given wrench is no sum of such pulls, however strong, a direction
proves it (Farkas) along which the wrench is positive and no pull is. A carrier whose reach is not a hard limit may be
anywhere around the platform. Still no cables exert a moment about a line through all attachments.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np

from ...models.points import placed
from ...solvers import Certificate, certify, solve_batch
from ...statics.distribution import wrench_problem
from ..audits.excess import TENSIONS, Excess
from ..audits.tensions import UNDERACTUATED_TOLERANCE, nearest, scaled, tolerance_of
from ..tasks.paths import Motion
from ..tasks.scenario import ATTITUDE, Scenario
from ..tasks.wind_set import possible_winds_at

MOST = 30_000  # boxes
CERTAIN = 1e-5  # [m], of distances, whose formulas are rounded where things touch
CERTAIN_FORCE = 1e-6  # of the weight, likewise
AROUND = 10.0  # of the largest arms: a box around all attachments, towards whose corners pulls span all directions

Turned = Callable[[np.ndarray], np.ndarray]
"""Takes offsets from the reference attitude (n, k), and returns poses (n, 6)."""
Tensions = Callable[[np.ndarray, float], tuple[np.ndarray, np.ndarray]]
"""Takes the centres of boxes of offsets (n, k) and half their size [rad]; returns the shortfall of tensions at each
centre (n,) [N], and a lower bound of their shortfall in the whole box (n,) [N]."""


def no_attitude(
    scenario: Scenario,
    time: float,
    angles: list[int],
    platform: np.ndarray,
    carriers: np.ndarray,
    usable: np.ndarray,
    rests: bool,
) -> list[Excess]:
    """Return the violation at the reference attitude if there is one at every attitude, else nothing.

    - `time`: when the platform is there [s].
    - `angles`: the coordinates of the attitude that the tube leaves free, of 3 to 5.
    - `platform`, `carriers`: their poses there, (6,) and (c, 6).
    - `usable`: which of the values of all limits depend on the platform's pose alone, (k,).
    - `rests`: whether the platform is at rest there and the poses of the carriers are given.
    """
    robot, turn = scenario.robot, scenario.task.tube.turn
    points = np.vstack([robot.attachments, robot.platform.com, scenario.body_corners])
    arm = float(np.linalg.norm(points, axis=1).max())
    limits = [
        (k, limit)
        for k, (limit, place) in enumerate(zip(scenario.limits, scenario.limits.places, strict=True))
        if limit.soft is None
        and np.isfinite(limit.per_metre)
        and usable[place].all()
        and scenario.in_force(limit, np.array([time])).all()
    ]

    def turned(offsets: np.ndarray) -> np.ndarray:
        pose = np.repeat(platform[None], len(offsets), axis=0)
        pose[:, angles] += offsets
        return pose

    tensions = _tensions_at_rest(scenario, time, carriers, turned) if rests else None
    if not (limits or tensions) or not set(angles) <= set(ATTITUDE) or not np.isfinite(turn):
        return []

    def exceeded(offsets: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return by how many metres of movement limits are exceeded (n, limits), and all values."""
        values = scenario.limits.at_rest(turned(offsets), np.repeat(carriers[None], len(offsets), axis=0))
        over = [np.full(len(offsets), -np.inf)] * (not limits)
        over += [np.maximum(limit.low - values[k], values[k] - limit.high).max(axis=1) for k, limit in limits]
        rates = [limit.per_metre for _, limit in limits] or [1.0]
        return np.stack(over, axis=1) / rates, values

    centres, half, count = np.zeros((1, len(angles))), turn, 0
    reasons: set[str] = set()
    while len(centres):
        count += len(centres)
        worst = exceeded(centres)[0].max(axis=1)
        kept, unproven = worst <= CERTAIN, worst <= arm * half * len(angles) + CERTAIN
        reasons |= {"keeps all distances"} if not unproven.all() else set()
        if tensions is not None and unproven.any():
            short, certain = tensions(centres[unproven], half)
            kept[unproven] &= short <= 0
            unproven[unproven] = certain <= 0
            reasons |= {"has feasible tensions at rest"} if (certain > 0).any() else set()
        if count > MOST or kept.any():
            return []
        centres = _corners(centres[unproven], half / 2)
        half /= 2
    middle, values = exceeded(np.zeros((1, len(angles))))
    why = f"no attitude in the tube {' and '.join(sorted(reasons, reverse=True))}"
    if middle.max() <= CERTAIN and tensions is not None:
        short, _ = tensions(np.zeros((1, len(angles))), 0.0)
        return [Excess(TENSIONS, "platform", time, float(short[0]), 0.0, "N", "at most", why)]
    k, limit = limits[int(middle[0].argmax())]
    which = int(np.maximum(limit.low - values[k][0], values[k][0] - limit.high).argmax())
    return [Excess.of(limit, which, time, values[k][0, which], why)]


def _corners(centres: np.ndarray, half: float) -> np.ndarray:
    """Return the corners of boxes (n, k), those of each box in turn, (2^k n, k)."""
    k = centres.shape[1]
    ways = np.stack(np.meshgrid(*[[-half, half]] * k), axis=-1).reshape(-1, k)
    return (centres[:, None] + ways).reshape(-1, k)


def _tensions_at_rest(scenario: Scenario, time: float, carriers: np.ndarray, turned: Turned) -> Tensions | None:
    """Return the function that computes shortfalls at rest; None on the ground or with pulleys.

    Of a set of winds, those come first in which most is missing at the reference attitude, and each only counts where
    the ones before prove nothing.

    Along a direction d = (f, c) of wrenches, cable i gives at most the larger of its limits times x_i = u_i . (f + c x
    r_i), u_i its direction and r_i its arm about the CoM. In a box of size 2 h, x_i differs from a mean of those at the
    corners by at most h^2 / 2 times its second derivative, summed over the angles. The same holds for the part of
    the weight along d, which varies if a load turns with the platform.
    """
    robot, at = scenario.robot, np.array([time])
    grounded = scenario.phases.resting(at).any()
    if grounded or robot.pulley_radii.any():
        return None
    mass, *com = scenario.phases.loads_at(at)[0, :4] if scenario.phases.carry else np.zeros(4)
    turning = mass * np.linalg.norm(robot.gravity) * np.linalg.norm(np.array(com) - robot.platform.com)  # [N m]
    low, high = (bound[0] for bound in scenario.bounds_at(at))
    reach, arms = (np.linalg.norm(robot.attachments - at, axis=1) for at in (0.0, np.array(robot.platform.com)))
    least = max(tolerance_of(robot), CERTAIN_FORCE * robot.force_scale)

    def wrenches(offsets: np.ndarray, wind: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return wrench matrices (n, 6, m), required wrenches (n, 6) and cable lengths (n, m)."""
        poses, places = turned(offsets), np.repeat(carriers[None], len(offsets), axis=0)
        dynamics, bodies = scenario.dynamics, (Motion.still(poses), Motion.still(places))
        w = scenario.required_wrench(np.full(len(poses), time), *bodies, wind)
        return (
            scaled(scenario, dynamics.wrench_matrix(poses, places)),
            scaled(scenario, w),
            dynamics.cable_lengths(poses, places),
        )

    def short_in(wind: np.ndarray | None, centres: np.ndarray, half: float) -> tuple[np.ndarray, np.ndarray]:
        A, w, lengths = wrenches(centres, wind)
        n, k = centres.shape
        closest, away = nearest(A, w, low, high)
        d = (w - np.einsum("nij,nj->ni", A, closest)) / np.maximum(away, least)[:, None]
        f, c = (np.linalg.norm((d * robot.wrench_scale)[:, part], axis=1)[:, None] for part in (slice(3), slice(3, 6)))
        per_length = reach / np.maximum(lengths - reach * half * k, 1e-9)  # of attachments' speeds, at most
        second = (f + c * arms) * (per_length + 3 * per_length**2) + c * arms * (1 + 2 * per_length)
        between = k * half**2 / 2
        A, w = (part.reshape(n, -1, *part.shape[1:]) for part in wrenches(_corners(centres, half), wind)[:2])
        x = np.einsum("ncij,ni->ncj", A, d) + (between * second)[:, None]
        lacking = np.einsum("nci,ni->nc", w, d) - np.maximum(low * x, high * x).sum(axis=2)
        return np.where(away > least, away, 0.0), lacking.min(axis=1) - between * turning * c[:, 0] - least

    def short(centres: np.ndarray, half: float) -> tuple[np.ndarray, np.ndarray]:
        away, certain = np.zeros(len(centres)), np.full(len(centres), -np.inf)
        for wind in winds:
            left = np.flatnonzero(certain <= 0)
            if left.size:
                values = zip((away, certain), short_in(wind, centres[left], half), strict=True)
                for most, its in values:
                    most[left] = np.maximum(most[left], its)
        return away, certain

    winds: list[np.ndarray | None] = [None if scenario.wind is None else np.array(scenario.wind)]
    middle = np.zeros((1, 1))  # of all angles
    if scenario.wind_set is not None:
        winds = [wind[0] for wind in possible_winds_at(scenario.wind_set, robot, turned(middle), np.zeros((1, 6)))]
        winds.sort(key=lambda wind: -float(short_in(wind, middle, 0.0)[0][0]))
    return short


def out_of_reach(
    scenario: Scenario, times: np.ndarray, platform: Motion, carriers: Motion, free: np.ndarray
) -> Certificate | None:
    """Return the certificate of the worst of some instants at which the platform is given; None if there is none.

    - `times`: the instants, (n,) [s], none of them on the ground.
    - `platform`, `carriers`: motions there in {G}, (n, 6) and (n, c, 6) each.
    - `free`: whether each carrier may be elsewhere, in its reach box or, without one, anywhere, (n, c).
    """
    robot, corners = scenario.robot, []
    boxes = [(index, scenario.reach(index)) for index in np.flatnonzero(free.any(axis=0)).tolist()]
    if not (len(times) and boxes) or robot.pulley_radii.any():
        return None
    centre = placed(platform.pose, np.array([robot.platform.com]))[:, 0]
    around = AROUND * (robot.length + np.linalg.norm(robot.anchors, axis=1).max())
    for sides in product((False, True), repeat=3):
        poses = carriers.pose.copy()
        for index, box in boxes:
            far = centre + around * np.where(sides, 1.0, -1.0)
            corner = far if box is None else np.where(sides, box.max, box.min)
            poses[:, index, :3] = np.where(free[:, index, None], corner, poses[:, index, :3])
        corners.append(scenario.dynamics.wrench_matrix(platform.pose, poses) * robot.dof_mask[:, None])
    A = np.concatenate(corners, axis=2)  # (n, 6, 8 m)
    w = scenario.required_wrench(times, platform, carriers, scenario.wind) * robot.dof_mask
    limits = np.zeros(A.shape[2]), np.full(A.shape[2], np.inf)
    scaled = A[0] / np.repeat([1.0, robot.length], 3)[:, None]
    if free.all() and not any(box for _, box in boxes) and np.linalg.matrix_rank(scaled) == robot.dof_mask.sum():
        return None  # pulls in all directions at these attachments exert all wrenches
    batch = solve_batch(A, w, *limits, length=robot.length)
    short = np.where(batch.feasible, -np.inf, np.nan_to_num(batch.shortfall))
    for row in np.argsort(-short)[: np.count_nonzero(~batch.feasible)]:  # one certificate takes as long as the batch
        found = certify(wrench_problem(robot, A[row], w[row], *limits))
        if found is not None and found.shortfall > UNDERACTUATED_TOLERANCE * robot.force_scale:
            # Each corner's pull is a cable of the problem; a cable of the robot gives their sum.
            pulls = (A[row, :3] * found.closest).reshape(3, 8, robot.m).sum(axis=1)
            none = np.zeros(0, dtype=np.intp)
            closest = np.linalg.norm(pulls, axis=0)
            return replace(found, time=float(times[row]), at_max=none, at_min=none, closest=closest)
    return None
