"""`missing_pulleys`: whether cables seem to run over pulleys that the robot's file lacks, and what these would change.

A cable that comes to the anchor along a swivel axis and runs over a pulley of radius r is longer than one from a point
by about r (t - sin t), with the angle t between the cable and the axis. Displaced anchors and offsets absorb nearly all
of this, so the residuals remain small, and the anchors are wrong by more than r. With the normal matrix S of the fitted
parameters f and the radii, the fit is displaced by g r, where g = S_ff^-1 S_fr. If all pulleys are equal, r follows
from the residuals that are not absorbed, and from the anchors: with the covariance V of the fit and the variance s^2 of
the file's errors, these differ from the file by N(g r, V + s^2), up to a rigid motion of all together.

Few logs decide this: files with errors of 30 mm hide pulleys of 20 mm, which displace anchors by 50 mm. So errors have
a mixture of two distributions, by the probability of pulleys given the log (Bayesian model averaging), if a fifth of
all files lack them, the usual directions of the axes are equally frequent, and so are values of log r and log s. The
covariance is that of the normal distribution with the same 95 % limits.
"""

from dataclasses import replace
from itertools import islice
from typing import NamedTuple

import numpy as np
from scipy.linalg import null_space
from scipy.special import ndtr, ndtri

from ...models.cable import Pulley
from ...models.robot import Robot
from .geometry import length_of
from .model import Model, State
from .normal_equations import NormalEquations, metric
from .observability import generators
from .parameters import GROUPS, Parameters
from .solving import Solved, inflation_of

LACKING = 0.2  # of the files
OUTSIDE = 0.05  # of the errors, may be beyond the limits that a covariance means
LIKELY = 0.9  # probability, below which there may be no pulleys
ALSO = 0.02  # times the probability of the likeliest direction of the axes
RADII = np.geomspace(1e-3, 0.05, 60)  # of the cables' length
ERRORS = np.geomspace(1e-4, 0.1, 100)  # of the file's anchors, relative to the cables' length
TINY = 1e-10  # [m], radius at which derivatives by the radius are those of a point
OBSERVABLE = 1e-6  # of the largest variance, or of the longest common motion
GAUGES = 6  # rigid motions of all anchors
MOST_SAMPLES = 6000


class MissingPulleys(NamedTuple):
    """Pulleys that the file of a robot may lack.

    Attributes:
        radii: Expected radii [m], by the directions of the swivel axes that are likely; empty if there may be none.
        covariance: Covariance that pulleys add to the parameters, in their order and units, (p, p).
        information: As in `Noise`, (p, p), with this covariance.
    """

    radii: dict[str, float]
    covariance: np.ndarray
    information: np.ndarray


def missing_pulleys(solved: Solved) -> MissingPulleys | None:
    """Return the pulleys that the file may lack, or None if it has some or the log cannot show any."""
    of, state = solved.model, solved.fit.state
    known = of.measurements.carrier_poses is None and of.robot.fixed_lengths is None and not of.size_is_open
    known = known and {"anchors", "offsets"} <= {*of.parameters.groups} and np.isfinite(solved.noise.excess)
    if not known or of.robot.pulley_radii.any():
        return None
    if len(of.measurements) > MOST_SAMPLES:
        rows = np.linspace(0, len(of.measurements) - 1, MOST_SAMPLES).astype(int)
        of, state = of.only(rows), state.only(rows)
    found = {text: _evidence(solved, of, state, robot) for text, robot in _with_pulleys(of.robot).items()}
    logs = np.array([log for log, *_ in found.values()])
    logs += np.log(LACKING / (1 - LACKING) / len(found))
    shares = np.exp(logs - np.logaddexp(0.0, np.logaddexp.reduce(logs)))
    share, radii = float(shares.sum()), dict[str, float]()
    for k in np.argsort(-shares) if share > LIKELY else ():
        if shares[k] > ALSO * shares.max():
            text, (_, radii[text], _) = list(found.items())[k]
    roots = np.hstack([np.sqrt(own / share) * root for own, (_, _, root) in zip(shares, found.values(), strict=True)])
    values, axes = np.linalg.eigh(solved.noise.covariance)
    axes = (axes * np.sqrt(np.maximum(values, 0.0)))[:, len(values) - solved.observability.rank :]
    values, turn = np.linalg.eigh(np.linalg.pinv(axes) @ roots @ roots.T @ np.linalg.pinv(axes).T)
    root = axes @ turn * np.sqrt(_widened(share, np.maximum(values, 0.0)) - 1)
    known = solved.noise.information @ root
    information = solved.noise.information - known @ np.linalg.solve(np.eye(root.shape[1]) + root.T @ known, known.T)
    root /= metric(of)[of.parameters.varies, None]
    return MissingPulleys(radii, root @ root.T, information)


def _widened(share: float, added: np.ndarray) -> np.ndarray:
    """Return variances of normal distributions with the 95 % limits of mixtures.

    These have the variance 1, and a `share` of them that of pulleys `added`, (n,).
    """
    wide = np.sqrt(1 + added)
    limits = np.geomspace(1.0, wide, 400) * ndtri(1 - OUTSIDE / 2)
    outside = 2 * (1 - share) * ndtr(-limits) + 2 * share * ndtr(-limits / wide)
    found = [np.interp(-OUTSIDE, -one, limit) for one, limit in zip(outside.T, limits.T, strict=True)]
    return (np.array(found) / ndtri(1 - OUTSIDE / 2)) ** 2


def _with_pulleys(robot: Robot) -> dict[str, Robot]:
    """Return the robot with tiny pulleys, by the direction of their swivel axes."""
    turned, _ = Parameters(robot, ()).carriers
    away, one = np.where(robot.home_anchors < robot.home[:3], -1.0, 1.0), np.ones(robot.m)
    found: dict[bytes, tuple[str, Robot]] = {}
    for k in np.flatnonzero(robot.dof_mask[:3]):  # along the others, pulleys would have the effect of offsets
        word = "xyz"[k]
        ways = {"": one, "-": -one, "away from the platform along ": away[:, k], "towards it along ": -away[:, k]}
        for text, signs in ways.items():
            axes = signs[:, None] * turned[:, k]  # of {G} in the frames of the carriers
            pulleys = [Pulley(radius=TINY, axis=axis) for axis in axes.tolist()]
            pairs = zip(robot.cables, pulleys, strict=True)
            cables = tuple(cable.model_copy(update={"pulley": pulley}) for cable, pulley in pairs)
            found.setdefault(axes.tobytes(), (f"{text}{word}", robot.model_copy(update={"cables": cables})))
    return dict(found.values())


def _evidence(solved: Solved, of: Model, state: State, robot: Robot) -> tuple[float, float, np.ndarray]:
    """Return what a log says about pulleys with some axes.

    These are the logarithm of the ratio of likelihoods, the expected radius [m], and a root (p, m) of the covariance
    that such pulleys add.
    """
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
    each = (equations.S[np.ix_(~free, ~free)] - across.T @ moved) / noise
    information = float(each.sum())
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
    radii = RADII * length_of(of.robot)
    logs = without + np.multiply.outer(radii, toward) - np.multiply.outer(radii**2, information / 2)
    likelihoods = np.exp(logs - logs.max()).sum(axis=1)
    ratio = logs.max() - without.max() + np.log(likelihoods.mean() / np.exp(without - without.max()).sum())
    expected = likelihoods / likelihoods.sum()
    # Radii and axes of single cables differ by as much as the residuals allow.
    square, others = float(expected @ radii**2), np.asarray(null_space(np.ones((1, len(each)))))
    values, turn = np.linalg.eigh(others.T @ each @ others)
    differences = others @ turn / np.sqrt(np.maximum(values, 0.0) + 1 / square)
    root = np.column_stack([np.full(len(each), np.sqrt(square)), differences])
    return float(ratio), float(expected @ radii), moved @ root
