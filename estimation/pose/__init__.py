"""Forward kinematics: the pose of the platform from the lengths of its cables."""

from .branches import branches
from .estimate import PoseEstimate
from .from_lengths import pose_from_lengths
from .tracker import PoseTracker

__all__ = ["PoseEstimate", "PoseTracker", "branches", "pose_from_lengths"]
