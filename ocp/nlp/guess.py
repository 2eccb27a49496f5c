"""Guess the motion that the planner starts from: `initial_guess`."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..limits.carriers import CarrierAcceleration, CarrierSpeed
from ..tasks.deviation import Deviation
from ..tasks.ends import fixed_values
from ..tasks.paths import Motion
from ..tasks.scenario import POSITION, Scenario
from .formation import clear_formation

ATTITUDES_MEET = 3  # rounds: where the cables leave a quadrotor depends on how it tilts, a little


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
