"""The answer: `TensionSolution`, which judges its own tensions, and its `Status`."""

from collections.abc import Callable
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SolverError
from .certificate import Certificate, certificate_along, certify
from .problem import TensionProblem

__all__ = ["Status", "TensionSolution"]


class Status(StrEnum):
    """The status of a solution; the values are plain strings."""

    OPTIMAL = "optimal"
    """The tensions give w inside the limits, within `TensionProblem.tolerance`, and are the method's answer."""

    INFEASIBLE = "infeasible"
    """The limits forbid w; a verified certificate shows along which direction and by how much."""

    SINGULAR = "singular"
    """w has a part outside the range of A: no tensions of either sign give it, whatever the limits. The certificate's
    direction is in the left null space of A and no cable binds. A rank-deficient A alone is not singular in this sense:
    if w is in its range the problem may well be optimal."""

    INACCURATE = "inaccurate"
    """The tensions miss w by more than the tolerance: read `residual` before using them. Either no certificate proves
    that w is out of reach, or one does and the method is one that answers all the same (`Method.always_answers`)."""

    INVALID = "invalid"
    """A row of a batch whose numbers are no problem: NaN, crossed limits, a weight that is not positive. A single
    problem like that is an `InputError`."""

    FAILED = "failed"
    """A back end gave up, or called the problem infeasible and could not be believed, or the method has no answer here
    although other methods may have one; `detail` is its message."""


class TensionSolution:
    """Tensions, or the proof that there are none.

    Attributes
    ----------
    problem :
        The problem as it was stated.
    tensions :
        Tensions [N], shape (m,), always inside the limits to the last bit; None unless `status` is optimal or
        inaccurate.
    status :
        See `Status`.
    method, backend :
        The method and the code that answered. `backend` of "active-set" is "compiled" or "interpreted", the two forms
        of our kernel, which give the same bits, or "daqp" where the kernel was not sure; of "qp" it is the package. It
        is None for methods that have none.
    time :
        Wall time of the call [s].
    iterations :
        Iterations of the method, None if it does not count any.
    detail :
        What the method reports beyond the status, else empty.

    `direction` computes the direction on which the method's own status rests, when it is first read.
    """

    __slots__ = (
        "_certificate",
        "_direction",
        "backend",
        "detail",
        "iterations",
        "method",
        "problem",
        "status",
        "tensions",
        "time",
    )

    def __init__(
        self,
        problem: TensionProblem,
        tensions: NDArray[np.float64] | None,
        status: Status,
        method: str,
        backend: str | None = None,
        time: float = 0.0,
        certificate: Certificate | None = None,
        iterations: int | None = None,
        detail: str = "",
        direction: Callable[[TensionProblem], NDArray[np.float64] | None] | None = None,
    ) -> None:
        self.problem = problem
        self.tensions = tensions  # (m,)
        self.status = status
        self.method = method
        self.backend = backend
        self.time = time
        self._certificate = certificate
        self._direction = direction
        self.iterations = iterations
        self.detail = detail

    def __repr__(self) -> str:
        return f"TensionSolution(status={self.status.value!r}, tensions={self.tensions!r}, method={self.method!r})"

    @property
    def certificate(self) -> Certificate | None:
        """Return why there are no tensions, exactly if `status` is infeasible or singular.

        Its `closest` holds the tensions whose wrench is nearest. The method "active-set" proves its status by a
        direction of its own; the sharpest certificate is then computed when it is first read. Where rounding keeps
        the projection from finding it (cables parallel to six digits that pull with 1e6 times the load; one problem in
        10^5 of those) the certificate is along the method's own direction, and its shortfall is less than the distance.

        Raises
        ------
        SolverError
            If neither proves the status. No problem is known that leads here.
        """
        if self._certificate is None and (self.status is Status.INFEASIBLE or self.status is Status.SINGULAR):
            self._certificate = certify(self.problem) or self._own_proof()
        return self._certificate

    def _own_proof(self) -> Certificate:
        """Return the certificate along the direction on which the method's status rests."""
        direction = None if self._direction is None else self._direction(self.problem)
        certificate = None if direction is None else certificate_along(self.problem, direction)
        if certificate is None:
            raise SolverError(f"{self.method} reported {self.status}, but no certificate confirms it; try method daqp")
        return certificate

    @property
    def feasible(self) -> bool:
        """Return whether the tensions can be used as they are."""
        return self.status is Status.OPTIMAL

    @property
    def residual(self) -> float:
        """Return the wrench error |S (A t - w)| [N], S dividing moments by the length; nan without tensions."""
        if self.tensions is None:
            return float("nan")
        error = self.problem.scaled_A @ self.tensions - self.problem.scaled_w
        return float(np.sqrt(error @ error))

    @property
    def bound_violation(self) -> float:
        """Return the largest distance of a tension beyond its limits [N]; nan without tensions."""
        if self.tensions is None:
            return float("nan")
        below, above = self.problem.t_min - self.tensions, self.tensions - self.problem.t_max
        return max(0.0, float(below.max()), float(above.max()))

    @property
    def cost(self) -> float:
        """Return the value of the cost, sum of weights_i (t_i - t_ref_i)^2 [N^2]; nan without tensions."""
        if self.tensions is None:
            return float("nan")
        return float(self.problem.weights @ (self.tensions - self.problem.t_ref) ** 2)

    def to_dict(self) -> dict[str, Any]:
        """Return plain lists, numbers and strings, ready for JSON; what does not exist is None."""
        given = self.tensions is not None
        return {
            "status": self.status.value,
            "feasible": self.feasible,
            "tensions": self.tensions.tolist() if self.tensions is not None else None,
            "residual": self.residual if given else None,
            "cost": self.cost if given else None,
            "certificate": self.certificate.to_dict() if self.certificate is not None else None,
            "method": self.method,
            "backend": self.backend,
            "time": self.time,
            "iterations": self.iterations,
            "detail": self.detail,
        }
