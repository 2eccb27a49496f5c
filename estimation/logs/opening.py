"""`recordings`: open logs of any kind; the first bytes of a file decide which."""

import os
from collections.abc import Sequence
from pathlib import Path

from ...base.errors import InputError
from ...base.inputs import file_path, printable
from ...base.reading import check_file, read_bytes
from .messages import from_bag, from_mcap
from .recording import Recording
from .tables import from_csv, from_netcdf

LARGEST_LOG, LARGEST_CSV, LARGEST_BAG = 1_000_000_000, 500_000_000, 100_000_000_000  # [bytes]
WHAT = "a CSV, NetCDF or MCAP file or a ROS bag"
BEGINS = {
    b"\x89HDF\r\n\x1a\n": "NetCDF",
    b"CDF": "NetCDF",
    b"\x89MCAP0\r\n": "MCAP",
    b"#ROSBAG V": "a bag of ROS 1",
    b"SQLite format 3\0": "a bag of ROS 2",
}
PARTS = (".mcap", ".db3")  # of a folder that is a bag of ROS 2


def recordings(paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]]) -> list[Recording]:
    """Open one log or several; a folder is a bag of ROS 2.

    Raises `InputError`, one line that names the file, if one cannot be read.
    """
    several = isinstance(paths, Sequence) and not isinstance(paths, str | bytes)
    files: list[Path] = []
    for given in paths if several else [paths]:
        path = file_path("log", given, f"the path of {WHAT}")
        parts = sorted(part for part in path.iterdir() if part.suffix in PARTS) if os.path.isdir(path) else [path]
        if not parts:
            packed = any(part.suffix == ".zstd" for part in path.iterdir())
            got = "compressed ones; `zstd -d` unpacks them" if packed else "none"
            raise InputError(
                f"{printable(str(path))} must be {WHAT}; a folder must have .mcap or .db3 files, got {got}"
            )
        files += parts
    if not files:
        raise InputError(f"log must be the path of {WHAT}, or several, got none")
    return [_recording(file) for file in files]


def is_recording(path: str | os.PathLike[str]) -> bool:
    """Return whether a path is an existing log by its kind, and no NetCDF file of a plan or a simulation."""
    file = file_path("log", path)
    try:
        if not file.is_file():  # a pipe would keep whoever opens it waiting
            return file.is_dir()
        with file.open("rb") as stream:
            begin = stream.read(16)
        kind = next((kind for magic, kind in BEGINS.items() if begin.startswith(magic)), file.suffix.lower())
        if kind != "NetCDF":
            return kind in (*BEGINS.values(), ".csv", ".tsv", ".txt")
        import h5py

        with h5py.File(file, "r") as content:
            return "robot" not in content.attrs and "cable_lengths" in content
    except (OSError, ValueError):
        return False


def _recording(file: Path) -> Recording:
    where = printable(str(file))
    check_file(file, WHAT, LARGEST_BAG)
    try:
        with file.open("rb") as stream:
            begin = stream.read(16)
        kind = next((kind for magic, kind in BEGINS.items() if begin.startswith(magic)), "CSV")
        if kind == "MCAP":
            return from_mcap(file, where)
        if kind.startswith("a bag"):
            return from_bag(file, where, kind)
        if kind == "NetCDF":
            return from_netcdf(read_bytes(file, WHAT, LARGEST_LOG), where)
        if file.suffix.lower() in (*PARTS, ".bag", ".nc"):
            raise InputError(f"must begin as {file.suffix} files do, got other bytes; it may be damaged")
        return from_csv(read_bytes(file, WHAT, LARGEST_CSV), where)  # which drops the bytes before it reads the text
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith(where) else f"{where}: {text}") from None
    except OSError as error:
        raise InputError(f"{where}: cannot be read ({error.strerror})") from None
