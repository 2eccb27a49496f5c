"""`Measurements`: measured cable lengths of a robot, and poses, tensions and times if known."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from copy import copy
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from ...base.display import Displayed
from ...base.inputs import InputError, file_path, number, one_of, real_array, required, shown
from ...base.netcdf import Contents, Variable, save_netcdf
from ...models import points
from ...models.part import COORDINATES, LARGEST
from ...models.robot import Robot
from .recording import check_rising

SIGMA = 1e-3  # [m] of lengths
LARGEST_SIGMA = 100.0  # [m], [rad] or [-]
OF_TENSIONS = 0.02  # of tensions, relative
OF_DIRECTIONS = 0.02  # [rad]
MOST, CHUNK = 10_000_000, 100_000  # samples in all, and of which attitudes are converted together
ARRAYS = ("lengths", "poses", "tensions", "times", "carrier_poses", "directions")  # of `Measurements`


class Sigma(NamedTuple):
    """Standard deviations of measurements.

    Attributes:
        lengths: Standard deviation of each reading, after scaling [m].
        position: Standard deviation of measured positions, along each axis [m]; 0: exact.
        rotation: Standard deviation of measured orientations, about each axis [rad]; 0: exact.
        tensions: Standard deviation of each tension, relative to it [-].
        directions: Standard deviation of cable directions, about each axis across the cable [rad].
        clocks: Standard deviation of the carriers' clocks relative to the clock of the platform's poses [s]; 0: one.
    """

    lengths: float = SIGMA
    position: float = 0.0
    rotation: float = 0.0
    tensions: float = OF_TENSIONS
    directions: float = OF_DIRECTIONS
    clocks: float = 0.0


class Measurements(Displayed):
    """N samples of a robot's cable lengths, with poses, tensions and times if they were measured.

    Args:
        lengths: Readings of the lengths [m], (N, m): the lengths from anchor to attachment up to offset and scale.
        poses: (x, y, z, roll, pitch, yaw) of the platform frame in {G} [m, rad], (N, 6), or positions alone, (N, 3).
            Rows of nan were not measured. Default: no pose was measured.
        orientations: Orientations of the platform, unless `poses` includes them: (roll, pitch, yaw) [rad], (N, 3), or
            quaternions (x, y, z, w), (N, 4). Rows of nan were not measured.
        tensions: Cable tensions at the winches [N], (N, m), for elastic elongation and the balance of forces on the
            platform. Default: not measured, no elongation.
        times: Times of the samples [s], (N,), increasing; a clock offset requires them.
        carrier_poses: Measured poses of the carriers in {G}, (N, c, 6) [m, rad], exact. Default: at home.
        sigma: Standard deviation of the lengths [m], or a mapping with `lengths` [m], `position` [m], `rotation` [rad],
            `tensions` (relative), `directions` [rad] and `clocks` of carriers [s]. Default: 1 mm, poses that are exact,
            2 % of tensions, 0.02 rad, one clock.
        directions: Unit vectors in {G} along the cables, from the anchor to the platform, (N, m, 3). Cables with nan
            were not measured; if only z is nan, x and y are the direction seen from above (a swivel angle). Default:
            not measured.

    Attributes:
        lengths: (N, m) [m].
        poses: (N, 6) [m, rad], nan where not measured, or None.
        tensions, times, carrier_poses, directions: The given arrays, or None; directions have unit length, horizontal
            if azimuths were measured.
        sigma: `Sigma`: of lengths, positions, rotations, tensions, directions and clocks.
        framed: Parameters that are always estimated because poses were corrected for them: "frame" and "body", or none.

    Raises:
        InputError: If an argument has a wrong shape or value; nan in lengths, tensions or times is refused.
    """

    def __init__(
        self,
        lengths: ArrayLike,
        poses: ArrayLike | None = None,
        orientations: ArrayLike | None = None,
        tensions: ArrayLike | None = None,
        times: ArrayLike | None = None,
        sigma: float | Mapping[str, float] = SIGMA,
        carrier_poses: ArrayLike | None = None,
        directions: ArrayLike | None = None,
    ):
        self.lengths = _table("lengths", lengths, None)  # (N, m)
        count = len(self.lengths)
        if not 1 <= count <= MOST:
            raise InputError(f"lengths must have 1 to {MOST} rows, got {count}")
        if poses is None and orientations is not None:
            poses = np.full((count, 3), np.nan)
        shape = self.lengths.shape
        self.poses = None if poses is None else _poses(poses, orientations, count)  # (N, 6)
        self.tensions = CHECKS["tensions"](tensions, shape)  # (N, m)
        self.times = CHECKS["times"](times, shape)  # (N,)
        self.sigma = _sigma(sigma)
        self.carrier_poses = CHECKS["carrier_poses"](carrier_poses, shape)  # (N, c, 6)
        self.directions = CHECKS["directions"](directions, shape)  # (N, m, 3)
        self.framed: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.lengths)

    @property
    def m(self) -> int:
        """Return the number of cables."""
        return self.lengths.shape[1]

    def only(self, rows: np.ndarray | slice) -> Measurements:
        """Return the measurements of some samples: indices, flags (N,) of bool or a slice.

        Raises:
            InputError: If `rows` are none of these.
        """
        arrays = {name: getattr(self, name) for name in ARRAYS}
        try:
            if isinstance(rows, slice) and rows.step in (None, 1) and len(self.lengths[rows]):
                part = copy(self)
                for name, array in arrays.items():
                    setattr(part, name, None if array is None else array[rows])
                return part
            return self.changed(**{name: None if array is None else array[rows] for name, array in arrays.items()})
        except (IndexError, TypeError, ValueError):
            accepted = f"indices below {len(self)} that rise, flags ({len(self)},) or a slice"
            raise InputError(f"rows must be {accepted}, got {shown(rows)}") from None

    def changed(self, **new: Any) -> Measurements:
        """Return the measurements with other arguments.

        Args:
            **new: Arguments by their names, as for the class, such as `lengths` (N, m) [m].

        Raises:
            InputError: If one has a wrong name, shape or value.
        """
        for name in new:
            one_of("the name of an argument", name, CHECKS)
        shape = self.lengths.shape
        if np.shape(new.get("lengths", self.lengths)) != shape:
            given: dict[str, Any] = {name: getattr(self, name) for name in ARRAYS}
            other = Measurements(**given | {"sigma": self.sigma._asdict(), **new})
            other.framed = self.framed
            return other
        result = copy(self)  # which shares the arrays that stay: those of a long log are large
        for name, value in new.items():
            setattr(result, name, CHECKS[name](value, shape))
        return result

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Save as NetCDF atomically, and return the path; `read_measurements` reads the file.

        Args:
            path: Path of the file; an existing file is overwritten.

        Raises:
            InputError: If the file cannot be written.
        """
        first = "sample" if self.times is None else "time"
        cable = (first, "cable")
        about = {"units": "m", "long_name": "readings: lengths from anchor to attachment up to offset and scale"}
        variables = {"cable_lengths": Variable(cable, self.lengths, about)}
        coordinates = {"cable": Variable(("cable",), np.arange(1, self.m + 1))}
        if self.tensions is not None:
            variables["tensions"] = Variable(cable, self.tensions, {"units": "N"})
        if self.poses is not None:
            about = {"units": "m, rad", "long_name": "of the platform in {G}; nan: not measured"}
            variables["pose"] = Variable((first, "coordinate"), self.poses, about)
            coordinates["coordinate"] = Variable(("coordinate",), np.array(COORDINATES))
        if self.carrier_poses is not None:
            about = {"units": "m, rad", "long_name": "of the carriers in {G}"}
            names = [f"carrier {i + 1}" for i in range(self.carrier_poses.shape[1])]
            variables["carrier_pose"] = Variable((first, "carrier", "coordinate"), self.carrier_poses, about)
            coordinates["coordinate"] = Variable(("coordinate",), np.array(COORDINATES))
            coordinates["carrier"] = Variable(("carrier",), np.array(names))
        if self.directions is not None:
            about = {"units": "1", "long_name": "unit vectors in {G} from anchor to platform"}
            variables["cable_directions"] = Variable((*cable, "axis"), self.directions, about)
            coordinates["axis"] = Variable(("axis",), np.array(COORDINATES[:3]))
        if self.times is not None:
            coordinates["time"] = Variable(("time",), self.times, {"units": "s"})
        attributes = {"framed": " ".join(self.framed)} if self.framed else {}
        attributes |= {f"sigma_{name}": value for name, value in self.sigma._asdict().items()}
        return save_netcdf(Contents(variables, coordinates, attributes), file_path("path", path))


def check_measurements(robot: Robot, measurements: object) -> Measurements:
    """Check measurements of a robot; raise InputError if they are invalid or have another number of cables."""
    given = required("measurements", measurements, Measurements)
    if given.m != robot.m:
        raise InputError(
            f"measurements.lengths must have a column for each of the {robot.m} cables of {robot.name}, got {given.m}"
        )
    given_carriers = given.carrier_poses
    if given_carriers is not None and given_carriers.shape[1] != len(robot.carriers):
        raise InputError(
            f"measurements.carrier_poses must have the shape (N, {len(robot.carriers)}, 6) of the carriers of "
            f"{robot.name}, got {given_carriers.shape}"
        )
    return given


def carriers_of(robot: Robot, measurements: Measurements) -> np.ndarray:
    """Return the poses of the carriers, (N, c, 6), or (c, 6) at home where they were not measured [m, rad]."""
    return robot.carrier_home if measurements.carrier_poses is None else measurements.carrier_poses


def measured_poses(robot: Robot, measurements: Measurements) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the positions (N, 3), rotations (N, 3, 3) and which coordinates were measured, (N, 6) of bool.

    Coordinates that were not measured have their values at home.
    """
    known = measured(measurements)
    poses = np.where(known, 0.0 if measurements.poses is None else measurements.poses, robot.home)
    return poses[:, :3], points.rotations(poses[:, 3:]), known


def measured(measurements: Measurements) -> np.ndarray:
    """Return which coordinates of the poses were measured, (N, 6) of bool."""
    poses = measurements.poses
    return np.zeros((len(measurements), 6), dtype=bool) if poses is None else np.isfinite(poses)


def tracked(robot: Robot, measurements: Measurements) -> np.ndarray:
    """Return the samples with a position, and an orientation if any was measured, (N,) of bool."""
    known, moves = measured(measurements), robot.dof_mask > 0
    there = known.any(axis=0) & moves
    placed = bool(there[:3].sum() == moves[:3].sum() and there.any())
    return np.asarray(known[:, there].all(axis=1) & placed)


def _table(name: str, value: Any, shape: tuple[int, ...] | None) -> np.ndarray:
    array = np.array(real_array(name, value), dtype=float)
    if array.ndim != 2 or (shape is not None and array.shape != shape) or (array.ndim == 2 and array.shape[1] == 0):
        accepted = "(N, m)" if shape is None else str(shape)
        raise InputError(f"{name} must have the shape {accepted}, got {array.shape}")
    _check_finite(name, array)
    return array


def _check_finite(name: str, array: np.ndarray) -> None:
    with np.errstate(invalid="ignore"):
        wrong = ~(np.abs(array) <= LARGEST)
    if wrong.any():
        at = tuple(int(i) for i in np.argwhere(wrong)[0])
        where = ", ".join(f"{word} {i}" for word, i in zip(("sample", "column"), at, strict=False))
        raise InputError(f"{name} must be finite numbers up to {LARGEST:g}, got {array[at]:g} at {where}")


def _directions(directions: Any, shape: tuple[int, ...]) -> np.ndarray:
    array = np.array(real_array("directions", directions), dtype=float)
    if array.shape != (*shape, 3):
        raise InputError(f"directions must have the shape {(*shape, 3)}, got {array.shape}")
    array[np.isnan(array[..., :2]).any(axis=2)] = np.nan
    size = np.linalg.norm(np.nan_to_num(array, nan=0.0, posinf=np.inf, neginf=np.inf), axis=2)
    known = np.isfinite(array[..., 0])
    wrong = known & ~((size > 0.5) & (size < 1.5) | np.isnan(array[..., 2]) & (size > 1e-3) & (size < 1.5))
    if wrong.any():
        row, cable = np.argwhere(wrong)[0]
        got = f"{shown(array[row, cable].tolist())} at sample {row} of cable {cable + 1}"
        raise InputError(f"directions must be unit vectors, got {got}")
    return array / np.where(known, size, 1.0)[..., None]


def _of_carriers(poses: Any, count: int) -> np.ndarray:
    array = np.array(real_array("carrier_poses", poses), dtype=float)
    if array.ndim != 3 or array.shape[::2] != (count, 6):
        raise InputError(f"carrier_poses must have the shape ({count}, c, 6), got {array.shape}")
    _check_finite("carrier_poses", array.reshape(count, -1))
    return array


def _poses(poses: Any, orientations: Any, count: int) -> np.ndarray:
    array = np.array(real_array("poses", poses), dtype=float)
    if array.shape not in ((count, 3), (count, 6)):
        raise InputError(f"poses must have the shape ({count}, 6), or ({count}, 3) of positions, got {array.shape}")
    result = np.full((count, 6), np.nan)
    result[:, : array.shape[1]] = array
    if orientations is not None:
        if array.shape[1] == 6:
            raise InputError(f"orientations must be None if poses have six columns, got {shown(orientations)}")
        result[:, 3:] = _angles(orientations, count)
    for part in (result[:, :3], result[:, 3:]):
        some = np.isfinite(part).any(axis=1) & ~np.isfinite(part).all(axis=1)
        if some.any():
            row = int(np.argmax(some))
            raise InputError(f"poses must have rows that are finite or nan as a whole, got both at sample {row}")
    _check_finite("poses", np.nan_to_num(result, nan=0.0))
    return result


def _angles(orientations: Any, count: int) -> np.ndarray:
    array = np.array(real_array("orientations", orientations), dtype=float)
    if array.shape == (count, 3):
        return array
    if array.shape != (count, 4):
        raise InputError(
            f"orientations must have the shape ({count}, 3) of angles or ({count}, 4) of quaternions, got {array.shape}"
        )
    known = np.all(np.isfinite(array), axis=1)
    short = known & ~(np.abs(np.linalg.norm(np.where(known[:, None], array, 1.0), axis=1) - 1) < 0.1)
    if short.any():
        row = int(np.argmax(short))
        raise InputError(
            f"orientations must be quaternions of length 1, got {shown(array[row].tolist())} at sample {row}"
        )
    result = np.full((count, 3), np.nan)
    for rows in np.array_split(np.flatnonzero(known), count // CHUNK + 1):  # matrices of all would need much memory
        result[rows] = points.angles(Rotation.from_quat(array[rows]).as_matrix())
    return result


def _rising(times: Any, count: int) -> np.ndarray:
    array = np.array(real_array("times", times), dtype=float)
    if array.shape != (count,):
        raise InputError(f"times must have the shape ({count},), got {array.shape}")
    _check_finite("times", array)
    check_rising(array)
    return array


def _sigma(sigma: Any) -> Sigma:
    given = sigma if isinstance(sigma, Mapping) else {"lengths": sigma}
    for name in given:
        if name not in Sigma._fields:
            raise InputError(f"sigma must have only the keys {', '.join(Sigma._fields)}, got {shown(name)}")
    values = {
        f"{name}": number(
            f"sigma.{name}" if isinstance(sigma, Mapping) else "sigma",
            value,
            {"lengths": 1e-9, "tensions": 1e-6, "directions": 1e-6}.get(name, 0.0),
            LARGEST_SIGMA,
            "" if isinstance(sigma, Mapping) else f", or a mapping of {', '.join(Sigma._fields)}",
        )
        for name, value in given.items()
    }
    return Sigma(**values)


CHECKS: dict[str, Callable[[Any, tuple[int, ...]], Any]] = {
    "lengths": lambda given, shape: _table("lengths", given, shape),
    "poses": lambda given, shape: None if given is None else _poses(given, None, shape[0]),
    "tensions": lambda given, shape: None if given is None else _table("tensions", given, shape),
    "times": lambda given, shape: None if given is None else _rising(given, shape[0]),
    "carrier_poses": lambda given, shape: None if given is None else _of_carriers(given, shape[0]),
    "directions": lambda given, shape: None if given is None else _directions(given, shape),
    "sigma": lambda given, _: _sigma(given),
}
