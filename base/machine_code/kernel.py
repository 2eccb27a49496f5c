"""Kernels: loops in Python source, compiled by Numba once for this process and once for this machine.

Compiled code is kept in the user's cache, so that the next process loads it in a fraction of the time: under
`$TOWLINE_CACHE`, else `$XDG_CACHE_HOME/towline`, else `~/.cache/towline`, a folder for each kernel, named by a hash of
everything that decides on the machine code. Where nothing can be written, kernels are compiled without it. Files are
written atomically, and a seal, the hash of them, reveals later damage: Numba would run it as it is.
"""

from __future__ import annotations

import ast
import hashlib
import math
import os
import platform
import threading
from collections.abc import Callable, Collection, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from ..version import __version__
from ..writing import whole_file

Kernel = Callable[..., None]  # (start, stop, *inputs (N, r, c), *outputs (N, r, c)); it releases the GIL

# Types of Numba as text, so that this module does not import it: inputs in any layout, also read-only; outputs.
GIVEN, RESULT = "Array(float64, {}, 'A', readonly=True)", "Array(float64, {}, 'C')"

_LONG_AGO = 1_000_000_000  # [s]; Numba knows a source by its time and size, and two processes may write it at once

_compiled: dict[str, Kernel] = {}
_compiling = threading.Lock()


def compile_kernel(source: str, n_in: int, n_out: int) -> Kernel:
    """Compile `kernel(start, stop, *inputs, *outputs)`, or take it from memory or from the disk.

    Parameters
    ----------
    source
        From `tape.translate`.
    n_in, n_out
        How many inputs (N, r, c) of float64 in any layout, also read-only, and outputs in C order it has.
    """
    return compile_function(source, "kernel", _signature(n_in, n_out))


def compile_function(source: str, name: str, signature: str) -> Kernel:
    """Compile the function `name` of a source, in which decorators mark those that it calls, or take it from the disk.

    Parameters
    ----------
    source
        Python with `math`, `np` and the decorators `part` and `inlined`, and nothing else from outside. What they mark
        allocates no memory.
    name
        The function that is returned.
    signature
        Its types in Numba's notation.
    """
    with _compiling:
        if source not in _compiled:
            _compiled[source] = _from_disk(source, name, signature) or _compile(source, name, signature)
        return _compiled[source]


def joined(modules: Iterable[Path], entry: str, inlined: Collection[str] = ()) -> str:
    """Return the functions and constants of modules that import only `math`, NumPy and each other.

    Parameters
    ----------
    modules
        Files, each after those that it imports.
    entry
        The function that calls the others, which alone may allocate memory.
    inlined
        Functions that are copied to where they are called.
    """
    lines: list[str] = []
    for module in modules:
        for node in ast.parse(module.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef):
                node.body = [part for part in node.body if not _is_text(part)]
                mark = "@inlined" if node.name in inlined else "@part"
                lines += [ast.unparse(node)] if node.name == entry else [mark, ast.unparse(node)]
            elif isinstance(node, ast.Assign):
                lines.append(ast.unparse(node))
    return "\n".join(lines) + "\n"


def _is_text(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def cache_folder() -> Path:
    """Return the folder of compiled kernels: `$TOWLINE_CACHE`, else `towline` in the user's cache folder."""
    if place := os.environ.get("TOWLINE_CACHE"):
        return Path(place)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "towline"


def _signature(n_in: int, n_out: int) -> str:
    arrays = [GIVEN.format(3)] * n_in + [RESULT.format(3)] * n_out
    return f"void(intp, intp, {', '.join(arrays)})"


def _compile(source: str, name: str, signature: str, file: Path | None = None) -> Kernel:
    """Compile the function, by Numba's cache beside `file` if one is given."""
    import numba

    options: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
    # Parts are called by compiled code alone, and allocate nothing, so that they count no references to arrays.
    part = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "_nrt": False, **options}
    # When Numba loads a function it imports the module named in it.
    space: dict[str, Any] = {"__name__": __name__, "math": math, "np": np}
    space |= {"part": numba.njit(**part), "inlined": numba.njit(forceinline=True, **part)}
    exec(compile(source, str(file or "<kernel>"), "exec"), space)
    return numba.njit(signature, cache=file is not None, **options)(space[name])


def _from_disk(source: str, name: str, signature: str) -> Kernel | None:
    """Compile with the cache on the disk; None where there is none or it is broken beyond repair."""
    try:
        folder = cache_folder() / _key(source)
        file, seal = folder / "kernel.py", folder / "seal"
        if not _is_intact(folder, source):
            for damaged in [seal, *_machine_code(folder)]:
                damaged.unlink(missing_ok=True)
            with whole_file(file) as place:
                place.write_text(source, encoding="utf-8")
                os.utime(place, (_LONG_AGO, _LONG_AGO))
        kernel = _compile(source, name, signature, file)
        if not seal.exists():
            with whole_file(seal) as place:
                place.write_text(_hash_of(folder))
    except Exception:  # a full or read-only disk, a pickle of anything: the cache is only ever a help
        return None
    return kernel


def _key(source: str) -> str:
    """Return the hash of everything that decides on the machine code: source, compilers and processor."""
    import llvmlite.binding
    import numba

    parts = [source, __version__, numba.__version__, np.__version__, platform.python_version()]
    parts += [llvmlite.binding.get_host_cpu_name(), llvmlite.binding.get_host_cpu_features().flatten()]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]


def _is_intact(folder: Path, source: str) -> bool:
    file, seal = folder / "kernel.py", folder / "seal"
    if not file.exists() or file.read_bytes() != source.encode():
        return False
    # Without a seal another process is about to write it, or was killed before: what is there is whole.
    return not seal.exists() or seal.read_bytes() == _hash_of(folder).encode()


def _machine_code(folder: Path) -> list[Path]:
    return sorted([*folder.glob("__pycache__/*.nbi"), *folder.glob("__pycache__/*.nbc")])


def _hash_of(folder: Path) -> str:
    return hashlib.sha256(b"".join(file.read_bytes() for file in _machine_code(folder))).hexdigest()
