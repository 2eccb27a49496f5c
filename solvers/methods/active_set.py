"""Method "active-set": the bounded quadratic program by our own null-space kernel."""

from .daqp import Daqp


class ActiveSet(Daqp):
    """Weighted least squares to t_ref inside the limits, by a dual active-set method in the null space.

    `solve` runs the C core, `towline.solvers.core`, if towline was installed where there is a C compiler. Without it a
    kernel of our own runs as plain Python, some 0.4 ms a call, until a process has lost more time to that than loading
    its machine code takes; a control loop calls `compiled.load()` first. What either is not sure of goes to the daqp
    package and is judged as the other methods are.
    """

    name = "active-set"
    source = (
        "null space: Golub and Van Loan, Matrix Computations, 5.4; D. Goldfarb, A. Idnani, Math. Program. 27, 1983; "
        "R. Seidel, Discrete Comput. Geom. 6, 1991"
    )
