"""The kernels: what Numba compiles. Imported by `compiled.py` alone, since Numba takes its time."""

from .rows import solve_rows
from .single import solve_packed

__all__ = ["solve_packed", "solve_rows"]
