"""Name the possible results of planning or timing a motion: `MotionStatus`."""

from enum import StrEnum


class MotionStatus(StrEnum):
    """The status of a plan or of a timing; the values are plain strings."""

    FEASIBLE = "feasible"
    """The motion keeps every limit; of a plan, the audit confirms it on its dense grid."""

    INFEASIBLE = "infeasible"
    """No motion that the task allows is possible, and that is proven: by the certificate of an instant at which no
    tensions give the required wrench, or by a limit that all these motions exceed (`Audit.excess`). If the task leaves
    the duration open, no duration and no time law that it allows are possible; the certificate is then that of the
    slowest motion, and `Plan.stages` state what excludes the others."""

    NOT_FOUND = "not-found"
    """The search ended without a motion that keeps every limit and without a proof that none exists. Certificate and
    `excess` are those of the closest motion known."""
