"""Robots as data, and their mechanics as CasADi Functions. This package knows no solver.

Each name below loads its module when it is first used, so that reading a robot file does not load CasADi.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .library import available

if TYPE_CHECKING:
    from .dynamics import Dynamics
    from .files import load
    from .forward_kinematics.branches import branches
    from .forward_kinematics.estimate import PoseEstimate
    from .forward_kinematics.from_lengths import pose_from_lengths
    from .forward_kinematics.tracker import PoseTracker
    from .relative_dynamics import RelativeDynamics
    from .robot import Robot
    from .uncertainty import Uncertainty

__all__ = [
    "Dynamics",
    "PoseEstimate",
    "PoseTracker",
    "RelativeDynamics",
    "Robot",
    "Uncertainty",
    "available",
    "branches",
    "load",
    "pose_from_lengths",
]

_HOME = {
    "Dynamics": "dynamics",
    "PoseEstimate": "forward_kinematics.estimate",
    "PoseTracker": "forward_kinematics.tracker",
    "RelativeDynamics": "relative_dynamics",
    "Robot": "robot",
    "Uncertainty": "uncertainty",
    "branches": "forward_kinematics.branches",
    "load": "files",
    "pose_from_lengths": "forward_kinematics.from_lengths",
}


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{_HOME[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names, loaded or not."""
    return sorted({*globals(), *_HOME})
