"""Draw a film of a replay, as `towline plan --animate` does, independently of any browser."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from ..figures.animation import FASTEST, Scene, Timing, draw, timing
from ..models.rotor_discs import rotor_discs
from .replay import Replay

RATE = 12.5  # [1/s]
LONGEST = 12.0  # [s] of the film: longer motions are shown faster


def film(replay: Replay) -> bytes:
    """Return a film of the saved instants of a replay as GIF."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.gif"
        speed = min(max(replay.duration / LONGEST, 1.0), FASTEST)
        when = timing(path, replay.duration, float(f"{speed:.2g}"), RATE)
        return draw(scene(replay, when), when, path).read_bytes()


def scene(replay: Replay, when: Timing) -> Scene:
    """Return what the film draws: at each of its times the nearest saved instant."""
    robot = replay.robot
    instants = [replay.at(replay.index_at(replay.times[0] + time), prove=False) for time in when.times]
    shown = [index for index, carrier in enumerate(robot.carriers) if carrier.drawing.body]
    carriers = np.array([instant.carriers for instant in instants])
    return Scene(
        title=replay.title,
        anchors=np.array([instant.points.anchors for instant in instants]),
        attachments=np.array([instant.points.attachments for instant in instants]),
        path=replay.path,
        path_times=replay.times - replay.times[0],
        carriers=carriers[:, shown, :3],
        names=[robot.carriers[index].name for index in shown],
        bodies=[np.flatnonzero(robot.carrier_of_cable == index) for index in shown],
        boxes=[(np.array(box.min), np.array(box.max)) for c in robot.carriers for box in c.drawing.boxes],
        obstacles=replay.obstacles,
        tensions=np.array([instant.tensions for instant in instants]),
        t_min=robot.t_min,
        t_max=robot.t_max,
        rotors=rotor_discs(robot, carriers),
    )
