"""Call a CasADi Function with NumPy arrays that have leading batch dimensions, or with symbols.

Arrays are evaluated in place, many rows at a time. What is called for every step of a loop is in the numeric core, see
`mechanics`.
"""

import math
from typing import Any

import casadi as ca
import numpy as np

from ..base.errors import InputError, SolverError
from ..base.inputs import FLOAT, check_dimensions, float64, leading, shown
from ..core import finite

SYMBOLIC = (ca.SX, ca.MX)
BLOCK = 64  # rows: to make a map of all costs more than to evaluate it


def is_symbolic(value: Any) -> bool:
    """Return whether `value` is a CasADi expression."""
    return isinstance(value, SYMBOLIC)


def call(function: ca.Function, arguments: dict[str, Any], matrices: tuple[str, ...] = ()) -> dict[str, Any]:
    """Evaluate `function` on named arguments; the outputs, in order, have the common leading dimensions of the inputs.

    - `function`: its input names are the keys of `arguments`; one that is not among them has the Function's default.
    - `arguments`: arrays of shape (..., *shape of the input), and (n,) for a column (n, 1); they broadcast as in NumPy.
      If one is a CasADi expression, all are used as they are, and the outputs are expressions too.
    - `matrices`: outputs that are matrices also when they happen to have one column, as A of one cable.

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
    rows = [_columns(arrays[name], batch, size, function.sparsity_in(name)) for name, size in sizes.items()]
    size = min(count, BLOCK)
    try:
        values = in_blocks(function.map(size) if size > 1 else function, rows, size)
    except RuntimeError:
        raise SolverError(f"{function.name()}: CasADi could not evaluate it") from None
    return {name: _matrices(function, name, its, batch) for name, its in zip(outputs, values, strict=True)}


def in_blocks(block: ca.Function, arguments: list[np.ndarray], size: int = BLOCK) -> list[np.ndarray]:
    """Return the outputs of a function of one row that is mapped to `size` of them, (n, k) each.

    `arguments` are (n, k) each. k are the elements of one row's matrix that are not zero by structure, column by
    column. Raises `RuntimeError` if the evaluation fails.
    """
    n = len(arguments[0])
    # NumPy joins a broadcast argument and one more row by columns, which no buffer takes.
    whole = [
        np.ascontiguousarray(np.concatenate([each, np.repeat(each[-1:], -n % size, axis=0)])) for each in arguments
    ]
    values = [np.empty((n + -n % size, block.nnz_out(i) // size)) for i in range(block.n_out())]
    buffer, evaluate = block.buffer()  # in place: as DM the arguments would take longer than all that is computed
    for start in range(0, n, size):
        rows = slice(start, start + size)
        for i, each in enumerate(whole):
            buffer.set_arg(i, each[rows].data)  # pyrefly: ignore[missing-argument]
        for i, each in enumerate(values):
            buffer.set_res(i, each[rows].data)  # pyrefly: ignore[missing-argument]
        evaluate()
        if buffer.ret():
            raise RuntimeError
    return [each[:n] for each in values]


def _columns(array: np.ndarray, batch: tuple[int, ...], size: tuple[int, int], places: ca.Sparsity) -> np.ndarray:
    """Return (..., *core) as the elements of each row of a batch at `places`, column by column, (n, k)."""
    every = np.broadcast_to(array, batch + _core(size)).reshape(math.prod(batch), *size)
    columns = every.swapaxes(1, 2).reshape(len(every), size[0] * size[1])
    return columns if places.is_dense() else columns[:, places.find()]


def _matrices(function: ca.Function, name: str, values: np.ndarray, batch: tuple[int, ...]) -> np.ndarray:
    """Return an output (..., *core) from its elements that are not zero by structure, (n, k)."""
    places, (rows, columns) = function.sparsity_out(name), function.size_out(name)
    every = values
    if not places.is_dense():
        every = np.zeros((len(values), columns * rows))
        every[:, places.find()] = values
    return every.reshape(len(values), columns, rows).swapaxes(1, 2).reshape(batch + _core((rows, columns)))


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
