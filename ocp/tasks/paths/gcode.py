"""`read_gcode`: a list of points in G-code: moves G0 and G1, dwell G4, units G20 and G21, G90 and G91."""

import math
import re
from typing import Any

from ....base.errors import InputError
from ....base.inputs import printable, shown

UNITS = {20: 0.0254, 21: 0.001}  # [m]: inches, millimetres
MOVES = {0, 1}
KNOWN = "G0, G1, G4, G20, G21, G90, G91, M2, M30, and the words F, N, P, X, Y, Z"
COMMENT = re.compile(r"\([^()]*\)|;.*")
WORD = re.compile(r"\s*([A-Z])\s*([-+]?(?:\d+\.?\d*|\.\d+))")


def read_gcode(text: str, where: str) -> dict[str, Any]:
    """Return the fields of a path from G-code: level points, how long it dwells, and times if each move has a feed.

    The first move must name X, Y and Z: it is where the path begins. G4 P rests for P seconds. If all later moves are
    G1, each takes its length over the feed F, its mean speed; a G0 has no speed, and with one the task's duration
    counts.

    Raises
    ------
    InputError
        Naming `where` and the line.
    """
    reader = _Reader()
    for number, line in enumerate(text.splitlines(), 1):
        try:
            reader.read(line)
        except ValueError as error:
            raise InputError(f"{where}, line {number}: {error}") from None
    if len(reader.points) < 2:
        raise InputError(f"{where} must have two points or more, got {len(reader.points)}")
    fields: dict[str, Any] = {"points": [(*point, 0.0, 0.0, 0.0) for point in reader.points]}
    if any(reader.dwell):
        fields["dwell"] = reader.dwell
    if all(seconds is not None for seconds in reader.seconds):
        times = [0.0]
        for seconds, rest in zip(reader.seconds, reader.dwell, strict=False):
            times.append(times[-1] + (seconds or 0.0) + rest)
        fields["times"] = times
    return fields


class _Reader:
    """The state of a machine that reads G-code line by line."""

    def __init__(self):
        self.points: list[tuple[float, ...]] = []
        self.dwell: list[float] = []
        self.seconds: list[float | None] = []  # of the moves after the first
        self._unit: float | None = None
        self._relative, self._ended = False, False
        self._move: int | None = None
        self._feed: float | None = None

    def read(self, line: str) -> None:
        """Read one line.

        Raises
        ------
        ValueError
            With what it must be.
        """
        codes, words = _words(line)
        if self._ended and (codes or words):
            raise ValueError("nothing must follow the end of the program, M2 or M30")
        rest = 4.0 in codes
        for code in codes:
            if code in UNITS:
                self._unit = UNITS[int(code)]
            elif code in MOVES:
                self._move = int(code)
            elif code in (90, 91):
                self._relative = code == 91
            elif code in (-2, -30):
                self._ended = True
        if "F" in words:
            self._feed = self._length(words.pop("F")) / 60
            if not self._feed > 0:
                raise ValueError("the feed F must be more than 0")
        if rest:
            self._rest(words)
        elif "P" in words:
            raise ValueError("the word P must follow G4")
        elif words:
            self._go({axis: self._length(value) for axis, value in words.items()})

    def _length(self, value: float) -> float:
        if self._unit is None:
            raise ValueError("the unit must be given before, by G20 (inches) or G21 (millimetres)")
        return value * self._unit

    def _rest(self, words: dict[str, float]) -> None:
        if set(words) != {"P"} or words["P"] < 0:
            raise ValueError("G4 must have the word P, the seconds of rest, and no other")
        if not self.points:
            raise ValueError("G4 must follow a move")
        self.dwell[-1] += words["P"]

    def _go(self, axes: dict[str, float]) -> None:
        if self._move is None:
            raise ValueError("a move must begin with G0 or G1")
        if not self.points:
            if set(axes) != set("XYZ") or self._relative:
                raise ValueError("the first move must name X, Y and Z, by G90")
            point = tuple(axes[axis] for axis in "XYZ")
        else:
            last = self.points[-1]
            point = tuple(
                axes.get(axis, 0.0) + before if self._relative else axes.get(axis, before)
                for axis, before in zip("XYZ", last, strict=True)
            )
            if point == last:
                return
            if self._move == 1 and self._feed is None:
                raise ValueError("G1 must have a feed F, here or before")
            self.seconds.append(math.dist(last, point) / self._feed if self._move == 1 and self._feed else None)
        self.points.append(point)
        self.dwell.append(0.0)


def _words(line: str) -> tuple[list[float], dict[str, float]]:
    """Return the G codes of a line, M codes as negative numbers, and the values of its other words."""
    line = COMMENT.sub(" ", line).strip().upper()
    if line == "%":
        return [], {}
    codes: list[float] = []
    words: dict[str, float] = {}
    at = 0
    while at < len(line):
        match = WORD.match(line, at)
        if match is None:
            raise ValueError(f"must be {KNOWN}, got {shown(printable(line[at:].strip()))}")
        letter, value = match[1], float(match[2])
        known = (letter == "G" and value in {*MOVES, 4, *UNITS, 90, 91}) or (letter == "M" and value in (2, 30))
        if not known and letter not in "FNPXYZ":
            raise ValueError(f"must be {KNOWN}, got {match[0].strip()}")
        if letter in "GM":
            codes.append(value if letter == "G" else -value)
        elif letter in words:
            raise ValueError(f"the word {letter} must occur once, got it twice")
        elif letter != "N":
            words[letter] = value
        at = match.end()
    return codes, words
