"""`plain_csv`: the text of a table as others write it, with one line of names, separators, points and seconds."""

import re
from collections.abc import Sequence
from contextlib import suppress
from datetime import UTC, datetime
from itertools import accumulate, pairwise

from ...base.errors import InputError
from .names import UNITS, unit_of

MOST_ABOVE, LONGEST_HEADER = 40, 100_000  # lines above the numbers, and their characters
KNOWN_UNITS = {"", *(unit for units in UNITS.values() for unit in units)}
LENGTH_UNITS = re.compile(r"(?i)length units?[,;:=\t ]+([a-z]+)")
DECIMAL_COMMA = re.compile(r"\s*[-+]?\d*,\d+(?:[eE][-+]?\d+)?\s*")
_CLOCK = r"\d\d?:\d\d:\d\d(?:\.\d+)?"
DATE = re.compile(rf"(?<![\d-])\d{{4}}-\d\d-\d\d[T ]{_CLOCK}(?:Z|[+-]\d\d:?\d\d)?")
DURATION = re.compile(r"(?m)^(\d+(?:\.\d+)?) sec(?=[,;\t])")  # of a timetable of MATLAB
HEADER = "t [s], l0 [m], l1 [m], x [m], y [m], z [m]"
LABVIEW = "***End_of_Header***"
# Rates [Hz] of motion capture systems: FREQUENCY of Qualisys, the second line of Vicon.
_ABOVE = r"(?:sampl[a-z]+ |frame )?(?:rate|frequency)[^\d\n]*|[a-z ]+[,;]*\r?\n"
RATE = re.compile(rf"(?i)(?:^|\n)(?:{_ABOVE})(\d+(?:\.\d+)?)[.,;\s]*\n")
PERIOD = re.compile(r"\nDelta_X\t+(\d+\.\d+)")  # [s] of LabVIEW
TIME_OF_DAY = re.compile(rf"(?<![\d:]){_CLOCK}(?![\d:])(?: ?([AaPp])[Mm])?")
# A date as others write it, before a time of day or in a column of its own.
OTHER_DATE = re.compile(rf"(?m)(?:^|(?<=[,;\t\"]))\d{{1,4}}([-./])\d\d?\1\d{{2,4}}(?: +(?={_CLOCK})|(?=[,;\t\"]))")


def plain_csv(text: str) -> str:
    """Return CSV with one header, commas, semicolons or tabs between columns, decimal points, and times in seconds.

    Dates count from 1970, in UTC unless they name another zone. Times of day count from midnight, also beside dates of
    other kinds.
    """
    text = f"#{text[1:]}" if text[:2] == "% " else text  # of MATLAB
    text = DURATION.sub(r"\1", text) if DURATION.search("\n".join(_head(text))) else text
    return _one_header(_with_points(_with_seconds(_with_tabs(text))))


def _head(text: str) -> list[str]:
    return text[:LONGEST_HEADER].splitlines()[: MOST_ABOVE + 1]


def _with_tabs(text: str) -> str:
    """Return a table with tabs, of one with spaces between numbers, whose names are commented out or not."""
    lines = _head(text)
    for line in lines:
        cells = line.split()
        if len(cells) > 1 and all(map(_is_number, cells)):
            return re.sub(r"[ \t]+", "\t", re.sub(r"(?m)^(#?)[ \t]+|[ \t]+$", r"\1", text))
        if re.search("[,;\t]", line) and line[:1] != "#":
            break
    return text


def _with_seconds(text: str) -> str:
    """Return a table with numbers for dates and times of day."""
    begin = "\n".join(line for line in _head(text) if line[:1] != "#")
    if DATE.search(begin):
        text = DATE.sub(lambda found: _since_1970(found[0]), text)
    if not TIME_OF_DAY.search(begin):
        return text
    if OTHER_DATE.search(begin):
        text = OTHER_DATE.sub(lambda found: "" if found[0][-1] == " " else re.sub(r"\D", "", found[0]), text)
    return TIME_OF_DAY.sub(_since_midnight, text)


def _since_1970(date: str) -> str:
    with suppress(ValueError):
        found = datetime.fromisoformat(date)
        return f"{(found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp():.6f}"
    return date


def _since_midnight(time: re.Match[str]) -> str:
    hours, minutes, seconds = time[0].rstrip(" AaPpMm").split(":")
    hour = int(hours) % 12 + 12 * (time[1] in "Pp") if time[1] else int(hours)
    return f"{3600 * hour + 60 * int(minutes) + float(seconds):.9g}"


def _with_points(text: str) -> str:
    """Return a table with decimal points, of one with decimal commas between semicolons or tabs."""
    for line in _head(text):
        cells = re.split("[;\t]", line)
        if len(cells) > 1 and 2 * sum(map(bool, map(DECIMAL_COMMA.fullmatch, cells))) >= len(cells):
            return text.replace(",", ".")
    return text


def _one_header(text: str) -> str:
    """Return CSV with one line of names: motion capture systems write several, and others one of units below names.

    Raises:
        InputError: If there are numbers without a line above them.
    """
    lines = _head(text)
    mark = max(",;\t", key="".join(lines).count)
    table = [[cell.strip().strip('"') for cell in line.split(mark)] for line in lines]
    below = [*table[1:], table[-1]]
    first = next((k for k, rows in enumerate(zip(table, below, strict=True)) if _is_data(*rows)), 0)  # of numbers
    last = table[first - 1] if first else []
    if any(last) and len(last) == len(table[first]) - 1 and not table[first][-1]:
        last.append("")  # only the numbers end with a separator
    rows = _rows_of_names(lines[:first], table[:first], len(table[first]))
    if rows is None:
        if _is_data(table[first], table[first]) and all(line[:1] in ("", "#") for line in lines[:first]):
            stated = "got numbers in its first line"
            raise InputError(f"must have a header that names its columns, as in {HEADER}, {stated}")
        return text
    plain = len(rows) == 1 and len(last) == len(table[first]) and lines[first - 1][:1] != "#"
    if plain and all(not line.strip() or line[:1] == "#" for line in lines[: first - 1]):
        return text
    head = "\n".join(lines[:first])
    names, units = _of_scope(rows) if any(row[0] == "Name" for row in rows) else _of_rows(rows, head)
    # Where each channel has times of its own, their columns have one name.
    names = [f"{names[0]} of {names[k + 1]}" if k and name == names[0] else name for k, name in enumerate(names)]
    titles = [f"{name} [{unit}]" if unit else name for name, unit in zip(names, units, strict=True)]
    above = sum(map(len, text[:LONGEST_HEADER].splitlines(keepends=True)[:first]))
    return "\n" * (first - 1) + mark.join(titles) + "\n" + text[above:]  # empty lines keep the numbers of lines


def _rows_of_names(lines: list[str], table: list[list[str]], width: int) -> list[list[str]] | None:
    """Return the rows of names above the numbers, of which each has `width` columns; None if no row has so many.

    Names that are commented out, as `numpy.savetxt` writes them, are names if no others are above the numbers.
    """
    begin = max((k + 1 for k, line in enumerate(lines) if line.startswith(LABVIEW)), default=0)
    above = [(_cut(row, width), line[:1] == "#") for row, line in zip(table[begin:], lines[begin:], strict=True)]
    above = [(row, commented) for row, commented in above if len(row) == width]
    if not above:
        return None
    rows = [row for row, commented in above if not (commented or _is_title(row))]
    return rows or [[cell.lstrip("# ") for cell in above[-1][0]]]


def _cut(row: list[str], width: int) -> list[str]:
    """Return a row of names without a last cell, empty or for comments (LabVIEW), that rows of numbers leave out."""
    return row[:width] if row[width:] in ([""], ["Comment"]) else row


def _is_title(row: list[str]) -> bool:
    """Return whether a row is empty, has a title alone in its first cell, or the numbers of bodies (OptiTrack)."""
    return not any(row[1:] or row) or row[1:2] == ["ID"]


def _of_rows(rows: Sequence[list[str]], head: str) -> tuple[list[str], list[str]]:
    """Return names and units of columns: of rows of names, and of one of units below them."""
    units = [cell.strip("[]()") for cell in rows[-1]]
    stated = len(rows) > 1 and all(unit in KNOWN_UNITS for unit in units)
    *above_names, last = rows[: len(rows) - stated]
    if last[1:2] and last[1].startswith("Time"):  # below the words Type, Name and Parent of OptiTrack
        above_names = [[row[0], "", *row[2:]] for row in above_names]
    # The name of a body may stand above the first of its columns only, or before the name of this column (Qualisys).
    above_names = [list(accumulate(row, lambda before, cell: cell or before)) for row in above_names]
    bodies = [cell[:-2] if cell.endswith(" X") and after == "Y" else "" for cell, after in pairwise([*last, ""])]
    of = list(accumulate(bodies, lambda before, body: body or before))
    pairs = zip(last, of, strict=True)
    last = [cell if not body or cell.startswith(body) else f"{body} {cell}" for cell, body in pairs]
    names = ["/".join(dict.fromkeys(filter(None, column))) for column in zip(*above_names, last, strict=True)]
    if stated:
        return names, units
    if last[0] == "X_Value":  # of LabVIEW
        return [name.replace("X_Value", "time") for name in names], ["s" if one == "X_Value" else "" for one in last]
    if "NO_OF_FRAMES" in head:  # of Qualisys
        units_of = dict.fromkeys("XYZ", "mm") | dict.fromkeys(("Roll", "Pitch", "Yaw"), "deg")
        return names, [units_of.get(name.rpartition(" ")[2], "") for name in names]
    if unit := LENGTH_UNITS.search(head):  # of a motion capture, above all names
        return names, [unit_of(unit[1]) if "position" in name.lower() else "" for name in names]
    return names, [""] * len(names)


def _of_scope(rows: Sequence[list[str]]) -> tuple[list[str], list[str]]:
    """Return names and units of columns of TwinCAT Scope: rows such as Name and Unit, beside the times of channels."""
    known = {row[0]: row for row in rows}
    titles, words = known["Name"], known.get("Unit", [""] * len(rows[0]))
    units = ["ms" if title == "Name" else word.partition(" ")[0] for title, word in zip(titles, words, strict=True)]
    names = ["time" if title == "Name" else title for title in titles]
    return names, [unit if unit in KNOWN_UNITS else "" for unit in units]


def sample_period(text: str) -> float | None:
    """Return the time between samples [s] that the lines above the names of `plain_csv` state, or None."""
    head = "\n".join(_head(text)).replace(",", ".")
    for pattern, power in ((PERIOD, 1), (RATE, -1)):
        if (found := pattern.search(head)) and float(found[1]) > 0:
            return float(float(found[1]) ** power)
    return None


def _is_data(row: Sequence[str], below: Sequence[str]) -> bool:
    """Return whether at least half of the fields that are not empty are numbers, the first one among them.

    If the first field is empty, all others must be numbers, in the row below too: rows of names may number markers.
    A single number is the rate of what follows with more columns.
    """
    filled = [cell for cell in row if cell]
    if len(row) == 1 < len(below):
        return False
    if row[0]:
        return _is_number(row[0]) and 2 * sum(map(_is_number, filled)) >= len(filled)
    return bool(filled) and all(map(_is_number, filled)) and all(map(_is_number, filter(None, below)))


def _is_number(cell: str) -> bool:
    with suppress(ValueError):
        float(cell)
        return True
    return False
