from typing import Any

CABLES: int  # of tension distribution
ROWS: int
MOST_CABLES: int  # of a robot's record
MOST_CARRIERS: int
ROBOT_BYTES: int
PROCESSOR: int  # kind of this one: 0 any, 1 with AVX2, 2 with AVX-512

def solve_packed(packed: Any, tensions: Any, direction: Any = None) -> int: ...
def solve_rows(n: int, m: int, rho: float, in_lanes: bool, *arrays: Any) -> int: ...
def facets(A: Any, low: Any, high: Any, normals: Any, least: Any, most: Any) -> None: ...
def full_rank(n: int, tolerance: float, A: Any, full: Any) -> None: ...
def lines(
    robot: Any, poses: Any, carriers: Any, lengths: Any, A: Any, J: Any, anchors: Any, sensitivity: Any
) -> None: ...
def required_wrench(robot: Any, poses: Any, velocities: Any, accelerations: Any, wind: Any, w: Any) -> None: ...
def horizon_size(N: int, n: int, m: int, p: int) -> int: ...
def horizon_places(N: int, n: int, m: int, p: int, memory: Any) -> dict[str, int]: ...
def horizon_relative_to(
    N: int, n: int, m: int, p: int, processor: int, memory: Any, states: Any, controls: Any
) -> None: ...
def horizon_solve(
    N: int,
    n: int,
    m: int,
    p: int,
    processor: int,
    beginning: int,
    iterations_max: int,
    tolerance: float,
    memory: Any,
    residuals: Any,
) -> tuple[int, bool]: ...
def run_plant(
    robot: Any,
    settings: Any,
    states: Any,
    commands: Any,
    history: Any,
    tensions: Any,
    steps: int,
    period: float,
    substeps: int,
    keep: int,
) -> None: ...
def sense(robot: Any, states: Any, motions: Any, lengths: Any) -> None: ...
def winch_lengths(
    robot: Any, states: Any, lengths: Any, tensions: Any, last_rates: Any, commands: Any, period: float
) -> None: ...
