"""Types of what kinematics and dynamics take and return: arrays in, arrays out; CasADi expressions in, the same out."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, Protocol, TypeAlias, TypeVar, overload

if TYPE_CHECKING:
    import casadi as ca
    import numpy as np
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
