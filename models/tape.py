"""A CasADi Function's instruction tape as the Python source of a loop that Numba can compile.

An SX Function is a straight list of scalar instructions on a work vector: load an input's element, compute, store an
output's element. The source has one local variable for each distinct value on the tape (two instructions that do the
same with the same values share it, which changes no bit) and does the operations in the tape's order, so that it
rounds where CasADi does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import casadi as ca

from ..base.errors import InputError

LONGEST = 15_000  # instructions; compiling takes about 1 ms for each, and more beyond

_OPERATIONS = {
    "ADD": "{0} + {1}",
    "SUB": "{0} - {1}",
    "MUL": "{0} * {1}",
    "DIV": "{0} / {1}",
    "NEG": "-{0}",
    "INV": "1.0 / {0}",
    "SQ": "{0} * {0}",
    "TWICE": "2.0 * {0}",
    "SQRT": "math.sqrt({0})",
    "POW": "math.pow({0}, {1})",
    "CONSTPOW": "math.pow({0}, {1})",
    "HYPOT": "math.hypot({0}, {1})",
    "EXP": "math.exp({0})",
    "EXPM1": "math.expm1({0})",
    "LOG": "math.log({0})",
    "LOG1P": "math.log1p({0})",
    "SIN": "math.sin({0})",
    "COS": "math.cos({0})",
    "TAN": "math.tan({0})",
    "ASIN": "math.asin({0})",
    "ACOS": "math.acos({0})",
    "ATAN": "math.atan({0})",
    "ATAN2": "math.atan2({0}, {1})",
    "SINH": "math.sinh({0})",
    "COSH": "math.cosh({0})",
    "TANH": "math.tanh({0})",
    "ASINH": "math.asinh({0})",
    "ACOSH": "math.acosh({0})",
    "ATANH": "math.atanh({0})",
    "ERF": "math.erf({0})",
    "FABS": "math.fabs({0})",
    "SIGN": "(-1.0 if {0} < 0.0 else (1.0 if {0} > 0.0 else {0}))",
    "COPYSIGN": "math.copysign({0}, {1})",
    "FMOD": "np.fmod({0}, {1})",
    "FLOOR": "np.floor({0})",
    "CEIL": "np.ceil({0})",
    "FMIN": "np.fmin({0}, {1})",
    "FMAX": "np.fmax({0}, {1})",
    "LT": "(1.0 if {0} < {1} else 0.0)",
    "LE": "(1.0 if {0} <= {1} else 0.0)",
    "EQ": "(1.0 if {0} == {1} else 0.0)",
    "NE": "(1.0 if {0} != {1} else 0.0)",
    "NOT": "(1.0 if {0} == 0.0 else 0.0)",
    "AND": "(1.0 if {0} != 0.0 and {1} != 0.0 else 0.0)",
    "OR": "(1.0 if {0} != 0.0 or {1} != 0.0 else 0.0)",
    "IF_ELSE_ZERO": "({1} if {0} != 0.0 else 0.0)",
}
_NAMES = {getattr(ca, name): name.removeprefix("OP_") for name in dir(ca) if name.startswith("OP_")}


def dense(function: ca.Function) -> ca.Function:
    """Return the Function with dense inputs and outputs, under the same names."""
    sparsities = [function.sparsity_in(i) for i in range(function.n_in())]
    sparsities += [function.sparsity_out(i) for i in range(function.n_out())]
    if all(sparsity.is_dense() for sparsity in sparsities):
        return function
    kind: Any = ca.SX if function.is_a("SXFunction") else ca.MX
    inputs = [kind.sym(name, *function.size_in(name)) for name in function.name_in()]
    outputs = [ca.densify(value) for value in function.call(inputs)]
    return ca.Function(function.name(), inputs, outputs, function.name_in(), function.name_out())


def translate(function: ca.Function) -> str:
    """Return Python source of `kernel(start, stop, x0, x1, ..., y0, y1, ...)`, for rows start to stop of a batch.

    Parameters
    ----------
    function
        A Function with dense inputs and outputs, as from `dense`. An MX Function is expanded first.

    Returns
    -------
    str
        xi and yi are inputs and outputs, (N, rows, columns) each. It needs `math` and `np` as globals.

    Raises
    ------
    InputError
        If an MX Function cannot be expanded, the tape has an operation that is not known here, or is too long.
    """
    tape = scalar(function)
    if tape.n_instructions() > LONGEST:
        raise InputError(
            f"{function.name()} must have at most {LONGEST} instructions for a kernel, got {tape.n_instructions()}"
        )
    variables, stores = straight_line(tape, _OPERATIONS, "x{0}[k, {1}, {2}]".format, _literal)
    arguments = [f"x{i}" for i in range(tape.n_in())] + [f"y{i}" for i in range(tape.n_out())]
    lines = [f"def kernel(start, stop, {', '.join(arguments)}):", "    for k in range(start, stop):"]
    lines += [f"        {variable} = {expression}" for expression, variable in variables.items()]
    # Row by row, as they lie in memory; the tape stores column by column.
    lines += [f"        y{i}[k, {row}, {column}] = {value}" for (i, row, column), value in sorted(stores.items())]
    return "\n".join([*lines, "        pass", ""])  # for a Function without outputs


def scalar(function: ca.Function) -> ca.Function:
    """Return the Function as one of scalar instructions; an MX Function is expanded.

    Raises
    ------
    InputError
        If it cannot be expanded.
    """
    if function.is_a("SXFunction"):
        return function
    try:
        return function.expand()
    except RuntimeError:
        raise InputError(f"{function.name()} must have only SX operations, got one that cannot be expanded") from None


def straight_line(
    tape: ca.Function,
    operations: Mapping[str, str],
    load: Callable[[int, int, int], str],
    literal: Callable[[float], str],
) -> tuple[dict[str, str], dict[tuple[int, int, int], str]]:
    """Translate a Function of scalar instructions to one variable for each distinct value, in the tape's order.

    Parameters
    ----------
    tape
        From `scalar`, with dense inputs and outputs.
    operations
        The expression of each operation, with {0} and {1} for its operands.
    load, literal
        Return the expression of an input's element (input, row, column), and that of a constant.

    Returns
    -------
    variables, stores
        The name of each expression's variable, and that of each output's element (output, row, column).

    Raises
    ------
    InputError
        If the tape has an operation that is not among `operations`.
    """
    work: dict[int, str] = {}  # what each slot of the work vector holds now
    variables: dict[str, str] = {}
    stores: dict[tuple[int, int, int], str] = {}
    for k in range(tape.n_instructions()):
        operation = _NAMES[tape.instruction_id(k)]
        inputs, outputs = tape.instruction_input(k), tape.instruction_output(k)
        if operation == "OUTPUT":
            column, row = divmod(outputs[1], tape.size1_out(outputs[0]))
            stores[outputs[0], row, column] = work[inputs[0]]
            continue
        if operation == "INPUT":
            column, row = divmod(inputs[1], tape.size1_in(inputs[0]))
            expression = load(inputs[0], row, column)
        elif operation == "CONST":
            expression = literal(tape.instruction_constant(k))
        elif operation in operations:
            expression = operations[operation].format(*(work[i] for i in inputs))
        else:
            raise InputError(f"{tape.name()} must have only the operations {', '.join(operations)}, got {operation}")
        work[outputs[0]] = variables.setdefault(expression, f"v{len(variables)}")
    return variables, stores


def _literal(value: float) -> str:
    text = repr(value)
    return {"inf": "math.inf", "-inf": "-math.inf", "nan": "math.nan"}.get(text, text)
