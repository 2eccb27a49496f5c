"""The optimum when w is on the boundary of the available wrench set, where rounding decides between yes and no.

There the feasible tensions have no interior, and an error of 1e-16 in A or w makes an exact method see none. `solve`
comes here if the method has no solution and no certificate explains it.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from . import compiled
from .direct_daqp import bounded_least_norm
from .problem import TensionProblem
from .projection import project
from .standard_form import StandardForm

__all__ = ["careful_candidates"]

# How far the limits move outwards, in units of s; every tension is put back inside its limits afterwards, so this much
# wrench error remains.
_SLACKS = (1e-13, 1e-12, 1e-11, 1e-10)


def careful_candidates(problem: TensionProblem, form: StandardForm) -> Iterator[NDArray[np.float64]]:
    """Yield points s, shape (k,), that give the available wrench nearest to w, the best first.

    The projection of w is available without doubt, its tensions are at hand, and limits moved outwards by a hair
    give even an exact method something to find. Where the weights are eleven decades apart the daqp package finds
    nothing there either, although w may be far from the boundary: then our own kernel may.
    """
    nearest = _nearest_available(problem, form)
    b = form.Q @ nearest
    for slack in _SLACKS:
        upper, lower = np.append(form.upper + slack, b), np.append(form.lower - slack, b)
        s = bounded_least_norm(upper, lower, form.Q, equalities=b.size).s
        if s is not None:
            yield s
    for side in (form.b, b):
        s = _by_kernel(form, side)
        if s is not None:
            yield s
    yield nearest


def _nearest_available(problem: TensionProblem, form: StandardForm) -> NDArray[np.float64]:
    """Return an s, shape (k,), inside the limits that gives the available wrench nearest to w, whatever its cost."""
    return (project(problem)[0] - form.origin)[form.moving] / form.unit


def _by_kernel(form: StandardForm, b: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the s of least norm with Q s = b inside the limits, shape (k,), if the kernel finds it."""
    rank, k = form.Q.shape
    if rank == 0:
        return None
    packed = np.concatenate([form.Q.ravel(), b, form.lower, form.upper, np.zeros(k), np.ones(k), [1.0]])
    s = np.empty(k)
    return s if compiled.solve_packed(packed, rank, k, s) == 0 else None
