"""Whether compiled code is worth its start-up time: decided once for a whole run.

Compiled code takes up to a minute on a machine's first run and a second on later ones, and then a microsecond or two a
problem. It agrees with the code that needs no compiling only up to rounding errors. So the decision rests on the size
of the whole run, never on a chunk or on what a process did before: the result does not depend on who computes what.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

__all__ = ["compiled_code", "is_decided", "uses_compiled_code", "worth_compiled_code"]

WORTH_COMPILED_CODE = 100_000  # tension problems

_decision: ContextVar[bool | None] = ContextVar("compiled_code", default=None)


def worth_compiled_code(problems: int) -> bool:
    """Return whether so many tension problems are worth compiled code."""
    return problems >= WORTH_COMPILED_CODE


@contextmanager
def compiled_code(use: bool) -> Iterator[None]:
    """Use compiled code, or do without it, for the tension problems inside the block."""
    token = _decision.set(use)
    try:
        yield
    finally:
        _decision.reset(token)


def is_decided() -> bool:
    """Return whether this is inside a `compiled_code` block."""
    return _decision.get() is not None


def uses_compiled_code(problems: int) -> bool:
    """Return what the block decided; outside of one, whether so many tension problems are worth compiled code."""
    decision = _decision.get()
    return worth_compiled_code(problems) if decision is None else decision
