"""Estimation from measurements: the pose from cable lengths (`pose`) and geometric calibration (`calibration`)."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .pose.branches import branches
    from .pose.estimate import PoseEstimate
    from .pose.from_lengths import pose_from_lengths
    from .pose.tracker import PoseTracker

__all__ = ["PoseEstimate", "PoseTracker", "branches", "pose_from_lengths"]

_HOME = {
    "PoseEstimate": "estimate",
    "PoseTracker": "tracker",
    "branches": "branches",
    "pose_from_lengths": "from_lengths",
}


if not TYPE_CHECKING:  # a type checker would accept any name

    def __getattr__(name: str) -> Any:
        """Load a public name, or a package, when it is first used."""
        if name in ("calibration", "pose"):
            return import_module(f".{name}", __name__)
        if name not in _HOME:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = getattr(import_module(f".pose.{_HOME[name]}", __name__), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    """List the public names, loaded or not."""
    return sorted({*globals(), *_HOME, "calibration", "pose"})
