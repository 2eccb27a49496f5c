"""Lists of points in files: `read_points` by the ending of the name, `read_csv` for CSV with units in its header."""

from pathlib import Path
from typing import Any

import numpy as np

from ....base.csv_columns import ANGLES, LENGTHS, TIMES, read_columns, unit_factor
from ....base.inputs import InputError, printable, shown
from ....base.reading import read_bytes
from .gcode import read_gcode

UNITS = {
    **dict.fromkeys(("x", "y", "z"), LENGTHS),
    **dict.fromkeys(("roll", "pitch", "yaw"), ANGLES),
    **dict.fromkeys(("t", "dwell"), TIMES),
}
GCODE = (".gcode", ".nc", ".ngc", ".tap")
LARGEST_FILE = 20_000_000  # [bytes]: half a million lines


def read_points(name: str, folder: Path) -> dict[str, Any]:
    """Return the points of a file, and its times [s] and how long it dwells [s] if it has them, as a path's fields.

    Raises `InputError` naming file, line and column.
    """
    path, where = folder / name, printable(name)
    ending = path.suffix.lower()
    if ending != ".csv" and ending not in GCODE:
        endings = ", ".join((".csv", *GCODE))
        raise InputError(f"points must be a list, or a file whose name ends in one of {endings}, got {shown(name)}")
    content = read_bytes(path, "a list of points", LARGEST_FILE)
    if content.startswith((b"\x89HDF", b"CDF")):
        raise InputError(f"{where} must be G-code or CSV, got NetCDF")
    if ending in GCODE:
        return read_gcode(content.decode("utf-8-sig", "replace"), where)  # comments are in any encoding
    try:
        return read_csv(content.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise InputError(f"{where} must be text in UTF-8, got another one (byte {error.start})") from None
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def read_csv(text: str) -> dict[str, Any]:
    """Return the fields of a path from CSV, with a header such as x [mm], y [mm], z [mm], yaw [deg], t [s].

    Raises `InputError` naming line and column.
    """
    names = ", ".join(UNITS)
    columns, lines = read_columns(text.lower(), lambda name, unit: unit_factor(name, unit, UNITS.get(name), names))
    for name in ("x", "y", "z"):
        if name not in columns:
            raise InputError(f"column {name} is missing, such as '{name} [m]'")
    if len(lines) < 2:
        raise InputError(f"must have a header and two points or more, got {len(lines)} below it")
    level = np.zeros(len(lines))
    poses = [columns.get(name, level).tolist() for name in ("x", "y", "z", "roll", "pitch", "yaw")]
    fields: dict[str, Any] = {"points": list(zip(*poses, strict=True))}
    for name, field in (("t", "times"), ("dwell", "dwell")):
        if name in columns:
            fields[field] = columns[name].tolist()
    _check_times(fields.get("times", []), lines)
    return fields


def _check_times(times: list[float], lines: np.ndarray) -> None:
    if times and times[0] != 0:
        raise InputError(f"line {lines[0]}, column t must start at 0 s, got {times[0]:g} s")
    for before, after, number in zip(times, times[1:], lines[1:], strict=False):
        if after <= before:
            raise InputError(f"line {number}, column t must increase, got {after:g} s after {before:g} s")
