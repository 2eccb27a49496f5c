"""Columns of numbers in CSV, with the unit of each in the header: `read_columns`."""

import csv
import math
from collections.abc import Callable, Mapping

import numpy as np

from .errors import InputError
from .inputs import printable, shown

LENGTHS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 1e-3, "um": 1e-6, "km": 1e3, "in": 0.0254}
ANGLES = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180, "°": math.pi / 180}
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
MOST_FIELDS = 2_000_000  # some microseconds each; NetCDF may have more
MOST_COLUMNS = 1000
ENDS = "\n\r\v\f\x1c\x1d\x1e\x85\u2028\u2029"  # of lines, for `str.splitlines`
Rows = list[tuple[int, str]]  # lines of a file that are neither empty nor comments, with their numbers from 1


def read_columns(
    text: str, factor: Callable[[str, str], float], gaps: bool = False
) -> tuple[dict[str, np.ndarray], list[int]]:
    """Return columns in SI units by their names, (N,), and the numbers of their lines, from 1.

    The header is such as `x [mm], yaw [deg]`; columns are separated by commas, semicolons or tabs. Empty lines and
    those that begin with # are left out. `factor` returns the factor to SI units for a name and a unit, see
    `unit_factor`. With `gaps`, fields may be empty or nan.

    Raises `InputError` that names line and column, but not the file.
    """
    rows = _rows(text)
    mark = max(",;\t", key=rows[0][1].count)
    for number, line in rows:
        if (count := 1 + line.count(mark)) > MOST_COLUMNS:
            raise InputError(f"line {number} must have at most {MOST_COLUMNS} columns, got {count}")
    factors: dict[str, float] = {}
    try:
        titles = [printable(cell.strip()) for cell in _split(rows[0][1], mark)]
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


def _rows(text: str) -> Rows:
    """Return the lines of a text, or raise InputError if there are so many fields that reading takes too long."""
    fields = sum(text.count(end) for end in ENDS) - text.count("\r\n") + max(text.count(mark) for mark in ",;\t")
    if fields > MOST_FIELDS:
        raise InputError(f"must have at most {MOST_FIELDS} fields, got {fields}")
    lines = enumerate(text.splitlines(), 1)
    return [(number, line) for number, line in lines if (begin := line.lstrip()[:1]) and begin != "#"] or [(1, "")]


def _split(line: str, mark: str) -> list[str]:
    return next(csv.reader([line], delimiter=mark, skipinitialspace=True), [])


def _numbers(rows: Rows, mark: str, titles: list[str], gaps: bool) -> np.ndarray:
    table = np.empty((len(rows), len(titles)))
    try:  # a hundred times as fast
        lines = [_filled(line, mark) if gaps else line for _, line in rows]
        fast = np.loadtxt(lines, delimiter=mark, ndmin=2, comments=None) if rows else table
        if fast.shape == table.shape and (gaps or np.isfinite(fast).all()):
            return fast
    except ValueError:
        pass
    for row, (number, line) in enumerate(rows):
        cells = _split(line, mark)
        if len(cells) != len(titles):
            raise InputError(f"line {number} must have {len(titles)} columns as the header, got {len(cells)}")
        table[row] = [_value(cell, gaps) for cell in cells]
        wrong = np.flatnonzero(np.isinf(table[row]))
        if wrong.size:
            title, cell = titles[wrong[0]], printable(cells[wrong[0]].strip())
            raise InputError(f"line {number}, column {title} must be a number, got {shown(cell)}")
    return table


def _value(cell: str, gaps: bool) -> float:
    """Return the number of a field, nan of an empty one where that may be, and infinity of any other."""
    try:
        value = float(cell)
        return value if gaps or not math.isnan(value) else math.inf
    except ValueError:
        return math.nan if gaps and not cell.strip() else math.inf


def _filled(line: str, mark: str) -> str:
    """Return a line with nan in its empty fields."""
    return mark.join(cell if cell.strip() else "nan" for cell in line.split(mark))
