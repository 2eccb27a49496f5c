"""The optimum when w is on the boundary of the available wrench set, where rounding decides between yes and no.

There the feasible tensions have no interior, and an error of 1e-16 in A or w makes an exact method see none. `solve`
comes here if the method found nothing and no certificate says why.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from .direct_daqp import bounded_least_norm
from .problem import TensionProblem
from .projection import project
from .standard_form import StandardForm

__all__ = ["boundary_candidates"]

# How much the limits give way, in units of s; every tension is put back inside its limits afterwards, so this much
# wrench error remains.
_ROOM = (1e-13, 1e-12, 1e-11, 1e-10)


def boundary_candidates(problem: TensionProblem, form: StandardForm) -> Iterator[NDArray[np.float64]]:
    """Yield points s, shape (k,), that give the available wrench nearest to w, the best first.

    The projection of w is available without doubt, its tensions are at hand, and limits with a hair of room around
    them give even an exact method something to find. Those tensions themselves, not of least norm, come last.
    """
    nearest = (project(problem)[0] - form.origin)[form.moving] / form.unit
    b = form.Q @ nearest
    for room in _ROOM:
        upper, lower = np.append(form.upper + room, b), np.append(form.lower - room, b)
        s = bounded_least_norm(upper, lower, form.Q, equalities=b.size).s
        if s is not None:
            yield s
    yield nearest
