"""Which poses are reachable. One pose for now: the tension problem that it poses, and whether it has an answer."""

from .pose import hints, pose_problem

__all__ = ["hints", "pose_problem"]
