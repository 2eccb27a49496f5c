"""`settled`: fit poses with fixed parameters, each with its own step length."""

import numpy as np

from .model import Model, State
from .normal_equations import pose_steps

MOST_STEPS = 10
SHORTER = 0.25  # of the last step of a pose that fitted worse


def settled(model: Model, state: State, negligible: float) -> State:
    """Return the state with better poses, until the decrease of each sample's sum of squares is negligible."""
    share = np.ones(len(state.shift))
    residuals, derivatives = model.linearised(state)
    for _ in range(MOST_STEPS):
        dq, expected = pose_steps(model, residuals, derivatives)
        moves = expected > negligible
        if not moves.any():
            break
        tried = model.moved(state, np.zeros_like(state.x), np.where(moves, share, 0.0)[:, None] * dq)
        after = model.linearised(tried)
        better = after[0].of_samples <= residuals.of_samples
        share = np.where(better, 1.0, SHORTER * share)
        if better.all():
            state, (residuals, derivatives) = tried, after
        else:
            kept = (np.where(better, a.T, b.T).T for a, b in zip(tried[1:], state[1:], strict=True))
            state = State(state.x, *kept)
            residuals, derivatives = model.linearised(state)
    return state
