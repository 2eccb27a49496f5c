"""Compile the kernel of `sensors`, with the plant's kernels that it uses; `prepare` compiles those of flights."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from ..control.machine import mechanics
from ..models.kernel import Kernel, compile_function
from ..models.plant import machine
from ..models.plant.machine import joined, run_rows

__all__ = ["prepare", "sense_rows"]

_PLANT = Path(machine.__file__).parent
_MODULES = (*(_PLANT / f"{name}.py" for name in ("layout", "bodies", "lines")), Path(__file__).parent / "sensors.py")
_SIGNATURE = (
    "void(float64[:, ::1], float64[:, ::1], float64[::1], float64[:, ::1], float64[:, :, ::1], float64[:, :, ::1])"
)


@cache
def sense_rows() -> Kernel:
    """Return `sensors.sense_rows` as machine code; compiling takes some seconds once on a machine."""
    return compile_function(joined(_MODULES, "sense_rows"), "sense_rows", _SIGNATURE)


def prepare() -> None:
    """Load the machine code of flights, so that the first one does not wait for it.

    A machine compiles it once, which takes some 30 s; loading takes less than a second.
    """
    for kernel in (run_rows, mechanics, sense_rows):
        kernel()
