"""Vectors of eight numbers for Numba, loaded from any place of an array: what products of small matrices are made of.

Numba's loops over rows of twenty numbers lose most of their time before and after the vector instructions. Here a
vector is a type of its own, `<8 x double>` in LLVM, which splits it where the processor's are shorter.

    sums = fused(work[i], load8(work, j), sums)     # sums + work[i] * work[j : j + 8], rounded once or twice
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable

__all__ = ["NAMES", "fused", "largest8", "load8", "magnitude8", "splat8", "store8", "total8", "where8"]

_WIDTH = 8
_DOUBLE = ir.DoubleType()
_VECTOR = ir.VectorType(_DOUBLE, _WIDTH)


class Eight(types.Type):
    """Eight floats."""

    def __init__(self) -> None:
        super().__init__(name="Eight")


eight = Eight()


@register_model(Eight)
class _EightModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR)


def _splat(builder: Any, number: Any) -> Any:
    """Put a number in all lanes."""
    empty = ir.Constant(_VECTOR, ir.Undefined)
    first = builder.insert_element(empty, number, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, empty, ir.Constant(ir.VectorType(ir.IntType(32), _WIDTH), [0] * _WIDTH))


def _call(builder: Any, name: str, kind: Any, *arguments: Any) -> Any:
    """Call one of LLVM's functions of vectors."""
    signature = ir.FunctionType(kind, [argument.type for argument in arguments])
    return builder.call(cgutils.get_or_insert_function(builder.module, signature, f"llvm.{name}.v8f64"), arguments)


def _place(context: Any, builder: Any, kind: Any, array: Any, at: Any) -> Any:
    """Point to an entry of an array, as to a vector that begins there."""
    data = context.make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [at]), _VECTOR.as_pointer())


def _instruction(function: Callable[..., Any]) -> Any:
    """Define an intrinsic; the typing context, which Numba adds, is hidden from type checkers."""
    return intrinsic(function)


@_instruction
def splat8(typingctx: Any, number: Any) -> Any:
    """Return a vector of one number."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _splat(builder, arguments[0])

    return eight(types.float64), generate


@_instruction
def load8(typingctx: Any, array: Any, at: Any) -> Any:
    """Return eight numbers of an array of float64, from a place on."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load(_place(context, builder, signature.args[0], *arguments), align=8)

    return eight(array, types.intp), generate


@_instruction
def store8(typingctx: Any, array: Any, at: Any, value: Any) -> Any:
    """Write a vector to an array of float64, from a place on."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.store(arguments[2], _place(context, builder, signature.args[0], *arguments[:2]), align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, eight), generate


@_instruction
def fused(typingctx: Any, x: Any, y: Any, z: Any) -> Any:
    """Return x y + z, in one instruction where the processor has one; x is a number or a vector."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        x, y, z = arguments
        return _call(builder, "fmuladd", _VECTOR, x if signature.args[0] is eight else _splat(builder, x), y, z)

    return eight(eight if x is eight else types.float64, eight, eight), generate


@_instruction
def magnitude8(typingctx: Any, x: Any) -> Any:
    """Return the absolute values."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _call(builder, "fabs", _VECTOR, arguments[0])

    return eight(eight), generate


@_instruction
def largest8(typingctx: Any, x: Any, y: Any) -> Any:
    """Return the larger of each pair, the second where one is nan."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.select(builder.fcmp_ordered(">", *arguments), *arguments)

    return eight(eight, eight), generate


@_instruction
def where8(typingctx: Any, exists: Any, x: Any) -> Any:
    """Return x where a mask is 1, else 0, whatever x is there."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        zero = ir.Constant(_VECTOR, [0.0] * _WIDTH)
        return builder.select(builder.fcmp_ordered(">", arguments[0], zero), arguments[1], zero)

    return eight(eight, eight), generate


@_instruction
def total8(typingctx: Any, x: Any) -> Any:
    """Return the sum of the eight, added in pairs."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        vector = arguments[0]
        for half in (4, 2, 1):
            order = [(lane + half) % _WIDTH for lane in range(_WIDTH)]
            turned = builder.shuffle_vector(vector, vector, ir.Constant(ir.VectorType(ir.IntType(32), _WIDTH), order))
            vector = builder.fadd(vector, turned)
        return builder.extract_element(vector, ir.Constant(ir.IntType(32), 0))

    return types.float64(eight), generate


def _operator(on: Any, build: str) -> None:
    """Define an operator of two vectors."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return getattr(builder, build)(*arguments)

    lower_builtin(on, eight, eight)(generate)

    @type_callable(on)
    def kind_of(context: Any) -> Any:
        def typer(x, y):
            return eight(eight, eight) if x is eight and y is eight else None

        return typer


_operator(operator.add, "fadd")
_operator(operator.sub, "fsub")
_operator(operator.mul, "fmul")
_operator(operator.truediv, "fdiv")

# The names that kernels use.
NAMES = {
    "splat8": splat8,
    "load8": load8,
    "store8": store8,
    "fused": fused,
    "magnitude8": magnitude8,
    "largest8": largest8,
    "total8": total8,
    "where8": where8,
}
