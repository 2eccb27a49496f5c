"""Run the kernel as plain NumPy until machine code pays: that takes seconds to compile, once on a machine."""

from __future__ import annotations

import threading
from functools import cache
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from ...base.machine_code import simd
from ...base.machine_code.kernel import Kernel, compile_function
from ...base.machine_code.kernel import joined as join
from . import descent

__all__ = ["compiled", "run"]

_FOLDER = Path(__file__).parent
_MODULES = ("trigonometry", "lengths", "curvature", "descent")
_PATIENCE = 0.5  # seconds of NumPy after which machine code is loaded, or compiled

_GIVEN, _RESULT = "Array(float64, 1, 'C', readonly=True)", "Array(float64, 1, 'C')"
_NUMBERS = "float64, float64, float64, intp, intp, intp"
_SIGNATURE = f"void({_GIVEN}, intp, {', '.join([_GIVEN] * 4)}, {_NUMBERS}, {', '.join([_RESULT] * 3)})"

_lost = 0.0
_kernel: Kernel | None = None
_loading = threading.Lock()


def run(*arguments: Any) -> None:
    """Call `descent.descend_rows`, in whichever form costs less in the long run."""
    global _lost
    if _kernel is not None:
        _kernel(*arguments)
    elif _lost > _PATIENCE:
        load()(*arguments)
    else:
        begin = perf_counter()
        with np.errstate(all="ignore"):
            descent.descend_rows(*arguments)
        _lost += perf_counter() - begin


def load() -> Kernel:
    """Return the machine code, from the disk or compiled now."""
    global _kernel
    with _loading:
        _kernel = compiled()
    return _kernel


@cache
def compiled() -> Kernel:
    """Return `descent.descend_rows` as machine code; compiling takes some seconds, loading a part of one."""
    from ...base.machine_code import simd_llvm

    known = {name: getattr(simd_llvm, name) for name in simd.__all__}
    source = join([_FOLDER / f"{name}.py" for name in _MODULES], "descend_rows")
    return compile_function(source, "descend_rows", _SIGNATURE, known)
