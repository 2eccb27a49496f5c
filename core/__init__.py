"""The numeric core, in C: tension distribution, a robot's mechanics and motion, and the program of predictive control.

Its functions work on the memory of arrays; what they take is in `_core.pyi` and the headers beside it. Packages above
call them with arrays that they have checked.
"""

from ._core import (
    CABLES,
    MOST_CABLES,
    MOST_CARRIERS,
    PROCESSOR,
    ROWS,
    facets,
    full_rank,
    horizon_places,
    horizon_relative_to,
    horizon_size,
    horizon_solve,
    lines,
    required_wrench,
    run_plant,
    sense,
    solve_packed,
    solve_rows,
    winch_lengths,
)

__all__ = [
    "CABLES",
    "MOST_CABLES",
    "MOST_CARRIERS",
    "PROCESSOR",
    "ROWS",
    "facets",
    "full_rank",
    "horizon_places",
    "horizon_relative_to",
    "horizon_size",
    "horizon_solve",
    "lines",
    "required_wrench",
    "run_plant",
    "sense",
    "solve_packed",
    "solve_rows",
    "winch_lengths",
]
