"""The robot as C: robot.c, the record of sources/unit.h at the start, and the places of its variables."""

import re
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...base.version import __version__
from .variables import Variable

_TEMPLATE = Path(__file__).parent / "sources" / "robot.c.in"
_FLAT = ("inertia", "inverse_inertia")  # matrices that are one row in C


def robot_c(data: Mapping[str, Any], variables: Sequence[Variable], most: int) -> str:
    """Return robot.c, from the members of `towline_unit`; all files are to be compiled for as many cables as `most`."""
    lines = [f".{name} = {_value(name, value)}," for name, value in data.items()]
    wrapped = (part for line in lines for part in textwrap.wrap(line, 116, break_long_words=False))
    values = {"version": __version__, "cables": str(len(data["little"])), "most": str(most)}
    values |= {"start": "\n".join(f"    {line}" for line in wrapped)}
    values |= {"variables": "\n".join(f"    {_entry(variable)}," for variable in variables)}
    return re.sub(r"@(\w+)@", lambda match: values[match[1]], _TEMPLATE.read_text(encoding="utf-8"))


def _entry(variable: Variable) -> str:
    """Return the entry of a variable in the table of their places."""
    how = "UNIT_READ" if variable.causality in ("output", "independent") else "UNIT_FINITE"
    how, least = ("UNIT_ANY", "0") if np.isnan(variable.least) else (how, _number(variable.least))
    return f"{{offsetof(towline_unit, {variable.place}), {how}, {least}}}"


def _value(name: str, value: Any) -> str:
    """Return the initialiser of a member: numbers, records and arrays of both, which zeros may end."""
    if isinstance(value, str):
        return f'"{value}"'
    array = np.asarray(value)
    if array.dtype.names and array.ndim == 0:
        kept = [f".{part} = {_value(part, array[part])}" for part in array.dtype.names if _is_set(array[part])]
    elif array.ndim == 0:
        return repr(int(array)) if array.dtype.kind in "bi" else _number(float(array))
    else:
        rows = list(array.ravel() if name in _FLAT else array)
        while rows and not _is_set(rows[-1]):
            rows.pop()
        kept = [_value("", row) for row in rows]
    return f"{{{', '.join(kept) or '0'}}}"


def _is_set(value: Any) -> bool:
    return bool(np.asarray(value).tobytes().strip(b"\0"))


def _number(value: float) -> str:
    return {"inf": "INFINITY", "-inf": "-INFINITY", "nan": "NAN"}.get(repr(value), repr(value))
