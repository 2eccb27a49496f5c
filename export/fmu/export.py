"""`export_fmu`: write a robot as a functional mock-up unit, with robot.c, its record of sources/unit.h at the start."""

import hashlib
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import textwrap
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...base.inputs import InputError, check_ending, file_path, one_of, printable
from ...base.version import __version__
from ...base.writing import check_writable, whole_file
from ...control.computed_torque import ComputedTorque
from ...control.controller import Reference, State
from ...control.fallback import CARRIED
from ...control.planned_references import references_at
from ...control.trajectory import read_trajectory
from ...core import MOST_CABLES
from ...models.files import AnyRobot, as_robot
from ...models.record import record_of
from ...models.robot import Robot
from ...plant import Plant
from ...plant.plant import DRIVES
from ...plant.reading import sensed
from ...plant.steps import ANGLE, default_drive, fastest_motion, winding_time
from .variables import PARTS, Variable, build_description, model_description, variables_of

_CORE = Path(__file__).parents[2] / "core"
_OWN = Path(__file__).parent / "sources"
# The parts of the core that a unit needs, and the folders of the headers that these include.
_COMPILED = (
    "plant/*.c",
    "distribution/*.c",
    *(f"control/{n}.c" for n in ("step", "heard", "compensation", "thrusts", "turning", "lateness")),
)
_HEADERS = ("*.h", *(f"{folder}/*.h" for folder in ("plant", "distribution", "control", "mechanics", "numbers")))
_DEFINITIONS = {"TOWLINE_CABLES": str(MOST_CABLES)}
_FLAGS = ("-std=c99", "-O3", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math", "-fvisibility=hidden")
_SYSTEMS = {"linux": ("linux", ".so"), "darwin": ("darwin", ".dylib"), "win32": ("windows", ".dll")}
_ABOUT = {"plant": "Plant", "controller": "Controller", "both": "Plant with its controller,"}
_MACHINES = {"amd64": "x86_64", "arm64": "aarch64"}
_TEMPLATE = Path(__file__).parent / "sources" / "robot.c.in"
_FLAT = ("inertia", "inverse_inertia")  # matrices that are one row in C
PERIOD = 1e-3  # [s], of `simulate`
LONGEST = 1e9  # [s]: what is as good as infinity


def export_fmu(
    robot: AnyRobot, file: str | os.PathLike[str], part: str = "plant", drive: str | None = None, reference: Any = None
) -> str | None:
    """Write a robot as a unit for co-simulation with FMI 3.0: its C sources, and the binary for this platform.

    Args:
        robot: A `Robot`, the name of one in the library, or the path of a robot file.
        file: File to write, with the ending .fmu.
        part: "plant" (`Plant`), "controller" (`ComputedTorque`), or "both" in a closed loop.
        drive: Type of the cable commands of the plant, see `Plant` (default: tensions, which the plant realises as in
            `simulate`, or constant lengths for robots that have these).
        reference: A plan, the NetCDF file of one, a path or a pose (6,), at the beginning of which a simulation starts
            (default: the robot's home).

    Returns:
        Platform of the binary, such as "x86_64-linux"; None without a C compiler, which is `cc` or what the environment
            variable CC names.

    Raises:
        InputError: If an argument is wrong, the file cannot be written, or the compiler fails.
    """
    loaded, path = as_robot(robot), check_ending("file", file_path("file", file), ".fmu")
    check_writable(path)
    contents = unit_files(loaded, part, drive, reference)
    identifier = _identifier(loaded)
    built = _binary(contents, identifier)
    with whole_file(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in (contents | ({} if built is None else built[1])).items():
            entry = zipfile.ZipInfo(name)  # of 1980: the same robot gives the same bytes
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            archive.writestr(entry, content)
    return None if built is None else built[0]


def unit_files(robot: Robot, part: str = "plant", drive: str | None = None, reference: Any = None) -> dict[str, bytes]:
    """Return the files of a unit without binaries, by their names; arguments and errors as in `export_fmu`."""
    one_of("part", part, PARTS)
    if drive is not None and part == "controller":
        raise InputError(f"drive must be left out for part 'controller', which has no plant, got {drive!r}")
    plant = Plant(robot, default_drive(robot) if drive is None else one_of("drive", drive, DRIVES))
    is_fixed = plant.drive == "lengths" and robot.fixed_lengths is not None
    by = {"lengths": 0 if is_fixed else 2, "forces": 3}.get(plant.drive, 1) if part == "both" or drive is None else 1
    if part == "both" and (
        plant.drive == "rates" or (by == 2 and not plant.record["cable"]["stiffness"][: robot.m].all())
    ):
        raise InputError(f"drive must accept commanded tensions for part 'both', got {plant.drive!r}")
    winches = plant.drive if part == "plant" and (drive is not None or is_fixed) else None
    trajectory = read_trajectory(robot, robot.home if reference is None else reference, None)
    if (load := trajectory.load_at(0.0)) is not None:
        raise InputError(
            f"reference must begin without a load, because exported units have none, got one of {load.mass:g} kg"
        )
    data = data_at(robot, plant, references_at(robot, trajectory, np.zeros(1))[0])
    variables = variables_of(robot, part, winches, data)
    data |= {"simulates": part != "controller", "controls": part != "plant"}
    data["cables"] = 0 if winches or is_fixed else by  # `unit_cables`
    sources = _core()
    sources |= {path.name: path.read_bytes() for path in sorted(_OWN.iterdir()) if path.suffix in (".c", ".h")}
    text = robot_c(data, variables, MOST_CABLES)
    token = hashlib.sha256(repr((robot.name, part, text, variables)).encode()).hexdigest()[:32]
    sources["robot.c"] = robot_c({"token": token} | data, variables, MOST_CABLES).encode()
    about = printable(f"{_ABOUT[part]} of the cable robot {robot.name}: {robot.source}", 1000)
    model = model_description(robot.name, _identifier(robot), token, about, PERIOD, variables)
    compiled = [name for name in sources if name.endswith(".c")]
    built = build_description(_identifier(robot), compiled, _DEFINITIONS)
    contents = {"modelDescription.xml": model, "sources/buildDescription.xml": built}
    return contents | {f"sources/{name}": content for name, content in sources.items()}


def _core() -> dict[str, bytes]:
    """Return the files of the core that a unit needs, by their names in it."""
    files = sorted({file for pattern in (*_COMPILED, *_HEADERS) for file in _CORE.glob(pattern)})
    return {file.relative_to(_CORE).as_posix(): file.read_bytes() for file in files}


def _identifier(robot: Robot) -> str:
    """Return the name of a robot as one in C."""
    name = re.sub(r"\W", "_", robot.name, flags=re.ASCII)
    return name if name[0].isalpha() else f"robot_{name}"


def _binary(contents: dict[str, bytes], identifier: str) -> tuple[str, dict[str, bytes]] | None:
    """Return the platform and the binary for it, by its name in the unit; None if there is no compiler."""
    command = shlex.split(os.environ.get("CC") or "cc")
    machine = _MACHINES.get(platform.machine().lower(), platform.machine().lower())
    if sys.platform not in _SYSTEMS or not command or shutil.which(command[0]) is None:
        return None
    system, ending = _SYSTEMS[sys.platform]
    with tempfile.TemporaryDirectory() as folder:
        sources, made = Path(folder, "sources"), Path(folder, f"{identifier}{ending}")
        for name, content in contents.items():
            Path(folder, name).parent.mkdir(parents=True, exist_ok=True)
            Path(folder, name).write_bytes(content)
        compiled = [str(file) for file in sorted(sources.rglob("*.c"))]
        defined = [f"-D{name}={value}" for name, value in _DEFINITIONS.items()]
        flags = [*_FLAGS, *defined, *shlex.split(os.environ.get("CFLAGS", "")), "-shared", "-fPIC", f"-I{sources}"]
        done = subprocess.run([*command, *flags, *compiled, "-lm", "-o", str(made)], capture_output=True, text=True)
        if done.returncode != 0:
            said = done.stderr.splitlines()
            reason = next((line for line in said if "error" in line), f"it ended with exit code {done.returncode}")
            raise InputError(f"CC must be a C compiler, got {printable(shlex.join(command))}: {printable(reason)}")
        return f"{machine}-{system}", {f"binaries/{machine}-{system}/{made.name}": made.read_bytes()}


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


class _Exported(ComputedTorque):
    """A controller whose settings can be read."""

    def data(self) -> dict[str, Any]:
        """Return the members of `towline_unit` that describe it."""
        low_high = self._boxes or [np.full((len(self.robot.carriers), 3), sign * np.inf) for sign in (-1, 1)]
        bandwidth = float(np.sqrt(self._settings["kp"][0]))
        return {
            "controller": self._settings,
            "bandwidth": bandwidth,
            "damping": float(self._settings["kd"][0]) / (2 * bandwidth),
            "integral": float(self._settings["ki"][0]),
            "length": self.robot.length,
            "negligible": self._negligible,
            "carried": CARRIED * self.robot.force_scale,
            "little": self._little,
            "box": np.stack(low_high),
            "platform": self._platform[0],
        }


def data_at(robot: Robot, plant: Plant, reference: Reference) -> dict[str, Any]:
    """Return the members of `towline_unit` at a reference, on which the robot is, with its tensions."""
    pulls = np.zeros(robot.m) if reference.tensions is None else np.maximum(reference.tensions, 0.0)
    motion = (reference.pose, reference.velocity, reference.carrier_pose, reference.carrier_velocity)
    fixed, fastest = plant.fixed_lengths(pulls), max(fastest_motion(plant))
    state = plant.start(*motion, tensions=pulls if fixed is None else None, lengths=fixed)
    motions, lengths = sensed(robot, state)
    carriers = np.stack(reference[3:6], axis=1)  # (c, 3, 6)
    given = np.vstack([np.concatenate(motion[:2]), np.concatenate(motion[2:], axis=1)])
    measured = np.where(np.isnan(motions), given, motions)  # at a pitch of 90 degrees
    controller = _Exported(robot)
    command = controller.step(0.0, State(*motion, pulls), reference)
    controller.reset()
    return {
        "robot": plant.record,
        "plant": plant.settings,
        "longest_step": ANGLE / fastest if fastest else PERIOD,
        "winding_time": min(winding_time(plant), LONGEST),
        "mass": robot.platform.mass,
        "state": state,
        "last": np.full(2 * robot.m, np.nan),
        "known": record_of(robot),
        "period": PERIOD,
        **controller.data(),
        "measured": measured.ravel(),
        "lengths": lengths.ravel(),
        "tension": pulls,
        "mean_tension": pulls,
        "reference": np.concatenate(reference[:3]),
        "carriers": carriers.ravel(),
        "jerks": np.zeros(carriers.size // 3),
        "t_ref": np.zeros(robot.m) if reference.tensions is None else reference.tensions,
        "ordered": np.stack(command[1:4], axis=1).ravel(),
        "ordered_jerks": np.zeros(carriers.size // 3),
        "tensions": command.tensions,
        "winches": {"lengths": plant.read(state).lengths if fixed is None else fixed, "rates": np.zeros(robot.m)}.get(
            plant.drive, command.tensions
        ),
        "actuation": np.zeros(0) if command.actuation is None else command.actuation.ravel(),
        "wind": np.zeros(3),
        "wrench": np.zeros(6),
    }
