"""Read what to show: a robot, a plan, a flight or a workspace."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from ..inputs import printable
from ..models import Robot, load
from ..netcdf import load_netcdf

if TYPE_CHECKING:
    import xarray as xr

    from .cloud import Cloud
    from .replay import Replay

HDF5 = b"\x89HDF\r\n\x1a\n"  # how NetCDF files begin
ACCEPTED = "a robot, or a file that `towline plan`, `towline simulate` or `towline workspace` wrote"


@dataclass(frozen=True)
class Subject:
    """A robot, a plan, a flight or a workspace to show.

    Attributes
    ----------
    title
        Its title, one line.
    robot
        The robot, or that of the plan, flight or workspace.
    replay
        The instants of a plan or a flight, or None.
    cloud
        The points of a workspace, or None.
    """

    title: str
    robot: Robot
    replay: Replay | None = None
    cloud: Cloud | None = None

    @property
    def kind(self) -> str:
        """Return "robot", "plan", "flight" or "workspace"."""
        if self.replay is not None and self.replay.reference is not None:
            return "flight"
        return "plan" if self.replay else "workspace" if self.cloud else "robot"


def read(target: str, robot: str | None = None) -> Subject:
    """Read a robot, a plan, a flight or a workspace.

    Parameters
    ----------
    target
        A robot of the library or a robot file; a plan, a flight or a workspace as NetCDF, or a workspace as a Zarr
        folder.
    robot
        The robot of a workspace, if it is not in the library: a workspace file has only the name.

    Raises
    ------
    InputError
        If it is none of these, or belongs to another robot.
    """
    path = Path(target)
    if path.suffix == ".zarr" or _is_netcdf(path):
        return _of_dataset(_open(path), target, robot)
    if robot is not None:
        raise InputError(f"--robot must be left out unless a workspace is shown, got {robot!r} with {target}")
    loaded = load(target)
    return Subject(loaded.name, loaded)


def _of_dataset(dataset: xr.Dataset, where: str, robot: str | None) -> Subject:
    if "pose" in dataset and "time" in dataset.variables:
        from .replay import Replay

        if robot is not None:
            raise InputError(f"--robot must be left out for a plan, which has its robot, got {robot!r} for {where}")
        replay = Replay(dataset, where)
        return Subject(replay.title, replay.robot, replay=replay)
    if "reached" not in dataset and "position" not in dataset:
        raise InputError(f"{where} must be {ACCEPTED}, got a dataset that is neither a plan nor a workspace")
    from .cloud import cloud

    name = str(dataset.attrs.get("robot"))
    try:
        loaded = load(robot if robot is not None else name)
    except InputError:
        if robot is not None:
            raise
        raise InputError(f"--robot must be the file of {name!r}, which is not in the library, for {where}") from None
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
    import xarray as xr

    if not path.exists():
        raise InputError(f"{path} does not exist; it must be {ACCEPTED}")
    if path.is_dir() and path.suffix != ".zarr":
        raise InputError(f"{path} must be {ACCEPTED}, got a folder")
    refusal = f"{path} must be {ACCEPTED}, got a file that cannot be read"
    if path.suffix != ".zarr":
        return load_netcdf(path, refusal)
    try:
        return xr.open_zarr(path).load()
    except ImportError:
        raise InputError(
            f"zarr is not installed; install the extra cluster to read {path}: pip install 'towline[cluster]'"
        ) from None
    except Exception as error:  # a damaged folder may fail at any place of two libraries
        raise InputError(f"{refusal} ({printable((str(error) or 'empty').splitlines()[0])})") from None
