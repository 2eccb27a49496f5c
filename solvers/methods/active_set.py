"""Method "active-set": the bounded quadratic program by our own null-space solver."""

from .daqp import Daqp


class ActiveSet(Daqp):
    """Weighted least squares to t_ref inside the limits, by a dual active-set method in the null space.

    `solve` runs the C core, `towline.core`. Where that is not sure, and for problems larger than those it has room for,
    the daqp package proposes and `solve` judges, as with the other methods: some 0.2 ms a call.
    """

    name = "active-set"
    source = (
        "null space: Golub and Van Loan, Matrix Computations, 5.4; D. Goldfarb, A. Idnani, Math. Program. 27, 1983; "
        "R. Seidel, Discrete Comput. Geom. 6, 1991"
    )
