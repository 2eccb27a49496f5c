"""Lists of points in files: `read_points` by the ending of the name, `read_csv` for CSV with units in its header."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path
from typing import Any

from ....base.errors import InputError
from ....base.inputs import printable, shown
from ....base.reading import read_bytes
from .gcode import read_gcode

__all__ = ["read_csv", "read_points"]

LENGTHS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
ANGLES = {"rad": 1.0, "deg": math.pi / 180}
TIMES = {"s": 1.0, "ms": 0.001, "min": 60.0}
UNITS = {
    **dict.fromkeys(("x", "y", "z"), LENGTHS),
    **dict.fromkeys(("roll", "pitch", "yaw"), ANGLES),
    **dict.fromkeys(("t", "dwell"), TIMES),
}
GCODE = (".gcode", ".ngc", ".tap")
COLUMN = re.compile(r"\s*([a-z]+)\s*(?:\[\s*([a-z]+)\s*\])?\s*")


def read_points(name: str, folder: Path) -> dict[str, Any]:
    """Return the points of a file, and its times [s] and how long it dwells [s] if it has them, as a path's fields.

    Raises
    ------
    InputError
        Naming file, line and column.
    """
    path, where = folder / name, printable(name)
    ending = path.suffix.lower()
    if ending != ".csv" and ending not in GCODE:
        endings = ", ".join((".csv", *GCODE))
        raise InputError(f"points must be a list, or a file whose name ends in one of {endings}, got {shown(name)}")
    try:
        text = read_bytes(path, "a list of points").decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{where} must be text in UTF-8, got another one (byte {error.start})") from None
    try:
        return read_csv(text, where) if ending == ".csv" else read_gcode(text, where)
    except csv.Error as error:  # a field of more than 131 072 characters
        raise InputError(f"{where} must be CSV that can be read, got {error}") from None


def read_csv(text: str, where: str) -> dict[str, Any]:
    """Return the fields of a path from CSV, with a header such as x [mm], y [mm], z [mm], yaw [deg], t [s].

    Raises
    ------
    InputError
        Naming `where`, line and column.
    """
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    lines = [(number, line) for number, line in lines if not line.lstrip().startswith("#")]
    if len(lines) < 3:
        raise InputError(f"{where} must have a header and two points or more, got {len(lines)} lines")
    mark = max(",;\t", key=lines[0][1].count)
    titles = _cells(lines[0][1], mark)
    scales = _header(titles, f"{where}, line {lines[0][0]}")
    columns: dict[str, list[float]] = {name: [] for name in scales}
    for number, line in lines[1:]:
        cells = _cells(line, mark)
        if len(cells) != len(titles):
            raise InputError(f"{where}, line {number} must have {len(titles)} columns as the header, got {len(cells)}")
        for (name, scale), title, cell in zip(scales.items(), titles, cells, strict=True):
            columns[name].append(scale * _number(cell, f"{where}, line {number}, column {title}"))
    count = len(lines) - 1
    level = [0.0] * count
    poses = (columns.get(name, level) for name in ("x", "y", "z", "roll", "pitch", "yaw"))
    fields: dict[str, Any] = {"points": list(zip(*poses, strict=True))}
    for name, field in (("t", "times"), ("dwell", "dwell")):
        if name in columns:
            fields[field] = columns[name]
    _check_times(columns.get("t", []), [number for number, _ in lines[1:]], where)
    return fields


def _cells(line: str, mark: str) -> list[str]:
    return [printable(cell.strip()) for cell in next(csv.reader([line], delimiter=mark, skipinitialspace=True))]


def _header(titles: list[str], where: str) -> dict[str, float]:
    """Return the unit in SI of each column, by its name."""
    scales: dict[str, float] = {}
    for title in titles:
        match = COLUMN.fullmatch(title.lower())
        name, unit = match.groups() if match else (None, None)
        if name not in UNITS:
            raise InputError(f"{where}: a column must be one of {', '.join(UNITS)} with its unit, got {shown(title)}")
        if unit not in UNITS[name]:
            accepted = ", ".join(f"'{name} [{unit}]'" for unit in UNITS[name])
            raise InputError(f"{where}: column {name} must be one of {accepted}, got {shown(title)}")
        if name in scales:
            raise InputError(f"{where}: column {name} must occur once, got it twice")
        scales[name] = UNITS[name][unit]
    for name in ("x", "y", "z"):
        if name not in scales:
            raise InputError(f"{where}: column {name} is missing, such as '{name} [m]'")
    return scales


def _number(cell: str, where: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{where} must be a number, got {shown(cell)}")
    return value


def _check_times(times: list[float], numbers: list[int], where: str) -> None:
    if times and times[0] != 0:
        raise InputError(f"{where}, line {numbers[0]}, column t must start at 0 s, got {times[0]:g} s")
    for before, after, number in zip(times, times[1:], numbers[1:], strict=False):
        if after <= before:
            raise InputError(f"{where}, line {number}, column t must increase, got {after:g} s after {before:g} s")
