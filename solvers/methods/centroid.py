"""Method "centroid": the centre of gravity of the feasible tensions, which the field calls barycentric."""

from typing import Any

from .method import Method, Proposal, StandardForm
from .numerics.feasible_polytope import corners, simplex_centroid

# Largest m - rank that is taken: the hull of the corners takes 0.2 ms in three dimensions, 7 ms in five, 0.25 s in six
# and minutes in eight.
_MOST = 5


class Centroid(Method):
    """Barycentric distribution: the centroid of the feasible polygon.

    For m - rank = 1 it is the middle of an interval, for 3 to 5 the centroid of a polytope. Existence: wherever the
    problem is feasible and the feasible tensions are bounded; failed if they are unbounded (a missing limit), and at
    once if m - rank > 5. Continuous, also where the feasible tensions lose their interior (w on the very boundary). Far
    from the limits: the safest choice against slack, at the price of high tensions. Cost: pairs of lines for a polygon;
    Qhull and a linear program, 2 ms to 10 ms, beyond. Outside the feasible set: a certificate. The centroid does not
    depend on t_ref and weights.
    """

    name = "centroid"
    guarantee = (
        "barycentric: the centroid of the feasible tensions, continuous in w; fails if they are unbounded or "
        "m - rank > 5"
    )
    source = (
        "L. Mikelsons et al., ICRA 2008; J. Lamaury, M. Gouttefarde, Cable-Driven Parallel Robots 2013; "
        "M. Gouttefarde, J. Lamaury, C. Reichert, T. Bruckmann, IEEE Trans. Robotics 31(6), 2015"
    )
    exact = True
    continuous = True

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Take the centroid of the corners in the null space."""
        freedom = form.N.shape[0]
        if freedom > _MOST:
            detail = f"m - rank is {freedom}, and a centroid is costly beyond {_MOST}; analytic-centre takes any"
            return Proposal(None, detail=detail, final=True)
        points = corners(form)
        if points is None:
            return Proposal(None, detail="the feasible tensions have no centroid: unbounded", final=True)
        if points.shape[0] == 0:
            return Proposal(None, detail="the limits enclose nothing")
        return Proposal(form.b @ form.Q + simplex_centroid(points) @ form.N, points.shape[0])
