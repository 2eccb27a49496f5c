"""Write numbers for people: about four digits, no exponent where none is needed, never "-0.000"."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from typing import SupportsFloat, SupportsIndex

Number = SupportsFloat | SupportsIndex | None

DIGITS = 4
NO_VALUE = "-"  # for None and nan
PLAIN_FROM, PLAIN_BELOW = 1e-3, 1e7  # magnitudes that are written without an exponent
GROUPED_FROM = 10_000  # 1034, but 10 340
NEGLIGIBLE = 1e-12  # smaller magnitudes are rounding and are written as 0


def quantity(value: Number, unit: str = "", digits: int = DIGITS) -> str:
    """Write a number with its unit: `quantity(10337.2, "N")` is "10 340 N".

    Parameters
    ----------
    value
        A number of type int is exact, any other is rounded; None and nan become "-".
    unit
        Is written after the number; default: no unit.
    digits
        How many significant digits a rounded number has at most; trailing zeros are left out.
    """
    if value is None or math.isnan(value):
        return NO_VALUE
    text = _whole(value) if isinstance(value, int) else _rounded(float(value), digits)
    return f"{text} {unit}" if unit else text


def quantity_row(values: Iterable[Number], unit: str = "", digits: int = DIGITS) -> str:
    """Write numbers separated by commas, and their unit once: "1, 2.5, 10 340 N"; `digits` as in `quantity`."""
    text = ", ".join(quantity(value, digits=digits) for value in values)
    return f"{text} {unit}" if unit and text else text


def quantity_range(values: Iterable[Number], unit: str = "", digits: int = DIGITS) -> str:
    """Write the smallest and the largest of some numbers: "2 to 30 N", or one number where both read the same.

    Nan and None are left out; without any number the text is "-". `digits` as in `quantity`.
    """
    known = [value for value in values if value is not None and not math.isnan(value)]
    if not known:
        return NO_VALUE
    low, high = (quantity(end, digits=digits) for end in (min(known, key=float), max(known, key=float)))
    text = low if low == high else f"{low} to {high}"
    return f"{text} {unit}" if unit else text


def column(values: Iterable[Number], digits: int = DIGITS) -> list[str]:
    """Write the numbers of a table's column with equally many decimals, of which the largest number needs `digits`."""
    cells = list(values)
    known = [abs(float(value)) for value in cells if value is not None and math.isfinite(value)]
    largest = max(known, default=0.0)
    if largest >= PLAIN_BELOW or largest < PLAIN_FROM:
        return [quantity(value, digits=digits) for value in cells]
    decimals = max(0, digits - 1 - math.floor(math.log10(largest)))
    return [
        quantity(value) if value is None or not math.isfinite(value) else _decimals(float(value), decimals)
        for value in cells
    ]


def _rounded(value: float, digits: int) -> str:
    if math.isinf(value):
        return f"{value}"
    if abs(value) < NEGLIGIBLE:
        return "0"
    rounded = float(f"{value:.{digits - 1}e}")
    size = abs(rounded)
    if size < PLAIN_FROM or size >= PLAIN_BELOW:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        mantissa = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
        return f"{mantissa}e{int(exponent)}"
    text = _decimals(rounded, max(0, digits - 1 - math.floor(math.log10(size))))
    return text.rstrip("0").rstrip(".") if "." in text else text


def _decimals(value: float, count: int) -> str:
    """Write a number with so many decimals; zero has no sign."""
    value = round(value, count) + 0.0
    return f"{value:,.{count}f}".replace(",", " ") if abs(value) >= GROUPED_FROM else f"{value:.{count}f}"


def _whole(value: int) -> str:
    return f"{value:,}".replace(",", " ") if abs(value) >= GROUPED_FROM else str(value)


def in_columns(rows: Sequence[Sequence[str]], right: Collection[int]) -> list[str]:
    """Return rows as lines of a table, its columns as wide as they need, those of the indices `right` flush right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell.rjust(width) if k in right else cell.ljust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]
