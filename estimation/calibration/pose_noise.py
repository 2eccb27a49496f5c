"""`seeming_information`: what the noise of unknown poses seems to tell of the parameters, and `steadied` against it.

A platform that never turns, for example, does not tell how its attachments are turned. Its estimated orientations
differ by their noise, though, so derivatives by parameters differ between them as if the platform turned.
With sigma points q + c_j, where the c_j add up to zero and all c_j c_j' to the covariance of an estimated pose q, the
normal matrix S of such derivatives exceeds the one at the true poses by

    B = sum_j S(q + c_j) - S(q)

on average, to second order (simulation extrapolation, SIMEX). The fewest such points are the corners of a regular
simplex, one more than coordinates; each pose has its own or, at random, the opposite one, so that terms of third order
average out. A minimum of the sum of squares is then as uncertain as (S - B)^-1 S (S - B)^-1: the sum itself has the
curvature S - B, and its gradient at the truth the covariance S.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.linalg import helmert

from .model import Model, State
from .normal_equations import NormalEquations, metric
from .observability import Observability, observability

MANY = 2000  # samples; with more, pairs of opposite random points suffice, because their errors average out
PAIRS = 2


def seeming_information(model: Model, state: State, equations: NormalEquations, scale: np.ndarray) -> np.ndarray:
    """Return B, (p, p) [1/m^2], of the `equations` at a state; zero if all poses were measured."""
    B, root = np.zeros_like(equations.S), equations.inverse_root
    if root is None or not B.size or not model.has_unknown_poses:
        return B
    for point in _sigma_points(model, *root.shape[:2]):
        dq = np.einsum("nji,nj->ni", root, point) * model.poses_vary
        moved = model.moved(state, np.zeros_like(state.x), dq)
        B += NormalEquations.at(model, moved, scale).S - equations.S
    return B


def _sigma_points(model: Model, count: int, size: int) -> Iterator[np.ndarray]:
    """Yield changes of all poses, (N, 6) in standard deviations, whose products add up to the identity for each."""
    random = np.random.default_rng(0)
    if count > MANY:
        for _ in range(PAIRS):
            point = random.choice((-1.0, 1.0), (count, size)) / np.sqrt(2 * PAIRS)
            yield from (point, -point)
        return
    varied = np.flatnonzero(model.poses_vary.any(axis=0))
    side = random.choice((-1.0, 1.0), (count, 1))
    for corner in helmert(len(varied) + 1).T:
        point = np.zeros((count, size))
        point[:, varied] = side * corner
        yield point


def observed(model: Model, state: State, length: float) -> Observability:
    """Return the observability at a state; `length` is the length of the cables [m]."""
    equations = NormalEquations.at(model, state, scale := metric(model))
    B = seeming_information(model, state, equations, scale)
    return observability(equations.S, B, model.parameters, state, scale, length, model.kept_rows)


def steadied(model: Model, state: State, length: float) -> tuple[Model, State]:
    """Return the model that keeps the file's values where little but noise tells otherwise, and the state moved there.

    The sum of squares is flat along such directions: noise would move the parameters far. A prior holds them, too.
    """
    if model.prior or not (noise := observed(model, state, length).noise).size:  # directions (p, d)
        return model, state
    scale, varies = metric(model), model.parameters.varies
    rows, dx = np.zeros((noise.shape[1], model.parameters.count)), np.zeros_like(state.x)
    rows[:, varies] = noise.T * scale[varies]
    dp = -noise @ (rows @ (state.x - model.parameters.first))
    dx[varies] = dp / scale[varies]
    return replace(model, kept=rows), model.moved(state, dx, NormalEquations.at(model, state, scale).poses_after(dp))
