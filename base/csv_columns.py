"""Columns of numbers in CSV, with the unit of each in the header: `read_columns`."""

import csv
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from .inputs import InputError, printable, shown
from .text import counted

LENGTHS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 1e-3, "um": 1e-6, "km": 1e3, "in": 0.0254}
ANGLES = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180, "°": math.pi / 180}
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
MOST_FIELDS = 2_000_000  # some microseconds each; NetCDF may have more
MOST_COLUMNS = 1000
BLOCK = 2_000_000  # characters
ENDS = "\n\r\v\f\x1c\x1d\x1e\x85\u2028\u2029"  # of lines, for `str.splitlines`
MISSING = {"", "na", "n/a", "#n/a", "null", "none", "-"}  # what may stand for a missing number
Rows = list[tuple[int, str]]  # some lines of a file, with their numbers from 1


def read_columns(
    text: str, factor: Callable[[str, str], float], gaps: bool = False, most: int = MOST_FIELDS
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return columns in SI units by their names, (N,), and the numbers of their lines, from 1, (N,) of int.

    The header is such as `x [mm], yaw [deg]`; columns are separated by commas, semicolons or tabs. Empty lines and
    those that begin with # are left out. `factor` returns the factor to SI units for a name and a unit, see
    `unit_factor`. With `gaps`, fields may be empty or nan, and columns that begin with text are left out.

    Raises `InputError` that names line and column, but not the file.
    """
    _check_size(text, most)
    first = [row for _, row in zip(range(2), (row for block in _blocks(text) for row in block), strict=False)]
    header = first[0][1] if first else ""
    mark = max(",;\t", key=header.count)
    factors: dict[str, float] = {}
    try:
        _check_width(first[:1], mark)
        titles = [printable(cell.strip()) for cell in _split(header, mark)]
        begin = _split(first[1][1], mark) if gaps and len(first) > 1 else []
        used = [k for k in range(len(titles)) if len(begin) != len(titles) or not _is_text(begin[k])]
        if titles and not used:
            raise InputError(f"line {first[1][0]} must have numbers below the header, got {shown(first[1][1].strip())}")
        for name, unit in _names_and_units([titles[k] for k in used]):
            if name in factors:
                raise InputError(f"must have each column once, got {name} twice")
            factors[name] = factor(name, unit)
        count = max(sum(map(len, _blocks(text))) - 1, 0)
        table, numbers = np.empty((count, len(used))), np.empty(count, dtype=int)
        done = -1  # of the rows, the header among them
        for block in _blocks(text):
            rows = block[1:] if done < 0 else block
            done += len(block)
            _check_width(rows, mark)
            if rows:
                table[done - len(rows) : done] = _numbers(rows, mark, titles, used, gaps)
                numbers[done - len(rows) : done] = [number for number, _ in rows]
    except csv.Error as error:  # a field of more than 131 072 characters
        raise InputError(f"must be CSV that can be read, got {error}") from None
    for column, scale in zip(table.T, factors.values(), strict=True):
        column *= scale
    return dict(zip(factors, table.T, strict=True)), numbers


def unit_factor(name: str, unit: str, units: Mapping[str, float] | None, names: str) -> float:
    """Return the factor to SI units; raise InputError for a name not among `names`, without `units`."""
    if units is None:
        raise InputError(f"columns must be among {names}, got {shown(name)}")
    if unit not in units:
        raise InputError(f"the unit of {name} must be one of {', '.join(units)}, got {shown(unit)}")
    return units[unit]


def _check_size(text: str, most: int) -> None:
    """Raise InputError if a text has so many fields that reading takes too long."""
    fields = sum(text.count(end) for end in ENDS) - text.count("\r\n") + max(text.count(mark) for mark in ",;\t")
    if fields > most:
        raise InputError(f"must have at most {most} fields, got {fields}")


def _check_width(rows: Rows, mark: str) -> None:
    for number, line in rows:
        if (count := 1 + line.count(mark)) > MOST_COLUMNS:
            raise InputError(f"line {number} must have at most {MOST_COLUMNS} columns, got {count}")


def _blocks(text: str) -> Iterator[Rows]:
    """Yield the lines of a text that are neither empty nor comments, some at a time: all would need more memory."""
    begin, before = 0, 0
    while begin < len(text):
        end = text.find("\n", begin + BLOCK) + 1 or len(text)
        lines = text[begin:end].splitlines()
        yield [(k, line) for k, line in enumerate(lines, before + 1) if (sign := line.lstrip()[:1]) and sign != "#"]
        begin, before = end, before + len(lines)


def _split(line: str, mark: str) -> list[str]:
    return next(csv.reader([line], delimiter=mark, skipinitialspace=True), [])


def _names_and_units(titles: Sequence[str]) -> list[tuple[str, str]]:
    """Return names and units: "x [mm]" has a unit, "q[0]" beside "q[1]", or "thrust[2]", an index."""
    parts = [title[:-1].rpartition("[") if re.search(r"\[.*]$", title) else (title, "", "") for title in titles]
    names = [name for name, _, _ in parts]
    return [
        (title, "") if unit.isdigit() and (names.count(name) > 1 or unit != "1") else (name.strip(), unit.strip())
        for title, (name, _, unit) in zip(titles, parts, strict=True)
    ]


def _is_text(cell: str) -> bool:
    try:
        float(cell or "nan")
    except ValueError:
        return bool(cell.strip())
    return False


def _numbers(rows: Rows, mark: str, titles: list[str], used: list[int], gaps: bool) -> np.ndarray:
    """Return the columns `used` of some lines."""
    for fill in (False, True) if gaps else (False,):
        try:  # a hundred times as fast
            lines = [_filled(line, mark) if fill else line for _, line in rows]
            if len(used) < len(titles) and any(line.count(mark) != len(titles) - 1 for line in lines):
                break
            columns = used if len(used) < len(titles) else None
            fast = np.loadtxt(lines, delimiter=mark, ndmin=2, comments=None, usecols=columns)
            if fast.shape == (len(rows), len(used)) and (gaps or np.isfinite(fast).all()):
                return fast
        except ValueError:
            pass
    table = np.empty((len(rows), len(used)))
    for row, (number, line) in enumerate(rows):
        cells = _split(line, mark)
        if len(cells) != len(titles):
            values = counted(len(titles), "value")
            raise InputError(f"line {number} must have {values} like the header, got {len(cells)}")
        table[row] = [_value(cells[k], gaps) for k in used]
        wrong = np.flatnonzero(np.isinf(table[row]))
        if wrong.size:
            title, cell = titles[used[wrong[0]]], printable(cells[used[wrong[0]]].strip())
            raise InputError(f"line {number}, column {title} must be a number, got {shown(cell)}")
    return table


def _value(cell: str, gaps: bool) -> float:
    """Return the number of a field, nan of a missing one where that may be, and infinity of any other."""
    try:
        value = float(cell)
        return value if gaps or not math.isnan(value) else math.inf
    except ValueError:
        return math.nan if gaps and cell.strip().lower() in MISSING else math.inf


def _filled(line: str, mark: str) -> str:
    """Return a line with nan in its empty fields."""
    return mark.join(cell if cell.strip() else "nan" for cell in line.split(mark))
