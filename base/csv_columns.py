"""Columns of numbers in CSV, with the unit of each in the header: `read_columns`."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping

import numpy as np

from .errors import InputError
from .inputs import printable, shown

LENGTHS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 1e-3, "um": 1e-6, "km": 1e3, "in": 0.0254}
ANGLES = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180, "°": math.pi / 180}
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
Rows = list[tuple[int, str]]  # lines of a file that are neither empty nor comments, with their numbers from 1


def read_columns(
    text: str, factor: Callable[[str, str], float], gaps: bool = False
) -> tuple[dict[str, np.ndarray], list[int]]:
    """Return columns in SI units by their names, (N,), and the numbers of their lines, from 1.

    The header is such as `x [mm], yaw [deg]`; columns are separated by commas, semicolons or tabs. Empty lines and
    those that begin with # are left out. `factor` returns the factor to SI units for a name and a unit, see
    `unit_factor`. With `gaps`, fields may be empty or nan.

    Raises
    ------
    InputError
        Naming line and column, but not the file.
    """
    rows = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    rows = [(number, line) for number, line in rows if not line.lstrip().startswith("#")] or [(1, "")]
    mark = max(",;\t", key=rows[0][1].count)
    factors: dict[str, float] = {}
    try:
        titles = _cells(rows[0][1], mark)
        for title in titles:
            name, _, unit = title[:-1].partition("[") if title.endswith("]") else (title, "", "")
            if (name := name.strip()) in factors:
                raise InputError(f"must have each column once, got {name} twice")
            factors[name] = factor(name, unit.strip())
        table = _numbers(rows[1:], mark, titles, gaps)
    except csv.Error as error:  # a field of more than 131 072 characters
        raise InputError(f"must be CSV that can be read, got {error}") from None
    columns = {name: column * scale for (name, scale), column in zip(factors.items(), table.T, strict=True)}
    return columns, [number for number, _ in rows[1:]]


def unit_factor(name: str, unit: str, units: Mapping[str, float] | None, names: str) -> float:
    """Return the factor to SI units; raise InputError for a name not among `names`, without `units`."""
    if units is None:
        raise InputError(f"columns must be among {names}, got {shown(name)}")
    if unit not in units:
        raise InputError(f"the unit of {name} must be one of {', '.join(units)}, got {shown(unit)}")
    return units[unit]


def _cells(line: str, mark: str) -> list[str]:
    return [printable(cell.strip()) for cell in next(csv.reader([line], delimiter=mark, skipinitialspace=True), [])]


def _numbers(rows: Rows, mark: str, titles: list[str], gaps: bool) -> np.ndarray:
    table = np.empty((len(rows), len(titles)))
    try:  # a hundred times as fast
        fast = np.loadtxt([line for _, line in rows], delimiter=mark, ndmin=2, comments=None) if rows else table
        if fast.shape == table.shape and (gaps or np.isfinite(fast).all()):
            return fast
    except ValueError:
        pass
    for row, (number, line) in enumerate(rows):
        cells = _cells(line, mark)
        if len(cells) != len(titles):
            raise InputError(f"line {number} must have {len(titles)} columns as the header, got {len(cells)}")
        for column, cell in enumerate(cells):
            gap = gaps and cell.lower() in ("", "nan")
            try:
                table[row, column] = np.nan if gap else float(cell)
            except ValueError:
                table[row, column] = np.inf
            if not gap and not np.isfinite(table[row, column]):
                raise InputError(f"line {number}, column {titles[column]} must be a number, got {shown(cell)}")
    return table
