"""Call a CasADi Function with NumPy arrays that have leading batch dimensions, or with symbols.

One row goes through CasADi's buffers, more rows through `Function.map`.
"""

from __future__ import annotations

import math
import threading
from typing import Any
from weakref import WeakKeyDictionary

import casadi as ca
import numpy as np

from ..base.errors import InputError, SolverError
from ..base.inputs import check_dimensions, float64, leading, shown
from ..core import finite
from .tape import dense

ROWS_OF_MAP = 64  # to make a map of n costs as much as to evaluate it, so one of this size is kept
SYMBOLIC = (ca.SX, ca.MX)

_FLOAT = np.dtype(np.float64)


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

    Raises
    ------
    InputError
        Naming the argument whose shape or value does not fit.
    SolverError
        If CasADi cannot evaluate the Function, which happens only with external or iterative functions.
    """
    if any(is_symbolic(value) for value in arguments.values()):
        outputs = function(**_as_symbols(function, arguments))
        return {name: outputs[name] for name in function.name_out()}  # CasADi's are in the order of the alphabet
    outputs = _evaluator(function)(arguments)
    for name in matrices:
        if name in outputs and function.size_out(name)[1] == 1:
            outputs[name] = outputs[name][..., None]
    return outputs


def as_array(name: str, value: Any, core: tuple[int, ...]) -> np.ndarray:
    """Return `value` as floats whose last dimensions are `core`, or raise InputError unless all are finite."""
    if type(value) is np.ndarray and value.dtype is _FLOAT:
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


def arrays(values: dict[str, tuple[Any, tuple[int, ...]]]) -> list[np.ndarray]:
    """Check arguments, each a value and its shape without leading dimensions, and return them as arrays of floats.

    Raises
    ------
    InputError
        Naming the argument whose shape or value does not fit; also if the leading dimensions do not broadcast.
    """
    checked = {name: as_array(name, value, core) for name, (value, core) in values.items()}
    leading({name: array.shape[: array.ndim - len(values[name][1])] for name, array in checked.items()})
    return list(checked.values())


class _Evaluator:
    """The data that the numeric calls of one Function share."""

    def __init__(self, function: ca.Function):
        self._function = ca.Function(dense(function))  # a handle of its own: see _evaluators
        self.name: str = function.name()
        self.inputs: dict[str, tuple[int, int]] = {name: function.size_in(name) for name in function.name_in()}
        self.outputs: dict[str, tuple[int, int]] = {name: function.size_out(name) for name in function.name_out()}
        self._cores = {name: _core(size) for name, size in self.inputs.items()}
        self._defaults = {name: float(function.default_in(i)) for i, name in enumerate(self.inputs)}
        self._own = threading.local()  # a buffer serves one thread at a time

    def __call__(self, arguments: dict[str, Any]) -> dict[str, np.ndarray]:
        arrays = self._arrays(arguments)
        if all(array.shape == core for array, core in zip(arrays.values(), self._cores.values(), strict=True)):
            return self._single(arrays)
        batch = leading({name: array.shape[: array.ndim - len(self._cores[name])] for name, array in arrays.items()})
        count = math.prod(batch)
        rows = [_rows(arrays[name], batch, size) for name, size in self.inputs.items()]
        outputs = {name: np.empty((count, *size)) for name, size in self.outputs.items()}
        self._map(count, rows, list(outputs.values()))
        return {name: value.reshape(batch + _core(self.outputs[name])) for name, value in outputs.items()}

    def _arrays(self, arguments: dict[str, Any]) -> dict[str, np.ndarray]:
        """Return all inputs in their order, as arrays of shape (..., *core) with finite values."""
        for name in arguments:
            if name not in self.inputs:
                raise InputError(f"{name} must be an input of {self.name}, which has {', '.join(self.inputs)}")
        return {
            name: as_array(name, arguments[name], core) if name in arguments else np.full(core, self._defaults[name])
            for name, core in self._cores.items()
        }

    def _single(self, arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        buffers = self._buffers(1)
        for array, place in zip(arrays.values(), buffers.inputs, strict=True):
            place[0] = array.reshape(place.shape[1:])
        buffers.evaluate()
        return {
            name: value[0, :, 0].copy() if value.shape[2] == 1 else value[0].copy()
            for name, value in zip(self.outputs, buffers.outputs, strict=True)
        }

    def _map(self, count: int, rows: list[np.ndarray], outputs: list[np.ndarray]) -> None:
        """Evaluate whole blocks through a map, and the rest row by row."""
        done = 0
        while done < count:
            step = ROWS_OF_MAP if count - done >= ROWS_OF_MAP else 1
            buffers = self._buffers(step)
            for array, place in zip(rows, buffers.inputs, strict=True):
                place[:] = array[done : done + step]
            buffers.evaluate()
            for array, place in zip(outputs, buffers.outputs, strict=True):
                array[done : done + step] = place
            done += step

    def _buffers(self, count: int) -> _Buffers:
        """Return the buffers of the calling thread, for so many rows at once."""
        name = f"of_{count}"
        if not hasattr(self._own, name):
            function = self._function if count == 1 else self._function.map(count)
            inputs, outputs = list(self.inputs.values()), list(self.outputs.values())
            setattr(self._own, name, _Buffers(function, count, inputs, outputs))
        return getattr(self._own, name)


class _Buffers:
    """Arrays that CasADi reads and writes in place, `inputs` and `outputs`, (count, r, c) each."""

    def __init__(self, function: ca.Function, count: int, sizes_in: list[Any], sizes_out: list[Any]):
        self._name = function.name()
        buffer: Any  # CasADi's type hints require a size beside a memoryview, CasADi itself refuses it
        buffer, self._evaluate = function.buffer()
        self._failed = buffer.ret
        # One row of a map after the other, each column by column.
        memory_in = [np.zeros((count, columns, rows)) for rows, columns in sizes_in]
        memory_out = [np.zeros((count, columns, rows)) for rows, columns in sizes_out]
        for i, memory in enumerate(memory_in):
            buffer.set_arg(i, memory.data)
        for i, memory in enumerate(memory_out):
            buffer.set_res(i, memory.data)
        self.inputs = [memory.transpose(0, 2, 1) for memory in memory_in]
        self.outputs = [memory.transpose(0, 2, 1) for memory in memory_out]

    def evaluate(self) -> None:
        try:
            self._evaluate()
            failed = self._failed()
        except RuntimeError:
            failed = True
        if failed:
            raise SolverError(f"{self._name}: CasADi could not evaluate it")


# An entry goes when the caller's handle of its Function goes, which it must not hold itself.
_evaluators: WeakKeyDictionary[ca.Function, _Evaluator] = WeakKeyDictionary()


def _evaluator(function: ca.Function) -> _Evaluator:
    evaluator = _evaluators.get(function)
    if evaluator is None:
        evaluator = _evaluators[function] = _Evaluator(function)
    return evaluator


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
                raise InputError(f"{name} must have the shape {_core(size)} beside expressions, got {array.shape}")
            result[name] = ca.DM(array)
    return result


def _shape(core: tuple[int, ...]) -> str:
    return f"(..., {', '.join(str(size) for size in core)})"


def _rows(array: np.ndarray, batch: tuple[int, ...], size: tuple[int, int]) -> np.ndarray:
    """Bring (..., *core) to (N, r, c) without a copy where possible: one row for all of a batch is not repeated."""
    count = math.prod(batch)
    array = np.require(array, requirements="A")
    if array.size == math.prod(size):
        return np.broadcast_to(array.reshape(1, *size), (count, *size))
    return np.broadcast_to(array, batch + _core(size)).reshape(count, *size)
