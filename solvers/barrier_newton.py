r"""Newton's method for a point inside the limits: least of a square and logarithms of the distances to the limits.

.. math::

    \min_s \; \frac{c}{2} |s|^2 - \mu \sum_i \big( \log (s_i - lower_i) + \log (upper_i - s_i) \big)
    \quad \text{s.t.} \quad Q s = b

The infeasible-start Newton method (Boyd and Vandenberghe 2004, section 10.3) needs no point that gives w to begin with,
so the last answer along a motion will do. Should it get stuck, a linear program finds a point to start from, from where
damped steps cannot fail: the function is self-concordant.
"""

import numpy as np
from numpy.typing import NDArray

from .linear_programs import optimise
from .method import Proposal
from .standard_form import StandardForm

__all__ = ["barrier_point"]

Array = NDArray[np.float64]

_STEPS = 60
_DAMPED_STEPS = 300

# Squared Newton decrement, in units of mu, below which the next full step would change nothing that counts.
_CONVERGED = 1e-22

# Error in Q s = b that is rounding.
_ON_PLANE = 1e-14

# Of the way to the nearest limit, what a step may go.
_FRACTION = 0.99


def barrier_point(form: StandardForm, square: float, mu: float, start: Array | None) -> Proposal:
    """Find the minimiser.

    Parameters
    ----------
    form :
        The problem.
    square :
        c, 0 or 1. With 0 the feasible tensions must be bounded.
    mu :
        Weight of the logarithms.
    start :
        Where to begin, shape (k,), anywhere; None = in the middle of the limits.
    """
    s = _pulled_inside(form, start)
    found, used = _infeasible_start(form, square, mu, s)
    if found is not None:
        return Proposal(found, used)
    s = _interior_point(form)
    if s is None:
        return Proposal(None, used, "the feasible tensions have no interior")
    found, more = _damped(form, square, mu, s)
    if found is None:
        return Proposal(None, used + more, "the feasible tensions are unbounded: no centre", final=True)
    return Proposal(found, used + more)


def _pulled_inside(form: StandardForm, start: Array | None) -> Array:
    """Return a point strictly inside the limits, near `start` if there is one."""
    lower, upper = form.lower, form.upper
    room = np.minimum(upper - lower, 2.0)
    if start is None:
        both = np.isfinite(lower) & np.isfinite(upper)
        middle = 0.5 * np.where(both, lower, 0.0) + 0.5 * np.where(both, upper, 0.0)
        start = np.where(both, middle, np.minimum(np.maximum(lower + 0.5, 0.0), upper - 0.5))
        # Of a range much wider than the load, the middle is far from everything.
        start = np.minimum(np.maximum(start, -2.0 + np.maximum(lower, 0.0)), 2.0 + np.maximum(lower, 0.0))
    return np.minimum(np.maximum(start, lower + 1e-3 * room), upper - 1e-3 * room)


def _slopes(form: StandardForm, square: float, mu: float, s: Array) -> tuple[Array, Array]:
    """Return gradient and (diagonal) Hessian, both (k,)."""
    below, above = 1.0 / (s - form.lower), 1.0 / (form.upper - s)
    return square * s + mu * (above - below), square + mu * (above**2 + below**2)


def _newton_step(form: StandardForm, gradient: Array, hessian: Array, error: Array) -> tuple[Array, Array]:
    """Return the step, (k,), and the multipliers after it, (r,)."""
    root = 1.0 / np.sqrt(hessian)
    M = form.Q * root  # (r, k)
    # M^T has full column rank; its QR loses half the digits that M M^T would.
    orthogonal, triangle = np.linalg.qr(M.T)
    scaled = gradient * root
    y = np.linalg.solve(triangle.T, error) if error.size else error
    along = orthogonal @ (y + orthogonal.T @ scaled)
    multipliers = -np.linalg.solve(triangle, y + orthogonal.T @ scaled) if error.size else error
    return root * (along - scaled), np.asarray(multipliers, dtype=np.float64)


def _infeasible_start(form: StandardForm, square: float, mu: float, s: Array) -> tuple[Array | None, int]:
    """Take Newton steps on the optimality conditions, halved until their error falls."""
    multipliers = np.zeros(form.b.size)

    def error_at(s: Array, multipliers: Array) -> float:
        gradient, _ = _slopes(form, square, mu, s)
        dual, primal = gradient + multipliers @ form.Q, form.Q @ s - form.b
        return float(np.sqrt(dual @ dual / mu + primal @ primal))

    for iteration in range(_STEPS):
        gradient, hessian = _slopes(form, square, mu, s)
        left = form.b - form.Q @ s
        step, target = _newton_step(form, gradient, hessian, left)
        if step @ (hessian * step) <= _CONVERGED * mu and left @ left <= _ON_PLANE**2:
            return s + step, iteration
        length = min(1.0, _FRACTION * _way_to_limits(form, s, step))
        now = error_at(s, multipliers)
        for _ in range(40):
            ahead = s + length * step, multipliers + length * (target - multipliers)
            if error_at(*ahead) <= (1.0 - 0.01 * length) * now or now < 1e-12:
                break
            length *= 0.5
        else:
            # Rounding is all that is left, or nothing leads on from here.
            done = step @ (hessian * step) <= 1e-16 * mu and left @ left <= 1e-24
            return (s + step if done else None), iteration
        s, multipliers = ahead
    return None, _STEPS


def _damped(form: StandardForm, square: float, mu: float, s: Array) -> tuple[Array | None, int]:
    """Take damped Newton steps from a point inside that gives w: always downhill, never outside."""
    for iteration in range(_DAMPED_STEPS):
        gradient, hessian = _slopes(form, square, mu, s)
        left = form.b - form.Q @ s
        step, _ = _newton_step(form, gradient, hessian, left)
        decrement = float(np.sqrt(step @ (hessian * step) / mu))
        if decrement**2 <= max(_CONVERGED, 1e-18):
            # One step more costs nothing and squares the error.
            return s + step, iteration
        length = 1.0 if decrement < 0.25 else 1.0 / (1.0 + decrement)
        s = s + min(length, _FRACTION * _way_to_limits(form, s, step)) * step
    return None, _DAMPED_STEPS


def _way_to_limits(form: StandardForm, s: Array, step: Array) -> float:
    """Return how many steps it is to the first limit."""
    room = np.where(step > 0, form.upper - s, s - form.lower)
    moving = step != 0.0
    return float((room[moving] / np.abs(step[moving])).min(initial=np.inf))


def _interior_point(form: StandardForm) -> Array | None:
    """Return a point as far inside the limits as a linear program finds one, or None."""
    k = form.lower.size
    # Of wide ranges, a unit of s is room enough.
    room = np.minimum(form.upper - form.lower, 1.0)[:, None]
    rows = np.block([[-np.eye(k), room], [np.eye(k), room]])
    found = optimise(form, np.r_[np.zeros(k), -1.0], rows, np.r_[-form.lower, form.upper], nonnegative=True, most=0.5)
    if found.s is None:
        return None
    share = (np.minimum(found.s - form.lower, form.upper - found.s) / room[:, 0]).min(initial=1.0)
    return found.s if share > 1e-9 else None
