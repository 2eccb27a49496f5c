"""Logs: measurements from CSV or NetCDF, with a unit for every column, and to NetCDF.

Columns: l0, l1, ... (readings of the lengths); x, y, z (position); roll, pitch, yaw, or qx, qy, qz, qw (orientation);
t (time); tension0, tension1, ... CSV: the first line has "name [unit]" for each. NetCDF: variables of one dimension
with these names and the attribute `units`, or, as towline writes them, cable_lengths, pose, tensions and time.
"""

import io
import os
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...base.csv_columns import ANGLES, LENGTHS, TIMES, read_columns, unit_factor
from ...base.declared import check_hdf5
from ...base.errors import InputError
from ...base.inputs import file_path, printable
from ...base.netcdf import check_units
from ...base.reading import read_bytes
from .measurements import Measurements, Sigma

LARGEST_LOG, LARGEST_CSV = 1_000_000_000, 50_000_000  # [bytes]
BINARY = (b"\x89HDF\r\n\x1a\n", b"CDF")  # how NetCDF files begin
ALWAYS_ACCEPTED = 40_000_000  # [bytes] of numbers, however well a log is compressed
FORCES = {"N": 1.0, "kN": 1e3, "mN": 1e-3}
NUMBERS = {"1": 1.0, "-": 1.0}
POSITION, ANGLE_NAMES, QUATERNION = ("x", "y", "z"), ("roll", "pitch", "yaw"), ("qx", "qy", "qz", "qw")
UNITS = {
    **dict.fromkeys(POSITION, LENGTHS),
    **dict.fromkeys(ANGLE_NAMES, ANGLES),
    **dict.fromkeys(QUATERNION, NUMBERS),
    "t": TIMES,
}
NUMBERED = re.compile(r"(l|tension)(0|[1-9]\d{0,2})")
WRITTEN = ("cable_lengths", "pose", "tensions", "time")  # by towline
ACCEPTED = "l0, l1, ..., x, y, z, roll, pitch, yaw, qx, qy, qz, qw, t, tension0, tension1, ..."


def read_measurements(path: str | os.PathLike[str], sigma: float | Mapping[str, float] | None = None) -> Measurements:
    """Read measurements from a CSV or NetCDF file with units.

    Parameters
    ----------
    path
        CSV with a header such as `t [s], l0 [m], l1 [m], x [mm], y [mm], z [mm], roll [deg], ..., tension0 [N]`; or
        NetCDF from `Measurements.save` or a simulation, or with variables named like these columns. Empty
        fields or nan mark poses that were not measured.
    sigma
        Standard deviations as for `Measurements`; default: those of the file if `Measurements.save` wrote it, otherwise
        the defaults of `Measurements`.

    Raises
    ------
    InputError
        If the file cannot be read, a column has no or an unknown unit, a length, tension or time is missing, or times
        do not increase.
    """
    file = file_path("log", path, "the path of a CSV or NetCDF file")
    where = printable(str(file))
    content = read_bytes(file, "a CSV or NetCDF file", LARGEST_LOG)
    binary = content.startswith(BINARY)
    if not binary and len(content) > LARGEST_CSV:
        most, size = LARGEST_CSV / 1e6, len(content) / 1e6
        raise InputError(f"{where} must be a CSV file of at most {most:g} MB, got {size:.1f} MB")
    if not content.strip():
        raise InputError(f"{where} must be a CSV or NetCDF file, got an empty file")
    try:
        arguments = _from_netcdf(content) if binary else _from_columns(_csv_columns(content))
        if sigma is not None:
            arguments["sigma"] = sigma
        return Measurements(**arguments)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _csv_columns(content: bytes) -> dict[str, np.ndarray]:
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"must be a CSV file in UTF-8, or NetCDF, got other bytes (byte {error.start})") from None
    if "\0" in text:
        raise InputError("must be a CSV file in UTF-8, or NetCDF, got binary data")
    columns, lines = read_columns(text, _factor, gaps=True)
    if not lines:
        raise InputError("must have a line for each sample below its header, got none")
    return columns


def _factor(name: str, unit: str) -> float:
    """Return the factor to SI units of a column or a variable."""
    numbered = NUMBERED.fullmatch(name)
    units = (LENGTHS if numbered[1] == "l" else FORCES) if numbered else UNITS.get(name)
    return unit_factor(name, unit, units, ACCEPTED)


def _from_columns(columns: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Return the arguments of `Measurements`."""
    lengths = _numbered(columns, "l")
    if lengths is None:
        raise InputError(f"must have columns l0, l1, ... of lengths, got {', '.join(columns) or 'none'}")
    result: dict[str, Any] = {"lengths": lengths, "tensions": _numbered(columns, "tension")}
    result["times"] = columns.get("t")
    groups = {names: [name for name in names if name in columns] for names in (POSITION, ANGLE_NAMES, QUATERNION)}
    for names, there in groups.items():
        if there and len(there) < len(names):
            raise InputError(f"must have all columns {', '.join(names)} or none of them, got {', '.join(there)}")
    if groups[ANGLE_NAMES] and groups[QUATERNION]:
        raise InputError("must have an orientation as roll, pitch, yaw or as qx, qy, qz, qw, got both")
    orientation = groups[ANGLE_NAMES] or groups[QUATERNION]
    if groups[POSITION]:
        result["poses"] = np.column_stack([columns[name] for name in POSITION])
    if orientation:
        result["orientations"] = np.column_stack([columns[name] for name in orientation])
    return result


def _numbered(columns: Mapping[str, np.ndarray], prefix: str) -> np.ndarray | None:
    """Return the columns prefix0, prefix1, ... side by side, (N, m), or None if there are none."""
    count = sum(1 for name in columns if (match := NUMBERED.fullmatch(name)) and match[1] == prefix)
    if not count:
        return None
    for i in range(count):
        if f"{prefix}{i}" not in columns:
            raise InputError(f"must have columns {prefix}0 to {prefix}{count - 1} without a gap, got no {prefix}{i}")
    table = np.column_stack([columns[f"{prefix}{i}"] for i in range(count)])
    wrong = np.argwhere(~np.isfinite(table))
    if wrong.size:
        row, column = (int(i) for i in wrong[0])
        raise InputError(f"{prefix}{column} must be a finite number at sample {row}, got {table[row, column]:g}")
    return table


def _from_netcdf(content: bytes) -> dict[str, Any]:
    import h5py

    try:
        # NetCDF 4 is HDF5. Of a damaged file, h5netcdf would complain once more on standard error when it is forgotten.
        with h5py.File(io.BytesIO(content), "r") as file:
            arrays = {
                name: (np.asarray(variable[...]), _attributes(variable))
                for name, variable in check_hdf5(file, len(content), _is_read, ALWAYS_ACCEPTED).items()
                if variable.dtype.kind in "fiu"
            }
            known = _attributes(file)
            stated = {name: known[f"sigma_{name}"] for name in Sigma._fields if f"sigma_{name}" in known}
    except InputError:
        raise
    except Exception as error:  # h5py raises of any kind for damaged files
        raise InputError(
            f"must be a NetCDF 4 file, got one that cannot be read ({printable(str(error), 80)})"
        ) from None
    if "cable_lengths" in arrays:
        return _as_towline_writes(arrays, stated)
    columns = {}
    for name, (values, attributes) in arrays.items():
        if values.ndim != 1 or name in WRITTEN:
            continue
        if "units" not in attributes:
            raise InputError(f"variable {name} must have the attribute units, got none")
        columns[name] = _floats(values) * _factor(name, str(attributes["units"]))
    sizes = {column.size for column in columns.values()}
    if len(sizes) > 1:
        raise InputError(f"variables must have one size, got {', '.join(str(size) for size in sorted(sizes))}")
    return _from_columns(columns)


def _is_read(name: str) -> bool:
    return bool(NUMBERED.fullmatch(name)) or name in UNITS or name in WRITTEN


def _attributes(of: Any) -> dict[str, Any]:
    """Return the texts and single numbers among the attributes of a file or a variable."""
    result: dict[str, Any] = {}
    for name in of.attrs:
        if name == "units" or name.startswith("sigma_"):
            value = np.asarray(of.attrs[name]).ravel()
            text = value[0] if value.size == 1 else ""
            result[name] = text.decode("utf-8") if isinstance(text, bytes) else text
    return result


def _floats(values: np.ndarray) -> np.ndarray:
    """Return values that are safe to compute with: a damaged file may contain signalling nan."""
    with np.errstate(invalid="ignore"):
        numbers = values.astype(float, copy=False)
        return np.add(numbers, 0.0, out=numbers)


def _as_towline_writes(arrays: dict[str, tuple[np.ndarray, dict[str, Any]]], stated: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments of `Measurements` from its own file, or from a simulation without standard deviations.

    Lengths of a simulation are those under tension, so its tensions are ignored.
    """
    known = {"cable_lengths": ("lengths", LENGTHS), "tensions": ("tensions", FORCES), "time": ("times", TIMES)}
    result: dict[str, Any] = {"sigma": dict(stated)} if stated else {}
    for name, (argument, units) in known.items():
        if name not in arrays or (name == "tensions" and not stated):
            continue
        values, attributes = arrays[name]
        result[argument] = _floats(values) * unit_factor(name, str(attributes.get("units", "")), units, name)
    if "pose" in arrays:
        values, attributes = arrays["pose"]
        check_units("pose", attributes)
        result["poses"] = _floats(values)
    return result
