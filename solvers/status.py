"""The status of a solution, one word."""

from enum import StrEnum


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
