"""Compile the kernels of a step, together with those of the plant for bodies and cables that they use."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from ..base.machine_code.kernel import Kernel, compile_function
from ..plant import machine
from ..plant.machine import joined

__all__ = ["aim", "carriers_of", "directions", "mechanics", "move_on", "stages", "thrusts"]

_PLANT, _HERE = Path(machine.__file__).parent, Path(__file__).parent
_SHARED = tuple(_PLANT / f"{name}.py" for name in ("layout", "bodies", "lines"))
_MECHANICS = (*_SHARED, _HERE / "carrier_compensation.py", _HERE / "mechanics.py")
_TETHERS = (*_MECHANICS, _HERE / "fixed_length_carriers.py")
_ROBOT = "Tuple((float64[:, ::1], float64[:, ::1], float64[::1], float64[::1]))"
_OF_ROWS = (
    f"void({_ROBOT}, float64[:, ::1], float64[:, ::1], float64[:, ::1], float64, float64, float64, "
    "float64[:, :, ::1], float64[:, :, ::1], float64[:, ::1], float64[:, ::1], float64[:, :, ::1], float64[:, :, ::1], "
    "boolean[::1], float64[:, :, ::1], "
    "float64[:, :, :, ::1], float64[:, :, :, ::1], float64[:, :, ::1], float64[:, ::1], float64[:, :, ::1])"
)
_OF_AGE = f"void({_ROBOT}, float64, float64[:, ::1], float64[:, :, ::1], float64[:, :, ::1], float64[:, :, ::1])"
_OF_THRUSTS = (
    f"void({_ROBOT}, float64[:, ::1], float64[:, :, ::1], float64[:, :, ::1], float64, float64[:, :, ::1], "
    "float64[:, :, :, ::1], float64[:, ::1], float64[:, :, ::1], float64[:, :, ::1], float64[:, :, :, ::1], "
    "float64[:, :, ::1])"
)
_OF_STAGES = (
    f"void({_ROBOT}, int64[:, ::1], float64[:, ::1], float64[::1], float64[::1], float64[:, :, ::1], float64[:, ::1], "
    "float64[:, ::1], float64[:, :, :], float64[:, :, :], float64[:, :])"
)
_OF_AIM = (
    "void(float64[::1], float64, float64[::1], float64[:, :, :], float64[:, :, :], float64[:, :], float64[:, :], "
    "float64[:, :])"
)
_OF_DIRECTIONS = f"void({_ROBOT}, float64[:, ::1], float64[:, :, ::1], float64[:, :, ::1])"
_OF_CARRIERS = f"void({_ROBOT}, float64[:, ::1], float64[:, ::1], float64[:, :, ::1])"


@cache
def mechanics() -> Kernel:
    """Return `mechanics.write_rows` as machine code; compiling takes some seconds once on a machine."""
    return _compiled(_MECHANICS, "write_rows", _OF_ROWS)


@cache
def move_on() -> Kernel:
    """Return `ageing.move_on` as machine code; compiling takes some seconds once on a machine."""
    return _compiled((*_TETHERS, _HERE / "prediction.py", _HERE / "ageing.py"), "move_on", _OF_AGE)


@cache
def thrusts() -> Kernel:
    """Return `thrusts.write_thrusts` as machine code; compiling takes some seconds once on a machine."""
    return _compiled((*_MECHANICS, _HERE / "thrusts.py"), "write_thrusts", _OF_THRUSTS)


@cache
def stages() -> Kernel:
    """Return `prediction.write_stages` as machine code; compiling takes some seconds once on a machine."""
    return _compiled((*_TETHERS, _HERE / "prediction.py"), "write_stages", _OF_STAGES)


@cache
def aim() -> Kernel:
    """Return `aiming.aim` as machine code; compiling takes some seconds once on a machine."""
    return _compiled((_PLANT / "layout.py", _HERE / "carrier_compensation.py", _HERE / "aiming.py"), "aim", _OF_AIM)


@cache
def directions() -> Kernel:
    """Return `tethers.write_directions` as machine code; compiling takes some seconds once on a machine."""
    return _compiled(_TETHERS, "write_directions", _OF_DIRECTIONS)


@cache
def carriers_of() -> Kernel:
    """Return `tethers.write_carriers` as machine code; compiling takes some seconds once on a machine."""
    return _compiled(_TETHERS, "write_carriers", _OF_CARRIERS)


def _compiled(modules: tuple[Path, ...], name: str, signature: str) -> Kernel:
    return compile_function(joined(modules, name), name, signature)
