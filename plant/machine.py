"""Join kernels of controllers with those of bodies and cables to one source, which becomes machine code."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from ..base.machine_code import kernel

__all__ = ["joined"]

# Called once or twice in each evaluation: a call hands seven words over for each array.
INLINED = {
    *("place_bodies", "_impose", "_position", "_velocity", "_acceleration"),
    *("set_quaternion", "normalise", "move_bodies", "_follow"),
    *("run_cables", "pull_of", "load_bodies", "pull_bodies"),
}


def joined(modules: Iterable[Path], entry: str) -> str:
    """Return modules as one source, see `kernel.joined`, with the small functions of the plant inlined."""
    return kernel.joined(modules, entry, INLINED)
