r"""Method "p-norm": least p-norm of the weighted distances to t_ref.

$$
\min_t \; \sum_i \big| \sqrt{\omega_i} (t_i - t_{ref,i}) \big|^p
\quad \text{s.t.} \quad A t = w, \; t_{min} \le t \le t_{max}
$$
"""

from typing import Any, ClassVar

import numpy as np

from ...base.inputs import number
from .method import Array, Method, Proposal, StandardForm
from .numerics.least_norm import bounded_least_norm, least_norm

_STEPS = 200

# Least curvature, relative to the largest: at s_i = 0 the p-norm has none and a Newton step no length.
_FLOOR = 1e-6

# Stop when a full step would lower the cost by no more than this part of it.
_CONVERGED = 1e-13


class PNorm(Method):
    """Least p-norm of the tensions' distances to t_ref, between least squares (p = 2) and least maximum (p large).

    Existence: wherever the problem is feasible. Unique, since the p-norm is strictly convex, hence continuous. Gosselin
    and Grenier take t_ref = (t_min + t_max) / 2 and p = 4 and rely on p to stay inside the limits; here they hold
    anyway. Cost: up to tens of quadratic programs (sequential quadratic programming with line search). Where tensions
    equal t_ref the cost is flat and they are exact to about 1e-4 of the largest distance only, the cost to 1e-12.
    Outside the feasible set: a certificate.
    """

    name = "p-norm"
    guarantee = "the unique optimum, continuous in w"
    source = "C. Gosselin, M. Grenier, Meccanica 46(1), 2011; R. Verhoeven, thesis, Duisburg 2004"
    exact = True
    continuous = True
    seeks_reference = True
    options: ClassVar[dict[str, str] | None] = {"p": "exponent, a number from 2 to 20; 4 if not given"}

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Take Newton steps, each a quadratic program, from the least-squares solution."""
        p = number("p", options.get("p", 4), 2, 20)
        first = least_norm(form)
        if first.s is None or not first.s.any() or not len(form.N) or p == 2:
            return first
        s = np.minimum(np.maximum(first.s, form.lower), form.upper)
        for iteration in range(1, _STEPS + 1):
            size = np.abs(s).max()
            part = np.abs(s) / size
            # Cost sum (|s_i| / size)^p / (p (p - 1)), its gradient and curvature, for s / size.
            gradient = np.sign(s) * part ** (p - 1) / (p - 1)
            curvature = np.maximum(part ** (p - 2), _FLOOR)
            step = _newton_step(form, s, gradient * size, curvature)
            if step.s is None:
                return step
            slope = float(gradient @ step.s) / size
            cost = _cost(s, size, p)
            if slope >= -_CONVERGED * cost:
                return Proposal(s, iteration)
            length = 1.0
            while _cost(s + length * step.s, size, p) > cost + 1e-4 * length * slope and length > 1e-10:
                length *= 0.5
            s = np.minimum(np.maximum(s + length * step.s, form.lower), form.upper)
        return Proposal(None, _STEPS, f"not converged in {_STEPS} steps")


def _cost(s: Array, size: float, p: float) -> float:
    return float(((np.abs(s) / size) ** p).sum()) / (p * (p - 1))


def _newton_step(form: StandardForm, s: Array, gradient: Array, curvature: Array) -> Proposal:
    """Minimise gradient . d + sum curvature_i d_i^2 / 2 for d of the null space, s + d inside the limits."""
    half = np.linalg.qr((form.N * np.sqrt(curvature)).T)[1]  # (m - rank, m - rank)
    # In y = half z + shift with d = N^T z the cost is |y|^2 / 2.
    rows = np.asarray(np.linalg.solve(half.T, form.N).T, dtype=np.float64)  # (k, m - rank)
    at = rows @ (rows.T @ gradient)
    program = bounded_least_norm(np.maximum(form.upper - s, 0.0) + at, np.minimum(form.lower - s, 0.0) + at, rows, 0)
    return program if program.s is None else Proposal(rows @ program.s - at)
