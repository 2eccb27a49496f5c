"""`TensionSolution`: tensions or a certificate, and a status of one word."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from ..base.display import BLUE, GREY, ORANGE, Curve, Displayed, Fact, picture
from ..base.errors import SolverError
from ..base.text import quantity, quantity_range, quantity_row
from .certificate import Certificate
from .problem import Array, TensionProblem


class Status(StrEnum):
    """The status of a solution; the values are plain strings."""

    OPTIMAL = "optimal"
    """The tensions give w inside the limits, within `TensionProblem.tolerance`, and are the method's result."""

    INFEASIBLE = "infeasible"
    """The limits forbid w; a verified certificate shows along which direction and by how much."""

    SINGULAR = "singular"
    """w has a part outside the range of A: no tensions of either sign give it, whatever the limits. The certificate's
    direction is in the left null space of A and no cable binds. A rank-deficient A alone is not singular in this sense:
    if w is in its range the problem may well be optimal."""

    INACCURATE = "inaccurate"
    """The tensions miss w by more than the tolerance, or are not proven to be the method's result: read `residual` and
    `detail` before using them. Either no certificate proves that w is out of reach, or one does and the method is one
    that answers all the same (`Method.always_answers`)."""

    INVALID = "invalid"
    """A row of a batch whose numbers do not define a problem: NaN, crossed limits, a weight that is not positive. A
    single problem like that is an `InputError`."""

    FAILED = "failed"
    """A back end gave up, or called the problem infeasible and could not be believed, or the method has no result here
    although other methods may have one; `detail` is its message."""


STATUSES = tuple(Status)
"""By code: the C core and `BatchSolution.code` count in this order."""

OPTIMAL, INFEASIBLE, SINGULAR, INACCURATE, INVALID, FAILED = range(len(STATUSES))

UNSURE = len(STATUSES)
"""Status of a problem that the C core is to solve, or that it could not: see `core/batch/batch.h`."""


_OPTIMAL = STATUSES[OPTIMAL]  # to read it from the enumeration takes longer than the rest of `feasible`


@dataclass(slots=True, eq=False)
class TensionSolution(Displayed):
    """Tensions, or the proof that none exist.

    Attributes:
        problem: The problem.
        tensions: Tensions [N], shape (m,), always inside the limits to the last bit; None unless `status` is optimal or
            inaccurate.
        status: See `Status`.
        method, backend: The method and the code that computed the result. For "active-set" `backend` is "c" for the C
            core, or "daqp" if its result was uncertain; for "qp" it is the package. Other methods have None.
        time: Wall time of the call [s].
        iterations: Iterations of the method, or None.
        detail: Further message of the method; may be empty.
        proof: The certificate, or a function of the problem that computes it on first access of `certificate`.
    """

    problem: TensionProblem
    tensions: Array | None  # (m,)
    status: Status
    method: str
    backend: str | None = None
    time: float = 0.0
    iterations: int | None = None
    detail: str = ""
    proof: Certificate | Callable[[TensionProblem], Certificate | None] | None = None

    def _headline(self) -> str:
        short = self.certificate and f", short by {quantity(self.certificate.shortfall, 'N')}"
        return f"{self.problem.m} cables: {self.status.value.upper()}{short or (self.detail and f', {self.detail}')}"

    def _facts(self) -> Iterable[Fact]:
        problem, facts = self.problem, []
        if self.tensions is not None:
            facts += [("tensions", quantity_row(self.tensions, "N")), ("residual", quantity(self.residual, "N"))]
        facts += [(name, quantity_range(getattr(problem, name), "N")) for name in ("t_min", "t_max")]
        if (certificate := self.certificate) is not None:
            facts += certificate._facts()
        return [*facts, ("method", f"{self.method}{(self.backend and f' ({self.backend})') or ''}")]

    def _picture(self) -> str:
        """Return each cable's tension as a mark between its limits; the closest ones if none exist."""
        problem, proof = self.problem, self.certificate
        tensions = proof.closest if self.tensions is None and proof is not None else self.tensions
        if tensions is None:
            return ""
        bounds = np.stack([problem.t_min, problem.t_max])
        known = np.concatenate([tensions, bounds[np.isfinite(bounds)]])
        colour = ORANGE if self.tensions is None else BLUE
        curves: list[Curve] = []
        for index, ends in enumerate(np.clip(bounds, known.min(), known.max()).T):
            cable, tension = index + 1, tensions[index]
            curves += [([cable, cable], ends, GREY), ([cable - 0.3, cable + 0.3], [tension, tension], colour)]
        return picture(curves, "cable", "tension [N]")

    @property
    def certificate(self) -> Certificate | None:
        """Return the proof that no tensions exist; None unless `status` is infeasible or singular.

        `closest` contains the tensions with the closest wrench. The method "active-set" proves its status by a
        direction of its own, and the sharpest certificate is computed on first access. If rounding prevents this
        (nearly parallel cables with huge tensions; about one problem in 10^5 of that kind) the certificate has the
        method's direction, and its shortfall is smaller than the distance.

        Raises `SolverError` if neither certificate proves the status. No problem is known for which this happens.
        """
        if callable(self.proof):
            proof = self.proof(self.problem)
            if proof is None:
                raise SolverError(
                    f"{self.method} reported {self.status}, but no certificate confirms it; try method daqp"
                )
            self.proof = proof
        return self.proof

    @property
    def feasible(self) -> bool:
        """Return whether the tensions are usable."""
        return self.status is _OPTIMAL

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

    @property
    def lambda_(self) -> Array | None:
        """Return lambda [N], shape (m - rank,), with tensions = A^+ w + N lambda; None without tensions.

        N is `problem.null_space`, whose columns are orthonormal and orthogonal to A^+ w: lambda = N^T t, for the
        tensions of any method.
        """
        return None if self.tensions is None else self.problem.null_space.T @ self.tensions

    def to_dict(self) -> dict[str, Any]:
        """Return plain lists, numbers and strings, ready for JSON; missing values are None."""
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
