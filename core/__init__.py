"""The numeric core, in C: tension distribution, a robot's mechanics and motion, and the program of predictive control.

Its functions work on the memory of arrays; `_core.pyi` and the headers describe their arguments. Packages above call
them with checked arrays.
"""

# ruff: noqa: F401
from ._core import (
    CABLES,
    MOST_CABLES,
    MOST_CARRIERS,
    PROCESSOR,
    ROWS,
    columns_by_geometry,
    control_aim,
    control_carriers,
    control_coordinates,
    control_move_on,
    control_stages,
    control_step,
    control_take,
    control_thrusts,
    ends,
    facets,
    finite,
    full_rank,
    horizon_places,
    horizon_relative_to,
    horizon_size,
    horizon_solve,
    lines,
    pose_covariance,
    pose_from_lengths,
    required_wrench,
    run_plant,
    sense,
    solve_packed,
    solve_rows,
    winch_lengths,
    wrench_by_axes,
    wrench_by_pose,
)
