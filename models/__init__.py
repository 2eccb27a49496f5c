"""Robots as data, and their mechanics as CasADi Functions. This package is independent of the solvers.

Each name below loads its module when it is first used, so that reading a robot file does not load CasADi.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from ..base.former_names import moved_name
from .library import available

if TYPE_CHECKING:
    from .dynamics import Dynamics
    from .files import load
    from .relative_dynamics import RelativeDynamics
    from .robot import Robot
    from .uncertainty import Uncertainty

__all__ = ["Dynamics", "RelativeDynamics", "Robot", "Uncertainty", "available", "load"]

_HOME = {
    "Dynamics": "dynamics",
    "RelativeDynamics": "relative_dynamics",
    "Robot": "robot",
    "Uncertainty": "uncertainty",
    "load": "files",
}


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used."""
    if name not in _HOME:
        return moved_name("models", name)
    value = getattr(import_module(f".{_HOME[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names, loaded or not."""
    return __all__
