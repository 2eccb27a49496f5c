"""Call a CasADi Function with NumPy arrays that have leading batch dimensions, or with symbols."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from ..errors import InputError


def is_symbolic(value: Any) -> bool:
    """Whether `value` is a CasADi expression."""
    return isinstance(value, ca.SX | ca.MX)


def call(function: ca.Function, arguments: dict[str, Any]) -> dict[str, Any]:
    """Evaluate `function` on named arguments; the outputs have the common leading dimensions of the inputs.

    Parameters
    ----------
    function
        Its input names are the keys of `arguments`.
    arguments
        Arrays of shape (..., *shape of the input), where a column (n, 1) counts as (n,); they broadcast as in NumPy.
        If one is a CasADi expression all are taken as they are and the outputs are expressions too.

    Raises
    ------
    InputError
        Naming the argument whose shape or value does not fit.
    """
    if any(is_symbolic(value) for value in arguments.values()):
        return function(**{name: _as_symbolic(value) for name, value in arguments.items()})
    arrays = {name: _as_array(function, name, value) for name, value in arguments.items()}
    shapes = {name: function.size_in(name) for name in arrays}
    leading = {name: array.shape[: array.ndim - len(_core(shapes[name]))] for name, array in arrays.items()}
    try:
        batch = np.broadcast_shapes(*leading.values())
    except ValueError:
        told = ", ".join(f"{name} {shape}" for name, shape in leading.items())
        raise InputError(f"leading dimensions do not broadcast: {told}; accepted: equal ones, or 1") from None
    columns = {
        name: _to_columns(np.broadcast_to(array, batch + _core(shapes[name])), shapes[name], batch)
        for name, array in arrays.items()
    }
    count = int(np.prod(batch))
    if count == 0:
        sizes = {name: function.size_out(name) for name in function.name_out()}
        return {name: np.zeros(batch + _core(size)) for name, size in sizes.items()}
    mapped = function if count == 1 else function.map(count)
    outputs = mapped(**columns)
    return {name: _from_columns(value, function.size_out(name), batch) for name, value in outputs.items()}


def _core(size: tuple[int, int]) -> tuple[int, ...]:
    return size[:1] if size[1] == 1 else size


def _as_symbolic(value: Any) -> Any:
    return value if is_symbolic(value) or isinstance(value, ca.DM) else ca.DM(np.asarray(value, dtype=float))


def _as_array(function: ca.Function, name: str, value: Any) -> np.ndarray:
    core = _core(function.size_in(name))
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(
            f"{name}: {value!r} is not an array of numbers; accepted: shape (..., {_told(core)})"
        ) from None
    if array.shape[array.ndim - len(core) :] != core or array.ndim < len(core):
        raise InputError(f"{name}: has shape {array.shape}; accepted: (..., {_told(core)})")
    if not np.isfinite(array).all():
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(f"{name}: is {array[index]} at index {index}; accepted: finite numbers")
    return array


def _told(core: tuple[int, ...]) -> str:
    return ", ".join(str(size) for size in core)


def _to_columns(array: np.ndarray, size: tuple[int, int], batch: tuple[int, ...]) -> np.ndarray:
    """(..., r, c) to (r, N c): CasADi's map wants one call's argument beside the next."""
    rows, columns = size
    count = int(np.prod(batch))
    return array.reshape(count, rows, columns).transpose(1, 0, 2).reshape(rows, count * columns)


def _from_columns(value: ca.DM, size: tuple[int, int], batch: tuple[int, ...]) -> np.ndarray:
    rows, columns = size
    count = int(np.prod(batch))
    stacked = value.full().reshape(rows, count, columns).transpose(1, 0, 2)
    return np.ascontiguousarray(stacked).reshape(batch + _core(size))
