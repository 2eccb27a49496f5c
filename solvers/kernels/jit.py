"""Mark the functions of this package that `compiled.py` can turn into machine code; until then they are plain Python.

The same source gives the same bits with and without Numba: Numba compiles it without fused or reordered arithmetic.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

__all__ = ["GIVEN", "VECTOR", "compilable"]

Function = Callable[..., Any]

# Types of Numba as text, so that this module does not import it.
VECTOR = "Array(float64, 1, 'C')"
GIVEN = "Array(float64, 1, 'C', readonly=True)"


def compilable(*signature: str) -> Callable[[Function], Function]:
    """Mark a function; a signature (result, arguments) is compiled at once, and no other one."""

    def mark(function: Function) -> Function:
        text = f"{signature[0]}({', '.join(signature[1:])})" if signature else ""
        function.__dict__["signature"] = text
        return function

    return mark
