"""A CasADi Function's instruction tape as a C function.

It has one local variable for each distinct value, no branches, no work arrays, and no warnings. A file that includes it
defines `real`, the type of its numbers, `C(x)`, a constant of that type, and `MATH(sin)`, a function for it.
"""

from collections import Counter

import casadi as ca

from . import tape

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


def to_c_function(function: ca.Function, name: str) -> str:
    """Return C text of `static void NAME(inputs, outputs)`, matrices row by row.

    Parameters
    ----------
    function
        A Function, of which inputs and outputs become arrays of their names.
    name
        The name of the C function.

    Raises `InputError` if an MX Function cannot be expanded, or the tape has an operation that is not known here.
    """
    function = tape.scalar(tape.dense(function))
    inputs, outputs = function.name_in(), function.name_out()

    def load(i: int, row: int, column: int) -> str:
        return f"{inputs[i]}[{row * function.size2_in(i) + column}]"

    variables, stores = tape.straight_line(function, _OPERATIONS, load, literal)
    arguments = [f"const real *{name}" for name in inputs] + [f"real *{name}" for name in outputs]
    lines = [f"static void {name}({', '.join(arguments)}) {{"]
    lines += [f"    (void){inputs[i]};" for i in range(function.n_in()) if not _is_used(inputs[i], variables)]
    lines += [f"    const real {variable} = {expression};" for expression, variable in variables.items()]
    for (i, row, column), value in sorted(stores.items()):
        lines.append(f"    {outputs[i]}[{row * function.size2_out(i) + column}] = {value};")
    return "\n".join([*lines, "}", ""])


def operations(function: ca.Function) -> Counter[str]:
    """Count the operations of the C function by their names: ADD, MUL, SIN, ..."""
    function = tape.scalar(tape.dense(function))
    named = {name: f"{name} {expression}" for name, expression in _OPERATIONS.items()}
    variables, _ = tape.straight_line(function, named, "x{0}[{1}][{2}]".format, repr)
    return Counter(expression.split()[0] for expression in variables if expression.split()[0] in _OPERATIONS)


def _is_used(name: str, variables: dict[str, str]) -> bool:
    return any(expression.startswith(f"{name}[") for expression in variables)


def literal(value: float) -> str:
    """Return a number as C text."""
    text = f"C({float(value)!r})"
    return {"C(inf)": "C(INFINITY)", "C(-inf)": "C(-INFINITY)", "C(nan)": "C(NAN)"}.get(text, text)
