"""Estimation from measurements: the pose from cable lengths (`pose`) and geometric calibration (`calibration`)."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .pose.branches import branches
from .pose.estimate import PoseEstimate
from .pose.filter import MotionEstimate, PoseFilter
from .pose.from_lengths import pose_from_lengths
from .pose.from_log import LogPoses, poses_from_log

__all__ = [
    "LogPoses",
    "MotionEstimate",
    "PoseEstimate",
    "PoseFilter",
    "branches",
    "pose_from_lengths",
    "poses_from_log",
]


if not TYPE_CHECKING:  # a type checker would accept any name

    def __getattr__(name: str) -> Any:
        """Load the package `calibration` when it is first used."""
        if name != "calibration":
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return import_module(".calibration", __name__)
