"""`read_gcode`: a list of points in G-code: lines, arcs and dwells; what has no meaning for a path is listed."""

import math
import re
from typing import Any

from ....base.errors import InputError
from ....base.inputs import printable, shown

UNITS = {20: 0.0254, 21: 0.001}  # [m]: inches, millimetres
MOVES = {0, 1, 2, 3}
ARCS = {2: -1.0, 3: 1.0}  # their sense of rotation about z
IDLE = {17, 28, 40, 49, 54, 64, 80, 94}  # the XY plane, homing, and the usual state of a machine: listed
KNOWN = "G0 to G4, G20, G21, G90 to G92, M words, and the words E, F, I, J, N, P, R, S, T, X, Y, Z"
SAGITTA = 1e-5  # [m], between an arc and its chords
TURN = math.radians(5)  # of a chord, at most
SAME = 1e-3  # of the radius: by how much the ends of an arc may differ in their distance from its centre
COMMENT = re.compile(r"\([^()]*\)|;.*")
WORD = re.compile(r"\s*([A-Z])\s*([-+]?(?:\d+\.?\d*|\.\d+))")


def read_gcode(text: str, where: str) -> dict[str, Any]:
    """Return the fields of a path from G-code: level points, how long it dwells, feeds and times of its lines.

    The path begins where X, Y and Z are known first. Arcs become chords. G4 P rests for P seconds. Each line has the
    feed F, its mean speed; a G0 has none, for which the largest one of the file stands, and with one there are no
    times. Words of no meaning for a path (E, S, T, M, homing before the path) are listed as `ignored`.

    Raises `InputError` naming `where` and the line.
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
    known = [feed for feed in reader.feeds if feed is not None]
    if known:
        fields["feeds"] = [max(known) if feed is None else feed for feed in reader.feeds]
    if len(known) == len(reader.feeds):
        times = [0.0]
        for index, feed in enumerate(known):
            length = math.dist(reader.points[index], reader.points[index + 1])
            times.append(times[-1] + length / feed + reader.dwell[index])
        fields["times"] = times
    if reader.ignored:
        fields["ignored"] = sorted(reader.ignored)
    return fields


class _Reader:
    """The state of a machine that reads G-code line by line."""

    def __init__(self):
        self.points: list[tuple[float, ...]] = []
        self.dwell: list[float] = []
        self.feeds: list[float | None] = []  # of the lines between the points [m/s]
        self.ignored: set[str] = set()
        self._at: dict[str, float] = {}  # what is known of the position in the program's coordinates [m]
        self._moved: dict[str, float] = dict.fromkeys("XYZ", 0.0)  # of these coordinates by G92 [m]
        self._unit: float | None = None
        self._relative, self._ended, self._homed = False, False, False
        self._move: int | None = None
        self._feed: float | None = None

    def read(self, line: str) -> None:
        """Read one line.

        Raises `ValueError` with what it must be.
        """
        codes, words = self._words(line)
        if self._ended and (codes or words):
            raise ValueError("nothing must follow the end of the program, M2 or M30")
        for code in codes:
            if code in UNITS:
                self._unit = UNITS[int(code)]
            elif code in MOVES:
                self._move = int(code)
            elif code in (90, 91):
                self._relative = code == 91
            elif code in (-2, -30):
                self._ended = True
            elif code < 0 or code in IDLE:
                self.ignored.add(f"M{-code:g}" if code < 0 else f"G{code:g}")
        if any(code < 0 for code in codes) or 28 in codes:
            if 28 in codes:
                self._homed |= bool(self.points)
                self._at.clear()
            return  # their words are theirs
        self.ignored |= set(words) & set("EST") - ({"S"} if 4 in codes else set())
        words = {
            letter: value for letter, value in words.items() if letter not in "ET" and (letter != "S" or 4 in codes)
        }
        if "F" in words:
            self._feed = self._length(words.pop("F")) / 60
            if not self._feed > 0:
                raise ValueError("the feed F must be more than 0")
        if 4 in codes:
            self._rest(words)
        elif "P" in words:
            raise ValueError("the word P must follow G4")
        elif 92 in codes:
            for axis, value in words.items():
                if axis in self._at:
                    self._moved[axis] += self._at[axis] - self._length(value)
                self._at[axis] = self._length(value)
        elif words:
            self._go({letter: self._length(value) for letter, value in words.items()})

    def _length(self, value: float) -> float:
        if self._unit is None:
            raise ValueError("the unit must be given before, by G20 (inches) or G21 (millimetres)")
        return value * self._unit

    def _rest(self, words: dict[str, float]) -> None:
        if set(words) not in ({"P"}, {"S"}) or min(words.values()) < 0:
            raise ValueError("G4 must have the word P, the seconds of rest, and no other")
        if not self.points:
            raise ValueError("G4 must follow a move")
        self.dwell[-1] += sum(words.values())

    def _go(self, words: dict[str, float]) -> None:
        if self._move is None:
            raise ValueError("a move must begin with G0 or G1")
        if self._homed:
            raise ValueError("no move must follow G28 within a path, since homing ends somewhere else")
        start = dict(self._at)
        for axis in set(words) & set("XYZ"):
            if self._relative and axis not in self._at:
                raise ValueError("the first move must name X, Y and Z, by G90")
            self._at[axis] = words[axis] + (self._at[axis] if self._relative else 0.0)
        if len(self._at) < 3:
            return
        if not self.points:
            self._add(self._at)
            return
        if self._move in ARCS:
            for place in _chords(start, self._at, words, ARCS[self._move]):
                self._add(place)
            return
        if set(words) & set("IJR"):
            raise ValueError("the words I, J and R must follow G2 or G3")
        self._add(self._at)

    def _add(self, place: dict[str, float]) -> None:
        point = tuple(place[axis] + self._moved[axis] for axis in "XYZ")
        if self.points:
            if point == self.points[-1]:
                return
            if self._move != 0 and self._feed is None:
                raise ValueError(f"G{self._move} must have a feed F, here or before")
            self.feeds.append(None if self._move == 0 else self._feed)
        self.points.append(point)
        self.dwell.append(0.0)

    def _words(self, line: str) -> tuple[list[float], dict[str, float]]:
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
                if (codes and codes[-1] < 0) or 28 in codes:
                    break  # such as M117 and its text, or G28 X
                raise ValueError(f"must be {KNOWN}, got {shown(printable(line[at:].strip()))}")
            letter, value = match[1], float(match[2])
            if letter == "G" and value not in {*MOVES, *UNITS, *IDLE, 4, 90, 91, 92}:
                raise ValueError(f"must be {KNOWN}, got {match[0].strip()}")
            own = bool(codes) and codes[-1] < 0  # of an M code
            if letter in "GM":
                codes.append(value if letter == "G" else -value)
            elif not own and letter not in "EFIJNPRSTXYZ":
                raise ValueError(f"must be {KNOWN}, got {match[0].strip()}")
            elif not own and letter in words:
                raise ValueError(f"the word {letter} must occur once, got it twice")
            elif letter != "N":
                words[letter] = value
            at = match.end()
        return codes, words


def _chords(
    start: dict[str, float], end: dict[str, float], words: dict[str, float], sense: float
) -> list[dict[str, float]]:
    """Return the ends of the chords of an arc in the XY plane, a helix if Z changes.

    Its centre is at I and J from its start, or has the distance R from both ends; a negative R is the longer way.
    """
    x, y, dx, dy = start["X"], start["Y"], end["X"] - start["X"], end["Y"] - start["Y"]
    if "R" in words and not set(words) & set("IJ"):
        radius, chord = abs(words["R"]), math.hypot(dx, dy)
        if not 0 < chord <= 2 * radius * (1 + SAME):
            raise ValueError("R must be a radius that reaches from one end of the arc to the other")
        aside = math.sqrt(max(radius**2 - chord**2 / 4, 0.0)) / chord * sense * math.copysign(1.0, words["R"])
        i, j = dx / 2 - aside * dy, dy / 2 + aside * dx
    elif set(words) & set("IJ") and "R" not in words:
        i, j = words.get("I", 0.0), words.get("J", 0.0)
        radius = math.hypot(i, j)
        if not radius > 0 or abs(math.hypot(dx - i, dy - j) - radius) > SAME * radius:
            raise ValueError("I and J must lead to a centre with the same distance from both ends of the arc")
    else:
        raise ValueError("an arc must have I and J, or R")
    first, last = math.atan2(-j, -i), math.atan2(dy - j, dx - i)
    turn = sense * ((sense * (last - first)) % (2 * math.pi) or 2 * math.pi)
    step = min(TURN, 2 * math.acos(max(1 - SAGITTA / radius, -1.0)))
    count = max(math.ceil(abs(turn) / step), 1)
    places = []
    for k in range(1, count + 1):
        angle = first + turn * k / count
        place = {"X": x + i + radius * math.cos(angle), "Y": y + j + radius * math.sin(angle)}
        places.append(place | {"Z": start["Z"] + (end["Z"] - start["Z"]) * k / count})
    return [*places[:-1], dict(end)]
