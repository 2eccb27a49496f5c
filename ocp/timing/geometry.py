"""`geometry`: the curve of a path, parametrised so that it rests nowhere unless it turns at once there."""

import numpy as np

from ...base.errors import InputError
from ..tasks.paths import (
    AnyPath,
    Curve,
    FeedPath,
    LinePath,
    ReturnPath,
    SamplePath,
    SequencePath,
    TimedPath,
    WaypointPath,
)

PIECES = (400, 800, 1600)  # of a spline through points of a path, until it is near enough
LOOKS = 20_001
ON_PATH = 2e-6  # of a path's length: how far that spline may be off


def geometry(path: AnyPath, *, alone: bool) -> Curve:
    """Return the curve of a path; `alone` if no other path is followed with the same s.

    Raises `InputError` if a spline or samples turn so sharply that they must rest, or move nowhere, or for a
    sequence, a return or a feed.
    """
    if isinstance(path, SequencePath):
        raise InputError("path.kind must not be sequence to time a path; time its parts one by one")
    if isinstance(path, FeedPath):
        raise InputError("path.kind must not be feed to time a path, since it has its own speed; plan it instead")
    if isinstance(path, ReturnPath):
        raise InputError("path.kind must not be return to time a path; time the whole path instead")
    if isinstance(path, TimedPath):
        return path.along
    if isinstance(path, LinePath):
        return path.model_copy(update={"timing": "uniform"})
    if isinstance(path, WaypointPath) and path.shape == "spline" and (alone or path.times is None):
        return _by_length(path)
    return _by_length(path) if isinstance(path, SamplePath) and alone else path


def _by_length(path: WaypointPath | SamplePath) -> SamplePath:
    """Return a spline by length through many points of a path, densest at its ends."""
    shares = np.linspace(0.0, 1.0, LOOKS)
    looks = path.by_fraction(shares).pose
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(looks, axis=0), axis=1)))
    smooth = f"path of kind {path.kind} must rest nowhere between its ends to be timed, and not turn at once"
    if not length[-1] > 0:
        raise InputError(f"{smooth}, got one that moves nowhere")
    worst = np.zeros(6)
    for pieces in PIECES:
        targets = length[-1] * (1 - np.cos(np.pi * np.arange(pieces + 1) / pieces)) / 2
        at = np.interp(targets, length, shares)
        at[[0, -1]] = 0.0, 1.0
        poses = tuple((x, y, z, roll, pitch, yaw) for x, y, z, roll, pitch, yaw in path.by_fraction(at).pose.tolist())
        times = tuple((targets / length[-1]).tolist())
        spline = SamplePath(kind="samples", frame=path.frame, times=times, poses=poses)
        # Between the points only the deviation across the path matters: the time law decides where along it.
        between = (targets[1:] + targets[:-1]) / 2
        target, along, _ = path.by_fraction(np.interp(between, length, shares))
        along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), np.finfo(float).tiny)
        off = spline.by_fraction(between / length[-1]).pose - target
        across = np.linalg.norm(off - np.sum(off * along, axis=1, keepdims=True) * along, axis=1)
        if across.max() <= ON_PATH * length[-1]:
            return spline
        worst = target[int(across.argmax())]
    raise InputError(f"{smooth}, got one that does near ({', '.join(f'{value:.3g}' for value in worst[:3])}) m")
