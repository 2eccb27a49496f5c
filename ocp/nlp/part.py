"""`Part`: a node or an interval of a program as functions of its columns, which `part_of` makes of expressions."""

from collections.abc import Callable, Iterable
from functools import cache, partial
from itertools import chain
from typing import NamedTuple, TypeAlias

import casadi as ca

from ..limits.limits import Limits
from .derivatives import Differentiable
from .near import is_local
from .rows import Row

Constraints: TypeAlias = tuple[list[ca.SX], list[Row]]  # values, and their names and bounds


class Part(NamedTuple):
    """A node or an interval."""

    cost: Differentiable  # A function of its own, since IPOPT evaluates objective and constraints one after the other
    function: Differentiable  # the values of its rows
    rows: list[Row]  # names and bounds of these
    # Index of each local limit, what returns the function of some of its values, and its rows.
    local: list[tuple[int, Callable[[tuple[int, ...]], Differentiable], list[Row]]]


def part_of(
    name: str,
    unknowns: dict[str, ca.SX],
    parameters: dict[str, ca.SX],
    cost: ca.SX,
    constraints: list[Constraints],
    limits: Limits,
    of_limits: Iterable[tuple[int, Constraints]],
) -> Part:
    """Return the functions of a part whose symbols have the names that `Columns` has.

    `of_limits` are the constraints of `limits`, each with the index of its limit.
    """
    local: list[tuple[int, Callable[[tuple[int, ...]], Differentiable], list[Row]]] = []
    for index, (values, rows) in of_limits:
        if is_local(limits.all[index]):
            function_of_some = partial(_function_of_some, unknowns, parameters, ca.vertcat(*values))
            local.append((index, cache(function_of_some), rows))
        else:
            constraints.append((values, rows))
    values, rows = ([*chain(*parts)] for parts in zip(*constraints, strict=True))
    function = function_of(name, unknowns, parameters, ca.vertcat(*values))
    return Part(function_of(f"{name}_cost", unknowns, parameters, cost), function, rows, local)


def _function_of_some(
    unknowns: dict[str, ca.SX], parameters: dict[str, ca.SX], values: ca.SX, picked: tuple[int, ...]
) -> Differentiable:
    return function_of("near", unknowns, parameters, values[list(picked)])


def function_of(name: str, unknowns: dict[str, ca.SX], parameters: dict[str, ca.SX], value: ca.SX) -> Differentiable:
    """Return the function of all unknowns and of those parameters on which its value depends.

    CasADi would differentiate with respect to the parameters too and throw the result away: a Hessian took 6 times as
    long.
    """
    inputs = unknowns | {key: each for key, each in parameters.items() if ca.depends_on(value, each)}
    options = {"cse": True, "is_diff_in": [key in unknowns for key in inputs]}
    function = ca.Function(name, [*inputs.values()], [value], [*inputs], ["value"], options)
    return Differentiable(function, sum(each.numel() for each in unknowns.values()))
