"""A CasADi Function's instruction tape as a C function.

An SX Function is a straight list of scalar instructions on a work vector: load an input's element, compute, store an
output's element. The C function has one local variable for each distinct value on the tape (two instructions that do
the same with the same values share it, which changes no bit) and does the operations in the tape's order, so that it
rounds where CasADi does. It has no branches, no work arrays, and no warnings. A file that includes it defines `real`,
the type of its numbers, `C(x)`, a constant of that type, and `MATH(sin)`, a function for it.
"""

from collections import Counter
from typing import NamedTuple

import casadi as ca

from ..base.errors import InputError

_NAMES = {getattr(ca, name): name.removeprefix("OP_") for name in dir(ca) if name.startswith("OP_")}
_UNARY = (
    *("sqrt", "exp", "expm1", "log", "log1p", "sin", "cos", "tan", "asin", "acos", "atan"),
    *("sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "erf", "fabs", "floor", "ceil"),
)
_BINARY = ("hypot", "atan2", "copysign", "fmod", "fmin", "fmax")
_OPERATIONS = {
    "ADD": "{0} + {1}",
    "SUB": "{0} - {1}",
    "MUL": "{0} * {1}",
    "DIV": "{0} / {1}",
    "NEG": "-{0}",
    "INV": "1 / {0}",
    "SQ": "{0} * {0}",
    "TWICE": "2 * {0}",
    "POW": "MATH(pow)({0}, {1})",
    "CONSTPOW": "MATH(pow)({0}, {1})",
    "SIGN": "({0} < 0 ? -C(1) : ({0} > 0 ? C(1) : {0}))",
    "LT": "({0} < {1} ? C(1) : C(0))",
    "LE": "({0} <= {1} ? C(1) : C(0))",
    "EQ": "({0} == {1} ? C(1) : C(0))",
    "NE": "({0} != {1} ? C(1) : C(0))",
    "NOT": "({0} == 0 ? C(1) : C(0))",
    "AND": "({0} != 0 && {1} != 0 ? C(1) : C(0))",
    "OR": "({0} != 0 || {1} != 0 ? C(1) : C(0))",
    "IF_ELSE_ZERO": "({0} != 0 ? {1} : C(0))",
    **{name.upper(): f"MATH({name})({{0}})" for name in _UNARY},
    **{name.upper(): f"MATH({name})({{0}}, {{1}})" for name in _BINARY},
}


class _Value(NamedTuple):
    """A distinct value on a tape: the name of its variable, and the operation that computes it."""

    variable: str
    operation: str


def to_c_function(function: ca.Function, name: str) -> str:
    """Return C text of `static void NAME(inputs, outputs)`, matrices row by row.

    - `function`: an SX Function with dense inputs and outputs, which become arrays of their names.
    - `name`: the name of the C function.

    Raises `InputError` if the tape has an operation that is not known here.
    """
    inputs, outputs = function.name_in(), function.name_out()
    values, stores = _straight_line(function)
    arguments = [f"const real *{name}" for name in inputs] + [f"real *{name}" for name in outputs]
    lines = [f"static void {name}({', '.join(arguments)}) {{"]
    used = {expression.partition("[")[0] for expression in values}
    lines += [f"    (void){name};" for name in inputs if name not in used]
    lines += [f"    const real {value.variable} = {expression};" for expression, value in values.items()]
    for (i, row, column), variable in sorted(stores.items()):
        lines.append(f"    {outputs[i]}[{row * function.size2_out(i) + column}] = {variable};")
    return "\n".join([*lines, "}", ""])


def operations(function: ca.Function) -> Counter[str]:
    """Count the operations of the C function by their names: ADD, MUL, SIN, ..."""
    values, _ = _straight_line(function)
    return Counter(value.operation for value in values.values() if value.operation in _OPERATIONS)


def _straight_line(function: ca.Function) -> tuple[dict[str, _Value], dict[tuple[int, int, int], str]]:
    """Return the distinct values of a tape by their expressions, and the variable of each (output, row, column)."""
    work: dict[int, str] = {}  # what each slot of the work vector holds now
    values: dict[str, _Value] = {}
    stores: dict[tuple[int, int, int], str] = {}
    for k in range(function.n_instructions()):
        operation = _NAMES[function.instruction_id(k)]
        inputs, outputs = function.instruction_input(k), function.instruction_output(k)
        if operation == "OUTPUT":
            column, row = divmod(outputs[1], function.size1_out(outputs[0]))
            stores[outputs[0], row, column] = work[inputs[0]]
            continue
        if operation == "INPUT":
            column, row = divmod(inputs[1], function.size1_in(inputs[0]))
            expression = f"{function.name_in(inputs[0])}[{row * function.size2_in(inputs[0]) + column}]"
        elif operation == "CONST":
            expression = literal(function.instruction_constant(k))
        elif operation in _OPERATIONS:
            expression = _OPERATIONS[operation].format(*(work[i] for i in inputs))
        else:
            accepted = ", ".join(_OPERATIONS)
            raise InputError(f"{function.name()} must have only the operations {accepted}, got {operation}")
        work[outputs[0]] = values.setdefault(expression, _Value(f"v{len(values)}", operation)).variable
    return values, stores


def literal(value: float) -> str:
    """Return a number as C text."""
    text = f"C({float(value)!r})"
    return {"C(inf)": "C(INFINITY)", "C(-inf)": "C(-INFINITY)", "C(nan)": "C(NAN)"}.get(text, text)
