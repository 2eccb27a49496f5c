"""Crafted files of every kind that a command reads: one line that says what is wrong, soon, and without much memory.

    python -m tests.soak files [--start 0] [--count 1000] [--only netcdf,...]

A file is sound, damaged (bytes changed, cut, doubled) or made to hurt: arrays that are declared larger than any memory,
external storage, virtual datasets, entities that grow, hundreds of thousands of wrong items, words for numbers. A
command reads it in a process of its own. Wrong is another exit code than 0, 1 or 2, a traceback or more than one line
on standard error with code 2, more than 5 s of processor time, or more than 200 MB besides what the commands import.

What a sound plan or simulation takes is not the reader's: those kinds are read by commands that do little else.
"""

from __future__ import annotations

import contextlib
import io
import os
import random
import shlex
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np
from typer.testing import CliRunner

from towline import Dynamics, load, plan
from towline.cli.entry import main
from towline.cli.main import app

SECONDS, MEMORY = 5.0, 200e6
ROBOT = "wang-flying"
REST = {"name": "rest", "path": {"kind": "rest", "pose": [0, 0, -1]}, "duration": 0.3, "output_rate": 50}
NUMBERS = (
    "nan",
    "inf",
    "-1",
    "1e999",
    "1e300",
    "''",
    "x",
    "9" * 5000,
    "0x1F",
    "1,5",
    "\x00",
    "é",
    "[1]",
    "{a: 1}",
    "null",
)


class Kind(NamedTuple):
    """What a file is called, the command that reads it, and how a sound one and one that hurts are made."""

    file: str
    command: str
    sound: Callable[[random.Random], bytes]
    hurting: Sequence[Callable[[random.Random], bytes]]


def soak(start: int, count: int, parts: Sequence[str]) -> bool:
    """Read `count` files from seed `start` on, print what is wrong, and return whether nothing is."""
    codes, wrong, slowest, largest = Counter[str](), 0, 0.0, 0.0
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        plan(ROBOT, REST).save("rest.nc")
        Path("caspr").mkdir()
        for name, text in BESIDE.items():
            Path(name).write_text(text)
        for kind in (KINDS[name] for name in parts):  # what the commands import is not counted
            Path(kind.file).write_bytes(kind.sound(random.Random(0)))
            CliRunner().invoke(app, shlex.split(kind.command))
        for number in range(start, start + count):
            name = parts[number % len(parts)]
            answer = _read(KINDS[name], number)
            codes[f"{name}: {answer.code}"] += 1
            slowest, largest = max(slowest, answer.seconds), max(largest, answer.memory)
            if reason := _reason(answer):
                wrong += 1
                print(f"{number} {name}: {reason}\n{answer.text[:500]}", flush=True)
    print(f"{count} files, {wrong} wrong; at most {slowest:.1f} s and {largest / 1e6:.0f} MB")
    print("\n".join(f"{code}: {number}" for code, number in sorted(codes.items())))
    return not wrong


class Answer(NamedTuple):
    """The exit code, what was printed on standard error, processor time [s] and memory beyond the start's [bytes]."""

    code: int
    text: str
    seconds: float
    memory: float


def _reason(answer: Answer) -> str:
    lines = answer.text.strip().splitlines()
    if answer.code not in (0, 1, 2):
        return f"code {answer.code}"
    if "Traceback" in answer.text or (answer.code == 2 and len(lines) != 1):
        return f"{len(lines)} lines"
    if answer.seconds > SECONDS:
        return f"{answer.seconds:.1f} s"
    return f"{answer.memory / 1e6:.0f} MB" if answer.memory > MEMORY else ""


def _read(kind: Kind, number: int) -> Answer:
    """Make the file of a number, and read it in a child process."""
    rng = random.Random(number)
    Path(kind.file).write_bytes(_crafted(kind, rng))
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(read)
        _run(shlex.split(kind.command), write)
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        held, text = int(pipe.readline()), pipe.read().decode(errors="replace")
    _, status, used = os.wait4(child, 0)
    Path(kind.file).unlink()
    return Answer(
        os.waitstatus_to_exitcode(status), text, used.ru_utime + used.ru_stime, (used.ru_maxrss - held) * 1024.0
    )


def _run(arguments: list[str], write: int) -> None:
    """Run a command and end this process with its code.

    The memory that the process holds before [KiB], a line, and what the command prints on standard error go to `write`.
    """
    import resource  # Windows has neither this nor fork

    os.write(write, b"%d\n" % resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    os.dup2(write, 2)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w")  # a test has put others there
    resource.setrlimit(resource.RLIMIT_CPU, (60, 60))
    sys.argv = ["towline", *arguments]
    code = 3
    try:
        main()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    finally:
        sys.stderr.flush()
        os._exit(code)


def _crafted(kind: Kind, rng: random.Random) -> bytes:
    choice = rng.random()
    if choice < 0.4 and kind.hurting:
        return rng.choice(kind.hurting)(rng)
    data = kind.sound(rng)
    return data if choice > 0.95 else rng.choice((_flipped, _cut, _doubled, _renumbered))(data, rng)


def _flipped(data: bytes, rng: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.randint(1, 30)):
        changed[rng.randrange(len(changed))] = rng.randrange(256)
    return bytes(changed)


def _cut(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data))]


def _doubled(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + data[rng.randrange(len(data)) :] + data[at:]


def _renumbered(data: bytes, rng: random.Random) -> bytes:
    """Replace a digit by something that is no number, or none of use."""
    digits = [i for i, byte in enumerate(data) if 48 <= byte <= 57]
    at = rng.choice(digits) if digits else 0
    return data[:at] + rng.choice(NUMBERS).encode() + data[at + 1 :]


# ---- NetCDF and HDF5


def _hdf5(fill: Callable[[h5py.File], object]) -> bytes:
    memory = io.BytesIO()
    with h5py.File(memory, "w") as file:
        file.create_dataset("time", data=np.linspace(0.0, 1.0, 11))
        fill(file)
    return memory.getvalue()


def _bomb(rng: random.Random) -> bytes:
    shape = (10 ** rng.randint(7, 12), rng.choice((1, 6)))
    options = {"chunks": (1024, shape[1]), "compression": "gzip"} if rng.random() < 0.5 else {}
    return _hdf5(lambda file: file.create_dataset(rng.choice(("pose", "lengths", "time2")), shape, "f8", **options))


def _external(rng: random.Random) -> bytes:
    target = rng.choice(("/etc/passwd", "/dev/zero", "rest.nc", "missing"))
    return _hdf5(lambda file: file.create_dataset("pose", (11, 6), "f8", external=[(target, 0, 11 * 6 * 8)]))


def _virtual(rng: random.Random) -> bytes:
    layout = h5py.VirtualLayout((11, 6), "f8")
    layout[:] = h5py.VirtualSource(rng.choice(("rest.nc", "/dev/zero", ".")), rng.choice(("pose", "time")), (11, 6))
    return _hdf5(lambda file: file.create_virtual_dataset("pose", layout))


def _linked(rng: random.Random) -> bytes:
    link = rng.choice((h5py.ExternalLink("rest.nc", "pose"), h5py.SoftLink("/pose"), h5py.SoftLink("/nothing")))
    return _hdf5(lambda file: file.__setitem__("pose", link))


def _typed(rng: random.Random) -> bytes:
    kind = rng.choice(("S10", "c16", "i1", "O", "f2", [("a", "f8"), ("b", "i4")]))
    text = h5py.string_dtype() if kind == "O" else kind
    return _hdf5(lambda file: file.create_dataset("pose", (11, 6), text))


def _plan(_: random.Random) -> bytes:
    return Path("rest.nc").read_bytes()


# ---- text


def _log(rng: random.Random) -> bytes:
    dynamics = Dynamics(load(ROBOT))
    poses = load(ROBOT).home + np.array([[rng.uniform(-0.2, 0.2) for _ in range(6)] for _ in range(20)])
    rows = np.hstack([poses, dynamics.cable_lengths(poses)])
    poses_of = [f"{name} [m]" for name in "xyz"] + [f"{name} [rad]" for name in ("roll", "pitch", "yaw")]
    names = [*poses_of, *(f"l{i} [m]" for i in range(rows.shape[1] - 6))]
    return "\n".join([",".join(names), *(",".join(f"{x:.6f}" for x in row) for row in rows)]).encode()


def _repeated(line: str, end: str = "\n") -> Callable[[random.Random], bytes]:
    return lambda rng: (rng.choice(("", line[:3])) + (line + end) * (10 ** rng.randint(4, 6))).encode()


def _log_of(value: str) -> Callable[[random.Random], bytes]:
    def made(rng: random.Random) -> bytes:
        head, row, *_ = _log(rng).decode().split("\n")
        bad = ",".join([value] * (row.count(",") + 1))
        return "\n".join([head, *[bad] * 10 ** rng.randint(2, 5)]).encode()

    return made


def _task(_: random.Random) -> bytes:
    return b"name: rest\npath: {kind: rest, pose: [0, 0, -1]}\nduration: 0.3\n"


def _items(key: str) -> Callable[[random.Random], bytes]:
    return lambda rng: (f"{key}: [" + "x, " * 10 ** rng.randint(3, 5) + "x]\n").encode()


def _anchors(rng: random.Random) -> bytes:
    """Return YAML whose anchors refer to each other, ten times a level."""
    depth = rng.randint(3, 12)
    lines = ["a0: &a0 [1, 2, 3]", *(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, depth))]
    return "\n".join(lines).encode()


def _deep(open_: str, close: str) -> Callable[[random.Random], bytes]:
    return lambda rng: (open_ * (size := 10 ** rng.randint(2, 5)) + close * size).encode()


def _robot(_: random.Random) -> bytes:
    from towline.models.parsing import to_yaml

    return to_yaml(load(ROBOT)).encode()


def _gcode(rng: random.Random) -> bytes:
    moves = (f"G1 X{rng.uniform(-200, 200):.2f} Y{rng.uniform(-200, 200):.2f} F600" for _ in range(5))
    return "\n".join(["G21", "G90", "G0 X0 Y0 Z-1000", *moves]).encode()


def _stl(rng: random.Random) -> bytes:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    faces = np.zeros(4, [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
    faces["corners"] = corners[[[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]] * rng.uniform(0.05, 0.3) + 3.0
    return b"\0" * 80 + np.uint32(4).tobytes() + faces.tobytes()


def _stl_declared(rng: random.Random) -> bytes:
    data = _stl(rng)
    return data[:80] + np.uint32(rng.choice((0, 3, 5, 2**31, 2**32 - 1))).tobytes() + data[84:]


def _stl_large(rng: random.Random) -> bytes:
    count = rng.choice((10_000, 100_000, 400_000))
    faces = np.zeros(count, [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
    faces["corners"] = np.random.default_rng(rng.randrange(2**32)).normal(size=(count, 3, 3)) + 50
    if rng.random() < 0.3:
        faces["corners"][rng.randrange(count)] = np.nan
    return b"\0" * 80 + np.uint32(count).tobytes() + faces.tobytes()


def _xml(_: random.Random) -> bytes:
    return (
        b'<?xml version="1.0"?><bodies_system><links display_range="-1 1 -1 1 -1 1"><link_rigid num="1" name="a">'
        b'<joint type="SPATIAL_EULER_XYZ" q_initial="0 0 0 0 0 0"/><physical><mass>1</mass><com_location>0 0 0'
        b'</com_location><inertia ref="com"><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz><Ixy>0</Ixy><Ixz>0</Ixz><Iyz>0</Iyz>'
        b"</inertia><end_location>0 0 0</end_location></physical><parent><num>0</num><location>0 0 0</location>"
        b"</parent></link_rigid></links></bodies_system>"
    )


def _laughs(rng: random.Random) -> bytes:
    depth = rng.randint(2, 12)
    entities = "".join(f'<!ENTITY e{i} "{f"&e{i - 1};" * 10 if i else "ha"}">' for i in range(depth))
    return f"<!DOCTYPE b [{entities}]><bodies_system>&e{depth - 1};</bodies_system>".encode()


def _secret(_: random.Random) -> bytes:
    return b'<!DOCTYPE b [<!ENTITY x SYSTEM "file:///etc/passwd">]><bodies_system>&x;</bodies_system>'


HDF5 = (_bomb, _external, _virtual, _linked, _typed)
BESIDE = {  # files that commands read beside the crafted one
    "gcode.yaml": "name: part\npath: {kind: waypoints, points: points.gcode}\nduration: 60\n",
    "mesh.yaml": """\
name: past
path: {kind: rest, pose: [0, 0, -1]}
duration: 0.3
limits: {keep_out: [{kind: mesh, name: part, file: part.stl, scale: 1}]}
""",
    "caspr/a_cables.xml": '<cables default_cable_set="a"><cable_set id="a"/></cables>',
}
KINDS = {
    "netcdf": Kind("motion.nc", f"simulate {ROBOT} motion.nc --duration 0.05", _plan, HDF5),
    "view": Kind("shown.nc", "view shown.nc --html page.html", _plan, HDF5),
    "log": Kind(
        "log.csv",
        f"calibrate {ROBOT} log.csv",
        _log,
        (
            _log_of("nan"),
            _log_of("x"),
            _log_of("1e300"),
            _log_of(""),
            _repeated(",,,,"),
            _repeated("1,2"),
            _repeated('"'),
        ),
    ),
    "log in netcdf": Kind("log.nc", f"calibrate {ROBOT} log.nc", _plan, HDF5),
    "task": Kind(
        "task.yaml",
        f"plan {ROBOT} task.yaml --out plan.nc",
        _task,
        (
            _items("path"),
            _items("obstacles"),
            _items("x"),
            _anchors,
            _deep("[", "]"),
            _deep("{a: ", "}"),
            _repeated("- x"),
        ),
    ),
    "robot": Kind(
        "robot.yaml",
        "robots robot.yaml",
        _robot,
        (_items("cables"), _items("carriers"), _anchors, _deep("[", "]"), _repeated("name: x")),
    ),
    "gcode": Kind(
        "points.gcode",
        f"plan {ROBOT} gcode.yaml --out plan.nc",
        _gcode,
        (_repeated("G1 X"), _repeated("G1 X1 Y1 Z-1000"), _repeated("("), _repeated("G2 X1 I1")),
    ),
    "stl": Kind(
        "part.stl", f"plan {ROBOT} mesh.yaml --out plan.nc", _stl, (_stl_declared, _stl_large, _repeated("solid"))
    ),
    "xml": Kind(
        "caspr/a_bodies.xml", "import caspr caspr --out r.yaml", _xml, (_laughs, _secret, _deep("<a>", "</a>"))
    ),
}
