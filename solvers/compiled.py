"""When the Numba kernels are loaded: not before they pay.

`import numba` takes 0.2 s to 0.5 s and the machine code 0.3 s from the disk; the first time on a machine it is compiled
in some 25 s. A call without the kernels costs about 0.07 ms more: a process that solves a handful of problems is better
off without them, and one that would have to compile them needs many more before that pays.
"""

import hashlib
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import ModuleType

from ..writing import whole_file

__all__ = ["CALLS_WORTH_COMPILING", "CALLS_WORTH_LOADING", "count_a_call", "load", "solve_packed"]

CALLS_WORTH_LOADING = 5000
CALLS_WORTH_COMPILING = 300_000

solve_packed: Callable[..., int] | None = None
"""`kernel.solve_packed` once it is loaded."""

_ROOM = Path(__file__).parent / "kernels"

_calls = 0
_loading = threading.Lock()


def load() -> ModuleType:
    """Load the kernels now, or compile them if this machine has not yet; return their module."""
    global solve_packed
    with _loading:
        if solve_packed is None:
            _forget_old_code()
        from . import kernels

        solve_packed = kernels.solve_packed
    return kernels


def count_a_call() -> Callable[..., int] | None:
    """Count a call that had to do without the kernel, and load it if there have been enough of them."""
    global _calls
    _calls += 1
    if _calls >= CALLS_WORTH_COMPILING or (_calls == CALLS_WORTH_LOADING and _on_disk()):
        load()
    return solve_packed


def _on_disk() -> bool:
    """Whether Numba left the kernels' machine code beside their source, where it keeps it if it may write there."""
    return any((_ROOM / "__pycache__").glob("rows.*.nbi"))


def _forget_old_code() -> None:
    """Remove machine code that is of other sources than those that lie here: Numba looks at a function's own file only.

    The tolerances are such a source too: their numbers are in the machine code.
    """
    folder = _ROOM / "__pycache__"
    sources = sorted((*_ROOM.glob("*.py"), *_ROOM.parent.glob("tolerances.py")))
    digest = hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()
    seal = folder / "sources.sha256"
    with suppress(OSError):
        if not seal.exists() or seal.read_text() != digest:
            folder.mkdir(exist_ok=True)
            for index in folder.glob("*.nb[ic]"):
                index.unlink(missing_ok=True)
            with whole_file(seal) as place:
                place.write_text(digest)
