"""`Mechanics`: a robot's mechanics on arrays, by the numeric core; `world_functions` has the same for symbols."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from .. import core
from ..base import processors
from ..base.inputs import leading
from .arrays import Array, Motion
from .batch import as_array
from .cables.elastic import axial_stiffness, unstrained_length
from .parameters import locate
from .record import record_of
from .robot import Robot

ROWS_WORTH_A_THREAD = 50_000  # some milliseconds

_RESULTS = 5  # of `core.lines`
_COLUMNS = {"anchor": 0, "attachment": 3, "radius": 6}  # of `Mechanics.columns_by_geometry`


class Mechanics:
    """Compute a robot's mechanics at one pose or at many: arguments, results and errors as in `Dynamics`.

    - `robot`: one that `record.fits`.
    - `record`: the record to read at each call, whose ends of cables may change; default: the robot's.
    """

    def __init__(self, robot: Robot, record: np.ndarray | None = None):
        self._record = record_of(robot) if record is None else record
        self._home, m = robot.carrier_home, robot.m
        self._m = m
        self._lines = {"cable_lengths": (0, (m,)), "wrench_matrix": (1, (6, m)), "length_jacobian": (2, (m, 6))}
        self._stiffness = np.array([cable.stiffness or 0.0 for cable in robot.cables])

    def line(self, name: str, pose: Array, carrier_pose: Array | None) -> np.ndarray:
        """Return "wrench_matrix", (..., 6, m), "cable_lengths", (..., m) [m], or "length_jacobian", (..., m, 6)."""
        which, shape = self._lines[name]
        batch, poses, carriers = self._placed(pose, carrier_pose)
        results: list[np.ndarray | None] = [None] * _RESULTS
        results[which] = result = np.empty(batch + shape)
        self._run(core.lines, [poses, carriers, *results], batch)
        return result

    def points(self, pose: Array, carrier_pose: Array | None) -> tuple[np.ndarray, np.ndarray]:
        """Return anchors and attachments in {G}, (..., m, 3) each [m]."""
        batch, poses, carriers = self._placed(pose, carrier_pose)
        anchors, attachments = (np.empty((*batch, self._m, 3)) for _ in range(2))
        self._run(core.ends, [poses, carriers, anchors, attachments], batch)
        return anchors, attachments

    def columns_by_geometry(self, pose: Array, carrier_pose: Array | None) -> np.ndarray:
        """Return how each column of A changes with its cable's ends and pulley, (..., m, 6, 7) [1/m].

        By the anchor in its carrier's frame (3), the attachment in the platform's (3) and the radius of the pulley.
        """
        batch, poses, carriers = self._placed(pose, carrier_pose)
        result = np.empty((*batch, self._m, 6, 7))
        self._run(core.columns_by_geometry, [poses, carriers, result], batch)
        return result

    def wrench_jacobian(self, pose: Array, tensions: Array, carrier_pose: Array | None) -> np.ndarray:
        """Return the derivative of A t with respect to the pose, (..., 6, 6)."""
        return self._of_tensions(core.wrench_by_pose, pose, tensions, carrier_pose)

    def stiffness(self, pose: Array, tensions: Array, carrier_pose: Array | None, elastic: bool) -> np.ndarray:
        """Return K about the CoM in {G}, (..., 6, 6) [N/m, N, N m]; see `elasticity`."""
        K = -self._of_tensions(core.wrench_by_axes, pose, tensions, carrier_pose)
        if elastic:
            A, lengths = (self.line(name, pose, carrier_pose) for name in ("wrench_matrix", "cable_lengths"))
            pulls = np.maximum(np.asarray(tensions, dtype=float), 0.0)
            k = axial_stiffness(self._stiffness, unstrained_length(lengths, pulls, self._stiffness))
            K += (A * np.where(pulls > 0, k, 0.0)[..., None, :]) @ A.swapaxes(-1, -2)  # a slack cable has none
        return K

    def required_wrench(self, motion: Motion, wind: Array | None) -> np.ndarray:
        """Return w, (..., 6) [N, N m]; the carriers' motion is checked, and has no effect."""
        arrays, shapes = [], {}
        for index, (name, value) in enumerate(motion._asdict().items()):
            if index < 3:
                arrays.append(np.zeros(6) if value is None else as_array(name, value, (6,)))
                shapes[name] = arrays[-1].shape[:-1]
            elif value is not None:
                shapes[name] = as_array(name, value, self._home.shape).shape[:-2]
        if wind is not None:
            wind = as_array("wind", wind, (3,))
            shapes["wind"] = wind.shape[:-1]
        batch = _common(shapes)
        air = None if wind is None else _rows(wind, batch, (3,), may_be_one=True)
        w = np.empty((*batch, 6))
        self._run(core.required_wrench, [*(_rows(array, batch, (6,)) for array in arrays), air, w], batch)
        return w

    def _of_tensions(self, function: Callable, pose: Array, tensions: Array, carrier_pose: Array | None) -> np.ndarray:
        """Return a derivative of the wrench of tensions, (..., 6, 6)."""
        pose, pulls = as_array("pose", pose, (6,)), as_array("tensions", tensions, (self._m,))
        shapes, carriers = {"pose": pose.shape[:-1], "tensions": pulls.shape[:-1]}, self._home
        if carrier_pose is not None:
            carriers = as_array("carrier_pose", carrier_pose, carriers.shape)
            shapes["carrier_pose"] = carriers.shape[:-2]
        batch = _common(shapes)
        result = np.empty((*batch, 6, 6))
        placed = [_rows(pose, batch, (6,)), _rows(carriers, batch, self._home.shape, may_be_one=True)]
        self._run(function, [*placed, _rows(pulls, batch, (self._m,)), result], batch)
        return result

    def _placed(self, pose: Array, carrier_pose: Array | None) -> tuple[tuple[int, ...], np.ndarray, np.ndarray]:
        """Check arguments, and return their common leading dimensions and the rows of both."""
        pose = as_array("pose", pose, (6,))
        if carrier_pose is None:
            batch = pose.shape[:-1]
            return batch, _rows(pose, batch, (6,)), self._home
        home = self._home.shape
        carriers = as_array("carrier_pose", carrier_pose, home)
        batch = _common({"pose": pose.shape[:-1], "carrier_pose": carriers.shape[:-2]})
        return batch, _rows(pose, batch, (6,)), _rows(carriers, batch, home, may_be_one=True)

    def _run(self, function: Callable, arrays: Sequence[np.ndarray | None], batch: tuple[int, ...]) -> None:
        """Call a function of the core for rows, which threads share if there are many."""
        count = math.prod(batch)
        if count < 2 * ROWS_WORTH_A_THREAD:
            function(self._record, *arrays)
            return

        def run(start: int, stop: int) -> None:
            # Arguments without a row for each pose are None, or one row for all.
            rows = [a if a is None or a.size % count else a.reshape(count, -1)[start:stop] for a in arrays]
            function(self._record, *rows)

        processors.in_threads(run, count, min(processors.available(), count // ROWS_WORTH_A_THREAD))


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


def _common(shapes: dict[str, tuple[int, ...]]) -> tuple[int, ...]:
    """Return the common leading dimensions of arguments, from those of each."""
    return leading(shapes) if any(shapes.values()) else ()


def _rows(array: np.ndarray, batch: tuple[int, ...], shape: tuple[int, ...], may_be_one: bool = False) -> np.ndarray:
    """Return an argument as the core reads it: a row after the other, or the only row for all if it `may_be_one`."""
    if array.shape != batch + shape and not (may_be_one and array.size == math.prod(shape)):
        array = np.broadcast_to(array, batch + shape)
    flags = array.flags
    return array if flags.c_contiguous and flags.aligned else np.array(array, order="C")
