"""`settled`: fit poses with fixed parameters, each with its own step length."""

import numpy as np

from .model import Model, State
from .normal_equations import pose_steps

MOST_STEPS = 10
SHORTER = 0.25  # of the last step of a pose that fitted worse


def settled(model: Model, state: State, negligible: float) -> State:
    """Return the state with better poses, until the decrease of each sample's sum of squares is negligible."""
    share = np.ones(len(state.shift))
    for _ in range(MOST_STEPS):
        dq, expected, before = pose_steps(model, state)
        moves = expected > negligible
        if not moves.any():
            break
        tried = model.moved(state, np.zeros_like(state.x), np.where(moves, share, 0.0)[:, None] * dq)
        after = model.residuals(tried).of_samples
        better = after <= before
        share = np.where(better, 1.0, SHORTER * share)
        state = State(state.x, *(np.where(better, a.T, b.T).T for a, b in zip(tried[1:], state[1:], strict=True)))
    return state
