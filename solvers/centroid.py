"""Method "centroid": the centre of gravity of the feasible tensions."""

from typing import Any, ClassVar

from .feasible_polytope import corners, simplex_centroid
from .method import Method, Proposal
from .standard_form import StandardForm

__all__ = ["Centroid"]


class Centroid(Method):
    """Barycentre of the feasible polygon; of the interval for m - rank = 1, of the polytope beyond 2.

    Existence: wherever the problem is feasible and the feasible tensions are bounded; failed if they are unbounded (a
    missing limit). With w on the very boundary and m - rank > 2 it is the nearest to t_ref instead. Continuous while
    the feasible tensions have an interior, and where they shrink to a point. Far from the limits: the safest choice
    against slack, at the price of high tensions. Cost: pairs of lines for a polygon; Qhull and a linear program beyond
    m - rank = 2, which is slow. Outside the feasible set: a certificate. The centroid is that of the tensions
    themselves whatever t_ref and weights.
    """

    name: ClassVar[str] = "centroid"
    guarantee: ClassVar[str] = (
        "the centroid of the feasible tensions, continuous; failed if they are unbounded, certificate if there are none"
    )
    source: ClassVar[str] = (
        "L. Mikelsons et al., ICRA 2008; J. Lamaury, M. Gouttefarde, Cable-Driven Parallel Robots 2013"
    )
    exact: ClassVar[bool] = True
    continuous: ClassVar[bool] = True

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Take the centroid of the corners in the null space."""
        points = corners(form)
        if points is None:
            return Proposal(None, detail="the feasible tensions have no centroid: unbounded", final=True)
        if points.shape[0] == 0:
            return Proposal(None, detail="the limits enclose nothing")
        return Proposal(form.b @ form.Q + simplex_centroid(points) @ form.N, points.shape[0])
