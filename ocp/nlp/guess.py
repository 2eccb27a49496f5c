"""Guess a motion that avoids obstacles, and tensions: how platform and carriers shift, turn and squeeze past them.

A nonlinear program that starts inside a wall, or on its wrong side, stays there. So at each of many points along the
path a few formations are tried: the platform `lateral` and `vertical` of its path and turned by `yaw`, its carriers
with it and drawn together across the path by `squeeze`, at their distance from the platform. Dynamic programming picks
the sequence that violates the task's distances least, and among these a short and smooth one; finer tries about it
follow. Statics is left to the program that starts from the guess.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from ...base.display import Displayed
from ..limits.carriers import CarrierAcceleration, CarrierSpeed
from ..limits.distance import Distance
from ..tasks.deviation import Deviation
from ..tasks.ends import carrier_ends, fixed_values, platform_ends
from ..tasks.paths import Motion
from ..tasks.scenario import POSITION, Scenario

DISTANCES = ("keep_out", "cable_clearance", "cable_platform_clearance", "carrier_separation", "platform_box")
PLACES = 120  # along the path; the first time every second
LATERAL, VERTICAL, YAW, SQUEEZE = range(4)
TRIES = (7, 3, 3, 5)  # of each of these, the first time
TWO_SIDED = np.array([1.0, 1.0, 1.0, 0.0])  # squeeze is never negative
REFINEMENTS = 3  # each with three tries of each, about the last, at half the distance
MOST_SQUEEZE = 0.8
CLEARANCE = 0.05  # [m] that a guess stays farther away than it must
VIOLATION = 1e3  # cost of a metre of violation of a distance
UNUSUAL = 1e-2  # cost of the formation farthest from the usual one
AHEAD = 0.1  # of the path: where it begins to change
ATTITUDES_MEET = 3  # rounds: where the cables leave a quadrotor depends on how it tilts, a little


@dataclass(frozen=True)
class Formation(Displayed):
    """The deviation of a formation from that at home, along the path."""

    scenario: Scenario
    shares: np.ndarray  # (k,) of the duration
    shape: np.ndarray  # (k, 4): lateral [m], vertical [m], yaw [rad] and squeeze

    def motion(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the poses of the platform (n, 6) and of the carriers (n, c, 6) at `times` [s]."""
        at = times / self.scenario.duration
        shape = np.stack([np.interp(at, self.shares, column) for column in self.shape.T], axis=1)
        return _placed(self.scenario, _References.at(self.scenario, times), shape)


def clear_formation(scenario: Scenario) -> Formation | None:
    """Return the formation along the path that violates the task's distances least.

    Return None if the usual one violates none, or if nothing of the formation is free.
    """
    span = _span(scenario)
    if scenario.relative or not any(limit.name in DISTANCES for limit in scenario.limits) or not span.any():
        return None
    shares = np.linspace(0.0, 1.0, PLACES // 2 + 1)
    references = _References.at(scenario, shares * scenario.duration)
    shape = np.zeros((len(shares), 4))
    if _beyond(scenario, *_placed(scenario, references, shape)).max() <= 0.0:
        return None
    shape = _best(scenario, references, _tried(shape, span, 0), span)
    finer = np.linspace(0.0, 1.0, PLACES + 1)
    references = _References.at(scenario, finer * scenario.duration)
    shape = np.stack([np.interp(finer, shares, column) for column in shape.T], axis=1)
    for attempt in range(1, 1 + REFINEMENTS):
        shape = _best(scenario, references, _tried(shape, span, attempt), span)
    from scipy.ndimage import gaussian_filter1d  # loads for longer than a plan takes that does not need it

    return Formation(scenario, finer, gaussian_filter1d(shape, PLACES / 60, axis=0, mode="nearest"))


@dataclass(frozen=True)
class _References:
    """The poses of platform and carriers without deviation, and the direction across the path."""

    platform: np.ndarray  # (n, 6)
    carriers: np.ndarray  # (n, c, 6)
    across: np.ndarray  # (n, 3), horizontal

    @staticmethod
    def at(scenario: Scenario, times: np.ndarray) -> _References:
        platform, carriers = scenario.references(times)
        return _References(platform.pose, np.stack([c.pose for c in carriers], axis=1), _across(platform))


def _across(platform: Motion) -> np.ndarray:
    """Return the horizontal direction across the platform's velocity; at rest, the one at the nearest moving point."""
    velocity = platform.velocity[:, :2]
    speed = np.linalg.norm(velocity, axis=1)
    moving = np.flatnonzero(speed > 1e-3 * max(speed.max(), 1e-9))
    if not len(moving):
        return np.tile([0.0, 1.0, 0.0], (len(velocity), 1))
    nearest = moving[np.clip(np.searchsorted(moving, np.arange(len(velocity))), 0, len(moving) - 1)]
    along = velocity[nearest] / speed[nearest, None]
    # Left stays left where the motion turns back.
    same = np.where((along[1:] * along[:-1]).sum(axis=1) < 0, -1.0, 1.0)
    along[1:] *= np.cumprod(same)[:, None]
    return np.stack([-along[:, 1], along[:, 0], np.zeros(len(along))], axis=1)


def _span(scenario: Scenario) -> np.ndarray:
    """Return the largest lateral, vertical, yaw and squeeze, (4,); zero where not free."""
    tube, robot, loose = scenario.task.tube, scenario.robot, scenario.loose
    bodies = [robot.attachments, *(robot.carrier_home[[i], :3] - robot.home[:3] for i in loose)]
    size = float(np.linalg.norm(np.vstack(bodies), axis=1).max())
    moves = set(POSITION) <= set(scenario.platform_free)
    lateral = min(2 * size, tube.radius) if moves else 0.0
    yaw = tube.turn if 5 in scenario.platform_free else 0.0
    squeeze = MOST_SQUEEZE if len(loose) > 1 else 0.0
    return np.array([lateral, lateral / 2, min(yaw, np.pi / 2), squeeze])


def _tried(shape: np.ndarray, span: np.ndarray, attempt: int) -> np.ndarray:
    """Return formations (k, tries, 4) to try about `shape` (k, 4): first all over the span, then near them."""
    step = span * np.where(TWO_SIDED, 2.0, 1.0) / (np.array(TRIES) - 1)
    if attempt == 0:
        levels = [
            np.arange(count) * size - side * most
            for count, size, side, most in zip(TRIES, step, TWO_SIDED, span, strict=True)
        ]
    else:
        levels = [size / 2**attempt * np.array([-1.0, 0.0, 1.0]) for size in step]
    changes = np.array(list(product(*(np.unique(level) for level in levels))))
    return np.clip(shape[:, None] + changes, -span * TWO_SIDED, span)


def _placed(scenario: Scenario, references: _References, shape: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the poses of platform (n, 6) and carriers (n, c, 6) in formations (n, 4)."""
    robot = scenario.robot
    platform, carriers = references.platform.copy(), references.carriers.copy()
    lateral, vertical, yaw, squeeze = shape.T
    platform[:, :3] += lateral[:, None] * references.across
    platform[:, 2] += vertical
    platform[:, 5] += yaw
    cos, sin = np.cos(yaw), np.sin(yaw)
    for index in scenario.loose:
        x, y, z = robot.carrier_home[index, :3] - robot.home[:3]
        offset = np.stack([cos * x - sin * y, sin * x + cos * y, np.full_like(yaw, z)], axis=1)
        aside = (offset * references.across).sum(axis=1)
        offset -= (squeeze * aside)[:, None] * references.across
        flat = offset[:, 0] ** 2 + offset[:, 1] ** 2
        offset[:, 2] = np.sign(z) * np.sqrt(np.maximum(x**2 + y**2 + z**2 - flat, 0.0))
        carriers[:, index, :3] = platform[:, :3] + offset
    return platform, carriers


def _beyond(scenario: Scenario, platform: np.ndarray, carriers: np.ndarray, tries: int = 1) -> np.ndarray:
    """Return the sum of the violations of the task's distances by platform (n, 6) and carriers (n, c, 6), (n,) [m].

    So many successive `tries` are near each other: the distances of one show that those of most others suffice.
    """
    beyond, limits = np.zeros(len(platform)), scenario.limits
    others = limits.along(Motion.still(platform), Motion.still(carriers), distances=False)
    points = scenario.moving_points(platform, carriers)
    points = points.reshape(-1, tries, *points.shape[1:])
    moved = np.linalg.norm(points - points[:, tries // 2, None], axis=3).max(axis=2)
    for limit, values in zip(limits, others, strict=True):
        if limit.name not in DISTANCES:
            continue
        rows = np.arange(len(platform))
        if isinstance(limit, Distance):
            if np.isfinite(limit.per_metre):
                middle = (Motion.still(pose[tries // 2 :: tries]) for pose in (platform, carriers))
                slack = limits.distances(limit, *middle).min(axis=1) - limit.low
                rows = np.flatnonzero(slack[:, None] - limit.per_metre * moved < CLEARANCE)
            values = limits.distances(limit, *(Motion.still(pose[rows]) for pose in (platform, carriers)))
        for side in (limit.low + CLEARANCE - values, values - limit.high + CLEARANCE):
            beyond[rows] += np.maximum(side, 0.0).sum(axis=1)
    return beyond


def _best(scenario: Scenario, places: _References, tried: np.ndarray, span: np.ndarray) -> np.ndarray:
    """Return the cheapest sequence of formations (k, 4) among those tried at each point, (k, tries, 4)."""
    count, tries, _ = tried.shape
    every = _References(*(np.repeat(part, tries, axis=0) for part in (places.platform, places.carriers, places.across)))
    passed = _beyond(scenario, *_placed(scenario, every, tried.reshape(-1, 4)), tries).reshape(count, tries)
    size = tried / np.where(span > 0, span, 1.0)
    squares = (size**2).sum(axis=2)
    cost = VIOLATION * passed + UNUSUAL * squares
    for end in (0, -1):
        cost[end] += _end_cost(scenario, size[end])
    smooth = UNUSUAL * (AHEAD * (count - 1)) ** 2
    came_from = np.zeros((count, tries), dtype=int)
    total = cost[0]
    for k in range(1, count):
        # |p - p'|^2 of all pairs, by their products.
        change = squares[k - 1][:, None] + squares[k] - 2 * size[k - 1] @ size[k].T
        reached = total[:, None] + smooth * change
        came_from[k] = reached.argmin(axis=0)
        total = reached[came_from[k], np.arange(tries)] + cost[k]
    best = np.zeros(count, dtype=int)
    best[-1] = total.argmin()
    for k in range(count - 1, 0, -1):
        best[k - 1] = came_from[k, best[k]]
    return tried[np.arange(count), best]


def _end_cost(scenario: Scenario, size: np.ndarray) -> np.ndarray:
    """Return what formations (tries, 4) cost at an end that the task prescribes."""
    kept = np.zeros(4)
    of_platform, of_carriers = platform_ends(scenario.task), carrier_ends(scenario.task)
    kept[[LATERAL, VERTICAL]] = of_platform in ("rest", "exact")
    kept[YAW] = of_platform == "exact"
    kept[SQUEEZE] = of_carriers in ("exact", "periodic")
    return VIOLATION**2 * np.abs(size) @ kept


def initial_guess(scenario: Scenario, nodes: np.ndarray) -> Deviation:
    """Return a guess that needs nothing from the user.

    Carriers that may go anywhere keep their positions relative to the platform, as at home, or draw together where the
    task keeps them from obstacles (`formation`); others stay. Quadrotors tilt as their thrust has to point. The
    tensions are those of least norm, cut to their limits.
    """
    in_formation = formation_guess(scenario)
    return usual_guess(scenario, nodes) if in_formation is None else in_formation(nodes)


def formation_guess(scenario: Scenario) -> Callable[[np.ndarray], Deviation] | None:
    """Return the guess, as a function of its nodes, in the formation that keeps the distances; None if none differs."""
    formation = clear_formation(scenario)
    return None if formation is None else lambda nodes: guess_through(scenario, formation.motion(nodes), nodes)


def usual_guess(scenario: Scenario, nodes: np.ndarray) -> Deviation:
    """Return the guess whose platform is on its path, and whose carriers keep their places, whatever is in the way."""
    return balanced(scenario, _about_home(scenario, nodes))


def guess_through(scenario: Scenario, poses: tuple[np.ndarray, np.ndarray], nodes: np.ndarray) -> Deviation:
    """Return the guess that brings platform (n, 6) and carriers (n, c, 6) to `poses` at `nodes`."""
    platform, carriers = scenario.references(nodes)
    at_home = np.stack([carrier.pose for carrier in carriers], axis=1)
    q = scenario.free_of(poses[0] - platform.pose, poses[1] - at_home)
    return balanced(scenario, _spline(scenario, nodes, q))


def balanced(scenario: Scenario, guess: Deviation) -> Deviation:
    """Return the same motion with carriers tilted as they must be, and tensions."""
    if any(scenario.robot.carriers[index].efforts for index, _ in scenario.carrier_free):
        for _ in range(ATTITUDES_MEET):
            guess = _tilted(scenario, _pulled(scenario, guess))
    return _pulled(scenario, guess)


def _about_home(scenario: Scenario, nodes: np.ndarray) -> Deviation:
    """Return the deviation that keeps carriers which may go anywhere about the platform as at home.

    Carriers that are too slow for this follow only a share of its motion, about the middle of its path.
    """
    robot, loose = scenario.robot, [] if scenario.relative else scenario.loose
    q, v, a = np.zeros((3, len(nodes), scenario.count))
    platform, carriers = scenario.references(nodes)
    shares = {carrier: _followed(scenario, carrier, platform) for carrier in loose}
    for column, (owner, coordinate) in enumerate(scenario.owners()):
        if owner is not None and owner in shares and coordinate in POSITION:
            share, path = shares[owner], platform.pose[:, coordinate]
            for part, its, own in zip((q, v, a), platform, carriers[owner], strict=True):
                part[:, column] = share * its[:, coordinate] - own[:, coordinate]
            q[:, column] += (1 - share) * (path.min() + path.max()) / 2
            q[:, column] += robot.carrier_home[owner, coordinate] - robot.home[coordinate]
    return Deviation(nodes, q, v, a, np.zeros((len(nodes), robot.m)))


def _followed(scenario: Scenario, carrier: int, platform: Motion) -> float:
    """Return the share of the platform's motion that a carrier follows, from 1 to 0 as it can follow all to half of it.

    A guess on or beyond limits of speed and acceleration takes several times as many iterations, or has no solution.
    Cables of constant length make the carrier follow all of it, and a longer duration makes all of it slower.
    """
    if scenario.robot.fixed_lengths is not None or scenario.duration_range is not None:
        return 1.0
    able, name = 1.0, scenario.robot.carriers[carrier].name
    for limit in scenario.limits:
        if isinstance(limit, CarrierSpeed | CarrierAcceleration) and limit.is_about(name):
            peak = float(np.linalg.norm(platform[limit.derivative][:, :3], axis=1).max())
            able = min(able, limit.high / peak if peak > 0.0 else 1.0)
    return max(2 * able - 1, 0.0)


def _spline(scenario: Scenario, nodes: np.ndarray, q: np.ndarray) -> Deviation:
    """Return cubic splines through q (n, count) at `nodes`, at rest at the ends where the task requires it."""
    from scipy.interpolate import CubicSpline  # loads for longer than a plan takes that does not need it

    v, a = np.zeros_like(q), np.zeros_like(q)
    resting = {column for _, column, order, _ in fixed_values(scenario) if order == 1}
    for column in range(q.shape[1]):
        curve = CubicSpline(nodes, q[:, column], bc_type="clamped" if column in resting else "not-a-knot")
        v[:, column], a[:, column] = curve(nodes, 1), curve(nodes, 2)
    return Deviation(nodes, q, v, a, np.zeros((len(nodes), scenario.robot.m)))


def _pulled(scenario: Scenario, guess: Deviation) -> Deviation:
    """Return the same motion with the tensions of least norm, cut to their limits."""
    A, w = _balance(scenario, guess)
    least = (np.linalg.pinv(A, rcond=1e-6) @ w[..., None])[..., 0]
    return replace(guess, tensions=np.clip(least, *scenario.bounds_at(guess.nodes)))


def _tilted(scenario: Scenario, guess: Deviation) -> Deviation:
    """Return the motion with each carrier tilted as its efforts balance its motion and its cables."""
    A, _ = _balance(scenario, guess)
    platform, carriers = scenario.motion(guess.nodes, guess)
    turned = with_tilts(scenario, A, guess.tensions, carriers.pose, carriers.acceleration)
    change = scenario.free_of(np.zeros_like(platform.pose), turned - carriers.pose)
    return _spline(scenario, guess.nodes, guess.q + change)


def with_tilts(
    scenario: Scenario, A: np.ndarray, tensions: np.ndarray, carriers: np.ndarray, acceleration: np.ndarray
) -> np.ndarray:
    """Return the poses of carriers (n, c, 6), tilted as their efforts balance motion, weight and cables if they may."""
    robot, carriers = scenario.robot, carriers.copy()
    owners = robot.carrier_of_cable
    for i in {owner for owner, coordinate in scenario.carrier_free if coordinate == 3}:
        cables = owners == i
        pull = -np.einsum("nij,nj->ni", A[:, :3, cables], tensions[:, cables])
        tilt = robot.carriers[i].balanced_tilt(carriers[:, i], acceleration[:, i], pull, np.array(robot.gravity))
        if tilt is not None:
            carriers[:, i, 3:5] = tilt
    return carriers


def _balance(scenario: Scenario, guess: Deviation) -> tuple[np.ndarray, np.ndarray]:
    """Return A (n, 6, m) and w (n, 6) of a motion."""
    platform, carriers = scenario.motion(guess.nodes, guess)
    A = scenario.dynamics.wrench_matrix(platform.pose, carriers.pose)
    return A, scenario.required_wrench(guess.nodes, platform, wind=scenario.wind)
