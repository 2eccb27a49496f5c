"""A CasADi Function's instruction tape as straight-line source of another language.

An SX Function is a straight list of scalar instructions on a work vector: load an input's element, compute, store an
output's element. The source has one local variable for each distinct value on the tape (two instructions that do the
same with the same values share it, which changes no bit) and does the operations in the tape's order, so that it
rounds where CasADi does.
"""

from collections.abc import Callable, Mapping
from typing import Any

import casadi as ca

from ..base.errors import InputError

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


def scalar(function: ca.Function) -> ca.Function:
    """Return the Function as one of scalar instructions; an MX Function is expanded.

    Raises `InputError` if it cannot be expanded.
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

    Raises `InputError` if the tape has an operation that is not among `operations`.
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
