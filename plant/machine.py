"""Compile the kernels of the plant: their modules, joined to one source, become one function of machine code.

It is the same for all robots, which are data to it, so it is compiled once on a machine and then loaded from the user's
cache, see `kernel`. Its parts can be joined with other modules, as a controller that runs beside the plant.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from pathlib import Path

from ..base.machine_code import kernel
from ..base.machine_code.kernel import GIVEN, RESULT, Kernel, compile_function

__all__ = ["MODULES", "joined", "run_rows"]

_FOLDER = Path(__file__).parent
MODULES = tuple(
    _FOLDER / f"{name}.py"
    for name in ("layout", "carrier_motion", "bodies", "lines", "constraints", "forces", "impacts", "steps", "rows")
)

# Called once or twice in each evaluation: a call hands seven words over for each array.
INLINED = {
    *("place_bodies", "_impose", "_position", "_velocity", "_acceleration"),
    *("set_quaternion", "normalise", "move_bodies", "_follow"),
    *("run_cables", "pull_of", "load_bodies", "pull_bodies"),
    *("set_modes", "elastic_tensions", "_geometry", "_forces"),
}

_SIGNATURE = (
    f"void(intp, intp, {', '.join(['float64[:, ::1]'] * 2)}, float64[::1], {GIVEN.format(2)}, {GIVEN.format(3)}, "
    f"intp, float64, intp, intp, {RESULT.format(3)}, {RESULT.format(3)})"
)


def joined(modules: Iterable[Path], entry: str) -> str:
    """Return modules as one source, see `kernel.joined`, with the small functions of the plant inlined."""
    return kernel.joined(modules, entry, INLINED)


@cache
def run_rows() -> Kernel:
    """Return `rows.run_rows` as machine code; compiling takes some 45 s, loading 1 s."""
    return compile_function(joined(MODULES, "run_rows"), "run_rows", _SIGNATURE)
