from typing import Any

CABLES: int
ROWS: int

def solve_packed(packed: Any, tensions: Any, direction: Any = None) -> int: ...
def solve_rows(n: int, m: int, rho: float, *arrays: Any) -> int: ...
