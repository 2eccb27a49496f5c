"""Vectors of sixteen numbers for Numba: one instruction works on many problems.

Numba's loops over problems become vector instructions only if LLVM can prove that nothing overlaps, which for a
kernel with many intermediate rows it cannot. Here a vector is a type of its own, `<16 x double>` in LLVM, that lives in
registers; LLVM splits it where the processor's are shorter. `Lanes` has + - * / and comparisons, among each other and
with numbers; a comparison gives `Mask`, which has & | ~.

    x = load(work, row)                  # numbers 16 row to 16 row + 15 of an array
    y = where(x > 0.0, sqrt(x), splat(0.0))
    store(work, row, y)

Nothing is fused or reordered: each operation rounds as that of `simd`, which runs the same kernels on NumPy arrays.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit
from numba.core import cgutils, types
from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable

__all__ = [
    "TOGETHER",
    "WIDTH",
    "any_of",
    "floor",
    "gather",
    "load",
    "magnitude",
    "maximum",
    "minimum",
    "places",
    "scatter",
    "splat",
    "sqrt",
    "store",
    "vectors",
    "where",
]

WIDTH = TOGETHER = 16  # two registers of the widest processors, so that one need not wait for the other

_VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)
_BITS = ir.VectorType(ir.IntType(1), WIDTH)


class Lanes(types.Type):
    """Sixteen floats."""

    def __init__(self) -> None:
        super().__init__(name=f"Lanes{WIDTH}")


class Mask(types.Type):
    """Sixteen truths."""

    def __init__(self) -> None:
        super().__init__(name=f"Mask{WIDTH}")


lanes, mask = Lanes(), Mask()


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR)


@register_model(Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _BITS)


@njit
def vectors(size: int) -> Any:
    """Return a work array of so many numbers."""
    return np.zeros(size)


def _splat(builder: Any, number: Any) -> Any:
    """Put a number in all lanes."""
    empty = ir.Constant(_VECTOR, ir.Undefined)
    first = builder.insert_element(empty, number, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, empty, ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH))


def _call(builder: Any, name: str, *arguments: Any) -> Any:
    """Call one of LLVM's functions of vectors."""
    kind = ir.FunctionType(_VECTOR, [_VECTOR] * len(arguments))
    function = cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{WIDTH}f64")
    return builder.call(function, arguments)


def _place(context: Any, builder: Any, kind: Any, array: Any, row: Any) -> Any:
    """Point to the row of an array (numbers,), as a vector."""
    data = context.make_array(kind)(context, builder, array).data
    at = builder.mul(row, ir.Constant(row.type, WIDTH))
    return builder.bitcast(builder.gep(data, [at]), _VECTOR.as_pointer())


def _instruction(function: Callable[..., Any]) -> Any:
    """Define an intrinsic; the typing context, which Numba adds, is hidden from type checkers."""
    return intrinsic(function)


@_instruction
def splat(typingctx: Any, number: Any) -> Any:
    """Return a vector of one number."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _splat(builder, arguments[0])

    return lanes(types.float64), generate


@_instruction
def load(typingctx: Any, array: Any, row: Any) -> Any:
    """Return the row of an array of float64, sixteen numbers a row."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load(_place(context, builder, signature.args[0], *arguments), align=8)

    return lanes(array, types.intp), generate


@_instruction
def store(typingctx: Any, array: Any, row: Any, value: Any) -> Any:
    """Write a vector to the row of an array of float64."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.store(arguments[2], _place(context, builder, signature.args[0], *arguments[:2]), align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, lanes), generate


@_instruction
def places(typingctx: Any, rows: Any, each: Any) -> Any:
    """Return where the numbers of so many rows begin, `each` of them apart, as a tuple for `gather`."""
    kind = types.UniTuple(types.intp, WIDTH)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        given, each = arguments
        data = context.make_array(signature.args[0])(context, builder, given).data
        starts = []
        for e in range(WIDTH):
            row = builder.load(builder.gep(data, [ir.Constant(each.type, e)]))
            starts.append(builder.mul(row, each))
        return cgutils.pack_array(builder, starts)

    return kind(rows, types.intp), generate


@_instruction
def gather(typingctx: Any, array: Any, starts: Any, offset: Any) -> Any:
    """Return the numbers at starts[e] + offset of an array of float64; `starts` is from `places`."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        given, starts, offset = arguments
        data = context.make_array(signature.args[0])(context, builder, given).data
        vector = ir.Constant(_VECTOR, ir.Undefined)
        for e in range(WIDTH):
            at = builder.add(builder.extract_value(starts, e), offset)
            number = builder.load(builder.gep(data, [at]))
            vector = builder.insert_element(vector, number, ir.Constant(ir.IntType(32), e))
        return vector

    return lanes(array, types.UniTuple(types.intp, WIDTH), types.intp), generate


@_instruction
def scatter(typingctx: Any, array: Any, starts: Any, offset: Any, values: Any) -> Any:
    """Write numbers to starts[e] + offset of an array of float64; `starts` is from `places`."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        given, starts, offset, values = arguments
        data = context.make_array(signature.args[0])(context, builder, given).data
        for e in range(WIDTH):
            at = builder.gep(data, [builder.add(builder.extract_value(starts, e), offset)])
            builder.store(builder.extract_element(values, ir.Constant(ir.IntType(32), e)), at)
        return context.get_dummy_value()

    return types.void(array, types.UniTuple(types.intp, WIDTH), types.intp, lanes), generate


@_instruction
def where(typingctx: Any, chosen: Any, yes: Any, no: Any) -> Any:
    """Choose lane by lane."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.select(*arguments)

    return lanes(mask, lanes, lanes), generate


@_instruction
def any_of(typingctx: Any, chosen: Any) -> Any:
    """Return whether a mask holds in any lane."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        bits = ir.IntType(WIDTH)
        return builder.icmp_unsigned("!=", builder.bitcast(arguments[0], bits), ir.Constant(bits, 0))

    return types.boolean(mask), generate


def _unary(name: str, doc: str) -> Any:
    def function(typingctx: Any, x: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return _call(builder, name, arguments[0])

        return lanes(lanes), generate

    function.__doc__ = doc
    return _instruction(function)


sqrt = _unary("sqrt", "Return the square root.")
magnitude = _unary("fabs", "Return the absolute value.")
floor = _unary("floor", "Return the largest whole number that is not above x.")


def _compared(comparison: str, doc: str) -> Any:
    def function(typingctx: Any, x: Any, y: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.select(builder.fcmp_ordered(comparison, *arguments), *arguments)

        return lanes(lanes, lanes), generate

    function.__doc__ = doc
    return _instruction(function)


maximum = _compared(">", "Return the larger, the second where one is nan.")
minimum = _compared("<", "Return the smaller, the second where one is nan.")


def _operator(on: Callable[..., Any], result: Any, build: Callable[..., Any]) -> None:
    """Define an operator of two vectors, or of a vector and a number."""
    for kinds in ((lanes, lanes), (lanes, types.float64), (types.float64, lanes)):

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            pairs = zip(signature.args, arguments, strict=True)
            return build(builder, *[a if kind is lanes else _splat(builder, a) for kind, a in pairs])

        lower_builtin(on, *kinds)(generate)

    @type_callable(on)
    def kind_of(context: Any) -> Any:
        def typer(x, y):
            if x is lanes or y is lanes:
                number = [isinstance(kind, types.Float | types.Integer) for kind in (x, y)]
                if all(n or kind is lanes for n, kind in zip(number, (x, y), strict=True)):
                    return result(*[types.float64 if n else lanes for n in number])
            return None

        return typer


_operator(operator.add, lanes, lambda builder, x, y: builder.fadd(x, y))
_operator(operator.sub, lanes, lambda builder, x, y: builder.fsub(x, y))
_operator(operator.mul, lanes, lambda builder, x, y: builder.fmul(x, y))
_operator(operator.truediv, lanes, lambda builder, x, y: builder.fdiv(x, y))
for _symbol, _on in {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}.items():
    _operator(_on, mask, lambda builder, x, y, symbol=_symbol: builder.fcmp_ordered(symbol, x, y))


def _logical(on: Callable[..., Any], build: str, count: int) -> None:
    """Define an operator of masks."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return getattr(builder, build)(*arguments)

    lower_builtin(on, *[mask] * count)(generate)

    @type_callable(on)
    def kind_of(context: Any) -> Any:
        if count == 1:
            return lambda x: mask(mask) if x is mask else None
        return lambda x, y: mask(mask, mask) if x is mask and y is mask else None


_logical(operator.and_, "and_", 2)
_logical(operator.or_, "or_", 2)
_logical(operator.invert, "not_", 1)


def _negative(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    return builder.fneg(*arguments)


lower_builtin(operator.neg, lanes)(_negative)


@type_callable(operator.neg)
def _kind_of_negative(context: Any) -> Any:
    return lambda x: lanes(lanes) if x is lanes else None
