"""Run the kernel of batches as plain NumPy until machine code pays; both give the same bits.

Importing Numba and loading the machine code from the disk takes about a second, compiling it (once on a machine) some
15 s. A process pays for that once it has lost as much time to NumPy, or when it calls `load`. It looks at the disk
again from time to time: another process may have compiled it.
"""

from __future__ import annotations

import hashlib
import shutil
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from time import perf_counter
from types import FunctionType
from typing import Any

import numpy as np

from ..base import tolerances
from ..base.display import Displayed
from ..base.machine_code import simd
from ..base.writing import whole_file
from .kernels import rows

COMPILED, INTERPRETED = "compiled", "interpreted"  # what `solution.backend` reports

_SECONDS_TO_LOAD = 1.0
_SECONDS_TO_COMPILE = 15.0
_DISK_SPACE = 50_000_000  # bytes; the machine code takes about 5 MB

_FOLDER = Path(__file__).parent / "kernels"
_SHARED = (tolerances.__file__, simd.__file__, Path(simd.__file__).with_name("simd_llvm.py"))  # in the machine code too
_MODULES = ("codes", "lanes", "lanes_newton", "lanes_proof", "lanes_slabs", "rows")

_lock = threading.Lock()
_lost = 0.0  # seconds spent in NumPy so far
_patience = _SECONDS_TO_LOAD  # seconds of NumPy until the disk is looked at for machine code


@dataclass(frozen=True, eq=False)
class Kernels(Displayed):
    """The kernel in one of its forms.

    Attributes
    ----------
    backend :
        `COMPILED` or `INTERPRETED`.
    many :
        `solve_rows` of `kernels.rows`.
    rows_at_once :
        How many rows `many` takes together; threads share multiples of it. None if threads gain nothing.
    """

    backend: str
    many: Callable[..., None]
    rows_at_once: int | None


def current() -> Kernels:
    """Return the kernels in the form that is loaded."""
    return _kernels


def load() -> Kernels:
    """Load the machine code now, or compile it if this machine has not yet; return it."""
    global _kernels
    with _lock:
        if _kernels.backend != COMPILED:
            _forget_old_code()
            _kernels = _compile()
    return _kernels


def keep() -> None:
    """Compile the machine code if the disk has none, so that processes which start later only load it."""
    _forget_old_code()
    if not _on_disk():
        load()


def _many_in_numpy(*arguments: Any) -> None:
    """Solve the rows of a batch on NumPy arrays; see `kernels.rows.solve_rows`."""
    start = perf_counter()
    with np.errstate(all="ignore"):
        rows.solve_rows(*arguments)
    _lose(perf_counter() - start)


PLAIN = Kernels(INTERPRETED, _many_in_numpy, None)
_kernels = PLAIN


def _lose(seconds: float) -> None:
    """Count the time spent in NumPy, and load the machine code once it pays."""
    global _lost, _patience
    _lost += seconds
    if _lost <= _patience:
        return
    _forget_old_code()
    if _on_disk() or _lost > _SECONDS_TO_COMPILE:
        load()
    else:
        _patience = min(2.0 * _patience, _SECONDS_TO_COMPILE)


def _compile() -> Kernels:
    """Hand copies of the marked functions to Numba; the plain ones stay as they are."""
    from ..base.machine_code import simd_llvm

    spaces = [dict(vars(import_module(f"{__package__}.kernels.{name}"))) for name in _MODULES]
    machine: dict[Any, Any] = {
        getattr(simd, name): getattr(simd_llvm, name) for name in simd.__all__ if callable(getattr(simd, name))
    }
    signatures = []
    for space in spaces:
        for function in list(space.values()):
            signature = getattr(function, "__dict__", {}).get("signature")
            if signature is None or function.__module__ != space["__name__"]:
                continue
            copy = FunctionType(function.__code__, space, function.__name__, function.__defaults__)
            machine[function] = machine_code(copy)
            if signature:
                signatures.append((machine[function], signature))
    for space in spaces:
        for name, value in space.items():
            if isinstance(value, FunctionType) and value in machine:
                space[name] = machine[value]
        space |= {name: getattr(simd_llvm, name) for name in ("WIDTH", "TOGETHER") if name in space}
    for function, signature in signatures:
        function.compile(signature)
        function.disable_compile()
    return Kernels(COMPILED, machine[rows.solve_rows], simd_llvm.WIDTH)


def machine_code(function: FunctionType) -> Any:
    """Mark a function for Numba, kept on the disk where there is a folder for that."""
    import numba

    options = {"nogil": True, "error_model": "numpy"}
    try:
        return numba.njit(function, cache=_has_space(), **options)
    except RuntimeError:  # no folder can be written
        return numba.njit(function, **options)


def _has_space() -> bool:
    """Return whether the disk has space for machine code: Numba would raise when it is full."""
    from numba.core import config

    place = Path(getattr(config, "CACHE_DIR", "") or _FOLDER)
    try:
        there = next(folder for folder in (place, *place.parents) if folder.exists())
        return shutil.disk_usage(there).free > _DISK_SPACE
    except OSError:
        return False


def _on_disk() -> bool:
    """Return whether Numba left the machine code beside the source, where it keeps it if it may write there."""
    return any((_FOLDER / "__pycache__").glob("rows.solve_rows*.nbi"))


def _forget_old_code() -> None:
    """Remove machine code of other sources than those that lie here: Numba compares a function's own file only."""
    folder = _FOLDER / "__pycache__"
    sources = [*sorted(_FOLDER.glob("*.py")), *map(Path, _SHARED)]
    digest = hashlib.sha256(b"".join(source.read_bytes() for source in sources if source.exists())).hexdigest()
    seal = folder / "sources.sha256"
    with suppress(OSError):
        if not seal.exists() or seal.read_text() != digest:
            folder.mkdir(exist_ok=True)
            for index in folder.glob("*.nb[ic]"):
                index.unlink(missing_ok=True)
            with whole_file(seal) as place:
                place.write_text(digest)
