"""The numeric core, in C: tension distribution, and a robot's mechanics.

Its functions work on the memory of arrays; what they take is in `_core.pyi` and the headers beside it. Packages above
call them with arrays that they have checked.
"""

from ._core import CABLES, MOST_CABLES, MOST_CARRIERS, ROWS, lines, required_wrench, solve_packed, solve_rows

__all__ = ["CABLES", "MOST_CABLES", "MOST_CARRIERS", "ROWS", "lines", "required_wrench", "solve_packed", "solve_rows"]
