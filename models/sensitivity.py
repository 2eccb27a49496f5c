"""How the wrench matrix depends on the numbers that place the cables, by their names."""

from collections.abc import Sequence

import numpy as np

from .mechanics import Mechanics
from .parameters import locate
from .robot import Robot

_COLUMNS = {"anchor": 0, "attachment": 3, "radius": 6}  # of `Mechanics.columns_by_geometry`


def derivatives(
    robot: Robot, pose: np.ndarray, carrier_pose: np.ndarray, names: Sequence[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Return how wrenches depend on p numbers of the cables, by the `names` of `Robot.parameter_values`.

    That is the derivative by each number of the column of its cable, (n, 6, p) [1/m, -], and the index of that cable,
    (p,), at poses of the platform, (n, 6), and of the carriers, (n, c, 6), in {G} [m, rad].

    Raises `ValueError` if the robot has no such number; `InputError` if the robot has more cables or carriers than
    the numeric core has room for.
    """
    places = [locate(name, robot.cables) for name in names]
    cables = np.array([place.cable for place in places], dtype=int)
    columns = np.array([_COLUMNS[place.part] + place.axis for place in places], dtype=int)
    by_geometry = Mechanics(robot).columns_by_geometry(pose, carrier_pose)  # (n, m, 6, 7)
    return np.moveaxis(by_geometry[:, cables, :, columns], 0, 2), cables
