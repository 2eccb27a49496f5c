"""`scene`: a flight as figures draw it in space, with anchors, attachments and carriers at given times."""

from __future__ import annotations

import numpy as np

from ..figures.animation import Scene
from ..models import Dynamics
from ..models.rotor_discs import rotor_discs
from .data import SimulationData

__all__ = ["scene"]

TRAIL = 10  # every so many periods have a point of the trail


def scene(flight: SimulationData, times: np.ndarray) -> Scene:
    """Return the flight's robot at the periods nearest to `times` [s]."""
    robot, record = flight.robot, flight.record
    rows = np.clip(np.round(times / flight.period).astype(int), 0, flight.lasted - 1)
    poses, carriers = record.motions[rows, 0, :6], record.motions[rows, 1:, :6]
    shown = [index for index, carrier in enumerate(robot.carriers) if carrier.drawing.body]
    anchors, attachments = Dynamics(robot).points(poses, carriers)
    trail = slice(0, flight.lasted, TRAIL)
    return Scene(
        title=f"{robot.name}, flight: {'passed' if flight.passed else 'failed'}",
        anchors=anchors,
        attachments=attachments,
        path=record.motions[trail, 0, :3],
        path_times=flight.times[::TRAIL],
        carriers=carriers[:, shown, :3],
        names=[robot.carriers[index].name for index in shown],
        bodies=[np.flatnonzero(robot.carrier_of_cable == index) for index in shown],
        boxes=[(np.array(box.min), np.array(box.max)) for c in robot.carriers for box in c.drawing.boxes],
        obstacles=[],
        tensions=record.tensions[rows],
        cut=flight.conditions.cut(robot.m, rows),
        t_min=robot.t_min,
        t_max=robot.t_max,
        rotors=rotor_discs(robot, carriers),
    )
