"""`scene`: the 3-D scene of a plan or a simulation at given times."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base.inputs import printable
from ..figures.animation import Scene
from ..figures.outlines import outlines_from
from ..models.body import surface
from ..models.dynamics import dynamics_of
from ..models.points import placed
from ..models.robot import Robot

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
    poses, carriers = dataset["pose"].to_numpy(), dataset["carrier_pose"].to_numpy()[rows]
    anchors, attachments = dynamics_of(robot).points(poses[rows], carriers)
    trail = np.unique(np.linspace(0, len(saved) - 1, min(len(saved), TRAIL)).round().astype(int))
    body = robot.platform.body
    shown = [index for index, carrier in enumerate(robot.carriers) if carrier.drawing.body]
    return Scene(
        title=printable(str(dataset.attrs.get("title", robot.name)), LONGEST),
        anchors=anchors,
        attachments=attachments,
        path=poses[trail, :3],
        path_times=saved[trail],
        path_missing=np.asarray(np.isnan(dataset["tensions"].to_numpy()[trail]).any(axis=1)),
        carriers=carriers[:, shown, :3],
        names=[robot.carriers[index].name for index in shown],
        bodies=[np.flatnonzero(robot.carrier_of_cable == index) for index in shown],
        boxes=[(np.array(box.min), np.array(box.max)) for c in robot.carriers for box in c.drawing.boxes],
        obstacles=outlines_from(dataset, "dataset"),
        tensions=dataset["tensions"].to_numpy()[rows],
        t_min=robot.t_min,
        t_max=robot.t_max,
        rotors=rotor_discs(robot, carriers),
        surface=None if body is None else placed(poses[rows], surface(body)),
        cut=dataset["cut"].to_numpy()[rows] > 0 if "cut" in dataset else None,
    )


def rotor_discs(robot: Robot, carriers: np.ndarray) -> np.ndarray:
    """Return a circle with the radius of each carrier that has rotors, (k, r, p, 3) in {G} [m].

    Parameters
    ----------
    carriers
        Poses of all carriers, (k, c, 6) [m, rad].
    """
    which = [index for index, carrier in enumerate(robot.carriers) if carrier.drawing.rotors]
    circle = np.stack([np.cos(ROUND), np.sin(ROUND), np.zeros_like(ROUND)], axis=1)
    circles = [placed(carriers[:, index], robot.carrier_radius[index] * circle) for index in which]
    return np.stack(circles, axis=1) if which else np.zeros((len(carriers), 0, len(ROUND), 3))
