"""Replay of recordings: the right model leaves the noise, a wrong one is named, and what is no recording is one line.

Recordings are made by `simulate` and the plant at 1 kHz, sampled and given noise here.
"""

import json
import re
from functools import cache

import numpy as np
import pytest
import xarray as xr
from scipy.interpolate import CubicSpline

from towline import Dynamics, InputError, load, simulate, tensions
from towline.control import Command, Controller, LengthControl
from towline.estimation.logs.recorded import read_recorded
from towline.models.cable import Winch
from towline.plant import Plant
from towline.simulation import Replay, replay
from towline.simulation.replayed_robot import Parameters, changed, given_by_drives
from towline.simulation.windows import Windows

from .framed import framed
from .warm import towline as run

NOISE = {"pose": 5e-4, "length": 5e-5, "tension": 0.3}  # [m, rad], [m], [N]
SECONDS = 4.0


def with_cables(robot, **changes):
    return robot.model_copy(update={"cables": tuple(one.model_copy(update=changes) for one in robot.cables)})


def with_mass(robot, factor):
    platform = robot.platform
    inertia = platform.inertia and tuple(factor * part for part in platform.inertia)
    heavier = platform.model_copy(update={"mass": factor * platform.mass, "inertia": inertia})
    return robot.model_copy(update={"platform": heavier})


PLANAR = with_cables(load("planar-4"), stiffness=20e3, damping=20.0)
WINCH = Winch(inertia=20, friction=15, speed_max=5, force_max=5000)
COGIRO = with_cables(load("cogiro"), stiffness=200e3, damping=1000.0, winch=WINCH)


class Commanded(Controller):
    """Commands of every millisecond, whatever happens."""

    def __init__(self, commands):
        self.commands = commands

    def step(self, time, state, reference):
        now = self.commands[min(round(1e3 * time), len(self.commands) - 1)]
        return Command(now, *reference[3:6], np.array(0))


def swing(centre, size, rates, seconds):
    """A path that begins and ends at rest."""
    times = np.linspace(0, seconds, 101)
    even = np.clip(np.minimum(times, seconds - times), 0, 1)
    even = even**3 * (10 - 15 * even + 6 * even**2)
    poses = np.zeros((len(times), 6))
    poses[:, :3] = centre + np.array(size) * np.sin(2 * np.pi * np.outer(times, rates)) * even[:, None]
    return {"kind": "samples", "times": times.tolist(), "poses": poses.tolist()}


@cache
def motion(kind, seconds=SECONDS):
    """A robot and its simulation."""
    if kind == "thrusts":
        robot = load("multi-quadrotor-3")
        pushed = simulate(robot, robot.home, events=["push 6 4 5 at 0.1 for 0.3"], duration=seconds, tolerance=9)
        return robot, pushed.trajectory.isel(time=slice(450, None))  # how it comes back
    robot, controller, path = {
        "lengths": (PLANAR, LengthControl(PLANAR), swing((0, 0, 0.75), (0.2, 0, 0.12), (0.5, 1, 0.8), seconds)),
        "tensions": (load("planar-4"), None, swing((0, 0, 0.75), (0.2, 0, 0.12), (0.5, 1, 0.8), seconds)),
        "drives": (COGIRO, None, swing((0, 0, 1.5), (0.5, 0.4, 0.1), (0.25, 0.3, 0.4), seconds)),
    }[kind]
    return robot, simulate(robot, path, controller).trajectory


@cache
def driven_by_motors():
    """A point mass whose motors pull with known forces, without a controller; times, forces, and the run."""
    cables = {"stiffness": 2e4, "damping": 20.0, "winch": Winch(inertia=4, friction=2, speed_max=5, force_max=500)}
    robot = with_cables(load("point-mass-3"), **cables)
    plant = Plant(robot, drive="forces")
    held = np.asarray(tensions(robot, robot.home).tensions)
    times = 1e-3 * np.arange(2000)
    forces = held * (1 + 0.4 * np.sin(7 * times[:, None] + [0, 2, 4]))
    return robot, times, forces, plant.run(plant.start(tensions=held), plant.command(forces), 1e-3)


def columns(kind, rows, seed=0, seconds=SECONDS):
    """The columns of a recording with noise at some of the samples."""
    robot, trajectory = motion(kind, seconds)
    draw = np.random.default_rng(seed)

    def noisy(values, sigma):
        return np.asarray(values)[rows] + draw.normal(0, sigma, np.asarray(values)[rows].shape)

    pose, pulls, lengths = (trajectory[name].values for name in ("pose", "tensions", "cable_lengths"))
    names = ("x [m]", "y [m]", "z [m]", "roll [rad]", "pitch [rad]", "yaw [rad]")
    found = {"t [s]": trajectory["time"].values[rows]}
    found |= dict(zip(names, noisy(pose, NOISE["pose"]).T, strict=True))
    if kind == "thrusts":
        for i, carrier in enumerate(robot.carriers):
            own = noisy(trajectory["carrier_pose"].values[:, i], NOISE["pose"])
            found |= {f"{carrier.name}_{name}": values for name, values in zip(names, own.T, strict=True)}
            found[f"{carrier.name}_thrust [N]"] = trajectory["actuation"].values[rows, i, 0]
        return found
    EA = np.array([cable.stiffness or np.inf for cable in robot.cables])
    encoders = noisy(lengths / (1 + pulls / EA), NOISE["length"]) + 0.3  # an offset of the encoders
    found |= {f"l{i} [m]": values for i, values in enumerate(encoders.T)}
    if kind == "drives":
        orders = trajectory["tensions_commanded"].values[rows]
        found |= {f"tension_cmd_{i} [N]": values for i, values in enumerate(orders.T)}
    found |= {f"tension_{i} [N]": values for i, values in enumerate(noisy(pulls, NOISE["tension"]).T)}
    return found


def every(kind, rate=100):
    return slice(0, len(motion(kind)[1]["time"]), 1000 // rate)


def written(path, found):
    np.savetxt(path, np.column_stack(list(found.values())), "%.13g", ",", header=",".join(found), comments="")
    return path


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    kinds = ("lengths", "tensions", "drives", "thrusts")
    return {kind: written(folder / f"{kind}.csv", columns(kind, every(kind))) for kind in kinds}


@pytest.mark.parametrize("kind", ["lengths", "tensions"])
def test_the_right_model_leaves_the_noise(kind, logs):
    result = replay(motion(kind)[0], logs[kind])
    assert result.passed
    assert not result.named
    # Of each kind, what the noise that was added to the recording explains.
    rms, noise = result.rms(), result.matching.noise
    assert all(rms[name] < 1.5 * noise[name] for name in rms)
    assert rms["position"] < 2 * NOISE["pose"]
    assert "the model reproduces the recording" in result.report()
    assert "input error" not in result.report()
    # Of a robot in a plane, x and z are drawn, and its pitch.
    position, rotation = result.figures()["replay"].axes[:2]
    first, line = position.lines[0].get_ydata(), position.lines[-1].get_ydata()
    np.testing.assert_allclose(first, 1e3 * np.hypot(*result.residuals["position"][0][:, [0, 2]].T))
    assert line[0] == pytest.approx(1e3 * np.sqrt(2) * noise["position"])
    np.testing.assert_allclose(rotation.lines[0].get_ydata(), 1e3 * abs(result.residuals["rotation"][0][:, 1]))


def test_drives_give_commanded_tensions_whatever_their_winches_weigh_and_rub(logs):
    """Simulated drives compensate 20 kg and 15 N; replayed as the motors' forces, their commands missed by 64 mm."""
    result = replay(COGIRO, logs["drives"])
    assert result.to_dict()["drive"] == "tensions"
    assert not result.named
    # The first window begins where the recording does, with a velocity that is less well known.
    later = {name: np.sqrt(np.nanmean(part[1:] ** 2)) for name, part in result.residuals.items()}
    assert all(later[name] < 1.5 * noise for name, noise in result.matching.noise.items())
    assert later["position"] < 2 * NOISE["pose"]


def test_friction_that_drives_do_not_compensate_is_named(tmp_path):
    rubbed = simulate(COGIRO, swing((0, 0, 1.5), (0.5, 0.4, 0.1), (0.25, 0.3, 0.4), 3.0), mismatch={"friction": 8.0})
    result = replay(COGIRO, rubbed.save(tmp_path / "rubbed.nc"), fit=True)
    assert result.named == ["friction"]
    assert result.found[0].value == pytest.approx(8.0, rel=0.06)
    assert "tensions and lengths from anchor to attachment do not show the stiffness of the cables" in result.notes
    assert "stiffness" not in [one.name for one in result.found]
    assert [cable.winch for cable in result.robot.cables] == 8 * [WINCH]  # that of the file is compensated


def test_forces_of_motors_move_winches_with_inertia_and_friction(tmp_path):
    robot, times, forces, run = driven_by_motors()
    draw, now = np.random.default_rng(0), Plant(robot, drive="forces").read(run.states[:-1])
    rows = slice(0, len(times), 10)
    found = {"t [s]": times[rows]}
    found |= dict(
        zip(("x [m]", "y [m]", "z [m]"), (now.pose[rows, :3] + draw.normal(0, 2e-4, (200, 3))).T, strict=True)
    )
    found |= {f"l{i} [m]": one[rows] + draw.normal(0, 5e-5, 200) for i, one in enumerate(now.lengths.T)}
    found |= {f"tension_cmd_{i} [N]": one[rows] for i, one in enumerate(forces.T)}
    log = written(tmp_path / "motors.csv", found)
    result = replay(robot, log, delay=0.5e-3, drive="forces")
    assert result.to_dict()["drive"] == "forces"
    assert not result.named
    assert result.rms()["position"] < 4e-4
    rough = with_cables(robot, winch=robot.cables[0].winch.model_copy(update={"friction": 3.0}))
    result = replay(rough, log, delay=0.5e-3, drive="forces")
    assert result.named[0] in ("friction", "cable_friction")  # 1 N less, of all cables or of each
    assert next(one.value for one in result.found if one.name == "friction") == pytest.approx(2.0, rel=0.1)


@cache
def pulled_by_motors(with_tensions):
    """Eight cables on rubbing winches, pulled by known forces, and the columns of its recording with noise."""
    robot = with_cables(COGIRO, damping=400.0, winch=WINCH)
    held, times = np.asarray(tensions(robot, robot.home).tensions), 1e-3 * np.arange(2900)
    phases = np.arange(8) * 2.4
    forces = held * (1 + 0.15 * (np.sin(5 * times[:, None] + phases) - np.sin(phases) * np.exp(-3 * times[:, None])))
    plant, draw, rows = Plant(robot, drive="forces"), np.random.default_rng(2), slice(300, 2900, 10)
    run = plant.run(plant.start(tensions=held), plant.command(forces), 1e-3)
    now = plant.read(run.states[:-1])
    pose = now.pose[rows] + draw.normal(0, NOISE["pose"], (260, 6))
    names = ("x [m]", "y [m]", "z [m]", "roll [rad]", "pitch [rad]", "yaw [rad]")
    found = {"t [s]": times[rows]} | dict(zip(names, pose.T, strict=True))
    found |= {f"l{i} [m]": one[rows] + draw.normal(0, NOISE["length"], 260) for i, one in enumerate(now.lengths.T)}
    found |= {f"motor_force_cmd_{i} [N]": one[rows] for i, one in enumerate(forces.T)}
    if with_tensions:
        pulls = run.tensions[:-1][rows] + draw.normal(0, NOISE["tension"], (260, 8))
        found |= {f"tension_{i} [N]": one for i, one in enumerate(pulls.T)}
    return robot, found


@pytest.mark.parametrize(("factor", "with_tensions"), [(0.8, True), (1.0, True), (1.2, False)])
def test_friction_of_motors_that_is_wrong_by_a_fifth_is_named(factor, with_tensions, tmp_path):
    """Windows start from tensions that motors and winches show, and at the speeds of the winches' encoders."""
    robot, found = pulled_by_motors(with_tensions)
    wrong = with_cables(robot, winch=WINCH.model_copy(update={"friction": factor * WINCH.friction}))
    result = replay(wrong, written(tmp_path / "motors.csv", found), delay=0.5e-3)
    assert result.to_dict()["drive"] == "forces"
    if factor == 1:
        assert not result.named
        rms, noise = result.rms(), result.matching.noise
        assert all(rms[name] < 2 * noise[name] for name in rms)
    else:
        assert result.named[0] == "friction"
        assert result.found[0].value == pytest.approx(WINCH.friction, rel=0.05)


def test_windows_start_with_the_elongation_that_damped_cables_have(tmp_path):
    """Load cells also feel damping: windows began with cables that were too long by its share of the tension."""
    robot = with_cables(load("planar-4"), stiffness=20e3, damping=200.0)
    path = swing((0, 0, 0.75), (0.15, 0, 0.1), (0.9, 1, 1.1), 3.0)
    held, times, rows = np.asarray(tensions(robot, robot.home).tensions), 1e-3 * np.arange(3000), slice(0, 3000, 10)
    lengths = Dynamics(robot).cable_lengths(CubicSpline(path["times"], path["poses"])(times)) / (1 + held / 20e3)
    plant, draw = Plant(robot, drive="lengths"), np.random.default_rng(4)
    run = plant.run(plant.start(tensions=held), plant.command(lengths), 1e-3)
    now, pulls = plant.read(run.states[:-1]), run.tensions[:-1]
    names = ("x [m]", "y [m]", "z [m]", "roll [rad]", "pitch [rad]", "yaw [rad]")
    found = {"t [s]": times[rows]} | dict(zip(names, (now.pose[rows] + draw.normal(0, 1e-4, (300, 6))).T, strict=True))
    found |= {f"l{i} [m]": one[rows] for i, one in enumerate(now.lengths.T)}
    found |= {f"tension_{i} [N]": one[rows] + draw.normal(0, 0.03, 300) for i, one in enumerate(pulls.T)}
    windows = Windows(read_recorded(robot, written(tmp_path / "damped.csv", found)), None, 0.3)
    at = np.searchsorted(times, windows.starts)
    taut = pulls[at] > 0
    elastic = 20e3 * (Dynamics(robot).cable_lengths(now.pose) / now.lengths - 1)[at]
    away = (windows._tensions.elastic(windows.usual) - elastic)[taut]
    assert np.sqrt(np.mean(away**2)) < 0.5 * np.sqrt(np.mean((pulls[at] - elastic)[taut] ** 2))


@pytest.mark.parametrize("damping", [0.0, 200.0, 8000.0])
def test_tensions_of_drives_are_those_of_the_plant(damping):
    """Commands with a kink: their drive answers with the plant's winches, without a shift of time that suits ramps."""
    robot = with_cables(COGIRO, damping=damping)
    held, times = np.asarray(tensions(robot, robot.home).tensions), 1e-3 * np.arange(400)
    commands = held * (1 + np.clip(times - 0.1, 0, 0.1)[:, None] * [2, -2, 2, -2, 2, -2, 2, -2])
    flight = simulate(robot, robot.home, Commanded(commands), duration=0.4, tolerance=9).trajectory
    given = given_by_drives(robot, flight["tensions_commanded"].values[None], 1e-3)[0]
    means = 0.5 * (given[1:] + given[:-1])  # over periods, as in simulations
    away = means[1:390] - flight["tensions"].values[1:390]
    assert np.abs(away).max() < 0.04 * np.abs(commands - held).max()


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (lambda lengths: {name: 1e3 * one for name, one in lengths.items()}, "millimetres"),
        (
            lambda lengths: dict(zip(lengths, [lengths[f"l{i} [m]"] for i in (1, 0, 2, 3)], strict=True)),
            "l0 and l1 look exchanged",
        ),
    ],
)
def test_an_input_error_of_the_log_is_named(wrong, text, tmp_path):
    found = columns("tensions", every("tensions", 50))
    found |= wrong({name: one for name, one in found.items() if name.startswith("l")})
    result = replay("planar-4", written(tmp_path / "wrong.csv", found))
    report = result.report()
    assert not result.passed
    assert "the log probably has an input error: " in report
    assert text in report


def test_a_corrected_log_is_replayed_as_if_it_were_right(tmp_path):
    """The columns of all cables are in another order, also of their commands, and the lengths in millimetres."""
    found = columns("tensions", every("tensions", 50))
    found |= {f"tension_cmd_{i} [N]": found[f"tension_{i} [N]"] for i in range(4)}
    right = read_recorded("planar-4", written(tmp_path / "right.csv", found))
    for name in ("l{} [m]", "tension_{} [N]", "tension_cmd_{} [N]"):
        found |= {name.format(i): found[name.format(k)] for i, k in enumerate((1, 0, 2, 3))}
    found |= {f"l{i} [m]": 1e3 * found[f"l{i} [m]"] for i in range(4)}
    corrected = read_recorded("planar-4", written(tmp_path / "wrong.csv", found), fix=True)
    assert corrected.doubt is None
    assert [note for note in corrected.notes if re.match("corrected: .*millimetres.* l0 and l1 look exchanged", note)]
    for name in ("times", "pose", "lengths", "tensions", "commands"):
        np.testing.assert_allclose(getattr(corrected, name), getattr(right, name), rtol=1e-12, err_msg=name)
    with pytest.raises(InputError, match="fix must be False for multi-"):
        replay("multi-quadrotor-3", tmp_path / "wrong.csv", fix=True)


@pytest.mark.parametrize("both", [False, True])
def test_commanded_lengths_are_corrected_only_if_they_have_the_errors_of_the_readings(both, tmp_path):
    found = columns("tensions", every("tensions", 50))
    right = np.column_stack([found[f"l{i} [m]"] for i in range(4)])
    wrong = 1e3 * right[:, [1, 0, 2, 3]]
    found |= {f"l{i} [m]": wrong[:, i] for i in range(4)}
    found |= {f"l{i}_cmd [m]": (wrong if both else right)[:, i] for i in range(4)}
    corrected = read_recorded("planar-4", written(tmp_path / "wrong.csv", found), fix=True)
    assert corrected.commanded == "lengths"
    np.testing.assert_allclose(corrected.lengths, right, rtol=1e-12)
    np.testing.assert_allclose(corrected.commands, right, rtol=1e-12)


def test_positions_that_were_not_measured_are_no_small_errors(tmp_path):
    """With three of four poses missing the quantile is that of the measured ones."""
    found = replay("planar-4", written(tmp_path / "log.csv", columns("tensions", every("tensions", 50))))
    part = found.residuals["position"]
    known = np.isfinite(part).any(axis=-1)
    expected = np.quantile(np.sqrt(np.nansum(part**2, axis=-1))[known], 0.95)
    found.residuals["position"] = np.concatenate([part, *3 * [np.full_like(part, np.nan)]])
    assert found.error == pytest.approx(expected, rel=1e-12)


CASES = [  # other tests find the mass by lengths, and mass and delay by measured tensions
    ("lengths", "stiffness", with_cables(PLANAR, stiffness=24e3), {}, 1 / 1.2),
    ("lengths", "delay", PLANAR, {"delay": 0.02}, 0.0),
    ("drives", "stiffness", with_cables(COGIRO, stiffness=240e3), {}, 1 / 1.2),  # by lengths that winches measure
    ("thrusts", "mass", with_mass(load("multi-quadrotor-3"), 1.2), {}, 1 / 1.2),
]


@pytest.mark.parametrize(("kind", "name", "robot", "options", "truth"), CASES)
def test_what_is_wrong_is_named_first(kind, name, robot, options, truth, logs):
    result = replay(robot, logs[kind], **options)
    assert result.named[0] == name
    first = result.found[0]
    assert first.value == pytest.approx(truth, rel=0.06, abs=0.002)
    after = result.explained
    assert after is not None
    assert result._rms(after)["position"] < result.rms()["position"] * 1.05
    assert re.search(rf"; {name} \(.*\) explains", result.report().splitlines()[0])


@pytest.mark.parametrize("robot", [COGIRO, load("point-mass-3")])
def test_a_heavier_platform_has_as_much_more_inertia(robot):
    assert changed(robot, Parameters(mass=1.2)).platform == with_mass(robot, 1.2).platform


def test_commanded_lengths_cut_no_corners_between_samples(tmp_path):
    """Straight lines between commands of 20 Hz miss by 0.5 mm, which tighten these cables by several newtons."""
    rows = every("lengths", 20)
    orders = motion("lengths")[1]["lengths_commanded"].values[rows]
    found = columns("lengths", rows) | {f"l{i}_cmd [m]": one for i, one in enumerate(orders.T)}
    result = replay(PLANAR, written(tmp_path / "slow.csv", found))
    assert result.to_dict()["commands"] == "commanded"
    assert result.rms()["tensions"] < 2 * NOISE["tension"]
    assert not result.named


def test_commanded_tensions_are_compared_at_the_times_of_samples(tmp_path, monkeypatch):
    """Held for steps of the simulation, of 2 ms, they would be half a step late."""
    monkeypatch.setitem(NOISE, "tension", 0.02)
    found = columns("drives", every("drives", 25))
    result = replay(COGIRO, written(tmp_path / "slow.csv", found), window=1.0)
    assert np.sqrt(np.nanmean(result.residuals["tensions"][1:-1] ** 2)) < 1.8 * NOISE["tension"]


def test_commands_before_a_recording_are_extended_by_lines(tmp_path):
    """A delay of 0.15 s needs those of 0.1 s before the first. Cubics through rounded ones were 0.5 m off."""
    rows, orders = np.arange(600, 2740, 10), motion("lengths")[1]["lengths_commanded"].values
    found = columns("lengths", rows) | {f"l{i}_cmd [m]": one for i, one in enumerate(orders[rows + 150].T.round(3))}
    windows = replay(PLANAR, written(tmp_path / "late.csv", found), delay=0.15).residuals["position"]
    first, *others = np.sqrt(np.nanmean(windows**2, axis=(1, 2)))
    assert first < 0.02
    assert max(others) < 5e-3


def test_a_thrust_that_is_recorded_too_low_is_no_mass(tmp_path):
    found = columns("thrusts", every("thrusts"))
    found["quad2_thrust [N]"] = 0.93 * found["quad2_thrust [N]"]
    result = replay("multi-quadrotor-3", written(tmp_path / "log.csv", found))
    assert result.named[0] == "thrusts"
    np.testing.assert_allclose(result.found[0].value, [0, -0.07, 0], atol=0.01)
    assert re.search(r"thrusts \(the thrust of carriers\[1\] .* 0\.9\d+ times the thrust\) explain ", result.report())


def test_wrong_anchors_are_named(logs):
    moved = np.array([[0.0, 0, 0.03], [0, 0, 0], [-0.03, 0, 0], [0, 0, 0]])
    cables = [
        cable.model_copy(update={"anchor": tuple(np.add(cable.anchor, by).tolist())})
        for cable, by in zip(PLANAR.cables, moved, strict=True)
    ]
    result = replay(PLANAR.model_copy(update={"cables": tuple(cables)}), logs["lengths"])
    assert result.named == ["anchors"]
    assert re.search(r"; anchors \(.*\) explain ", result.report().splitlines()[0])


@pytest.mark.parametrize(("gain", "zero", "drive"), [(1.0, 10.0, None), (1.2, 0.0, "tensions")])
def test_a_wrong_load_cell_is_neither_mass_nor_stiffness(gain, zero, drive, tmp_path):
    """It is found if readings are compared with the simulation, and if they are its commands."""
    found = columns("lengths", every("lengths"))
    found["tension_1 [N]"] = gain * found["tension_1 [N]"] + zero
    result = replay(PLANAR, written(tmp_path / "log.csv", found), drive=drive, fit=gain > 1)
    assert result.named == ["load_cells"]
    gains, zeros = np.reshape(result.found[0].value, (2, -1))
    sigmas = np.reshape(result.found[0].sigma, (2, -1))
    np.testing.assert_array_less(np.abs(gains - [0, gain - 1, 0, 0]), 4 * sigmas[0] + 1e-3)
    np.testing.assert_array_less(np.abs(zeros * result.windows.usual_tension - [0, zero, 0, 0]), 1.5)
    assert re.search(
        r"; load cells \(the cell of cables\[1\] reads .*\) explain over 99 % of the residuals", result.report()
    )
    assert result.refused  # a wrong mass, or that no fit was asked for


def test_a_frame_that_is_not_level(logs):
    turned = PLANAR.model_copy(update={"gravity": (9.81 * np.sin(0.05), 0.0, -9.81 * np.cos(0.05))})
    result = replay(turned, logs["lengths"])
    assert result.named == ["tilt"]
    assert result.found[0].value[1] == pytest.approx(0.05, abs=4 * result.found[0].sigma[1])


def test_a_wrong_com_is_no_tilt(logs):
    wrong = PLANAR.model_copy(update={"platform": PLANAR.platform.model_copy(update={"com": (0.03, 0.0, 0.02)})})
    result = replay(wrong, logs["lengths"])
    assert result.named == ["com"]
    assert result.found[0].value[0] == pytest.approx(-0.03, abs=0.003)
    assert re.search(r"; CoM \(.*\) explains", result.report())


def test_a_winch_that_slips_is_in_the_summary(tmp_path):
    """Its windows are outliers, and the summary was that the model reproduces the recording."""
    found = columns("lengths", every("lengths"))
    found["l1 [m]"] = found["l1 [m]"] - 0.03 * np.clip((found["t [s]"] - 2.2) / 0.4, 0, 1)
    result = replay(PLANAR, written(tmp_path / "slip.csv", found))
    outlying = result._times[~result.matching.kept]
    assert outlying.min() < 2.6
    assert outlying.max() > 2.2
    assert f"except for 2 outlying windows from {outlying[0, 0]:.4g} s on" in result.report().splitlines()[0]


def test_the_right_team_leaves_the_noise_of_short_windows(tmp_path):
    found = columns("thrusts", slice(0, 1500, 10))
    result = replay("multi-quadrotor-3", written(tmp_path / "team.csv", found), window=0.3)
    assert not result.named
    assert result.rms()["position"] < 2 * NOISE["pose"]


@pytest.mark.parametrize(("rate", "seed", "tension"), [(50, 0, 0.3), (100, 0, 0.02), (50, 1, 0.003)])
def test_short_windows_blame_nothing_in_the_right_model(rate, seed, tension, tmp_path, monkeypatch):
    """Stiffness or load cells explained a share of residuals that were no larger than their noise."""
    monkeypatch.setitem(NOISE, "tension", tension)
    log = written(tmp_path / "log.csv", columns("lengths", slice(0, 2500 if rate == 100 else 5000, 1000 // rate), seed))
    assert not replay(PLANAR, log, window=0.2).named


@pytest.mark.parametrize(("late", "name"), [(20, "tension_"), (5, "tension_cmd_")])
def test_a_robot_that_is_late_has_a_positive_delay(late, name, tmp_path):
    rows = np.arange(0, len(motion("tensions")[1]["time"]) - 20, 10)
    found, early = columns("tensions", rows), columns("tensions", rows + late)  # commands 20 or 5 ms before they act
    found = {of: values for of, values in found.items() if "tension" not in of}
    found |= {of.replace("tension_", name): values for of, values in early.items() if "tension" in of}
    result = replay("planar-4", written(tmp_path / "late.csv", found))
    assert result.named == ["delay"]
    assert result.found[0].value == pytest.approx(1e-3 * late, abs=0.002)
    # Commands of 100 Hz that a controller holds act 5 ms late on average.
    assert any("--delay 0.005" in note for note in result.notes) == (late == 5)


@pytest.mark.parametrize(("ends", "late", "within"), [((0.22, 0.03), 0.05, 1.2e-3), ((0.088, 0.06), -0.05, 0.012)])
def test_the_delay_of_a_fast_motion_is_that_of_starts_that_suit_it(ends, late, within, tmp_path):
    """At 1 m/s, 50 ms are 50 mm, a part of which is explained by starts that were corrected for no delay at all.

    Cables to the second platform hardly turn it.
    """
    anchors = np.array([[0, 0, 1.65], [2.2, 0, 1.65], [2.2, 0, 0], [0, 0, 0]])
    attachments = np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]]) * [ends[0], 0, ends[1]]
    body = {"mass": 6.0, "inertia": [0.24, 0.24, 0.24, 0, 0, 0], "home": [1.1, 0, 0.81, 0, 0, 0]}
    robot = framed(zip(anchors, attachments, strict=True), {**body, "dof": ["x", "z", "pitch"]})
    draw, times = np.random.default_rng(0), 0.02 * np.arange(600)

    def poses(times):
        waves = np.sin(times[:, None] * [1.4, 0, 1.7, 0, 0.9, 0] + [3, 0, 0, 0, 4, 0])
        return robot.home + [0.7, 0, 0.45, 0, 0.15, 0] * waves

    seen = poses(times) + draw.normal(0, 1, (len(times), 6)) * [1e-4, 0, 1e-4, 0, 1e-3, 0]
    lengths = Dynamics(robot).cable_lengths(poses(times + late)) + draw.normal(0, 1e-4, (len(times), robot.m))
    found = {"t [s]": times, "x [m]": seen[:, 0], "z [m]": seen[:, 2], "pitch [rad]": seen[:, 4]}
    found |= {f"l{i} [m]": values for i, values in enumerate(lengths.T)}
    result = replay(robot, written(tmp_path / "late.csv", found))
    assert result.named == ["delay"]
    assert result.found[0].value == pytest.approx(late, abs=within)
    # What it explains is what the residuals with this value leave.
    left, whole = (
        sum(np.nansum((parts[name] / size) ** 2) for name, size in result.matching.windows.noise.items())
        for parts in (result.explained, result.residuals)
    )
    assert result.found[0].explained >= 1 - left / whole - 1e-9


def test_what_a_recording_does_not_show_is_not_named(tmp_path):
    """Without tensions, mass and stiffness only differ by how far cables sag, far less than the noise here."""
    found = {name: values for name, values in columns("lengths", every("lengths")).items() if "tension" not in name}
    result = replay(with_mass(PLANAR, 1.2), written(tmp_path / "bare.csv", found))
    assert not result.named
    assert result.passed


def test_friction_of_winches_that_follow_lengths_shows_in_motor_currents_only(tmp_path):
    """Motors feel less than the cables that they pay out, and more than those that they wind up."""
    found = columns("lengths", every("lengths"))
    speeds = [np.gradient(found[f"l{i} [m]"], found["t [s]"]) for i in range(4)]
    for i, speed in enumerate(speeds):
        found[f"tension_{i} [N]"] = found[f"tension_{i} [N]"] - 5.0 * np.sign(speed)
    result = replay(PLANAR, written(tmp_path / "motors.csv", found))
    assert result.named[0] == "friction"
    assert result.found[0].value == pytest.approx(5.0, rel=0.06)
    bare = {name: values for name, values in found.items() if "tension" not in name}
    result = replay(PLANAR, written(tmp_path / "bare.csv", bare))
    assert "friction" not in [one.name for one in result.found]
    assert any("lengths do not show friction" in note for note in result.notes)


def test_irregular_samples_gaps_and_missing_poses(tmp_path):
    draw = np.random.default_rng(3)
    count = len(motion("lengths", 5.0)[1]["time"])  # of 5 to 8 windows
    rows = np.sort(draw.choice(count, count // 10, replace=False))
    rows = rows[(rows < 0.4 * count) | (rows > 0.5 * count)]  # and a gap of half a second
    found = columns("lengths", rows, seconds=5.0)
    for name in ("x [m]", "y [m]", "z [m]", "roll [rad]", "pitch [rad]", "yaw [rad]"):
        found[name][::7] = np.nan
    found["t [s]"] += 1.7e9
    result = replay(PLANAR, written(tmp_path / "odd.csv", found))
    assert result.passed
    assert not result.named
    assert result.rms()["position"] < 2 * NOISE["pose"]
    assert 5 <= len(result.windows.starts) <= 8


def test_simulations_are_recordings_of_any_kind(tmp_path):
    robot = load("planar-4")
    saved = simulate(robot, swing((0, 0, 0.75), (0.2, 0, 0.12), (0.5, 1, 0.8), 2.0))
    recording = saved.save(tmp_path / "run.mcap")
    direct = simulate(robot, recording)
    assert isinstance(direct, Replay)
    for result in (direct, replay(robot, saved.save(tmp_path / "run.nc"))):
        assert result.passed
        assert result.error < 2e-4  # of a recording without noise, but with means of tensions over periods
    listed = run("log", tmp_path / "run.nc").stdout
    assert "tensions for replays" in listed
    with pytest.raises(InputError, match="reference must be a plan if simulate has other arguments"):
        simulate(robot, recording, duration=1)


def test_the_command_fits_and_writes_what_validation_windows_confirm(tmp_path):
    log = written(tmp_path / "short.csv", columns("tensions", slice(1000, 4100, 10)))
    heavy = with_mass(load("planar-4"), 1.2)
    heavy.save(tmp_path / "heavy.yaml")
    options = ["--fit", "fitted.yaml", "--figures", "drawn", "--json"]
    done = run("simulate", "heavy.yaml", log, *options, cwd=tmp_path, code=1)
    answer = json.loads(done.stdout)
    assert answer["explained_by"] == ["mass"]
    assert answer["validation"][1] < 2 < 10 < answer["validation"][0]
    fitted, true = load(tmp_path / "fitted.yaml").platform, load("planar-4").platform
    assert fitted.mass == pytest.approx(4.0, rel=2e-3)
    assert fitted.inertia == pytest.approx(true.inertia, rel=2e-3)
    assert (tmp_path / "drawn" / "replay.png").read_bytes().startswith(b"\x89PNG")
    with xr.open_dataset(tmp_path / answer["file"]) as saved:
        assert saved.position_residual.dims == ("window", "sample", "axis")
    with pytest.raises(InputError, match="the robot is not written: no parameter"):
        replay(load(tmp_path / "fitted.yaml"), log, fit=True).save_robot(tmp_path / "again.yaml")


def test_a_recording_with_too_few_windows_to_name_a_cause_says_so(tmp_path):
    log, heavy = written(tmp_path / "short.csv", columns("lengths", slice(1000, 2200, 10))), with_mass(PLANAR, 1.2)
    result = replay(heavy, log)
    assert not result.named
    assert "the windows are too few to name a cause: try some shorter than 0.5 s" in result.notes
    again = replay(heavy, log, window=0.2)
    assert again.named == ["mass"]
    assert again.found[0].value == pytest.approx(1 / 1.2, rel=0.06)
    assert not any("few" in note for note in replay(PLANAR, log).notes)


def test_a_fit_to_a_short_recording_needs_short_windows(tmp_path):
    log = written(tmp_path / "short.csv", columns("tensions", slice(1000, 2800, 10)))
    heavy = with_mass(load("planar-4"), 1.2)
    few = replay(heavy, log, fit=True)
    assert few.named == ["mass"]
    assert "of which there are few: try a window shorter than 0.5 s" in few.refused
    assert replay(heavy, log, fit=True, window=0.2).robot.platform.mass == pytest.approx(4.0, rel=2e-3)


HEAD = "t [s],x [m],y [m],z [m],roll [rad],pitch [rad],yaw [rad],l0 [m],l1 [m],l2 [m],l3 [m]\n"


@pytest.mark.parametrize(
    ("robot", "text", "options", "message"),
    [
        ("planar-4", HEAD.split(",", 1)[1] + "0,0,1,0,0,0,1,1,1,1\n", [], "must have times for a replay, got none"),
        ("planar-4", HEAD + "0,0,0,1,0,0,0,1,1,1,1\n", [], "must have a pose at 5 times or more, got 1"),
        ("planar-4", HEAD + "0,nan,0,1,0,0,0,1,1,1,inf\n", [], "l3 must be a finite number at sample 0, got inf"),
        (
            "planar-4",
            "t [s],l0 [m],l1 [m]\n0,1,1\n",
            [],
            "must have a length for each of the 4 cables of planar-4, got 2",
        ),
        ("wang-flying", "t [s],x [m]\n0,1\n", [], "must have"),
        ("planar-4", "", [], "got an empty file"),
        ("planar-4", HEAD, ["--wind", "1 0 0"], "--wind must be left out with a recording"),
        ("planar-4", HEAD, ["--window", "nan"], "--window must be a number from 0.05 to 10, got nan"),
        ("planar-4", HEAD, ["--drive", "rates"], "--drive must be one of lengths, tensions, forces, got 'rates'"),
    ],
)
def test_wrong_input_is_one_line(robot, text, options, message, tmp_path):
    (tmp_path / "log.csv").write_text(text)
    done = run("simulate", robot, "log.csv", *options, cwd=tmp_path, code=2)
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("kept", "missing"),
    [
        ("t|l|x|y|z|roll|pitch|yaw", None),
        ("t|l|tension", None),
        ("t|l|roll|pitch|yaw", None),
        ("t|l", "poses, or tensions or lengths that do not drive the plant"),
        ("l|tension", "times"),
    ],
)
def test_the_listing_of_a_log_says_whether_it_can_be_replayed(kept, missing, tmp_path):
    found = columns("tensions", every("tensions", 50))
    found = {name: one for name, one in found.items() if re.match(rf"({kept})(_?\d)? ", name)}
    log = written(tmp_path / "log.csv", found)
    assert json.loads(run("log", log, "--robot", "planar-4", "--json").stdout)["uses"]["replay"] == missing
    if missing is None:
        assert len(Windows(read_recorded("planar-4", log), None, 0.5).starts)
    else:
        with pytest.raises(InputError, match=f"must have {missing} for a replay, got none"):
            replay("planar-4", log)


def test_a_carrier_without_a_pose_is_named(logs, tmp_path):
    found = {name: one for name, one in columns("thrusts", every("thrusts")).items() if "quad2" not in name}
    log, missing = written(tmp_path / "lost.csv", found), "poses of carrier quad2 (quad2_x, ..., quad2_qw)"
    with pytest.raises(InputError, match=re.escape(f"must have {missing} for a replay, got none")):
        replay("multi-quadrotor-3", log)
    assert json.loads(run("log", log, "--robot", "multi-quadrotor-3", "--json").stdout)["uses"]["replay"] == missing
