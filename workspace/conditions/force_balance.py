"""Force balance, the first of paper C's conditions: the three rows of force, without the moments.

Three cables balance all six rows exactly only on a set of measure zero, so the paper's step (d) would reject every
sample. Its prisms follow from the forces alone.
"""

from typing import ClassVar, Literal

from .static_equilibrium import BalanceAtRest


class ForceBalance(BalanceAtRest):
    """Tensions inside the limits balance the weight as a force; moments are ignored."""

    forces_only: ClassVar[bool] = True

    kind: Literal["force-balance"] = "force-balance"
