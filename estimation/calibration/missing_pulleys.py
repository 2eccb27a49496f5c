"""`missing_pulleys`: whether cables seem to run over pulleys that the robot's file lacks, and what these would change.

A cable that comes to the anchor along a swivel axis and runs over a pulley of radius r is longer than one from a point
by about r (t - sin t), with the angle t between the cable and the axis. Displaced anchors and offsets absorb nearly all
of this, so the residuals remain small, and the anchors are wrong by more than r. With the normal matrix S of the fitted
parameters f and the radii, the fit is displaced by g r, where g = S_ff^-1 S_fr. If all pulleys are equal, r follows
from the residuals that are not absorbed, and from the anchors: with the covariance V of the fit and the variance s^2 of
the file's errors, these differ from the file by N(g r, V + s^2), up to a rigid motion of all together. r and s maximise
the likelihood, for each of the usual directions of the axes.
"""

from dataclasses import replace
from itertools import islice
from typing import NamedTuple

import numpy as np

from ...models.cable import Pulley
from ...models.robot import Robot
from .geometry import length_of
from .model import Model, State
from .normal_equations import NormalEquations, metric
from .observability import generators
from .parameters import GROUPS, Parameters
from .solving import Solved, inflation_of

CERTAIN = 8.0  # logarithm of the ratio of likelihoods, below which there may be no pulleys
LARGEST = 0.1  # of the cables' length, of a radius
ERRORS = np.geomspace(1e-4, 0.1, 100)  # of the file's anchors, relative to the cables' length
TINY = 1e-6  # [m], radius at which derivatives by the radius are those of a point
OBSERVABLE = 1e-6  # of the largest variance, or of the longest common motion
GAUGES = 6  # rigid motions of all anchors
MOST_SAMPLES = 6000


class MissingPulleys(NamedTuple):
    """Pulleys that explain a fit without any.

    Attributes:
        radii: Most likely radii [m], by the directions of the swivel axes that are likely.
        covariance: Covariance that radii of this size add to the parameters, in their order and units, (p, p).
    """

    radii: dict[str, float]
    covariance: np.ndarray


def missing_pulleys(solved: Solved) -> MissingPulleys | None:
    """Return the pulleys that a fit at known poses lacks, or None without evidence."""
    of, state = solved.model, solved.fit.state
    known = of.measurements.carrier_poses is None and of.robot.fixed_lengths is None and not of.size_is_open
    known = known and {"anchors", "offsets"} <= {*of.parameters.groups} and np.isfinite(solved.noise.excess)
    if not known or of.robot.pulley_radii.any():
        return None
    if len(of.measurements) > MOST_SAMPLES:
        rows = np.linspace(0, len(of.measurements) - 1, MOST_SAMPLES).astype(int)
        of, state = of.only(rows), state.only(rows)
    tried = {text: _likeliest(solved, of, state, robot) for text, robot in _with_pulleys(of.robot).items()}
    likely = max(gain for gain, _, _ in tried.values())
    if not likely >= CERTAIN:  # or nan
        return None
    tried = {text: one for text, one in tried.items() if one[0] > max(likely - CERTAIN, 0.0)}
    scale = metric(of)[of.parameters.varies]
    roots = [np.exp((gain - likely) / 2) * radius * moved / scale[:, None] for gain, radius, moved in tried.values()]
    radii = {text: radius for text, (_, radius, _) in sorted(tried.items(), key=lambda one: -one[1][0])}
    return MissingPulleys(radii, np.sum([root @ root.T for root in roots], axis=0))


def _with_pulleys(robot: Robot) -> dict[str, Robot]:
    """Return the robot with tiny pulleys, by the direction of their swivel axes."""
    turned, _ = Parameters(robot, ()).carriers
    away, one = np.where(robot.home_anchors < robot.home[:3], -1.0, 1.0), np.ones(robot.m)
    found: dict[bytes, tuple[str, Robot]] = {}
    for k, word in enumerate("xyz"):
        ways = {"": one, "-": -one, "away from the platform along ": away[:, k], "towards it along ": -away[:, k]}
        for text, signs in ways.items():
            axes = signs[:, None] * turned[:, k]  # of {G} in the frames of the carriers
            pulleys = [Pulley(radius=TINY, axis=axis) for axis in axes.tolist()]
            pairs = zip(robot.cables, pulleys, strict=True)
            cables = tuple(cable.model_copy(update={"pulley": pulley}) for cable, pulley in pairs)
            found.setdefault(axes.tobytes(), (f"{text}{word}", robot.model_copy(update={"cables": cables})))
    return dict(found.values())


def _likeliest(solved: Solved, of: Model, state: State, robot: Robot) -> tuple[float, float, np.ndarray]:
    """Return the logarithm of the ratio of likelihoods, the radius [m], and g for each cable's radius, (p, m)."""
    seen, noise = solved.observability, inflation_of(solved.noise)
    groups = tuple(name for name in GROUPS if name in (*of.parameters.groups, "radii"))
    whole = replace(of, parameters=replace(of.parameters, robot=robot, groups=groups))
    x = state.x.copy()
    whole.parameters.table(x)[:, 8] = TINY
    equations = NormalEquations.at(whole, state._replace(x=x), metric(whole))
    free = of.parameters.varies[whole.parameters.varies]
    axes = np.linalg.eigh(seen.inverse)[1][:, len(seen.inverse) - seen.rank :]
    S, across = equations.S[np.ix_(free, free)], equations.S[np.ix_(free, ~free)]
    inverse = axes @ np.linalg.inv(axes.T @ S @ axes) @ axes.T
    moved = inverse @ across
    information = float((equations.S[np.ix_(~free, ~free)] - across.T @ moved).sum()) / noise
    toward = -float((equations.b[~free] - moved.T @ equations.b[free]).sum()) / noise
    # The file's anchors, without motions of all together; a prior has made them a part of the fit already.
    own = Parameters(of.robot, ("anchors",)).varies
    own = np.concatenate([own, np.zeros(len(state.x) - len(own), dtype=bool)])
    rigid = np.array([change[own] for _, change in islice(generators(of.parameters, state), GAUGES)])
    change, own = (state.x - of.parameters.first)[own], own[of.parameters.varies]
    values, Q = np.linalg.eigh(noise * inverse[np.ix_(own, own)])
    Q = Q[:, (values > OBSERVABLE * values[-1]) & ("anchors" not in of.prior)]
    left, sizes, _ = np.linalg.svd(Q.T @ rigid.T)
    Q = Q @ left[:, int((sizes > OBSERVABLE * sizes.max(initial=0.0)).sum()) :]
    values, turn = np.linalg.eigh(Q.T @ (noise * inverse[np.ix_(own, own)]) @ Q)
    c, g = ((Q @ turn).T @ one for one in (change, moved[own].sum(axis=1)))
    w = np.maximum(values, 0.0) + (ERRORS[:, None] * length_of(of.robot)) ** 2
    without = -(np.log(w) + c**2 / w).sum(axis=1) / 2
    information, toward = information + (g**2 / w).sum(axis=1), toward + (g * c / w).sum(axis=1)
    radii = np.clip(toward / np.maximum(information, TINY), 0.0, LARGEST * length_of(of.robot))
    logs = without + radii * toward - radii**2 * information / 2
    k = int(np.argmax(logs))
    return float(logs[k] - without.max()), float(radii[k]), moved
