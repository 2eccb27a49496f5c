"""`Displayed`: what a terminal or a notebook shows of a result: a headline, its facts and one small picture."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from html import escape
from textwrap import wrap
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from .inputs import printable
from .text import quantity, quantity_row, unbroken

Fact = tuple[str, str]  # its name, and the fact with its unit
Curve = tuple[ArrayLike, ArrayLike, str]  # (n,) and (n,), broken at nan, and its colour

LINES, WIDTH = 5, 110  # of text
ROWS = 20  # of a table
SHORT = 60  # letters of a field
FEW = 8  # numbers that are written out
POINTS = 400  # of a curve

BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#888888"
SIZE, LEFT, BELOW, ABOVE = (480, 210), 56, 34, 8  # of a picture, and its margins [px]


class Displayed:
    """The base of results: `repr` has at most five lines, and a notebook shows a table and a picture.

    Both show `_headline` and `_facts`: unless a result has its own, the name of its class and its fields.
    """

    __slots__: ClassVar[tuple[str, ...]] = ()  # with no annotation, the site takes it for a field

    def __init_subclass__(cls, **options: Any) -> None:
        """Give each class a `__repr__` of its own, which `dataclass` then keeps."""
        super().__init_subclass__(**options)
        cls.__repr__ = cls.__repr__

    def _headline(self) -> str:
        return type(self).__name__

    def _facts(self) -> Iterable[Fact]:
        return _fields(self)

    def _picture(self) -> str:
        """Return a picture as SVG, from `picture`; empty for none."""
        return ""

    def __repr__(self) -> str:
        return _text(*_shown(self))

    def _repr_html_(self) -> str:
        headline, facts = _shown(self)
        rows = "".join(
            f'<tr><th style="text-align: left">{escape(name)}</th><td style="text-align: left">{cell}</td></tr>'
            for name, cell in ((name, unbroken(escape(fact))) for name, fact in facts[:ROWS])
        )
        return f"<p><strong>{escape(headline)}</strong></p><table>{rows}</table>{_or_without(self._picture, '')}"


def record(self: Any) -> str:
    """Return the fields of a named tuple in at most five lines: its `__repr__`, as it can have no other base."""
    return _text(type(self).__name__, _fields(self))


def _shown(result: Displayed) -> tuple[str, list[Fact]]:
    headline = _or_without(result._headline, type(result).__name__)
    return headline, _or_without(lambda: list(result._facts()), [])


def _or_without(show: Callable[[], Any], without: Any) -> Any:
    """Return what a function returns, or less: a result that cannot be computed, or is half made, is displayed too."""
    try:
        return show()
    except Exception:
        return without


def _text(headline: str, facts: Iterable[Fact]) -> str:
    lines = wrap("; ".join(f"{name}: {fact}" for name, fact in facts), WIDTH, initial_indent="  ",
                 subsequent_indent="  ", max_lines=LINES - 1, placeholder=" ...")  # fmt: skip
    return "\n".join([printable(headline, WIDTH), *lines])


def _fields(value: Any) -> list[Fact]:
    """Return the public fields of a dataclass, a named tuple or any other object, each in a few words."""
    if is_dataclass(value):
        names: Iterable[str] = [field.name for field in fields(value) if field.repr]
    else:
        names = getattr(value, "_fields", None) or vars(value)
    return [(name, brief(getattr(value, name))) for name in names if not name.startswith("_")]


def brief(value: Any) -> str:
    """Return a field in a few words."""
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, float | int | np.floating | np.integer):
        return quantity(value.item() if isinstance(value, np.number) else value)
    if isinstance(value, np.ndarray):
        if value.ndim == 1 and value.size <= FEW and value.dtype.kind in "fiu":
            return f"({quantity_row(value.tolist())})"
        return f"array of {' x '.join(map(str, value.shape))}" if value.ndim else str(value)
    if isinstance(value, Displayed):
        return printable(value._headline(), SHORT)
    if isinstance(value, str):
        return printable(value, SHORT)
    if isinstance(value, Sequence | Mapping | set | frozenset):
        if not value:
            return "none"
        if isinstance(value, tuple | list) and len(value) <= FEW and all(isinstance(one, float | int) for one in value):
            return f"({quantity_row(value)})"
        if isinstance(value, tuple | list) and len(value) <= FEW and all(isinstance(one, str) for one in value):
            return printable(", ".join(value), SHORT)
        return f"{quantity(len(value))} entries"
    return "none" if value is None else type(value).__name__


def tensions_over_time(times: np.ndarray, tensions: np.ndarray, t_min: np.ndarray, t_max: np.ndarray) -> str:
    """Return a picture of tensions (n, m) [N] over times (n,) [s], with those limits (m,) [N] that are near them."""
    known = tensions[np.isfinite(tensions)]
    far = 0.5 * float(np.ptp(known)) if known.size else np.inf
    limits = [
        limit
        for limit in np.unique(np.concatenate([t_min, t_max]))
        if known.size and known.min() - far <= limit <= known.max() + far
    ]
    curves: list[Curve] = [([times[0], times[-1]], [limit, limit], GREY) for limit in limits]
    return picture([*curves, *((times, one, BLUE) for one in tensions.T)], "time [s]", "tensions [N]")


def picture(curves: Iterable[Curve], x: str = "", y: str = "", equal: bool = False) -> str:
    """Return curves as an SVG picture without fonts, files or identifiers of its own; empty if there are no numbers.

    - `x`, `y`: labels of the axes; without, none is drawn.
    - `equal`: whether both axes have the same scale.
    """
    drawn = [(np.asarray(a, dtype=float), np.asarray(b, dtype=float), colour) for a, b, colour in curves]
    points = np.concatenate([np.empty((2, 0)), *(np.stack([a, b]) for a, b, _ in drawn)], axis=1)
    points = points[:, np.isfinite(points).all(axis=0)]
    if not points.size:
        return ""
    (width, height), low, high = SIZE, points.min(axis=1), points.max(axis=1)
    size = np.array([width - LEFT - ABOVE, height - BELOW - ABOVE])
    extent = np.where(high > low, high - low, np.maximum(abs(high), 1.0))
    scale = size / extent
    if equal:
        scale = np.full(2, scale.min())
    corner = np.array([LEFT, height - BELOW]) + [1, -1] * (size - scale * (high - low)) / 2  # of low

    def line(a: np.ndarray, b: np.ndarray) -> str:
        rows = np.arange(len(a))
        if len(a) > POINTS:  # with the extremes
            some = np.linspace(0, len(a) - 1, POINTS).astype(int)
            peaks = [np.nanargmin(b), np.nanargmax(b)] if np.isfinite(b).any() else []
            rows = np.unique(np.concatenate([some, np.array(peaks, dtype=int)]))
        path, pen = [], "M"
        for across, up in (np.stack([a, b], axis=1)[rows] - low) * scale * [1, -1] + corner:
            if np.isfinite(across + up):
                path.append(f"{pen}{across:.1f} {up:.1f}")
            pen = "L" if np.isfinite(across + up) else "M"
        return "".join(path)

    paths = "".join(f'<path d="{line(a, b)}" stroke="{colour}" fill="none"/>' for a, b, colour in drawn)
    words = ""
    if x and y:
        right, base = width - ABOVE, height - BELOW
        words = "".join(
            f'<text x="{at[0]:.0f}" y="{at[1]:.0f}" text-anchor="{anchor}">{escape(text)}</text>'
            for text, at, anchor in (
                (quantity(low[0], digits=3), (LEFT, base + 14), "middle"),
                (quantity(high[0], digits=3), (right, base + 14), "end"),
                (x, ((LEFT + right) / 2, base + 26), "middle"),
                (quantity(low[1], digits=3), (LEFT - 4, base), "end"),
                (quantity(high[1], digits=3), (LEFT - 4, ABOVE + 8), "end"),
            )
        )
        middle = (ABOVE + base) / 2
        words += f'<text transform="translate(12 {middle:.0f}) rotate(-90)" text-anchor="middle">{escape(y)}</text>'
        words += f'<path d="M{LEFT} {ABOVE}V{base}H{right}" stroke="{GREY}" fill="none"/>'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" style="max-width: {width}px" '
        f'font-size="11" font-family="sans-serif" fill="currentColor">{words}{paths}</svg>'
    )
