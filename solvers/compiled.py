"""When the Numba kernels are loaded: not before they pay.

`import numba` takes 0.2 s to 0.5 s and the machine code 0.3 s from the disk; the first time on a machine it is compiled
in some ten seconds. A process that solves a handful of problems is better off without.
"""

import threading
from collections.abc import Callable
from types import ModuleType

__all__ = ["CALLS_WORTH_LOADING", "count_a_call", "load", "solve_packed"]

CALLS_WORTH_LOADING = 5000

solve_packed: Callable[..., int] | None = None
"""`kernel.solve_packed` once it is loaded."""

_calls = 0
_loading = threading.Lock()


def load() -> ModuleType:
    """Load the kernels now, or compile them if this machine has not yet; return their module."""
    global solve_packed
    with _loading:
        from . import kernel

        solve_packed = kernel.solve_packed
    return kernel


def count_a_call() -> Callable[..., int] | None:
    """Count a call that had to do without the kernel, and load it if there have been enough of them."""
    global _calls
    _calls += 1
    if _calls >= CALLS_WORTH_LOADING:
        load()
    return solve_packed
