"""`read_gcode`: a list of points in G-code: lines, arcs and dwells; what has no meaning for a path is listed."""

import math
import re
from typing import Any

from ....base.inputs import InputError, printable, shown

UNITS = {20: 0.0254, 21: 0.001}  # [m]: inches, millimetres
MOVES = {0, 1, 2, 3}
ARCS = {2: -1.0, 3: 1.0}  # their sense of rotation about the normal of the plane
PLANES = {17: "XYZ", 18: "ZXY", 19: "YZX"}  # the axes of the plane of arcs, and its normal
CENTRE = {"X": "I", "Y": "J", "Z": "K"}  # the words of an arc's centre
ELSEWHERE = {28, 29, 30, 32, 34, 53}  # homing, levelling, and machine coordinates: the position is unknown afterwards
OFFSETS = {54, 55, 56, 57, 58, 59, 59.1, 59.2, 59.3}  # of the program's coordinates
# Retraction, a tool's length, and the usual state of a machine: they change no path.
IDLE = {10, 11, 40, 43, 43.1, 49, 50, 61, 61.1, 64, 69, 80, 91.1, 94, 97, 98, 99}
KNOWN = "G0 to G4, G17 to G21, G90 to G92, M words, and the words E, F, I, J, K, N, P, R, S, T, X, Y, Z"
OF_MACHINES = 10  # M codes below, and M30, occur beside moves; those of printers' firmware have lines of their own
CALLS, ENDS = {97, 98}, {2, 30}
SAGITTA = 1e-5  # [m], between an arc and its chords
TURN = math.radians(5)  # of a chord, at most
SAME = 1e-3  # of the radius: by how much the ends of an arc may differ in their distance from its centre
COMMENT = re.compile(r"\([^()]*\)|;.*")
MARK = re.compile(r"\*\d+$|^%$|^O\d+$")  # a line's checksum, a program's ends and number
WORD = re.compile(r"\s*([A-Z])\s*([-+]?(?:\d+\.?\d*|\.\d+))")
COMMAND = re.compile(r"([A-Z]+_\w*|[A-Z]{2,}(?=\s+\w+=))(\s|$)")  # of firmware, with a name
HEAD = r"^\s*(N\s*\d+\s*)?"
EXTRUDES = re.compile(HEAD + r"(G\s*0*[01]\b[^;(\n]*E|M(82|83|104|109|140|190)\b)", re.MULTILINE | re.IGNORECASE)


def read_gcode(text: str, where: str) -> dict[str, Any]:
    """Return the fields of a path from G-code: level points, how long it dwells, feeds and times of its lines.

    The path begins where X, Y and Z are known first. Arcs become chords. Each line has the feed F, its mean speed; a G0
    has none, for which the largest one of the file stands, and with one there are no times. In a file that extrudes, as
    slicers write it, firmware decides: lengths are in millimetres unless it says otherwise, G0 is G1, and G4 P counts
    milliseconds instead of seconds. What has no meaning for a path (E, S, T, M, homing before it) is listed as
    `ignored`.

    Raises `InputError` naming `where` and the line.
    """
    reader = _Reader(extrudes=EXTRUDES.search(text) is not None)
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

    def __init__(self, extrudes: bool):
        self.points: list[tuple[float, ...]] = []
        self.dwell: list[float] = []
        self.feeds: list[float | None] = []  # of the lines between the points [m/s]
        self.ignored: set[str] = set()
        self._extrudes = extrudes
        self._at: dict[str, float] = {}  # what is known of the position in the program's coordinates [m]
        self._moved: dict[str, float] = dict.fromkeys("XYZ", 0.0)  # of these coordinates by G92 [m]
        self._unit: float | None = UNITS[21] if extrudes else None
        self._offset, self._plane = 54.0, PLANES[17]
        self._relative, self._ended = False, False
        self._elsewhere = ""  # the code after which the path cannot go on
        self._move: int | None = None
        self._feed: float | None = None

    def read(self, line: str) -> None:
        """Read one line.

        Raises `ValueError` with what it must be.
        """
        line = MARK.sub("", COMMENT.sub(" ", line.upper()).strip())
        if self._ended and line:
            raise ValueError("nothing must follow the end of the program, M2 or M30")
        if command := COMMAND.match(line):
            self.ignored.add(command[1])
            return
        codes, words = self._words(line)
        for code in codes:
            self._set(code)
        away = ELSEWHERE.intersection(codes)
        if away:
            self._elsewhere = f"G{away.pop():g}" if self.points else ""
            self._at.clear()
        elif 4 in codes:
            self._rest(words)
        elif 10 in codes and "L" in words:
            raise ValueError("G10 must be without L: offsets that a program changes are not read")
        elif 92 in codes:
            self._rename(self._lengths(words, "XYZ"))
        else:
            if {10, 64}.intersection(codes):
                words.pop("P", None)  # a tool, a tolerance
            self._go(words)

    def _set(self, code: float) -> None:
        """Change the state as a G code does."""
        if code in UNITS:
            self._unit = UNITS[int(code)]
        elif code in PLANES:
            self._plane = PLANES[int(code)]
        elif code in MOVES:
            self._move = int(code)
        elif code in (90, 91):
            self._relative = code == 91
        elif code in OFFSETS:
            if self.points and code != self._offset:
                raise ValueError(f"G{code:g} must not change the coordinates within a path")
            self._offset = code
        if code in {*OFFSETS, *IDLE, *ELSEWHERE, 17}:
            self.ignored.add(f"G{code:g}")

    def _lengths(self, words: dict[str, float], letters: str) -> dict[str, float]:
        """Return the words that are lengths, in metres."""
        if self._unit is None:
            raise ValueError("the unit must be given before, by G20 (inches) or G21 (millimetres)")
        return {letter: value * self._unit for letter, value in words.items() if letter in letters}

    def _rest(self, words: dict[str, float]) -> None:
        if not set(words) <= {"P", "S", "X"} or len(words) > 1 or min(words.values(), default=0) < 0:
            raise ValueError("G4 must have the word P, the seconds of rest, and no other")
        if self.points:
            self.dwell[-1] += sum(words.values()) * (1e-3 if self._extrudes and "P" in words else 1.0)
        elif not self._extrudes:
            raise ValueError("G4 must follow a move")

    def _rename(self, place: dict[str, float]) -> None:
        """Give the position other coordinates, where it is."""
        for axis, value in place.items():
            if axis in self._at:
                self._moved[axis] += self._at[axis] - value
            self._at[axis] = value

    def _go(self, words: dict[str, float]) -> None:
        """Read the words of a line that moves, or does nothing."""
        if "F" in words:
            self._feed = self._lengths(words, "F")["F"] / 60
            if not self._feed > 0:
                raise ValueError("the feed F must be more than 0")
        self.ignored |= set(words) & set("EHDLQST")
        if "P" in words:
            raise ValueError("the word P must follow G4")
        if not set(words) & set("IJKRXYZ"):
            return
        words = self._lengths(words, "IJKRXYZ")
        if self._move is None:
            raise ValueError("a move must begin with G0 or G1")
        if self._elsewhere:
            raise ValueError(f"no move must follow {self._elsewhere} within a path, since it ends somewhere else")
        start = dict(self._at)
        for axis in set(words) & set("XYZ"):
            if not self._relative:
                self._at[axis] = words[axis]
            elif axis in self._at:
                self._at[axis] += words[axis]
            elif not self._extrudes:  # whose start lifts the head before homing
                raise ValueError("the first move must name X, Y and Z, by G90")
        if len(self._at) < 3:
            return
        if not self.points:
            self._add(self._at)
        elif self._move in ARCS:
            for place in _chords(start, self._at, words, self._plane, ARCS[self._move]):
                self._add(place)
        elif set(words) & set("IJKR"):
            raise ValueError("the words I, J and R must follow G2 or G3")
        else:
            self._add(self._at)

    def _add(self, place: dict[str, float]) -> None:
        point = tuple(place[axis] + self._moved[axis] for axis in "XYZ")
        rapid = self._move == 0 and not self._extrudes
        if self.points:
            if point == self.points[-1]:
                return
            if not rapid and self._feed is None:
                raise ValueError(f"G{self._move} must have a feed F, here or before")
            self.feeds.append(None if rapid else self._feed)
        self.points.append(point)
        self.dwell.append(0.0)

    def _words(self, line: str) -> tuple[list[float], dict[str, float]]:
        """Return the G codes of a line, and the values of its other words except M codes."""
        codes: list[float] = []
        words: dict[str, float] = {}
        at = 0
        while at < len(line):
            match = WORD.match(line, at)
            if match is None and ELSEWHERE.intersection(codes):
                break  # such as G28 X
            if match is None:
                raise ValueError(f"must be {KNOWN}, got {shown(printable(line[at:].strip()))}")
            letter, value, at = match[1], float(match[2]), match.end()
            if letter == "G":
                if value not in {*MOVES, *UNITS, *PLANES, *ELSEWHERE, *OFFSETS, *IDLE, 4, 90, 91, 92}:
                    raise ValueError(f"must be {KNOWN}, got {match[0].strip()}")
                codes.append(value)
            elif letter == "M":
                if value in CALLS and WORD.match(line, at):
                    raise ValueError(f"M{value:g} must be left out: programs that are called are not read")
                self.ignored |= set() if value in ENDS else {f"M{value:g}"}
                self._ended |= value in ENDS
                if (self._extrudes or value >= OF_MACHINES) and value not in ENDS and not codes:
                    break  # its words are its own, or text as of M117
            elif letter not in "DEFHIJKLNPQRSTXYZ":
                raise ValueError(f"must be {KNOWN}, got {match[0].strip()}")
            elif letter in words:
                raise ValueError(f"the word {letter} must occur once, got it twice")
            elif letter != "N":
                words[letter] = value
        return codes, words


def _chords(
    start: dict[str, float], end: dict[str, float], words: dict[str, float], axes: str, sense: float
) -> list[dict[str, float]]:
    """Return the ends of the chords of an arc in the plane of the first two axes, a helix if the third changes.

    Its centre is given from its start (I, J, K), or has the distance R from both ends; a negative R is the longer way.
    """
    first_axis, second_axis, normal = axes
    x, y = start[first_axis], start[second_axis]
    dx, dy = end[first_axis] - x, end[second_axis] - y
    centre = [words.get(CENTRE[axis]) for axis in axes]
    if "R" in words and centre == [None] * 3:
        radius, chord = abs(words["R"]), math.hypot(dx, dy)
        if not 0 < chord <= 2 * radius * (1 + SAME):
            raise ValueError("R must be a radius that reaches from one end of the arc to the other")
        aside = math.sqrt(max(radius**2 - chord**2 / 4, 0.0)) / chord * sense * math.copysign(1.0, words["R"])
        i, j = dx / 2 - aside * dy, dy / 2 + aside * dx
    elif centre[:2] != [None] * 2 and centre[2] is None and "R" not in words:
        i, j = centre[0] or 0.0, centre[1] or 0.0
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
        place = {first_axis: x + i + radius * math.cos(angle), second_axis: y + j + radius * math.sin(angle)}
        places.append(place | {normal: start[normal] + (end[normal] - start[normal]) * k / count})
    return [*places[:-1], dict(end)]
