"""Types of what kinematics and dynamics take and return, and `Motion`: where platform and carriers are and move."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Concatenate, NamedTuple, ParamSpec, Protocol, TypeAlias, TypeVar, overload

import numpy as np

from ..base.display import record

if TYPE_CHECKING:
    import casadi as ca
    from numpy.typing import ArrayLike

Symbol = TypeVar("Symbol", "ca.SX", "ca.MX")
Array: TypeAlias = Any  # an array with leading batch dimensions, or a CasADi expression
Matrix: TypeAlias = Any  # CasADi SX, MX or DM: what goes in comes out
Others = ParamSpec("Others")


class _OneArray(Protocol[Others]):
    """A method that returns an array, or an expression if its first argument is one."""

    @overload
    def __call__(self, pose: Symbol, /, *args: Others.args, **kwargs: Others.kwargs) -> Symbol: ...
    @overload
    def __call__(self, pose: ArrayLike, /, *args: Others.args, **kwargs: Others.kwargs) -> np.ndarray: ...


class _SeveralArrays(Protocol[Others]):
    """A method that returns arrays, or expressions if its first argument is one."""

    @overload
    def __call__(self, pose: Symbol, /, *args: Others.args, **kwargs: Others.kwargs) -> tuple[Symbol, ...]: ...
    @overload
    def __call__(self, pose: ArrayLike, /, *args: Others.args, **kwargs: Others.kwargs) -> tuple[np.ndarray, ...]: ...


def one_array(method: Callable[Concatenate[Any, Array, Others], Array]) -> _OneArray[Others]:
    """Return the method as it is, and let type checkers know that it returns what it receives: arrays or symbols."""
    known: Any = method
    return known


def several_arrays(method: Callable[Concatenate[Any, Array, Others], tuple[Array, ...]]) -> _SeveralArrays[Others]:
    """Return the method as it is, and let type checkers know that it returns what it receives: arrays or symbols."""
    known: Any = method
    return known


class Motion(NamedTuple):
    """Coordinates (x, y, z, roll, pitch, yaw) of platform and carriers and their first two time derivatives.

    Carriers whose coordinates are None are at home and at rest.
    """

    pose: Array  # of the platform frame, (..., 6) [m, rad]
    velocity: Array = None
    acceleration: Array = None
    carrier_pose: Array = None  # of the carriers, (..., c, 6), or (..., 6) of a single one
    carrier_velocity: Array = None
    carrier_acceleration: Array = None

    __repr__ = record

    @classmethod
    def symbols(cls, *carriers: int) -> Motion:
        """Return CasADi symbols of columns (6, 1), and of matrices of the shape `carriers` for the carriers."""
        import casadi as ca  # takes longer to load than a robot's file

        return cls(*(ca.SX.sym(name, *(carriers if "carrier" in name else (6,))) for name in cls._fields))

    def arguments(self, home: np.ndarray) -> dict[str, Array]:
        """Return the parts by their names, of carriers at `home` and at rest where they are None."""
        carriers = {"carrier_pose": home, "carrier_velocity": np.zeros_like(home)}
        carriers["carrier_acceleration"] = carriers["carrier_velocity"]
        return carriers | {name: value for name, value in self._asdict().items() if value is not None}
