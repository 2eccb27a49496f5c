"""Compile the kernels of `sensors` and `winch_lengths`, with those of the plant that they use: `prepare` does all."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from ..base.machine_code.kernel import GIVEN, Kernel, compile_function
from ..plant import machine
from ..plant.machine import joined, run_rows

__all__ = ["prepare", "sense_rows", "write_lengths"]

_PLANT, _HERE = Path(machine.__file__).parent, Path(__file__).parent
_MODULES = (*(_PLANT / f"{name}.py" for name in ("layout", "bodies", "lines")), _HERE / "sensors.py")
_SIGNATURE = (
    "void(float64[:, ::1], float64[:, ::1], float64[::1], float64[:, ::1], float64[:, :, ::1], float64[:, :, ::1])"
)


@cache
def sense_rows() -> Kernel:
    """Return `sensors.sense_rows` as machine code; compiling takes some seconds once on a machine."""
    return compile_function(joined(_MODULES, "sense_rows"), "sense_rows", _SIGNATURE)


@cache
def write_lengths() -> Kernel:
    """Return `winding.write_lengths` as machine code; compiling takes a second once on a machine."""
    signature = (
        f"void(float64[:, ::1], intp, float64[:, :, ::1], float64[:, ::1], {GIVEN.format(2)}, float64[::1], "
        "float64[::1], float64, float64, float64[:, ::1], intp)"
    )
    return compile_function(joined([_HERE / "winch_lengths.py"], "write_lengths"), "write_lengths", signature)


def prepare() -> None:
    """Load the machine code of flights, so that the first one does not wait for it.

    A machine compiles it once, which takes some 30 s; loading takes less than a second.
    """
    for kernel in (run_rows, sense_rows, write_lengths):
        kernel()
