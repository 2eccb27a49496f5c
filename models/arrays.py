"""Types of what kinematics and dynamics take and return: arrays in, arrays out; CasADi expressions in, the same out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

if TYPE_CHECKING:
    import casadi as ca

Symbol = TypeVar("Symbol", "ca.SX", "ca.MX")
Array: TypeAlias = Any  # an array with leading batch dimensions, or a CasADi expression
