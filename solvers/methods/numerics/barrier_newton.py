r"""Newton's method for a point inside the limits: least of a square and logarithms of the distances to the limits.

$$
\min_s \; \frac{c}{2} |s|^2 - \mu \sum_i \big( \log (s_i - lower_i) + \log (upper_i - s_i) \big)
\quad \text{s.t.} \quad Q s = b
$$

Far from the solution the plain Newton method crawls along the limits: with w not met yet, or with weights that differ
by thousands, hundreds of short steps. So primal-dual steps (Wright 1997, chapter 5), in which each distance to a limit
has a multiplier of its own, lead from any point, the last solution along a motion if there is one, to where plain
Newton steps converge at once. Should they get stuck, a linear program finds a point to start from, from where damped
steps cannot fail: the function is self-concordant (Boyd and Vandenberghe 2004, section 9.6).
"""

from typing import NamedTuple

import numpy as np

from ..method import Array, Proposal, StandardForm
from .linear_program import deepest

_STEPS = 50
_DAMPED_STEPS = 300

# Squared Newton decrement, in units of mu, below which the next full step would change nothing that counts.
_CONVERGED = 1e-18

# A decrement below this squares with each step; one that does not fall is rounding, of tensions next to their limits.
_ROUNDING = 1e-3

# Error in Q s = b from which on plain Newton steps take over.
_ON_PLANE = 1e-10

# How far, relative to mu, the products of distance and multiplier may be from mu when plain Newton steps take over.
_CENTRED = 0.5

# By how much one step may lower the products of distance and multiplier, towards mu.
_REDUCTION = 0.05

# The share of the distance to the nearest limit that a step may go.
_FRACTION = 0.99

# A distance to a limit, in units of s, that rounding may cancel.
_NO_SPACE = 1e-13

# In units of s, which is of order one: a minimiser out here means that there is none.
_FAR = 1e9


def barrier_point(form: StandardForm, square: float, mu: float, start: Array | None) -> Proposal:
    """Find the minimiser.

    - `form`: the problem.
    - `square`: c, 0 or 1. With 0 the feasible tensions must be bounded.
    - `mu`: weight of the logarithms.
    - `start`: where to begin, shape (k,), anywhere; None = in the middle of the limits.
    """
    if not form.lower.size:
        return Proposal(np.zeros(0))
    near, used = _primal_dual(form, square, mu, _pulled_inside(form, start), warm=start is not None)
    if near is not None:
        point, more = _damped(form, square, mu, near)
        used += more
        if point is not None:
            return Proposal(point, used)
    # As far inside the limits as a linear program finds a point; in wide ranges, one unit of s is enough.
    inner, share = deepest(form, np.minimum(form.upper - form.lower, 1.0), most=0.5)
    if inner.s is None or share <= 1e-9:
        return Proposal(None, used, "the feasible tensions have no interior")
    point, more = _damped(form, square, mu, inner.s)
    if point is None and square == 0.0:
        return Proposal(None, used + more, "the feasible tensions are unbounded: no centre", final=True)
    return Proposal(point, used + more, "" if point is not None else f"not converged in {_DAMPED_STEPS} Newton steps")


def _pulled_inside(form: StandardForm, start: Array | None) -> Array:
    """Return a point strictly inside the limits, near `start` if there is one."""
    lower, upper = form.lower, form.upper
    space = np.minimum(upper - lower, 2.0)
    if start is None:
        both = np.isfinite(lower) & np.isfinite(upper)
        middle = 0.5 * np.where(both, lower, 0.0) + 0.5 * np.where(both, upper, 0.0)
        start = np.where(both, middle, np.minimum(np.maximum(lower + 0.5, 0.0), upper - 0.5))
        # In a range much wider than the load, the middle is far from everything.
        start = np.minimum(np.maximum(start, -2.0 + np.maximum(lower, 0.0)), 2.0 + np.maximum(lower, 0.0))
    return np.minimum(np.maximum(start, lower + 1e-3 * space), upper - 1e-3 * space)


def _newton_step(form: StandardForm, gradient: Array, hessian: Array, error: Array) -> Array:
    """Return the step, (k,)."""
    root = 1.0 / np.sqrt(hessian)
    scaled = gradient * root
    if not error.size:
        return -root * scaled
    # M^T has full column rank; its QR loses half the digits that M M^T would.
    orthogonal, triangle = np.linalg.qr((form.Q * root).T)  # M = Q root, (r, k)
    along = orthogonal @ (np.linalg.solve(triangle.T, error) + orthogonal.T @ scaled)
    return root * (along - scaled)


class _Iterate(NamedTuple):
    """A point inside the limits, (k,), and the multipliers of its distances to them, (k,) each."""

    s: Array
    at_lower: Array
    at_upper: Array


def _primal_dual(form: StandardForm, square: float, mu: float, s: Array, warm: bool) -> tuple[Array | None, int]:
    """Return a point inside the limits and on Q s = b near the minimiser, or None if it does not come near."""
    below, above = s - form.lower, form.upper - s
    limits = int(np.isfinite(below).sum() + np.isfinite(above).sum())
    # A cold start takes the distances and multipliers of a much larger mu, which then falls step by step.
    product = mu if warm or not limits else max(mu, square * float(np.abs(s).max()) ** 2, 1e-2)
    iterate = _Iterate(s, product / below, product / above)
    for iteration in range(_STEPS):
        iterate = _primal_dual_step(form, square, max(mu, _REDUCTION * product), iterate)
        below, above = iterate.s - form.lower, form.upper - iterate.s
        space = min(float(below.min(initial=np.inf)), float(above.min(initial=np.inf)))
        if not (np.abs(iterate.s).max(initial=0.0) < _FAR and space > _NO_SPACE):
            return None, iteration + 1
        with np.errstate(invalid="ignore"):
            products = np.concatenate([iterate.at_lower * below, iterate.at_upper * above])
        products = products[np.isfinite(products)]
        product = float(products.sum() / limits) if limits else mu
        error = form.b - form.Q @ iterate.s
        if error @ error <= _ON_PLANE**2 and np.abs(products - mu).max(initial=0.0) <= _CENTRED * mu:
            return iterate.s, iteration + 1
    return None, _STEPS


def _primal_dual_step(form: StandardForm, square: float, target: float, iterate: _Iterate) -> _Iterate:
    """Take a step towards Q s = b and products of distance and multiplier that are `target`."""
    s, at_lower, at_upper = iterate
    below, above = s - form.lower, form.upper - s
    gradient = square * s - target / below + target / above
    with np.errstate(invalid="ignore"):
        curve_low, curve_high = np.nan_to_num(at_lower / below), np.nan_to_num(at_upper / above)
    step = _newton_step(form, gradient, square + curve_low + curve_high, form.b - form.Q @ s)
    change_low = target / below - at_lower - curve_low * step
    change_high = target / above - at_upper + curve_high * step
    length = min(1.0, _FRACTION * min(_way_to_limits(form, s, step), _way_to_zero(at_lower, change_low)))
    length = min(length, _FRACTION * _way_to_zero(at_upper, change_high))
    return _Iterate(s + length * step, at_lower + length * change_low, at_upper + length * change_high)


def _damped(form: StandardForm, square: float, mu: float, s: Array) -> tuple[Array | None, int]:
    """Take Newton steps from a point inside that gives w: always downhill, never outside."""
    last = np.inf
    for iteration in range(_DAMPED_STEPS):
        below, above = 1.0 / (s - form.lower), 1.0 / (form.upper - s)
        gradient, hessian = square * s + mu * (above - below), square + mu * (above**2 + below**2)
        step = _newton_step(form, gradient, hessian, form.b - form.Q @ s)
        decrement = float(np.sqrt(step @ (hessian * step) / mu))
        if decrement**2 <= _CONVERGED or last <= decrement < _ROUNDING:
            # One step more costs nothing and squares the error.
            return s + step, iteration
        last = decrement
        if not np.abs(s).max(initial=0.0) < _FAR:
            return None, iteration
        length = min(1.0, _FRACTION * _way_to_limits(form, s, step))
        if decrement > 0.25:
            # 1 / (1 + decrement) always lowers the function; often much more does.
            now = _value(form, square, mu, s)
            while (
                length > 1.0 / (1.0 + decrement)
                and _value(form, square, mu, s + length * step) > now - 0.1 * length * decrement**2 * mu
            ):
                length *= 0.5
        s = s + length * step
    return None, _DAMPED_STEPS


def _value(form: StandardForm, square: float, mu: float, s: Array) -> float:
    """Return the function that is minimised, but for a constant."""
    distances = np.concatenate([s - form.lower, form.upper - s])
    with np.errstate(divide="ignore"):  # infinite where rounding puts a point on a limit
        return 0.5 * square * float(s @ s) - mu * float(np.log(distances[np.isfinite(distances)]).sum())


def _way_to_zero(values: Array, change: Array) -> float:
    """Return how many changes it is until the first of the positive values is zero."""
    falling = change < 0.0
    return float((values[falling] / -change[falling]).min(initial=np.inf))


def _way_to_limits(form: StandardForm, s: Array, step: Array) -> float:
    """Return how many steps it is to the first limit."""
    space = np.where(step > 0, form.upper - s, s - form.lower)
    moving = step != 0.0
    return float((space[moving] / np.abs(step[moving])).min(initial=np.inf))
