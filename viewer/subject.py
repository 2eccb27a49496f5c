"""`Subject`: what is looked at: a robot, a plan, or a workspace; `read` finds out which."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from ..models import Robot, load

if TYPE_CHECKING:
    import xarray as xr

    from .cloud import Cloud
    from .replay import Replay

HDF5 = b"\x89HDF\r\n\x1a\n"  # how NetCDF files begin
ACCEPTED = "a robot, or a file that `towline plan` or `towline workspace` wrote"


@dataclass(frozen=True)
class Subject:
    """What is looked at.

    Attributes
    ----------
    title
        One line.
    robot
        Whose it is.
    replay
        Of a plan, else None.
    cloud
        Of a workspace, else None.
    """

    title: str
    robot: Robot
    replay: Replay | None = None
    cloud: Cloud | None = None

    @property
    def kind(self) -> str:
        """Robot, plan or workspace."""
        return "plan" if self.replay else "workspace" if self.cloud else "robot"


def read(target: str, robot: str | None = None) -> Subject:
    """Read what there is to look at.

    Parameters
    ----------
    target
        A robot of the library or a robot file; a plan or a workspace as NetCDF, or a workspace as a Zarr folder.
    robot
        Of a workspace, if it is not one of the library: the file has its name only.

    Raises
    ------
    InputError
        If it is none of these, or is of another robot: one line.
    """
    path = Path(target)
    if path.suffix == ".zarr" or _is_netcdf(path):
        return _of_dataset(_open(path), target, robot)
    if robot is not None:
        raise InputError(f"--robot: {robot!r} beside {target}; accepted: with a workspace, whose file does not hold it")
    loaded = load(target)
    return Subject(loaded.name, loaded)


def _of_dataset(found: xr.Dataset, where: str, robot: str | None) -> Subject:
    if "pose" in found and "time" in found.variables:
        from .replay import Replay

        if robot is not None:
            raise InputError(f"--robot: {robot!r} beside {where}; accepted: none, a plan holds its robot")
        replay = Replay(found, where)
        return Subject(replay.title, replay.robot, replay=replay)
    if "reached" not in found and "position" not in found:
        raise InputError(f"{where}: is neither a plan nor a workspace; accepted: {ACCEPTED}")
    from .cloud import cloud

    name = str(found.attrs.get("robot"))
    try:
        loaded = load(robot if robot is not None else name)
    except InputError:
        if robot is not None:
            raise
        raise InputError(f"{where}: is of robot {name!r}, not of the library; accepted: --robot FILE with it") from None
    if loaded.name != name:
        raise InputError(
            f"--robot: {robot!r} is {loaded.name!r}; accepted: the file of {name!r}, whose workspace this is"
        )
    return Subject(f"{loaded.name}, workspace", loaded, cloud=cloud(found, where))


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
        raise InputError(f"{path}: is not there; accepted: {ACCEPTED}")
    if path.is_dir() and path.suffix != ".zarr":
        raise InputError(f"{path}: is a folder; accepted: {ACCEPTED}")
    try:
        if path.suffix == ".zarr":
            return xr.open_zarr(path).load()
        return xr.load_dataset(path, engine="h5netcdf")
    except ImportError:
        raise InputError(f"{path}: zarr is not installed; accepted: pip install 'towline[cluster]'") from None
    except (OSError, ValueError, KeyError, TypeError, RuntimeError) as error:
        # HDF5 puts its own account of the matter, of several lines, where others have a few words.
        reason = (getattr(error, "strerror", None) or str(error) or "empty").splitlines()[0]
        raise InputError(f"{path}: cannot be read ({reason}); accepted: {ACCEPTED}") from None
