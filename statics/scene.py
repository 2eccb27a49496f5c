"""`scene`: the 3-D scene of a plan or a simulation at given times; `scene_at`: the scene of a robot at one pose."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..base.inputs import printable
from ..figures.scene import Scene, outlines_from
from ..models.dynamics import dynamics_of
from ..models.points import placed
from ..models.robot import Robot
from ..models.shapes import surface

if TYPE_CHECKING:
    import xarray as xr

TRAIL = 5000  # points of the trail at most
LONGEST = 100  # letters of the title
ROUND = np.linspace(0.0, 2 * np.pi, 33)


def scene(robot: Robot, dataset: xr.Dataset, times: np.ndarray) -> Scene:
    """Return the robot at the saved instants closest to `times` [s], counted from the first instant.

    Nothing is interpolated: every drawn instant was audited or simulated.
    """
    saved = dataset["time"].to_numpy() - float(dataset["time"][0])
    rows = np.searchsorted((saved[1:] + saved[:-1]) / 2, times)
    poses, carriers, tensions = (dataset[name].to_numpy() for name in ("pose", "carrier_pose", "tensions"))
    trail = np.unique(np.linspace(0, len(saved) - 1, min(len(saved), TRAIL)).round().astype(int))
    return replace(
        _scene(robot, poses[rows], carriers[rows], tensions[rows]),
        title=printable(str(dataset.attrs.get("title", robot.name)), LONGEST),
        path=poses[trail, :3],
        path_times=saved[trail],
        path_missing=np.asarray(np.isnan(tensions[trail]).any(axis=1)),
        obstacles=outlines_from(dataset, "dataset"),
        cut=dataset["cut"].to_numpy()[rows] > 0 if "cut" in dataset else None,
    )


def scene_at(robot: Robot, pose: np.ndarray, tensions: np.ndarray | None, title: str) -> Scene:
    """Return the robot at a pose (6,) [m, rad], its carriers at home; without tensions (m,) [N] its cables are grey."""
    known = np.full(robot.m, np.nan) if tensions is None else tensions
    return replace(_scene(robot, pose[None], robot.carrier_home[None], known[None]), title=title)


def _scene(robot: Robot, poses: np.ndarray, carriers: np.ndarray, tensions: np.ndarray) -> Scene:
    """Return the robot at poses (k, 6), with its carriers at (k, c, 6) [m, rad] and tensions (k, m) [N]."""
    anchors, attachments = dynamics_of(robot).points(poses, carriers)
    body = robot.platform.body
    shown = [index for index, carrier in enumerate(robot.carriers) if carrier.drawing.body]
    return Scene(
        title=robot.name,
        anchors=anchors,
        attachments=attachments,
        carriers=carriers[:, shown, :3],
        names=[robot.carriers[index].name for index in shown],
        bodies=[np.flatnonzero(robot.carrier_of_cable == index) for index in shown],
        boxes=[(np.array(box.min), np.array(box.max)) for c in robot.carriers for box in c.drawing.boxes],
        tensions=tensions,
        t_min=robot.t_min,
        t_max=robot.t_max,
        rotors=rotor_discs(robot, carriers),
        surface=None if body is None else placed(poses, surface(body)),
    )


def rotor_discs(robot: Robot, carriers: np.ndarray) -> np.ndarray:
    """Return a circle with the radius of each carrier that has rotors, (k, r, p, 3) in {G} [m].

    `carriers`: poses of all carriers, (k, c, 6) [m, rad].
    """
    which = [index for index, carrier in enumerate(robot.carriers) if carrier.drawing.rotors]
    circle = np.stack([np.cos(ROUND), np.sin(ROUND), np.zeros_like(ROUND)], axis=1)
    circles = [placed(carriers[:, index], robot.carrier_radius[index] * circle) for index in which]
    return np.stack(circles, axis=1) if which else np.zeros((len(carriers), 0, len(ROUND), 3))
