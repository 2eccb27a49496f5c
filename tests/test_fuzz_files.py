"""Thousands of broken robot files: what comes out is a valid robot or one line that says what is wrong, and soon."""

import random
import re
import time

import numpy as np
import pytest

from towline.base.errors import InputError
from towline.models import Robot, load
from towline.models.caspr import read_caspr
from towline.models.diagnosis import diagnose
from towline.models.parsing import parse_yaml, to_yaml

from .caspr_xml import BODIES, CABLES, write

pytestmark = pytest.mark.filterwarnings("error")  # on a user's screen a warning is no better than a traceback

# Small files that between them have every key: the YAML reader takes most of the time.
ROBOTS = [
    """\
name: crane
source: a test
gravity: [0, 0, -9.81]
platform: {mass: 1.2, inertia: [1, 1, 1, 0, 0, 0], com: [0, 0, 0.1], home: [0, 0, 1, 0, 0, 0]}
carriers:
  - {name: f, kind: ground}
cables:
  - {carrier: f, anchor: [0, 0, 2], attachment: [0, 0.1, 0], t_min: 0, t_max: 10,
     pulley: {radius: 0.1, axis: [0, 0, 1]}}
""",
    """\
name: towed
source: a test
drive: fixed-length
platform: {mass: 1.2, dof: [x, y, z], aero: {air_density: 1.29, drag: 0.45, lift: 0.05, area: 0.16, form: printed}}
carriers:
  - {name: m, kind: mobile, home: [0, 0, 3, 0, 0, 0], reach: {min: [-1, -1, 2], max: [1, 1, 4]}, speed_max: 1,
     acceleration_max: 2}
cables:
  - {carrier: m, anchor: [0, 0, 0], attachment: [0, 0, 0], t_min: 1.0, t_max: 10, stiffness: 1e4, damping: 3,
     length: 2}
""",
    """\
name: flying
source: |
  a test
platform:
  mass: 2
  inertia: [0.1, 0.1, 0.1, 0, 0, 0]
carriers:
  - name: q
    kind: quadrotor
    mass: 1.5
    inertia: [0.02, 0.02, 0.04, 0, 0, 0]
    thrust_max: 40
    torque_max: [1, 1, 1]
    tilt_max: 0.5
  - {name: p, kind: prescribed}
cables:
  - {carrier: q, anchor: [0, 0, -0.1], attachment: [0.1, 0, 0], t_min: 0, t_max: 10}
""",
]
# fmt: off
VALUES = [
    "nan", ".nan", ".inf", "-.inf", "1e999", "-1e999", "1e308", "1e-320", "-0", "-0.0", "0", "1", "-1", "0.5", "1e4",
    "1.5e3", "0x1F", "0o17", "1_000", "12:30:45", "true", "false", "yes", "null", "~", "", "{}", "[]", "[1]", "{a: 1}",
    "''", "'1'", '"1e3"', "'nan'", "words", "x", "ground", "2001-01-01", "2001-99-99", "2001-01-01T00:00:00Z", "!!int",
    "!!float 1", "!!str 1", "!!bool x", "!!set {1, 2, 3}", "!!binary MQ==", "!!python/name:os.system", "!x 1", "&a",
    "*a", "&a [1, *a]", "<<: {a: 1}", "?", "-", "|", ">", "@", "`", "%", '"\\x00"', '"\\e[31m"', "\x1b", "\u2028",
    "\ufeff", "é", "😀", "[0, 0]", "[0, 0, 0]", "[0, 0, 0, 0, 0, 0]", "[.nan, 0, 0]", "[x, y, x]", "9" * 400,
    "9" * 5000, "1" + "0" * 30,
]
XML_VALUES = [
    "nan", "NaN", "Inf", "-Inf", "1e999", "1e308", "-0", "0", "1", "-1", "2", "0.5", "1,5", "1_0", "0x1F", "words",
    "com", "joint", "R_Z", "T_XYZ", "PLANAR_XZ", "", "0 0", "0 0 0", "1 2 3 4 5 6 7", "&amp;", "&lt;", "&boo;", "&#0;",
    "&#10;",
    "&#x1F600;", "<![CDATA[1]]>", "<!-- -->", "<x/>", "<?x y?>", "]]>", "١", "9" * 400, '" x="', "\x1b", "é" * 100,
    "<!DOCTYPE a [<!ENTITY b 'c'>]>",
]
# fmt: on
NUMBERS = re.compile(rb"-?\d+(\.\d+)?(e\d+)?")
SCALARS = re.compile(rb"(?<=[:,\[] )[^,\]}\n]+|(?<=\[)[^,\]\n]+")
WORDS = re.compile(rb"[A-Za-z_]+(?=:)")
XML_TEXTS = re.compile(rb"(?<=>)[^<>\s][^<>]*(?=<)|(?<==\")[^\"]*(?=\")")
XML_WORDS = re.compile(rb"(?<=[</ ])[A-Za-z_]+(?=[ =>/])")
IN_YAML = {"number": (NUMBERS, VALUES), "scalar": (SCALARS, VALUES)}
IN_XML = {"number": (NUMBERS, XML_VALUES), "text": (XML_TEXTS, XML_VALUES)}


def pick(rng, pattern, data):
    """The place of one of the pattern's matches."""
    found = [match.span() for match in pattern.finditer(data)]
    return rng.choice(found) if found else (0, 0)


def bytes_flipped(rng, data):
    changed = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        changed[rng.randrange(len(changed))] = rng.randrange(256)
    return bytes(changed)


def lines_moved(rng, data):
    lines = data.splitlines(keepends=True)
    at, to = rng.randrange(len(lines)), rng.randrange(len(lines))
    kind = rng.randrange(4)
    if kind == 0:
        del lines[at]
    elif kind == 1:
        lines.insert(to, lines[at])
    elif kind == 2:
        lines[at], lines[to] = lines[to], lines[at]
    else:
        lines[at] = rng.choice([b"", b" ", b"\t"]) + lines[at].lstrip(b" ")
    return b"".join(lines)


def piece_replaced(rng, data, pattern, values):
    start, end = pick(rng, pattern, data)
    return data[:start] + rng.choice(values).encode() + data[end:]


def word_changed(rng, data, pattern):
    start, end = pick(rng, pattern, data)
    other, stop = pick(rng, pattern, data)
    word = data[start:end]
    new = rng.choice([word[1:], word + word, word.upper(), data[other:stop], b"", b"kind", b"1", b"\xe9", b"a\tb"])
    return data[:start] + new + data[end:]


def cut(rng, data):
    start, end = sorted(rng.randrange(len(data)) for _ in range(2))
    return rng.choice([data[:start], data[start:], data[:start] + data[end:], data + data[start:end]])


def spelled_otherwise(rng, data):
    text = data.decode("utf-8", errors="replace")
    return rng.choice(
        [
            b"\xef\xbb\xbf" + data,
            data.replace(b"\n", b"\r\n"),
            data.replace(b"\n", b"\r"),
            data.replace(b"\n", "\u2028".encode()),
            text.encode("utf-16"),
            text.encode("utf-32"),
            data.replace(b"utf-8", rng.choice([b"utf-16", b"latin-1", b"utf-7", b"cp037", b"klingon", b""])),
            data + b"\x00",
            data.replace(b"  ", b"\t"),
        ]
    )


def yaml_special(rng, data):
    depth = rng.choice([10, 100, 3000])
    return rng.choice(
        [
            b"%YAML 1.1\n---\n" + data,
            b"%TAG ! tag:x,2000:\n---\n" + data,
            data + b"---\n" + data,
            data + b"...\n",
            b"--- !!map\n" + data,
            b"? [a, b]\n: 1\n" + data,
            b"? {a: b}\n: 1\n" + data,
            b"null: 1\n" + data,
            b"1: 1\n" + data,
            b'"a\\nb\\e[31m": 1\n' + data,
            b"<<: {name: x}\n" + data,
            b"a: &a [1]\nb: *a\n" + data,
            data.replace(b"mass: ", b"mass: " + b"[" * depth, 1),
            data.replace(b"source: a test", b"source: " + b"{a: " * depth + b"}" * depth),
            data.replace(b"\n", b"\n" + b" " * rng.randint(1, 3), 1),
            b"- " * depth + data,
            data.replace(b"[0, 0, ", rng.choice([b"[0, , ", b"[0 0, ", b"[[0, 0], "]), 1),
        ]
    )


def xml_special(rng, data):
    depth = rng.choice([10, 1000, 20_000])
    start, end = pick(rng, XML_TEXTS, data)
    return rng.choice(
        [
            re.sub(rb"<!DOCTYPE[^>]*>", b"<!DOCTYPE a [<!ENTITY b 'c'>]>", data),
            re.sub(rb"<!DOCTYPE[^>]*>", b"<!DOCTYPE a SYSTEM 'http://127.0.0.1:9/'>", data),
            re.sub(rb"<!DOCTYPE[^>]*>", b"", data),
            re.sub(rb"<\?xml[^>]*>", b"", data),
            data[:start] + b"<a>" * depth + b"</a>" * depth + data[end:],
            data[:start] + b"<!-- " + data[start:end] + b" -->" + data[end:],
            data[:start] + b"<![CDATA[" + data[start:end] + b"]]>" + data[end:],
            data.replace(b"<properties", b"<p:properties xmlns:p='x'", 1).replace(
                b"</properties", b"</p:properties", 1
            ),
            data.replace(b'="', b"='", 1),
            data.replace(b"<physical>", b"<physical> stray "),
            data.replace(b"</attachments>", b"</attachments>" + b"<diameter>1</diameter>", 1),
            data.replace(b"</attachment>", b"</attachment> and "),
        ]
    )


def mutate(rng, data, pieces, words, special):
    """Change a file a few times: its bytes, lines, words, or `pieces`, by name a pattern and what replaces a match."""
    plain = {
        "bytes": bytes_flipped,
        "lines": lines_moved,
        "cut": cut,
        "spelling": spelled_otherwise,
        "special": special,
    }
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        if not data:
            return data
        change = rng.choice(["bytes", "lines", *2 * list(pieces), "word", "cut", "spelling", "special"])
        if change in pieces:
            data = piece_replaced(rng, data, *pieces[change])
        elif change == "word":
            data = word_changed(rng, data, words)
        else:
            data = plain[change](rng, data)
    return data


def outcome(read, data):
    """What became of the file: the robot, or the line. Anything else fails, and says for which file."""
    start = time.process_time()
    try:
        result = read()
    except InputError as error:
        result = str(error)
    except Exception as error:
        pytest.fail(f"{error!r} for {data!r}")
    assert time.process_time() - start < 10, data
    return result


def check_robot(robot, data, thoroughly):
    assert isinstance(robot, Robot)
    for array in (robot.home, robot.home_anchors, robot.home_attachments, robot.inertia, robot.t_min, robot.t_max):
        assert np.isfinite(array).all(), data
    assert np.isfinite([robot.weight, robot.length]).all(), data
    assert Robot.model_validate(robot.model_dump(mode="json")) == robot, data
    if thoroughly:
        diagnose(robot)
        assert parse_yaml(to_yaml(robot), Robot, "again") == robot, data


def check_line(line, file, data):
    assert len(line.splitlines()) == 1, data
    assert line.isprintable(), data
    assert line.startswith(f"{file}"), data
    assert len(line) < 1000, data


# Chunks, so that the workers of a test run share them.
@pytest.mark.parametrize("seed", range(2))
def test_mutated_robot_files(seed, tmp_path):
    rng = random.Random(seed)
    file = tmp_path / "my.yaml"
    robots, lines = 0, set()
    for count in range(500):
        data = mutate(rng, rng.choice(ROBOTS).encode(), IN_YAML, WORDS, yaml_special)
        file.write_bytes(data)
        result = outcome(lambda: load(file), data)
        if isinstance(result, Robot):
            robots += 1
            check_robot(result, data, thoroughly=count % 10 == 0)
        else:
            lines.add(re.sub(r"[0-9]+", "0", result))
            check_line(result, file, data)
    # The mutants are neither all hopeless nor all harmless.
    assert robots > 25
    assert len(lines) > 100


@pytest.mark.parametrize("seed", range(4))
def test_mutated_caspr_files(seed, tmp_path):
    rng = random.Random(seed)
    robots, lines = 0, set()
    for count in range(300):
        which, text = rng.choice([("bodies", BODIES), ("cables", CABLES)])
        data = mutate(rng, text.encode(), IN_XML, XML_WORDS, xml_special)
        write(tmp_path, **{which: data})
        result = outcome(lambda: read_caspr(tmp_path).robot, data)
        if isinstance(result, Robot):
            robots += 1
            check_robot(result, data, thoroughly=count % 10 == 0)
        else:
            lines.add(re.sub(r"[0-9]+", "0", result))
            check_line(result, tmp_path, data)
    assert robots > 25
    assert len(lines) > 30


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("mass: 1.2", "mass: true", r"platform\.mass must be a number, got True"),
        ("mass: 1.2", "mass: 1e308", r"platform\.mass must be less than or equal to \d+, got 1e\+308"),
        ("mass: 1.2", "mass: !!int", r"is not YAML \(has a YAML tag \(.*int,?\), line 4\)"),
        ("[0, 0, 2]", "!!set {0.1, 0, 2}", r"is not YAML \(has a YAML tag \(.*set\), line 8\)"),
        ("source", '"a\\nb\\e[31m": 1\nsource', r"a b\\x1b\[31m is not a known key"),
        ("source", f"{'k' * 900}: 1\nsource", r"kkk.* is not a known key"),
        (
            "[0, 0.1, 0]",
            "[0, 0.1, 1]",
            r"cables\[0\]\.attachment must lie off the swivel axis and outside the sheave of its pulley at home, got",
        ),
        ("a test", "&a [*a]", r"is not YAML \(has a YAML alias \(\*name\), line 2\)"),
    ],
    ids=["truth", "overflow", "int", "set", "escape", "long", "sheave", "alias"],
)
def test_what_the_fuzz_found_once(old, new, message):
    assert old in ROBOTS[0]
    with pytest.raises(InputError, match=message) as caught:
        parse_yaml(ROBOTS[0].replace(old, new, 1), Robot, "my.yaml")
    check_line(str(caught.value), "my.yaml", new)
