from typing import Any

CABLES: int  # of tension distribution
ROWS: int
MOST_CABLES: int  # of a robot's record
MOST_CARRIERS: int
ROBOT_BYTES: int

def solve_packed(packed: Any, tensions: Any, direction: Any = None) -> int: ...
def solve_rows(n: int, m: int, rho: float, *arrays: Any) -> int: ...
def lines(
    robot: Any, poses: Any, carriers: Any, lengths: Any, A: Any, J: Any, anchors: Any, sensitivity: Any
) -> None: ...
def required_wrench(robot: Any, poses: Any, velocities: Any, accelerations: Any, wind: Any, w: Any) -> None: ...
