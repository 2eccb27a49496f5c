"""The numeric core, in C: tension distribution, a robot's mechanics, and the program of predictive control.

Its functions work on the memory of arrays; what they take is in `_core.pyi` and the headers beside it. Packages above
call them with arrays that they have checked.
"""

from ._core import (
    CABLES,
    MOST_CABLES,
    MOST_CARRIERS,
    PROCESSOR,
    ROWS,
    control_aim,
    control_carriers,
    control_coordinates,
    control_move_on,
    control_problem,
    control_stages,
    control_take,
    control_thrusts,
    facets,
    full_rank,
    horizon_places,
    horizon_relative_to,
    horizon_size,
    horizon_solve,
    lines,
    required_wrench,
    solve_packed,
    solve_rows,
)

__all__ = [
    "CABLES",
    "MOST_CABLES",
    "MOST_CARRIERS",
    "PROCESSOR",
    "ROWS",
    "control_aim",
    "control_carriers",
    "control_coordinates",
    "control_move_on",
    "control_problem",
    "control_stages",
    "control_take",
    "control_thrusts",
    "facets",
    "full_rank",
    "horizon_places",
    "horizon_relative_to",
    "horizon_size",
    "horizon_solve",
    "lines",
    "required_wrench",
    "solve_packed",
    "solve_rows",
]
