"""Read a robot, a plan, a simulation or a workspace to show."""

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import xarray as xr

from ..base.declared import check_zarr
from ..base.display import Displayed
from ..base.inputs import InputError, file_path, printable, required, shown
from ..base.netcdf import load_netcdf, numbers_of
from ..base.text import quantity
from ..figures import style
from ..figures.tension_colours import rgb
from ..models import Robot, available, load
from .geometry import FARTHEST, Geometry
from .replay import Replay
from .snapshot import Snapshot

HDF5 = b"\x89HDF\r\n\x1a\n"  # how NetCDF files begin
READABLE = "a robot, or a file that `towline plan`, `towline simulate` or `towline workspace` wrote"
MOST_POINTS = 10_000  # more hide the robot among them
ACCEPTED, REFUSED = style.colour(2), style.colour(5)  # bluish green and orange: colours that do not need colour vision


@dataclass(frozen=True)
class Cloud(Displayed):
    """Coloured points in {G}."""

    positions: np.ndarray  # (n, 3) [m]
    colours: np.ndarray  # bytes (n, 3)
    legend: list[tuple[str, str]]  # (name, colour) pairs
    summary: str  # the number of points, as a sentence
    dataset: xr.Dataset  # source dataset


@dataclass(frozen=True)
class Subject(Displayed):
    """A robot, a plan, a simulation or a workspace to show.

    Attributes:
        title: Its title, one line.
        robot: The robot, also of a plan, a simulation or a workspace.
        replay: The instants of a plan or a simulation, or None.
        cloud: The points of a workspace, or None.
        other: A plan or a simulation of the same robot to compare the replay with, or None.
    """

    title: str
    robot: Robot
    replay: Replay | None = None
    cloud: Cloud | None = None
    other: Replay | None = None

    def __post_init__(self):
        """Raise InputError for a subject that cannot be shown."""
        required("title", self.title, str)
        required("robot", self.robot, Robot)
        for name, kind in (("replay", Replay), ("cloud", Cloud), ("other", Replay)):
            part = getattr(self, name)
            if part is not None and not isinstance(part, kind):
                raise InputError(f"{name} must be the {name} of a subject from `read`, or None, got {shown(part)}")

    @property
    def kind(self) -> str:
        """Return "robot", "plan", "simulation" or "workspace"."""
        if self.replay is not None and self.replay.reference is not None:
            return "simulation"
        return "plan" if self.replay else "workspace" if self.cloud else "robot"

    @cached_property
    def geometry(self) -> Geometry:
        """Return the geometry of its robot; raise InputError if it cannot be drawn."""
        return self.replay.geometry if self.replay else Geometry(self.robot)

    def other_at(self, instant: Snapshot) -> Snapshot | None:
        """Return the instant of the other motion at the same time, or its last instant; None without another motion."""
        if self.other is None or instant.time is None:
            return None
        return self.other.at(self.other.index_at(instant.time), prove=False)


def read(
    target: str | os.PathLike[str],
    robot: str | os.PathLike[str] | None = None,
    other: str | os.PathLike[str] | None = None,
) -> Subject:
    """Read a robot, a plan, a simulation or a workspace.

    Args:
        target: A robot of the library or a robot file; a plan, a simulation or a workspace as NetCDF, or a workspace as
            a Zarr folder.
        robot: The robot of a workspace, if it is not in the library: a workspace file has only the name.
        other: A plan or a simulation to compare a plan or a simulation with.

    Raises:
        InputError: If it is none of these, or belongs to another robot.
    """
    path = file_path("target", target, READABLE)
    if other is not None:
        beside = file_path("other", other, "the file of a plan or a simulation, or None")
        return _compared(read(path, robot), read(beside), printable(str(beside)))
    where = printable(str(path))
    name = None if robot is None else os.fspath(file_path("--robot", robot, "the name or the file of a robot"))
    if path.suffix == ".zarr" or _is_netcdf(path):
        return _of_dataset(_open(path), where, name)
    if name is not None:
        raise InputError(f"--robot must be left out unless a workspace is shown, got {shown(name)} with {where}")
    loaded = load(target)
    return Subject(loaded.name, loaded)


def _compared(first: Subject, second: Subject, where: str) -> Subject:
    if first.replay is None or second.replay is None:
        wrong = first if first.replay is None else second
        raise InputError(f"two files to compare must be plans or simulations, got the {wrong.kind} {wrong.title}")
    if (first.robot.name, first.robot.m) != (second.robot.name, second.robot.m):
        raise InputError(f"{where} must be of {first.robot.name} with {first.robot.m} cables, got {second.robot.name}")
    name = second.title.partition(", ")[2]  # of a simulation "simulation: passed"
    name = f"a {name}" if second.kind == "simulation" else f"{second.kind} {name}"
    title = f"{first.title}, compared with {name}"
    return Subject(title, first.robot, replay=first.replay, other=second.replay)


def _of_dataset(dataset: xr.Dataset, where: str, robot: str | None) -> Subject:
    if "pose" in dataset and "time" in dataset.variables:
        if robot is not None:
            raise InputError(
                f"--robot must be left out for a plan, which has its robot, got {shown(robot)} for {where}"
            )
        replay = Replay(dataset, where)
        return Subject(replay.title, replay.robot, replay=replay)
    if "reached" not in dataset and "position" not in dataset:
        raise InputError(f"{where} must be {READABLE}, got a dataset that is neither a plan nor a workspace")
    name = printable(str(dataset.attrs.get("robot")), 64)
    # A workspace names its robot: as a path, the name would make this program read any file.
    if robot is None and name not in available():
        raise InputError(f"--robot must be the file of {name!r}, which is not in the library, for {where}")
    loaded = load(name if robot is None else robot)
    if loaded.name != name:
        raise InputError(f"--robot must be the file of {name!r}, whose workspace this is, got {loaded.name!r}")
    return Subject(f"{loaded.name}, workspace", loaded, cloud=cloud(dataset, where))


def _is_netcdf(path: Path) -> bool:
    try:
        if not path.is_file():
            return path.suffix == ".nc"
        with path.open("rb") as stream:
            return stream.read(len(HDF5)) == HDF5 or path.suffix == ".nc"
    except (OSError, ValueError):  # too long for a file name, or with a NUL in it: no file has that name
        return False


def _open(path: Path) -> xr.Dataset:
    if not path.exists():
        raise InputError(f"{printable(str(path))} does not exist; it must be {READABLE}")
    if path.is_dir() and path.suffix != ".zarr":
        raise InputError(f"{printable(str(path))} must be {READABLE}, got a folder")
    refusal = f"{printable(str(path))} must be {READABLE}, got a file that cannot be read"
    if path.suffix != ".zarr":
        return load_netcdf(path, refusal)
    try:
        check_zarr(path)
        return xr.open_zarr(path).load()
    except ImportError:
        raise InputError(
            f"zarr is not installed; install the extra cluster to read {path}: pip install 'towline[cluster]'"
        ) from None
    except Exception as error:  # a damaged folder may fail at any place of two libraries
        raise InputError(f"{refusal} ({printable((str(error) or 'empty').splitlines()[0])})") from None


def cloud(dataset: xr.Dataset, where: str) -> Cloud:
    """Return the points of a dataset of `workspace.sample`; with `keep="none"`, the centres of the reached cells.

    Raises `InputError` if the dataset has no such points.
    """
    if "position" not in dataset:
        return _cells(dataset, where)
    positions = _places(dataset, "position", (-1, 3), where)
    accepted = (
        dataset["accepted"].to_numpy().astype(bool) if "accepted" in dataset else np.ones(len(positions), dtype=bool)
    )
    if accepted.shape != positions.shape[:1]:
        raise InputError(f"{where}: accepted must be one flag for each position, got the shape {accepted.shape}")
    shown = slice(None, None, max(-(-len(positions) // MOST_POINTS), 1))
    positions, accepted = positions[shown], accepted[shown]
    colours = np.where(accepted[:, None], rgb(ACCEPTED), rgb(REFUSED)).astype(np.uint8)
    legend = [("accepted", ACCEPTED)] + ([] if accepted.all() else [("not accepted", REFUSED)])
    kept, tried = (_count(dataset, name) for name in ("accepted", "samples"))
    summary = f"{kept} of {tried} samples accepted, {len(positions)} points shown"
    return Cloud(positions, colours, legend, summary, dataset)


def _count(dataset: xr.Dataset, name: str) -> str:
    """Return a count among the attributes of a file as text, "?" for anything that is not a number."""
    value = dataset.attrs.get(name)
    return quantity(int(value)) if isinstance(value, int | np.integer) else "?"


def _places(dataset: xr.Dataset, name: str, shape: tuple[int, ...], where: str) -> np.ndarray:
    """Return a variable of positions; raise InputError unless all of them can be drawn."""
    positions = numbers_of(dataset, name, shape, where, gaps=True, largest=np.inf)
    wrong = ~(np.abs(positions) <= FARTHEST)
    if wrong.any():
        raise InputError(f"{where}: positions must be within {FARTHEST:g} m, got {positions[wrong][0]:g}")
    return positions


def _cells(dataset: xr.Dataset, where: str) -> Cloud:
    if "reached" not in dataset or dataset["reached"].dims != ("x", "y", "z"):
        raise InputError(f"{where} must be a file written by `towline workspace`, got one without positions and cells")
    cells = np.argwhere(numbers_of(dataset, "reached", (-1, -1, -1), where) > 0)
    axes = [_places(dataset, name, (-1,), where) for name in ("x", "y", "z")]
    positions = np.stack([axis[column] for axis, column in zip(axes, cells.T, strict=True)], axis=1)
    colours = np.tile(np.array(rgb(ACCEPTED), np.uint8), (len(positions), 1))
    summary = f"{len(positions)} cells with accepted samples, shown by their centres"
    return Cloud(positions, colours, [("accepted in this cell", ACCEPTED)], summary, dataset)
