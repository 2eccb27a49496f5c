"""Name the possible results of planning or timing a motion: `MotionStatus`."""

from enum import StrEnum


class MotionStatus(StrEnum):
    """The status of a plan or of `time_along`; the values are plain strings."""

    FEASIBLE = "feasible"
    """The motion keeps every limit, as confirmed by the audit on its dense grid."""

    INFEASIBLE = "infeasible"
    """No motion that the task allows is feasible, and this is proven: by the certificate of an instant at which no
    tensions give the required wrench, or by a limit that all these motions exceed (`Audit.excess`). If the duration
    is free, no duration and no time law that the task allows are feasible. The certificate then refers to the
    slowest motion, and `Plan.stages` gives the reasons that exclude the others."""

    NOT_FOUND = "not-found"
    """The search ended without a motion that keeps every limit and without a proof that none exists. Certificate and
    `excess` refer to the closest motion known."""
