"""`seeming_information`: what the noise of unknown poses seems to tell of the parameters, and `steadied` against it.

A platform that never turns, for example, does not tell how its attachments are turned. Its estimated orientations
differ by their noise, though, and the derivatives at them by parameters differ like those of a platform that turns.
With sigma points at plus and minus the columns c_j of a root of the covariance of an estimated pose, the normal matrix
S of such derivatives exceeds the one at the true poses by

    B = 1/2 sum_j S(q + c_j) + S(q - c_j) - 2 S(q)

on average, to second order (simulation extrapolation, SIMEX). A minimum of the sum of squares is then as uncertain as
(S - B)^-1 S (S - B)^-1: the sum itself has the curvature S - B, and its gradient at the truth the covariance S.
"""

from dataclasses import replace

import numpy as np

from .model import Model, State
from .normal_equations import NormalEquations, metric
from .observability import Observability, observability

ONE_BY_ONE = 2000  # samples; more need no sigma points along single axes, because random ones average out
DRAWS = 2


def seeming_information(model: Model, state: State, equations: NormalEquations, scale: np.ndarray) -> np.ndarray:
    """Return B, (p, p) [1/m^2], of the `equations` at a state; zero if all poses were measured."""
    B, root = np.zeros_like(equations.S), equations.inverse_root
    if root is None or not B.size or not np.isinf(model.pose_sigmas).any():
        return B
    count, size = root.shape[:2]
    weights = np.eye(size)[:, None]  # (k, 1 or N, 6), whose sum of w w' is I
    if count > ONE_BY_ONE:
        weights = np.random.default_rng(0).choice((-1.0, 1.0), (DRAWS, count, size)) / np.sqrt(DRAWS)
    for weight in weights:
        dq = np.einsum("nji,nj->ni", root, np.broadcast_to(weight, (count, size))) * model.poses_vary
        if not dq.any():
            continue
        for sign in (1.0, -1.0):
            moved = model.moved(state, np.zeros_like(state.x), sign * dq)
            B += (NormalEquations.at(model, moved, scale).S - equations.S) / 2
    return B


def observed(model: Model, state: State, length: float) -> Observability:
    """Return the observability at a state; `length` is the length of the cables [m]."""
    equations = NormalEquations.at(model, state, scale := metric(model))
    B = seeming_information(model, state, equations, scale)
    return observability(equations.S, B, model.parameters, state, scale, length, model.kept_rows)


def steadied(model: Model, state: State, length: float) -> tuple[Model, State]:
    """Return the model that keeps the file's values where little but noise tells otherwise, and the state moved there.

    The sum of squares is flat along such directions: noise would move the parameters far. A prior holds them, too.
    """
    noise = np.zeros((0, 0)) if model.prior else observed(model, state, length).noise  # (p, d)
    if not noise.size:
        return model, state
    scale, varies = metric(model), model.parameters.varies
    rows, dx = np.zeros((noise.shape[1], model.parameters.count)), np.zeros_like(state.x)
    rows[:, varies] = noise.T * scale[varies]
    dp = -noise @ (rows @ (state.x - model.parameters.first))
    dx[varies] = dp / scale[varies]
    kept = rows if model.kept is None else np.vstack([model.kept, rows])
    return replace(model, kept=kept), model.moved(state, dx, NormalEquations.at(model, state, scale).poses_after(dp))
