"""Compile the kernel of `horizon`: its modules, joined to one source, become one function of machine code."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

from ...base.machine_code.kernel import Kernel, compile_function, joined

__all__ = ["solve_stages"]

_FOLDER = Path(__file__).parent
_MODULES = tuple(_FOLDER / f"{name}.py" for name in ("layout", "products", "riccati", "measure", "begin", "interior"))
_SIGNATURE = "void(float64[::1], int64[::1], float64[::1])"


@cache
def solve_stages() -> Kernel:
    """Return `interior.solve_stages` as machine code; compiling takes some 20 s once on a machine."""
    from . import vectors

    digest = hashlib.sha256((_FOLDER / "vectors.py").read_bytes()).hexdigest()
    source = f"# vectors: {digest}\n" + joined(_MODULES, "solve_stages")
    return compile_function(source, "solve_stages", _SIGNATURE, vectors.NAMES)
