"""`recordings`: open logs of any kind, by the first bytes of a file, and read tables (CSV, NetCDF)."""

import io
import os
import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...base.csv_columns import LENGTHS, TIMES, read_columns
from ...base.declared import check_hdf5, check_heaps
from ...base.inputs import InputError, file_path, printable
from ...base.netcdf import check_units
from ...base.reading import check_file, read_bytes
from ...base.text import quantity
from .csv_text import plain_csv, sample_period
from .measurements import Sigma
from .messages import from_bag, from_mcap
from .names import FORCES, role
from .recording import Recording, Samples, Topic

LARGEST_LOG, LARGEST_CSV, LARGEST_BAG = 1_000_000_000, 500_000_000, 100_000_000_000  # [bytes]
WHAT = "a CSV, NetCDF or MCAP file or a ROS bag"
BEGINS = {
    b"\x89HDF\r\n\x1a\n": "NetCDF",
    b"CDF": "NetCDF",
    b"\x89MCAP0\r\n": "MCAP",
    b"#ROSBAG V": "a bag of ROS 1",
    b"SQLite format 3\0": "a bag of ROS 2",
}
PACKED = {b"\x1f\x8b": "gzip", b"PK\3\4": "zip", b"BZh": "bzip2", b"\xfd7zXZ": "xz", b"\x28\xb5\x2f\xfd": "zstd"}
PARTS = (".mcap", ".db3")  # of a folder that is a bag of ROS 2
NANOSECONDS = re.compile(r"(?i)(?:nsecs?|nanosec(?:ond)?s?)$")
MOST_FIELDS = 40_000_000  # of a CSV file
CONTROLS = re.compile(rb"[\x00-\x08\x0e-\x1f]")  # which no text has
ALWAYS_ACCEPTED = 40_000_000  # [bytes] of numbers, however well a log is compressed
POSE = ("x", "y", "z", "roll", "pitch", "yaw")
POSE_UNITS = ("m", "m", "m", "rad", "rad", "rad")
OF_CARRIERS = {"carrier_pose": (POSE, POSE_UNITS), "actuation": (("thrust",), ("N",))}  # of a simulation
OTHERS = ("carrier", "pose", "lengths_commanded", "tensions_commanded", "cable_directions")
WRITTEN = {"cable_lengths": ("l", LENGTHS), "tensions": ("tension", FORCES), "time": ("t", TIMES)}  # by towline


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


def from_csv(content: bytes, where: str) -> Recording:
    """Return the columns of a CSV file."""
    if not content or content.isspace():
        raise InputError("must be a CSV, NetCDF or MCAP file or a ROS bag, got an empty file")
    if packed := next((kind for magic, kind in PACKED.items() if content.startswith(magic)), None):
        raise InputError(f"must be {WHAT}, got one that is packed ({packed}); unpack it first")
    try:
        wide = content[:2] in (BOM_UTF16_LE, BOM_UTF16_BE) and content[2:4] != b"\0\0"  # spreadsheets: "Unicode text"
        text = content.decode("utf-16" if wide else "utf-8-sig").lstrip("\ufeff")
    except UnicodeDecodeError as error:
        if CONTROLS.search(content):
            raise InputError(f"must be a CSV file in UTF-8, or NetCDF, got other bytes (byte {error.start})") from None
        text = content.decode("cp1252", "replace")  # of spreadsheets in European languages
    if "\0" in text:
        raise InputError("must be a CSV file in UTF-8, or NetCDF, got binary data")
    del content
    units: dict[str, str] = {}

    def note(name: str, unit: str) -> float:
        units[name] = unit
        return 1.0

    columns, lines = read_columns(plain_csv(text), note, gaps=True, most=MOST_FIELDS)
    if not lines.size:
        raise InputError("must have a line for each sample below its header, got none")
    _with_whole_stamps(columns)
    columns = _at_one_time(columns)
    notes = _with_frames(columns, sample_period(text))
    table = _table(columns, {name: units.get(name, "") for name in columns})
    return Recording(where, "CSV", {"": table}, notes=notes)


def _with_whole_stamps(columns: dict[str, np.ndarray]) -> None:
    """Join stamps of whole seconds and the nanoseconds beyond them, as messages of ROS have them, in place."""
    for name in [name for name in columns if NANOSECONDS.search(name)]:
        stem = NANOSECONDS.sub("", name)
        seconds = re.compile(rf"(?i){re.escape(stem)}(?:s|secs?|seconds)")
        whole = next(filter(seconds.fullmatch, columns), None)
        if whole is not None:
            stamps = columns.pop(whole) + 1e-9 * columns.pop(name)
            columns[stem.rstrip("./_ ") or "stamp"] = stamps


def _at_one_time(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return columns at the times of the first one, of a table in which each channel has times of its own."""
    first, times = next(iter(columns.items()))
    apart = {name: name.removeprefix(f"{first} of ") for name in columns if name.startswith(f"{first} of ")}
    if not apart:
        return columns
    there = np.isfinite(times)
    moved = {name: column[there] for name, column in columns.items() if name not in apart}
    for name, channel in apart.items():
        known = np.isfinite(columns[name])
        own, values = columns[name][known], columns[channel][known]
        moved[channel] = np.interp(times[there], own, values, np.nan, np.nan) if known.any() else moved[channel]
    return moved


def _with_frames(columns: dict[str, np.ndarray], period: float | None) -> list[str]:
    """Add times of frames, `period` [s] apart, to a table of several columns without times, in place; return a note."""
    known = [role(name) for name, column in columns.items() if np.isfinite(column).any()]
    if any(found and found.role == "time" for found in known) or period is None or len(columns) < 2:
        return []
    count = np.arange(len(next(iter(columns.values()))), dtype=float)
    columns["time"] = period * next((column for name, column in columns.items() if name.lower() == "frame"), count)
    return [f"times are computed from frames that are {quantity(1e3 * period, 'ms', 4)} apart, by the header"]


def from_netcdf(content: bytes, where: str) -> Recording:
    """Return the variables of one dimension of a NetCDF file, or what towline has written."""
    import h5py

    try:
        # NetCDF 4 is HDF5. Of a damaged file, h5netcdf would complain once more on standard error when it is forgotten.
        with h5py.File(io.BytesIO(content), "r") as file:
            check_heaps(content)
            there = check_hdf5(file, len(content), _is_read, ALWAYS_ACCEPTED)
            arrays = {
                name: (_unpacked(variable), _attributes(variable))
                for name, variable in there.items()
                if variable.dtype.kind in "fiu"
            }
            known = _attributes(file)
            carriers = [name.decode() for name in np.ravel(there["carrier"][()])] if "carrier" in there else []
    except InputError:
        raise
    except Exception as error:  # h5py raises of any kind for damaged files
        reason = printable(str(error), 80)
        raise InputError(f"must be a NetCDF 4 file, got one that cannot be read ({reason})") from None
    stated = {name: known[f"sigma_{name}"] for name in Sigma._fields if f"sigma_{name}" in known}
    columns: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    for name, (values, attributes) in arrays.items():
        if name == "pose":
            check_units(name, attributes)
            _add(columns, units, POSE, values, POSE_UNITS)
        elif "cable_lengths" in arrays and name in WRITTEN:
            # Lengths of a simulation are those under tension, so its tensions are left out.
            if name == "tensions" and not stated:
                efforts = [f"cables/joints[cable {i + 1}].effort" for i in range(values.shape[-1])]  # as in MCAP
                _add(columns, units, efforts, values, ["N"] * len(efforts))
                continue
            prefix, accepted = WRITTEN[name]
            unit = str(attributes.get("units", ""))
            if unit not in accepted:
                raise InputError(f"the unit of {name} must be one of {', '.join(accepted)}, got {unit!r}")
            one = values.ndim < 2
            names = [prefix] if one else [f"{prefix}{i}" for i in range(values.shape[1])]
            _add(columns, units, names, values[:, None] if one else values, [unit] * len(names))
        elif name == "cable_directions" and values.ndim == 3:
            names = [f"direction_{i}_{axis}" for i in range(values.shape[1]) for axis in "xyz"]
            _add(columns, units, names, values.reshape(len(values), -1), ["1"] * len(names))
        elif name == "lengths_commanded" or (name == "tensions_commanded" and "lengths_commanded" not in arrays):
            if np.isnan(values).all():  # of a run without a controller
                continue
            names = [f"{name.split('s_')[0]}_command_{i}" for i in range(values.shape[-1])]
            _add(columns, units, names, values, ["m" if name == "lengths_commanded" else "N"] * len(names))
        elif values.ndim == 1:
            if role(name) and "units" not in attributes:
                raise InputError(f"variable {name} must have the attribute units, got none")
            _add(columns, units, [name], values[:, None], [str(attributes.get("units", ""))])
    topics: dict[str, Topic] = {}
    for i, carrier in enumerate(carriers):  # in topics of their own, so that no pose of theirs is the platform's
        own: dict[str, np.ndarray] = {}
        named: dict[str, str] = {}
        for name, (names, stated_units) in OF_CARRIERS.items():
            values = arrays[name][0] if name in arrays else np.empty(0)
            if values.ndim == 3 and values.shape[1:] >= (i + 1, len(names)):
                _add(own, named, names, values[:, i, : len(names)], stated_units)
        if own:
            topics[carrier] = _table(own, named, carrier)
    longest: dict[int, int] = {}
    for column in columns.values():
        longest[len(column)] = longest.get(len(column), 0) + 1
    rows = max(longest, key=lambda size: longest[size], default=0)
    wrong = [name for name, column in columns.items() if len(column) != rows and role(name)]
    if wrong:
        sizes = ", ".join(str(size) for size in sorted(longest))
        raise InputError(f"variables must have one size, got {sizes} ({wrong[0]})")
    columns = {name: column for name, column in columns.items() if len(column) == rows}
    framed = tuple(name for name in ("frame", "body") if name in str(known.get("framed", "")).split())
    return Recording(where, "NetCDF", {"": _table(columns, units), **topics}, stated, framed)


def _table(columns: Mapping[str, np.ndarray], units: Mapping[str, str], name: str = "") -> Topic:
    def read(names: Sequence[str]) -> Samples:
        return Samples(None, np.column_stack([columns[name] for name in names]))

    count = len(next(iter(columns.values()))) if columns else 0
    return Topic(name, "columns", count, None, {name: units[name] for name in columns}, read)


def _add(columns: dict, units: dict, names: Sequence[str], values: np.ndarray, stated: Sequence[str]) -> None:
    """Add the columns of a table (N, k), safe to compute with: a damaged file may contain signalling nan."""
    if values.ndim != 2 or values.shape[1] != len(names):
        raise InputError(f"{names[0]} must be a table of {len(names)} columns, got the shape {values.shape}")
    with np.errstate(invalid="ignore"):
        numbers = values.astype(float, copy=False)
        numbers = np.add(numbers, 0.0, out=numbers)
    for name, unit, column in zip(names, stated, numbers.T, strict=True):
        columns[name], units[name] = column, unit


def _is_read(name: str) -> bool:
    return bool(role(name)) or name in (*WRITTEN, *OF_CARRIERS, *OTHERS)


def _unpacked(variable: Any) -> np.ndarray:
    """Return the values of a variable of NetCDF, which may be packed as whole numbers (CF conventions)."""
    values = np.asarray(variable[...])
    known = {name: variable.attrs[name] for name in ("scale_factor", "add_offset") if name in variable.attrs}
    missing = variable.attrs.get("_FillValue")
    if missing is not None and (lost := values == missing).any():
        values = np.where(lost, np.nan, values)
    scale, offset = (np.float64(known.get(name, one)).item() for name, one in (("scale_factor", 1), ("add_offset", 0)))
    return values * scale + offset if known else values


def _attributes(of: Any) -> dict[str, Any]:
    """Return the texts and single numbers among the attributes of a file or a variable."""
    result: dict[str, Any] = {}
    for name in of.attrs:
        if name in ("units", "framed") or name.startswith("sigma_"):
            value = np.asarray(of.attrs[name]).ravel()
            text = value.item() if value.size == 1 else ""
            result[name] = text.decode("utf-8") if isinstance(text, bytes) else text
    return result
