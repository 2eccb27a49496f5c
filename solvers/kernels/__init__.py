"""The kernels: what Numba compiles. Imported by `compiled.py` alone, since Numba takes its time."""

from .rows import solve_rows
from .simd import WIDTH
from .single import solve_packed

__all__ = ["WIDTH", "solve_packed", "solve_rows"]
