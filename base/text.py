"""Write numbers for people: about four digits, a prefix of the unit instead of an exponent, never "-0.000"."""

import math
import re
from collections.abc import Collection, Iterable, Sequence
from typing import SupportsFloat, SupportsIndex

Number = SupportsFloat | SupportsIndex | None

DIGITS = 4
NO_VALUE = "-"  # for None and nan
PLAIN_FROM, PLAIN_BELOW = 1e-3, 1e7  # magnitudes that are written without an exponent
GROUPED_FROM = 10_000  # 1034, but 10 340
NEGLIGIBLE = 1e-12  # smaller magnitudes are rounding and are written as 0
SMALL_DIGITS = 2  # of a number below PLAIN_FROM in its unit: "0.52 uN"
PREFIXES = ("n", "u", "m", "", "k", "M", "G")  # in steps of a thousand
PREFIXED = ("N", "m", "s", "rad", "g", "W", "Hz", "Pa")  # symbols that take a prefix
OTHERS = {"m^2": ("mm^2", 1e6), "m^3": ("cm^3", 1e6)}  # what a small value is written in, and how many make one
UNITS = rf"[{''.join(PREFIXES)}c]?(?:{'|'.join(PREFIXED)})|degrees?"
INSIDE = re.compile(  # "10 340 N m", "95 %", "t = 1.5 s"
    rf"(?<=\d) (?=(?:{UNITS}|\d{{3}})\b|%)|(?:(?<=\bN)|(?<=\bkg)) (?=m\b)|(?<=\b[a-z]) (?== )|(?<=\b[a-z] =) (?=\S)"
)


def quantity(value: Number, unit: str = "", digits: int = DIGITS) -> str:
    """Write a number with its unit: `quantity(10337.2, "N")` is "10 340 N", `quantity(5.2e-7, "N")` is "0.52 uN".

    - `value`: a number of type int is exact, any other is rounded; None and nan become "-".
    - `unit`: written after the number, with another prefix if the number is very small or very large (default: no
      unit).
    - `digits`: largest number of significant digits of a rounded number; trailing zeros are left out.
    """
    if value is None or math.isnan(value):
        return NO_VALUE
    if isinstance(value, int):
        whole = f"{value:,}".replace(",", " ") if abs(value) >= GROUPED_FROM else str(value)
        return f"{whole} {unit}".rstrip()
    scale, unit, digits = _scaled(abs(float(value)), unit, digits)
    return f"{_rounded(scale * float(value), digits)} {unit}".rstrip()


def at_most(value: float, unit: str, resolution: float) -> str:
    """Write the largest value of an error: "at most 2.5 mm", or "under 0.01 mm" below the resolution."""
    if value < resolution:
        return f"under {quantity(resolution, unit)}"
    return f"at most {quantity(value, unit, digits=3)}"


def quantity_row(values: Iterable[Number], unit: str = "", digits: int = DIGITS) -> str:
    """Write numbers separated by commas, and their unit once: "1, 2.5, 10 340 N"; `digits` as in `quantity`."""
    cells = list(values)
    scale, unit, digits = _scaled(_largest(cells), unit, digits)
    text = ", ".join(_cell(value, scale, unit, digits) for value in cells)
    return f"{text} {unit}" if unit and text else text


def quantity_range(values: Iterable[Number], unit: str = "", digits: int = DIGITS) -> str:
    """Write the smallest and the largest of some numbers: "2 to 30 N", or one number where both read the same.

    Nan and None are left out; without any number the text is "-". `digits` as in `quantity`.
    """
    known = [value for value in values if value is not None and not math.isnan(value)]
    if not known:
        return NO_VALUE
    scale, unit, digits = _scaled(_largest(known), unit, digits)
    low, high = (_cell(end, scale, unit, digits) for end in (min(known, key=float), max(known, key=float)))
    text = low if low == high else f"{low} to {high}"
    return f"{text} {unit}" if unit else text


def counted(count: int, noun: str) -> str:
    """Write how many things there are: "1 cable", "3 cables"."""
    return f"{count} {noun}{'s' * int(count != 1)}"


def numbered(noun: str, indices: Iterable[int]) -> str:
    """Write which things are meant, by their numbers from 1: "cable 3", "cables 1, 2"."""
    numbers = [str(index + 1) for index in indices]
    return f"{noun}{'s' * (len(numbers) > 1)} {', '.join(numbers)}"


def any_of(names: Iterable[str]) -> str:
    """Write of which things one is meant: "cables[1]", "one of cables[1], cables[2]"; empty for none."""
    listed = list(names)
    return "one of " * (len(listed) > 1) + ", ".join(listed)


def unbroken(text: str) -> str:
    """Return text in which no line breaks between a number and its unit, by no-break spaces, as pages need it."""
    return INSIDE.sub("\u00a0", text)


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


def _scaled(size: float, unit: str, digits: int) -> tuple[float, str, int]:
    """Return the factor, the unit and the digits with which a number of this size is written without an exponent."""
    if not unit or PLAIN_FROM <= float(f"{size:.{digits - 1}e}") < PLAIN_BELOW or size == 0 or math.isinf(size):
        return 1.0, unit, digits
    if size < PLAIN_FROM:
        digits = min(digits, SMALL_DIGITS)
    if unit in OTHERS:
        smaller, factor = OTHERS[unit]
        return (factor, smaller, digits) if size < PLAIN_FROM else (1.0, unit, digits)
    first = re.match(r"[A-Za-z]+(?!\^|[A-Za-z])", unit)
    symbol = next((one for one in PREFIXED if first and first[0] in [prefix + one for prefix in PREFIXES]), None)
    if first is None or symbol is None:
        return 1.0, unit, digits
    own = PREFIXES.index(first[0].removesuffix(symbol))
    below = 0.1 if size < PLAIN_FROM else 1.0
    steps = [step for step in range(len(PREFIXES)) if size * 1000.0 ** (own - step) >= below]
    step = max(steps, default=0)
    scale = 1000.0 ** (own - step) if steps else 0.0  # less than a tenth of a nano-unit is 0
    return scale, (PREFIXES[step] if steps else PREFIXES[own]) + symbol + unit[first.end() :], digits


def _largest(values: Iterable[Number]) -> float:
    return max((abs(float(value)) for value in values if value is not None and math.isfinite(value)), default=0.0)


def _cell(value: Number, scale: float, unit: str, digits: int) -> str:
    """Write a number of a row; beside larger ones with the same unit a very small one needs no exponent."""
    if isinstance(value, int) or value is None or not math.isfinite(value):
        return quantity(value, digits=digits)
    scaled = scale * float(value)
    if unit and abs(scaled) < PLAIN_FROM:
        return _decimals(scaled, 6).rstrip("0").rstrip(".")
    return _rounded(scaled, digits)


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


def in_columns(rows: Sequence[Sequence[str]], right: Collection[int]) -> list[str]:
    """Return rows as lines of a table, its columns as wide as they need, columns of the indices `right` flush right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell.rjust(width) if k in right else cell.ljust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]
