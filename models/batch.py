"""Call a CasADi Function with NumPy arrays that have leading batch dimensions, or with symbols.

Arrays go through `Function.map`. What is called for every step of a loop is in the numeric core, see `mechanics`.
"""

import math
from typing import Any

import casadi as ca
import numpy as np

from ..base.errors import InputError, SolverError
from ..base.inputs import FLOAT, check_dimensions, float64, leading, shown
from ..core import finite

SYMBOLIC = (ca.SX, ca.MX)


def is_symbolic(value: Any) -> bool:
    """Return whether `value` is a CasADi expression."""
    return isinstance(value, SYMBOLIC)


def call(function: ca.Function, arguments: dict[str, Any], matrices: tuple[str, ...] = ()) -> dict[str, Any]:
    """Evaluate `function` on named arguments; the outputs, in order, have the common leading dimensions of the inputs.

    Parameters
    ----------
    function
        Its input names are the keys of `arguments`; an input that is not among them has the Function's default.
    arguments
        Arrays of shape (..., *shape of the input), where a column (n, 1) counts as (n,); they broadcast as in NumPy.
        If one is a CasADi expression all are taken as they are and the outputs are expressions too.
    matrices
        Outputs that are matrices also when they happen to have one column, as the wrench matrix of one cable.

    Raises `InputError` that names the argument whose shape or value does not fit; `SolverError` if CasADi cannot
    evaluate the Function, which happens only with external or iterative functions.
    """
    if any(is_symbolic(value) for value in arguments.values()):
        outputs = function(**_as_symbols(function, arguments))
        return {name: outputs[name] for name in function.name_out()}  # CasADi's are in the order of the alphabet
    outputs = _evaluated(function, arguments)
    for name in matrices:
        if name in outputs and function.size_out(name)[1] == 1:
            outputs[name] = outputs[name][..., None]
    return outputs


def as_array(name: str, value: Any, core: tuple[int, ...]) -> np.ndarray:
    """Return `value` as floats whose last dimensions are `core`, or raise InputError unless all are finite."""
    if type(value) is np.ndarray and value.dtype is FLOAT:
        array = value
    else:
        try:
            given = np.asarray(value)
            if given.dtype.kind not in "fiubO":
                raise TypeError
            array = float64(given)
        except Exception:  # whatever the array interface of another library raises
            raise InputError(f"{name} must be numbers of shape {_shape(core)}, got {shown(value)}") from None
    if array.shape[array.ndim - len(core) :] != core or array.ndim < len(core):
        raise InputError(f"{name} must have the shape {_shape(core)}, got {array.shape}")
    check_dimensions(name, array.ndim - len(core))
    if not finite(array if array.flags.c_contiguous else np.ascontiguousarray(array)):
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(f"{name} must be finite numbers, got {array[index]} at index {index}")
    return array


def _evaluated(function: ca.Function, arguments: dict[str, Any]) -> dict[str, np.ndarray]:
    """Evaluate a Function on arrays, all rows of a batch in one call."""
    sizes = {name: function.size_in(name) for name in function.name_in()}
    for name in arguments:
        if name not in sizes:
            raise InputError(f"{name} must be an input of {function.name()}, which has {', '.join(sizes)}")
    arrays = {
        name: as_array(name, arguments.get(name, np.full(_core(size), function.default_in(index))), _core(size))
        for index, (name, size) in enumerate(sizes.items())
    }
    batch = leading({name: array.shape[: array.ndim - len(_core(sizes[name]))] for name, array in arrays.items()})
    count = math.prod(batch)
    outputs = {name: function.size_out(name) for name in function.name_out()}
    if not count:
        return {name: np.empty(batch + _core(size)) for name, size in outputs.items()}
    beside = [ca.DM(_beside(arrays[name], batch, size)) for name, size in sizes.items()]
    try:
        values = function.map(count).call(beside)
    except RuntimeError:
        raise SolverError(f"{function.name()}: CasADi could not evaluate it") from None
    return {
        name: value.full().reshape(rows, count, columns).swapaxes(0, 1).reshape(batch + _core((rows, columns)))
        for (name, (rows, columns)), value in zip(outputs.items(), values, strict=True)
    }


def _beside(array: np.ndarray, batch: tuple[int, ...], size: tuple[int, int]) -> np.ndarray:
    """Return (..., *core) as the matrices of all rows of a batch beside each other, (r, count c)."""
    rows, columns = size
    every = np.broadcast_to(array, batch + _core(size)).reshape(math.prod(batch), *size)
    return every.swapaxes(0, 1).reshape(rows, math.prod(batch) * columns)


def _core(size: tuple[int, int]) -> tuple[int, ...]:
    return size[:1] if size[1] == 1 else size


def _as_symbols(function: ca.Function, arguments: dict[str, Any]) -> dict[str, Any]:
    """Check the arguments of a call with expressions: their shapes, one kind of expression, finite numbers."""
    kinds = {type(value).__name__ for value in arguments.values() if is_symbolic(value)}
    if len(kinds) > 1:
        raise InputError(f"{', '.join(arguments)} must be expressions of one kind, got SX and MX in one call")
    result = {}
    for name, value in arguments.items():
        size = function.size_in(name)
        if is_symbolic(value):
            if value.shape != size:
                raise InputError(f"{name} must have the shape {size}, got an expression of shape {value.shape}")
            result[name] = value
        else:
            array = as_array(
                name, value.full().reshape(_core(size)) if isinstance(value, ca.DM) else value, _core(size)
            )
            if array.shape != _core(size):
                raise InputError(f"{name} must have the shape {_core(size)} with expressions, got {array.shape}")
            result[name] = ca.DM(array)
    return result


def _shape(core: tuple[int, ...]) -> str:
    return f"(..., {', '.join(str(size) for size in core)})"
