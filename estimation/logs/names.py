"""The usual names of what robots record: `role` of a field, and the units of each role."""

import re
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np

from ...base.csv_columns import ANGLES, LENGTHS, TIMES

# Load cells that were calibrated with weights report kilograms or grams.
FORCES = {"N": 1.0, "kN": 1e3, "mN": 1e-3, "kgf": 9.80665, "kg": 9.80665, "gf": 9.80665e-3, "g": 9.80665e-3}
FORCES["lbf"] = 4.4482216152605
NUMBERS = {"1": 1.0, "-": 1.0}
# Units in which turns of a drum are counted; the scale of its encoder is in metres per unit of the reading.
COUNTS = dict.fromkeys(("rev", "turns", "counts", "ticks"), 1.0)
UNITS = {
    "lengths": {**LENGTHS, **ANGLES, **COUNTS},
    "tensions": FORCES,
    "efforts": FORCES,
    "position": LENGTHS,
    "angles": ANGLES,
    "quaternion": NUMBERS,
    "time": TIMES,
    "thrusts": FORCES,
    "thrust_vectors": FORCES,
    "commands": {**LENGTHS, **FORCES},
    "directions": NUMBERS,
    "azimuths": ANGLES,
}
_BEFORE = r"(?:.*[./_ ])?"
_AFTER = r"(?:[./_ ](?:length|len|position|pos|data|value))*"
_NUMBER = r"[./_ ]?[\[(]?(\d+)[\])]?"
_OF = r"(?:(?:cable|rope|wire|winch|tether|tendon|line|string)[_ ]?)?"
_BODY = r"(?:payload|load|platform|plat|(?:end[_ ]?)?effector|ee|tcp|mp|mocap|vicon|opti(?:track)?|marker|prism"
_BODY += r"|laser|cart|(?:rigid[_ ]?)?body[_ ]?\d*|rb\d*|object|pose|state(?:_?estimate)?"
_BODY += r"|(?:vehicle[_ ]?)?local(?:[_ ]?position)?)"
_DIRECTION = r"(?:dir(?:ection)?s?|(?:unit[_ ]?)?vec(?:tor)?s?|unit)"
_CABLE = r"(?:cable|rope|wire|tether|winch|c)s?[_ ./]?\[?(?:cable )?(\d+)\]?"
_DRUM = r"(?:cable|rope|wire|tether|winch(?:e?s)?|motor|axis|ax|drive|drum|encoder|enc|joint|actuator|[cmw])s?"
_WINCH = rf"{_DRUM}[./_ ]?\[?(\d+)\]?[./_ ]"
# Names of readings of the sensor of a drum's motor.
TURNED = r"(?:act(?:ual)?)?(?:positions?|pos|angles?|theta|counts?|ticks?|incr(?:ements?)?)"
_SENSOR = r"(?:load[_ ]?cell|lc|cable|rope|wire|winch|tension|force[_ ]?sensor|ft)"
_NO_LENGTH = re.compile(r"tension|force|effort|speed|veloc|vel_|accel|current|torque|thrust|temp|status|error")
_SENSED = r"(?:[./_ ](?:data|value|estimated?|est|measured?|total|norm(?:ali[sz]ed)?|cmd|command|setpoint|body|xyz))*"
_VECTOR = r"(?:[./_ ](?:vector|data|value|wrench|force))*[./_ ]?\[?([xyz])\]?"
# The groups are what tells the fields of a role apart: the cable's number or name, the axis, or both.
PATTERNS = {
    "lengths": (
        rf"{_BEFORE}{_OF}(?:l|ell|rho|len|lengths?|cables?|ropes?|wires?|tethers?|tendons?|lines?|strings?|winch(?:es)?"
        rf"|drums?|reels?|spools?|payout|encoders?|enc){_NUMBER}{_AFTER}",
        rf"{_BEFORE}{_OF}lengths?[./_ ](?:data|values?|position)[\[.](\d+)\]?",
        rf"{_BEFORE}{_WINCH}(?:[a-z]+[./_ ])?(?:cable|rope|wire)?[_ ]?(?:len|lengths?)(?:[./_ ](?:data|value))*",
        r"field\.position(\d+)",  # of a JointState that `rostopic echo -p` wrote
        # Also of winch_1_joint.
        r"(?!.*(?:mocap|vicon|optitrack|qualisys)).*/position\[[^\]]*?(\d+)(?:[_ ][^\]0-9]+)?\]",
        r".*/joints\[[^\]]*?(\d+)\]\.position",
        rf"{_BEFORE}{_WINCH}(?:[a-z]+[./_ ])*{TURNED}",
        rf"{_BEFORE}(?:{_DRUM}[_ ]?{TURNED}|angles?|theta){_NUMBER}",
    ),
    "tensions": (
        rf"{_BEFORE}{_OF}(?:tens(?:ions?)?|(?:tension|load)[_ ]?cells?|forces?|lc|f|t){_NUMBER}"
        r"(?:[./_ ](?:data|value))*",
        rf"{_BEFORE}{_OF}(?:tensions?|forces?)[./_ ](?:data|values?|effort)\[(\d+)\]",
        rf".*{_WINCH}(?:[a-z]+[./_ ])?(?:tension|force)(?:[./_ ](?:data|value))*",
        rf"{_BEFORE}(?:tensions?|forces?)[./_ ](?:cable|rope|wire|winch)[_ ]?(\d+)",
        rf".*{_SENSOR}[_ ]?(\d+)[./_ ](?:.*[./_ ])?(?:force[./_ ]|f)z",  # of a WrenchStamped
    ),
    "position": (
        rf"{_BEFORE}(?:position|translation|pos|point)[./_ ]?([xyz])",
        r"/?[pt]?[_ ]?([xyz])",
        r".*/t([xyz])",
        rf"{_BEFORE}{_BODY}(?:[./_ ]state)?[./_ ]?(?:pos(?:ition)?[./_ ]?)?[pt]?([xyz])",
        rf"{_BEFORE}(?:position|pos|p)\[(\d)\]",  # of PX4, unless there are more than three
        rf"{_BEFORE}{_BODY}[./_ ]?pos(?:ition)?[_ ]?(\d)",  # PlatformPosition_1
        # PN, PE, PD, as in logs of ArduPilot
        rf"{_BEFORE}(?:(?:pos[_ ]?|p)(?=[nedu]$)|(?=north|east|down|up|height))"
        r"((?:north|east)(?:ing)?|down|up|height|[nedu])",
    ),
    "thrusts": (
        rf"{_BEFORE}(?:collective[_ ]?)?(?:thrusts?|throttle|thr|tho){_SENSED}[_ ]?(\d*){_SENSED}",
        rf"{_BEFORE}thrusts?{_SENSED}\[(\d*)\]",
    ),
    "thrust_vectors": (rf"{_BEFORE}thrusts?{_SENSED}{_VECTOR}",),
    "directions": (
        rf"{_BEFORE}{_OF}(?:{_DIRECTION}|q)[_ ./]?\[?(\d+)\]?{_VECTOR}",
        rf"{_BEFORE}{_CABLE}[_ ./](?:{_DIRECTION}|q){_VECTOR}",
        rf"{_BEFORE}{_DIRECTION}[_ ]{_CABLE}{_VECTOR}",
        rf"{_BEFORE}(?:(?:cable|rope|wire|tether)[_ ]?)?{_DIRECTION}(){_VECTOR}",  # of the only cable of a carrier
    ),
    "quaternion": (
        rf"{_BEFORE}(?:ori(?:entation)?|rot(?:ation)?|quaternion|quat|q|o)[./_ ]?([xyzw])",
        r"(?:.*/)?r([xyzw])",
        rf"{_BEFORE}q(?:uat)?_?\[?([0-3])\]?",  # w, x, y, z, as in logs of PX4
    ),
    "angles": (
        rf"{_BEFORE}(roll|pitch|yaw|heading|phi|theta|psi)",
        r"(?:.*/)?r([xyz])",  # with a unit
        rf"{_BEFORE}(?:tcp|ee|(?:end[_ ]?)?effector|pose)[./_ ]([abc])",  # about x, y, z, of machine tools (ISO 841)
        rf"{_BEFORE}(?:euler|rot|ang(?:les?)?|rpy)[./_ ]?(?:ang(?:les?)?[./_ ]?)?\[?([xyz012])\]?",
    ),
    "efforts": (r"/?cables[./]joints\[[^\]]*?(\d+)\]\.effort",),  # tensions in what towline writes
    "azimuths": (
        r".*(?:cable|rope|wire|tether|winch)[_ ]?(\d+)[./_ ](azimuth|elevation|swivel)",
        rf"{_BEFORE}{_OF}(?:dir(?:ection)?[_ ])?(azimuth|elevation|swivel)[_ ]?\[?(\d*)\]?",
    ),
    "time": (
        r"(?:.*/)?[%_]*(t|ts|tout|(?:ros|sim|log|recv|rec|unix|host|hw|sys|sample|date)?[_ ]?times?"
        r"|time_?us(?:ec)?|time_?boot|secs?|seconds)",
        rf"[%_]*({_BEFORE}(?:rosbag)?(?:time[_ ]?)?stamp)",
        r"(epoch|elapsed(?:[_ ]time)?|(?:sys(?:tem)?[_ ]?)?(?:ticks?|clock|uptime))",
        rf"{_BEFORE}((?:milli|micro|nano)s(?:ec(?:ond)?s?)?)",  # since an Arduino was switched on
        "([mun]s(?:ec)?)",
    ),
}
# Corners and letters instead of numbers: Length A, len_FL, front_left_length, position[winch_rear_right].
_CORNER = r"((?:(?:front|rear|back|left|right|upper|lower|top|bottom|north|south|east|west)[_ ]?)+|[a-hlr]"
_CORNER += r"|(?:[fbr][lr]|[lr][fbr]|[tu][lr]|(?!set)[ns][ew])[tbul]?)"
_HELD = r"(?:cable|rope|wire|winch|tether|drum)"
LETTERS = "abcdefgh"
LETTERED: dict[str, tuple[str, ...]] = {
    which: (rf"{_BEFORE}{_OF}{word}[_ ]{_CORNER}", rf"(?:.*/)?{_CORNER}[_ ](?:{_HELD}[_ ])?{word}")
    for which, word in (("lengths", "(?:len|lengths?)"), ("tensions", "(?:tens(?:ions?)?|forces?)"))
}
LETTERED["lengths"] += rf".*/position\[{_HELD}[_ ]{_CORNER}\]", rf".*/position\[{_CORNER}[_ ]{_HELD}\]"
DATES = 1e9, 4e9  # [s] from 1970, of recordings: 2001 to 2096
LEAST_COUNTED, SLOWEST = 100.0, 0.5  # step of times that are no seconds; time between samples [s]
MANY, LONG = 500, 3600.0  # samples, and [s] that so many would take, of a recording in milliseconds
# Names of commanded quantities: cmd_l0, length_0_ref, /winch_commands/position[0].
_COMMAND = re.compile(
    r"[./_ ]?(?:cmd|commands?|commanded|desired|setpoints?|targets?|refs?|references?"
    r"|(?<![a-z])(?:des|sp|goals?|set(?=_?pos|[./_ ]|\d|$)))(?=[./_ \[]|\d|$|pos)"
)
# Names of measured quantities in tables that have others too: x_gt, l1_meas, actual_length_1.
_MEASURED = re.compile(
    r"[./_ ]?(?<![a-z])(?:meas(?:ured)?|act(?:ual)?|fb|feedback|gt|ground[_ ]?truth|true"
    r"|mocap|vicon|optitrack|imu|ahrs)(?![a-z])"
)
_WORDS = {unit: unit.lower() for unit in ("cm", "ms", "us", "ns", "s", *FORCES)}  # of units
_SECONDS = "s(?:ec(?:ond)?s?)?"
_WORDS |= {unit: f"(?:{word}){_SECONDS}" for unit, word in (("ms", "m|milli"), ("us", "u|micro"), ("ns", "n|nano"))}
_WORDS["s"] = _SECONDS
_WORDS |= {"cm": "cm|centimet(?:er|re)s?", "in": "in|inch(?:es)?"}
_WORDS |= {"deg": "deg|degrees?|°", "rad": "rad|radians?", "m": "m|met(?:er|re)s?", "mm": "mm|millimet(?:er|re)s?"}
_SUFFIX = re.compile(rf"(.+?)\s*(?:[_ ]|\()({'|'.join(_WORDS.values())})\)?")


ANGLE_OF: dict[str, str] = dict(zip("xyz012abc", 3 * ("roll", "pitch", "yaw"), strict=True))
ANGLE_OF |= {"phi": "roll", "theta": "pitch", "psi": "yaw", "heading": "yaw"}


# Names of PLCs begin with a type (fbAxis, arLength, stPose.rX), vectors of Simulink count from 1 (Quat(4)), some names
# are German.
_TYPE = re.compile(r"(?<![A-Za-z])(?:a?(?:fb|st|lr|[finr])|[ag])(?=[A-Z][a-z])")
_TYPE_OF_AXIS = re.compile(r"(?<=[.\]])(?:lr|[fr])(?=[A-Z]$)")
_SEPARATOR = re.compile(r"(?<=[A-Za-z]):(?=\d)")  # lengths:1
_INDEX = re.compile(r"(?<![a-z])(q|quat(?:ernion)?|p|pos(?:ition)?|xyz|rpy|euler|angles?)\((\d+)\)")
_GERMAN = {"uhrzeit": "time", "zeit": "time", "stempel": "stamp", "winde": "winch", "seil": "cable", "kraft": "force"}
_GERMAN |= {"länge": "length", "laenge": "length", "plattform": "platform"}
_GERMAN |= {"winkel": "", "nick": "pitch", "gier": "yaw"}


class Role(NamedTuple):
    """Role of a field, which of its fields it is, the name with "#" in place of that, and a unit in the name.

    For a direction, the field is the number of the cable, empty if there is none, and the axis: "1 x".
    """

    role: str
    which: str
    group: str
    unit: str = ""


@lru_cache(maxsize=1024)  # each name of a recording is looked up for each role that fields may have
def role(name: str, stated: str = "") -> Role | None:
    """Return the role of a field, with its topic's name before it, or None if the name is not a usual one.

    `stated` is its unit, if there is one beside the name: `rx [deg]` is an angle, and `rx` is of a quaternion.
    """
    untyped, typed = _TYPE.subn("", name)
    untyped = _SEPARATOR.sub("_", _TYPE_OF_AXIS.sub("", untyped) if typed else untyped)
    low = _INDEX.sub(lambda found: f"{found[1]}[{int(found[2]) - 1}]", untyped.lower().lstrip(". "))
    for word, english in _GERMAN.items():
        low = low.replace(word, english)
    texts = [(low, "")]
    if found := _SUFFIX.fullmatch(low):
        texts.append((found[1], unit_of(found[2])))
    texts += [(bare, unit) for text, unit in texts if (bare := _MEASURED.sub("", text).lstrip("./_ ")) != text]
    usual = product(texts, PATTERNS.items())
    for (text, unit), (which, patterns) in (*usual, *product(reversed(texts), LETTERED.items())):
        if (which == "lengths" and _NO_LENGTH.search(text.rpartition("/")[2])) or (unit and unit not in UNITS[which]):
            continue
        for pattern in patterns:
            match = re.fullmatch(pattern, text)
            if match and not (which == "quaternion" and stated in ANGLES):
                return _role(which, match, unit, low)
    return None


def corner(name: str) -> str:
    """Return the corner in the name of a cable's field, such as fl of len_FL, empty if it has a number or a letter."""
    found = role(name)
    which = found.which if found and found.role in LETTERED else ""
    return "" if which.isdigit() or which in LETTERS else which


def unit_of(word: str) -> str:
    """Return the unit that a word means, such as s of "Seconds", or the word itself."""
    return next((unit for unit, words in _WORDS.items() if re.fullmatch(words, word.lower())), word)


def _role(which: str, match: re.Match[str], unit: str, name: str) -> Role:
    """Return the role of a name from which a unit and words such as "measured" may be cut off for the match."""
    group = text = match.string
    for first, last in reversed(match.regs[1:]):
        group = f"{group[:first]}#{group[last:]}"
    if words := _MEASURED.search(name):
        # x and x_gt are of different groups.
        group = name.replace(text, group, 1) if text in name else f"{group} {words[0]}"
    parts = sorted(match.groups(), key=lambda part: not (part.isdigit() or not part))
    if which == "quaternion" and parts[0].isdigit():
        parts = ["wxyz"[int(parts[0])]]
    if which == "angles":
        parts = [ANGLE_OF.get(parts[0], parts[0])]
    if which == "position":
        parts = [parts[0][0].replace("h", "u")]  # n of north, u of height
    if which == "time" and (short := re.search("([mun]|milli|micro|nano)s(ec(ond)?s?)?$", text)):
        unit = unit_of(short[0])
    return Role(which, " ".join(parts), group, unit)


def measured_name(name: str) -> str | None:
    """Return the name that the measured value of a commanded one has, or None if it is no command."""
    found, count = _COMMAND.subn("", name.lower())
    return found if count else None


def dated_unit(times: np.ndarray) -> str | None:
    """Return the unit, ms, us or ns, in which times (N,) count from 1970 to the date of a recording, or None."""
    largest = float(np.nanmax(np.abs(times), initial=0.0))
    return next((unit for unit in ("ms", "us", "ns") if DATES[0] <= largest * TIMES[unit] < DATES[1]), None)


def time_unit(times: np.ndarray) -> str:
    """Return the unit of times (N,) without one: by their size if they count from 1970, whole numbers by their steps.

    A recording has two samples per second or more: 1000 is a step of 1 kHz in us, not of 1 Hz in ms. Smaller steps are
    in seconds, unless the recording would be long: 500 samples in an hour or more are in milliseconds.
    """
    known = times[np.isfinite(times)]
    if (dated := dated_unit(known)) is not None:
        return dated
    step = float(np.median(np.diff(known))) if len(known) > 1 else 0.0
    if (known % 1).any() or (step < LEAST_COUNTED and (len(known) < MANY or np.ptp(known) < LONG)):
        return "s"
    return next((unit for unit in ("ms", "us") if step * TIMES[unit] <= SLOWEST), "ns")
