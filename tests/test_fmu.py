"""The command `towline export --fmu`: units for co-simulation that do what towline does, in FMPy."""

import json
import re
import shutil
import subprocess
import zipfile
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings, strategies as st
from typer.testing import CliRunner

import towline
from towline import load, simulate
from towline.base.errors import InputError
from towline.cli.main import app
from towline.control.planned_references import references_at
from towline.control.trajectory import read_trajectory
from towline.core import sense
from towline.export.fmu.export import unit_files
from towline.models import Robot
from towline.plant import Plant
from towline.plant.steps import default_drive, steps_in, windings_in

from .c_programs import require
from .units import Unit, compiled_once, each, motion, written
from .warm import towline as run

pytest.importorskip("fmpy", reason="the extra fmu installs FMPy")

ROBOTS = ("cogiro", "wang-flying", "multi-quadrotor-4")  # ground, prescribed carrier, team of quadrotors
PARTS = ("plant", "controller", "both")
STEP = 1e-3
MOTION = ("pose", "velocity", "acceleration")


@pytest.fixture
def unit(tmp_path_factory):
    """Return a function that loads a unit."""

    def make(robot, part, drive=None, file=None):
        folder = tmp_path_factory.mktemp("unit")
        return Unit(file or written(tmp_path_factory, robot, part, drive), folder)

    return make


@pytest.mark.parametrize(
    ("robot", "part"), [*zip(ROBOTS, PARTS, strict=True), ("multi-quadrotor-4", "plant")]
)  # each robot, each part
def test_fmpy_finds_no_fault(robot, part, unit, tmp_path_factory):
    import fmpy
    from fmpy.validation import validate_fmu

    file = written(tmp_path_factory, robot, part)
    assert validate_fmu(str(file)) == []
    one = unit(robot, part)
    # The structured convention, which FMPy does not check: names with indices, joined by dots.
    for name, variable in one.variables.items():
        assert re.fullmatch(r"[a-z_]+(\[\d+\])?(\.[a-z_]+(\[\d+\])?)*", name), name
        assert variable.unit or name in ("answered", "controller.damping")
    header = Path(fmpy.__file__).parent / "c-code" / "fmi3Functions.h"
    functions = re.findall(r"^FMI3_Export \w+ +(fmi3\w+);", header.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(functions) == 75
    assert all(hasattr(one.slave.dll, name) for name in functions)


def names_of(robot, part):
    """Return the names of the inputs and outputs of a unit, from its description alone."""
    variables = ElementTree.fromstring(unit_files(robot, part)["modelDescription.xml"]).find("ModelVariables")
    of = {causality: {each.get("name") for each in variables if each.get("causality") == causality}
          for causality in ("input", "output")}  # fmt: skip
    assert all(of.values())
    return of


def test_the_parts_fit_together():
    """By their names: what the plant measures is what the controller needs, and back."""
    for robot in ROBOTS:
        plant, controller, both = (names_of(load(robot), part) for part in PARTS)
        assert {name for name in controller["input"] if not name.startswith("reference.")} <= plant["output"]
        orders = {name for name in plant["input"] if name.startswith("command.")}
        fixed = {name for name in orders if name.startswith("command.length")}  # constant: no controller commands them
        assert bool(fixed) == (load(robot).fixed_lengths is not None)
        assert orders - fixed <= controller["output"]
        assert both["output"] == plant["output"] | controller["output"]


def commands_of(robot, plant, values):
    """Return the commands of a step, and of its end if carriers have a jerk, from inputs by their names."""
    count, a = len(robot.carriers), max(len(carrier.actuators) for carrier in robot.carriers)
    carriers = np.zeros((count, 4, 6))
    carriers[:, 0] = robot.carrier_home
    for k, order in np.ndindex(count, 4):
        names = motion(f"command.carrier[{k + 1}]", (*MOTION, "jerk")[order])
        carriers[k, order] = [values.get(name, old) for name, old in zip(names, carriers[k, order], strict=True)]
    actuation = [
        [values.get(f"command.carrier[{k + 1}].actuation[{i + 1}]", 0.0) for i in range(a)] for k in range(count)
    ]
    others = {"actuation": actuation, "wrench": [values[name] for name in values if name.startswith("wrench.")]}
    if robot.platform.aero:
        others["wind"] = [values[f"wind.{axis}"] for axis in "xyz"]
    cables = [value for name, value in values.items() if re.match(r"command\.(tension|length)", name)]
    row = plant.command(cables, carrier_pose=carriers[:, 0], carrier_velocity=carriers[:, 1],
                        carrier_acceleration=carriers[:, 2], **others)  # fmt: skip
    pose, velocity, acceleration, jerk = np.moveaxis(carriers, 1, 0)
    if not jerk.any():
        return row, None
    end = pose + STEP * (velocity + 0.5 * STEP * acceleration) + STEP * STEP * STEP * jerk / 6
    moved = velocity + STEP * acceleration + 0.5 * STEP * STEP * jerk
    return row, plant.command(
        cables, carrier_pose=end, carrier_velocity=moved, carrier_acceleration=acceleration + STEP * jerk
    )


@pytest.mark.parametrize(("name", "drive"), [("cogiro", None), ("wang-flying", "lengths"), ("multi-quadrotor-4", None)])
def test_a_thousand_random_steps_are_those_of_the_plant(name, drive, unit):
    """With the same bits: from the state of the unit on, with random commands, wind and wrenches."""
    robot, random = load(name), np.random.default_rng(1)
    plant, one = Plant(robot, drive or default_drive(robot)), unit(name, "plant", drive)
    assert steps_in(STEP, plant) == 1
    pulls = references_at(robot, read_trajectory(robot, robot.home, None), np.zeros(1))[0].tensions
    fixed, inputs, m = robot.fixed_lengths, one.names("input"), robot.m
    dampings = {each.unit for name, each in one.variables.items() if name.endswith("].damping")}
    assert dampings == ({"N.s/m"} if drive else set())  # a force when multiplied by a velocity
    state = plant.start(tensions=pulls if fixed is None else None, lengths=fixed)
    outputs = motion("platform", "pose", "velocity") + each("cable[{}].length", m) + each("cable[{}].rate", m)
    at_start = np.array([float(one.variables[name].start) for name in inputs])
    sizes = np.array([2e-3 if "length" in name or ".pose" in name else 10.0 for name in inputs])
    motions, lengths = np.zeros((1, 1 + len(robot.carriers), 12)), np.zeros((1, 2, m))
    for k in range(1000):
        values = at_start + sizes * random.normal(size=len(inputs))
        if k % 2:
            values[[".jerk" in name for name in inputs]] = 0.0
        row, after = commands_of(robot, plant, dict(zip(inputs, values, strict=True)))
        one.set(inputs, values)
        one.step(k * STEP, STEP)
        state = plant.step(state, row, STEP, after)
        sense(plant.record, state[None], motions, lengths)
        assert np.array_equal(one.get(outputs), np.concatenate([motions[0, 0], lengths.ravel()])), k
    assert np.abs(motions[0, 0, :3] - robot.home[:3]).max() > 1e-3


def swing(robot, duration):
    """Return the samples of a motion from rest at home, by (1, -1/2, 0) t^3, of the platform and its carriers."""
    times, way = np.linspace(0.0, duration, 3), np.array([1.0, -0.5, 0.0, 0.0, 0.0, 0.0])
    moves = np.array([[carrier.moves] for carrier in robot.carriers])
    variables = {"time": ("time", times)}
    for order, values in zip(MOTION, (times**3, 3 * times**2, 6 * times), strict=True):
        moved = np.outer(values, way)
        home, homes = (robot.home, robot.carrier_home) if order == "pose" else (0.0, 0.0)
        variables[order] = (("time", "coordinate"), home + moved)
        variables[f"carrier_{order}"] = (("time", "carrier", "coordinate"), homes + moves * moved[:, None])
    return xr.Dataset(variables, attrs={"robot": f"name: {robot.name}"})


@pytest.mark.parametrize(("name", "step"), [*((name, STEP) for name in ROBOTS), ("wang-flying", 0.01)])
def test_plant_and_controller_make_the_loop_of_simulate(name, step, unit):
    """Coupled by names, and in one unit: the same motion to 1e-9 m, with the period of the controller as the step.

    In 10 ms the winches of wang-flying change their rates several times, while its carrier moves with a jerk.
    """
    robot, steps = load(name), round(0.5 / step)
    m, plan = robot.m, swing(robot, step * (steps + 10))
    air = (0.0, 0.0, 0.0) if robot.platform.aero else None  # still air is that of a unit
    run = simulate(robot, plan, duration=step * steps, wind=air, period=step)
    assert (windings_in(step, Plant(robot, default_drive(robot))) > 1) == (step > STEP)
    references = references_at(robot, read_trajectory(robot, plan, None), step * np.arange(steps + 1))
    plant, controller, both = (unit(name, part) for part in PARTS)
    both.set(["controller.period"], [step])
    sensors = [name for name in controller.names("input") if not name.startswith("reference.")]
    orders = [name for name in plant.names("input") if name in controller.names("output")]
    found = np.zeros((2, steps, 6))
    for k, (now, after) in enumerate(pairwise(references)):
        values = dict(zip(motion("reference", *MOTION), np.concatenate(now[:3]), strict=True))
        values |= dict(zip(each("reference.tension[{}]", m), now.tensions, strict=True))
        jerks = (after.carrier_acceleration - now.carrier_acceleration) / step
        for i, row in enumerate(np.stack([*now[3:6], jerks], axis=1)):
            names = motion(f"reference.carrier[{i + 1}]", *MOTION, "jerk")
            values |= dict(zip(names, row.ravel(), strict=True)) if robot.carriers[i].moves else {}
        found[:, k] = plant.get(motion("platform", "pose")), both.get(motion("platform", "pose"))
        controller.set(sensors, plant.get(sensors))
        for one in (controller, both):
            one.set(values, list(values.values()))
        controller.step(k * step, step)
        plant.set(orders, controller.get(orders))
        for one in (plant, both):
            one.step(k * step, step)
    assert np.ptp(run.record.motions[:, 0, 0]) > 0.03
    assert np.abs(found - run.record.motions[:, 0, :6]).max() < 1e-9


def test_motors_of_winches_are_driven_as_in_simulate(unit, tmp_path, tmp_path_factory):
    """Pushed by 3 N; the unit computes its motors' forces by the same code."""
    data = load("point-mass-3").model_dump()
    winch = {"inertia": 3.0, "friction": 5.0, "speed_max": 50, "force_max": 1e4}
    data["cables"] = [cable | {"stiffness": 2e5, "winch": winch} for cable in data["cables"]]
    robot = Robot.model_validate(data)
    with compiled_once(tmp_path_factory):
        towline.export_fmu(robot, tmp_path / "unit.fmu", "both")
    one = unit(robot, "both", file=tmp_path / "unit.fmu")
    one.set(["wrench.force.x"], [3.0])
    expected = simulate(robot, robot.home, duration=0.1, disturbance=[3, 0, 0, 0, 0, 0]).record.motions[:, 0, :6]
    for k, pose in enumerate(expected):
        np.testing.assert_allclose(one.get(motion("platform", "pose")), pose, atol=1e-12)
        one.step(k * STEP, STEP)
    assert expected[-1, 0] > 1e-4


def test_steps_may_be_longer_than_the_period_of_the_controller(unit):
    one, other = unit("wang-flying", "both"), unit("wang-flying", "both")
    for each_of in (one, other):
        each_of.set(["wrench.force.x"], [1.0])
    one.step(0.0, 0.0101)  # ten periods of a little more than 1 ms
    for k in range(10):
        other.step(0.00101 * k, 0.00101)
    names = motion("platform", "pose", "velocity") + each("command.tension[{}]", 6)
    np.testing.assert_allclose(one.get(names), other.get(names), rtol=0, atol=1e-10)
    assert one.get(["platform.pose.x"]) != 0


def test_a_platform_without_tensions_falls(unit):
    """By g t^2 / 2, whatever its mass; a force along y moves it by F t^2 / (2 m), with the mass that is set."""
    one = unit("cogiro", "plant")
    z = one.get(["platform.pose.z"])[0]
    names = [*each("command.tension[{}]", 8), "wrench.force.y", "plant.mass"]
    one.set(names, [0.0] * 8 + [300.0, 150.0])
    for k in range(100):
        one.step(0.01 * k, 0.01)
    y, z = one.get(["platform.pose.y", "platform.pose.z"]) - [0.0, z]
    assert z == pytest.approx(-9.81 / 2, abs=0.02)
    assert y == pytest.approx(300.0 / 150.0 / 2, abs=0.02)
    assert one.get(["time"]) == pytest.approx(1.0)


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("robot", ROBOTS)
def test_a_state_that_is_set_continues_with_the_same_bits(robot, part, unit):
    one, other = unit(robot, part), unit(robot, part)
    outputs = [name for name in one.names("output") if "command" in name or "pose" in name]

    def go_on(which):
        seen = []
        for k in range(50, 100):
            if part == "controller":
                which.set(motion("platform", "pose"), [0.01 * np.sin(k), 0, -1, 0, 0, 0])
            else:
                which.set(["wrench.force.x"], [np.cos(k)])
            which.step(k * STEP, STEP)
            seen.append(which.get(outputs))
        return np.array(seen)

    for k in range(50):
        one.step(k * STEP, STEP)
    state = one.slave.getFMUState()
    stored = bytes(one.slave.serializeFMUState(state))
    expected = go_on(one)
    one.slave.setFMUState(state)
    assert np.array_equal(go_on(one), expected)
    other.slave.setFMUState(other.slave.deserializeFMUState(stored))
    assert np.array_equal(go_on(other), expected)
    one.slave.freeFMUState(state)
    one.slave.reset()
    one.begin()
    assert one.get(["time"]) == 0.0
    with pytest.raises(Exception, match="fmi3DeserializeFMUState"):
        unit(next(name for name in ROBOTS if name != robot), part).slave.deserializeFMUState(stored)


def test_wrong_calls_are_refused(unit):
    one = unit("cogiro", "plant")
    for names, value in ((["wrench.force.x"], np.nan), (["plant.mass"], 0.0), (["platform.pose.x"], 1.0)):
        with pytest.raises(Exception, match="fmi3SetFloat64"):
            one.set(names, [value])
    for step in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(Exception, match="fmi3DoStep"):
            one.step(0.0, step)
    # Cables above and below a platform, without stiffness: no pose has all lengths if one cable is shorter.
    closed = unit("ipanema-1", "plant", "lengths")
    closed.step(0.0, STEP)
    closed.set(["command.length[1]"], [float(closed.variables["command.length[1]"].start) - 1e-3])
    with pytest.raises(Exception, match="fmi3DoStep"):
        closed.step(STEP, STEP)
    with pytest.raises(Exception, match="fmi3GetFloat64"):
        one.slave.getFloat64([10**6])
    one.slave.guid = "of another unit"
    with pytest.raises(Exception, match="nstantiate"):
        one.slave.instantiate()


def test_whatever_sensors_report_tensions_are_in_their_limits(unit):
    """Also for no numbers, for which the reference tensions are commanded."""
    robot, one = load("cogiro"), unit("cogiro", "controller")
    names = [name for name in one.names("input") if not name.endswith("jerk")]
    numbers = st.one_of(st.floats(), st.floats(-10, 10))

    @settings(max_examples=50, deadline=None)
    @given(st.lists(st.dictionaries(st.sampled_from(names), numbers, max_size=20), min_size=1, max_size=3))
    def check(given):
        one.slave.reset()
        one.begin()
        for k, values in enumerate(given):
            one.set(values, list(values.values()))
            one.step(k * STEP, STEP)
            tensions = one.get(each("command.tension[{}]", 8))
            assert ((tensions >= robot.t_min) & (tensions <= robot.t_max)).all()
            assert one.get(["answered"]) in (0.0, 2.0, 3.0)

    check()


def test_the_sources_alone_make_a_unit(tmp_path):
    """Compiled in an empty folder, without a warning; no step allocates memory."""
    require("gcc")
    for name in ROBOTS:
        files = {file.removeprefix("sources/"): text for file, text in unit_files(load(name), "both").items()}
        for file, text in files.items():
            (tmp_path / file).parent.mkdir(exist_ok=True)
            (tmp_path / file).write_bytes(text)
        sources = [file for file in files if file.endswith(".c")]
        listed = files["buildDescription.xml"].decode()
        assert re.findall(r'<SourceFile name="(.*)"', listed) == sources
        own = sources if name == ROBOTS[0] else ["robot.c"]  # the other files are the same
        command = ["gcc", "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-I.", "-fPIC", "-c"]
        subprocess.run([*command, *own], cwd=tmp_path, check=True)
        objects = [Path(file).with_suffix(".o").name for file in sources]
        subprocess.run(["gcc", "-shared", "-o", "unit.so", *objects, "-lm"], cwd=tmp_path, check=True)
        assert [file for file in sources if b"alloc(" in files[file]] == ["functions.c"]
    assert unit_files(load(name), "both") == unit_files(load(name), "both")


def test_the_command_writes_a_unit(tmp_path, tmp_path_factory, monkeypatch):
    require("cc")
    monkeypatch.chdir(tmp_path)
    with compiled_once(tmp_path_factory):
        arguments = ["export", "planar-4", "--fmu", "my crane.fmu", "--json"]
        found = json.loads(CliRunner().invoke(app, arguments, catch_exceptions=False).stdout)
    assert found["file"] == "my crane.fmu"
    names = zipfile.ZipFile(tmp_path / "my crane.fmu").namelist()
    assert {"modelDescription.xml", "sources/buildDescription.xml", "sources/plant/plant.c"} <= set(names)
    assert any(name.startswith(f"binaries/{found['binary']}/planar_4.") for name in names)


def test_without_a_compiler_there_are_sources_only(tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    assert towline.export_fmu("planar-4", tmp_path / "unit.fmu") is None
    assert not any("binaries" in name for name in zipfile.ZipFile(tmp_path / "unit.fmu").namelist())
    monkeypatch.setenv("CC", shutil.which("false") or "false")
    with pytest.raises(InputError, match=r"^CC must be a C compiler, got \S+: it ended with exit code 1$"):
        towline.export_fmu("planar-4", tmp_path / "other.fmu")
    assert not (tmp_path / "other.fmu").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["nowhere", "--fmu", "a.fmu"], "no robot or file 'nowhere'"),
        (["cogiro", "--fmu", "a.zip"], "--fmu must end in .fmu, got 'a.zip'"),
        (["cogiro", "--fmu", "/proc/none/a.fmu"], "/proc/none/a.fmu: cannot be written"),
        (["cogiro", "--fmu", "a.fmu", "--fmu-of", "robot"], "part must be one of plant, controller, both, got 'robot'"),
        (["cogiro", "--fmu", "a.fmu", "--drive", "motors"], "drive must be one of lengths, rates, forces, tensions"),
        (["cogiro", "--fmu", "a.fmu", "--drive", "rates", "--fmu-of", "both"], "drive must accept commanded tensions"),
        (["cogiro", "--fmu", "a.fmu", "--drive", "rates", "--fmu-of", "controller"], "drive must be left out for part"),
        (["cogiro", "--fmu", "a.fmu", "--reference", "0 0 inf 0 0 0"], "--reference must be 6 finite numbers"),
        (["cogiro", "--fmu", "a.fmu", "--reference", "none.nc"], "no such file"),
        (["cogiro", "--fmu", "a.fmu", "--out", "b.fmu"], "--out must be left out with --fmu"),
        (["cogiro", "--c", "--drive", "rates"], "--drive must be left out without --fmu"),
        (["cogiro", "--c", "--fmu", "a.fmu"], "export requires exactly one of --mjcf, --c, --step and --fmu"),
    ],
)
def test_wrong_options_are_refused_in_one_line(options, said, tmp_path):
    done = run("export", *options, cwd=tmp_path, code=2)
    assert said in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_controller_whose_tension_sensors_fail_holds_the_robot_and_says_so(unit):
    plant, controller = unit("cogiro", "plant"), unit("cogiro", "controller")
    sensors = [name for name in controller.names("input") if not name.startswith("reference.")]
    tensions = [name for name in sensors if name.endswith("mean_tension")]
    orders = [name for name in plant.names("input") if name in controller.names("output")]
    assert len(tensions) == 8
    before, answered = plant.get(motion("platform", "pose")), []
    for k in range(150):
        controller.set(sensors, plant.get(sensors))
        if 50 <= k < 100:
            controller.set(tensions, [-1.0] * 8)
        controller.step(k * STEP, STEP)
        answered.append(controller.get(["answered"])[0])
        plant.set(orders, controller.get(orders))
        plant.step(k * STEP, STEP)
    np.testing.assert_array_equal(answered, [0] * 51 + [2] * 49 + [0] * 50)
    assert np.abs(plant.get(motion("platform", "pose")) - before).max() < 1e-4
