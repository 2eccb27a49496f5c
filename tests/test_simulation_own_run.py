"""A run of one's own, of `Plant.run`: saved, read, reported, drawn and shown as a simulation."""

import json

import numpy as np
import pytest
import xarray as xr
from matplotlib import pyplot

from towline import InputError, load, plan, simulate
from towline.control import LengthControl
from towline.estimation.logs.recorded import read_recorded
from towline.plant import Plant
from towline.simulation import replay, simulation_of
from towline.simulation.windows import Windows
from towline.statics.distribution import tensions as distribute
from towline.viewer import read

SECONDS, DT = 0.4, 1e-3


@pytest.fixture(scope="module")
def swing():
    """A load below a carrier, with constant lengths, pushed aside."""
    plant = Plant("wang-flying")
    state = plant.start(velocity=[0.1, 0, 0, 0, 0, 0], tensions=np.full(6, 2.0))
    lengths = state[-4 * 6 : -3 * 6]
    commands = np.tile(plant.command(lengths), (round(SECONDS / DT), 1))
    return plant, plant.run(state, commands, DT)


def test_it_has_the_motion_and_the_tensions_of_the_run(swing):
    plant, history = swing
    run = simulation_of(plant, history)
    reading = plant.read(history.states)
    np.testing.assert_allclose(run.trajectory.pose.values, reading.pose, atol=1e-12)
    np.testing.assert_allclose(run.trajectory.velocity.values, reading.velocity, atol=1e-12)
    np.testing.assert_array_equal(run.trajectory.tensions.values, history.tensions)
    np.testing.assert_allclose(run.times, history.times, atol=1e-12)
    assert run.error.max() == 0
    assert "controller" not in run.report()
    assert sum(run.answered.values()) == 0
    json.dumps(run.to_dict())


def test_it_is_saved_drawn_and_shown_as_simulations_are(swing, tmp_path):
    run = simulation_of(*swing)
    file = run.save(tmp_path / "own.nc")
    with xr.open_dataset(file, engine="h5netcdf") as saved:
        assert saved.attrs["title"].startswith("wang-flying, simulation")
    for canvas in run.figures().values():
        pyplot.close(canvas)
    played = read(file).replay
    assert played is not None
    assert len(played.times) == len(run.times)
    assert simulate("wang-flying", file, duration=0.01).passed in (True, False)  # a reference like any other


def test_its_file_is_replayed(tmp_path):
    """The file has no commands, since there was no controller: its tensions drive the plant, to the same motion."""
    plant = Plant("planar-4", drive="tensions")
    held = np.tile(distribute(plant.robot, plant.robot.home).tensions, (200, 1))
    history = plant.run(plant.start(velocity=[0.1, 0, 0, 0, 0, 0]), plant.command(held), 4e-3)
    found = replay("planar-4", simulation_of(plant, history).save(tmp_path / "own.nc"))
    assert found.passed
    assert found.windows.drive == "tensions"


def test_lengths_that_were_commanded_are_those_of_its_file(tmp_path):
    """Not the tensions that a controller of lengths expects: cables have l / (1 + t / EA) at each time, unless slow."""
    planar, EA = load("planar-4"), 3e4
    cables = tuple(one.model_copy(update={"stiffness": EA, "damping": 60.0}) for one in planar.cables)
    robot = planar.model_copy(update={"cables": cables})
    line = {
        "kind": "line",
        "start": robot.home[:3].tolist(),
        "end": (robot.home[:3] + np.array([0.3, 0, 0.2])).tolist(),
    }
    run = simulate(robot, line, LengthControl(robot), duration=0.8, period=2e-3)
    data, plant = run.trajectory, Plant(robot)
    expected = data.cable_lengths.values / (1 + data.tensions.values / EA)
    np.testing.assert_allclose(data.lengths_commanded.values, expected, atol=2e-5)
    commands = plant.command(data.lengths_commanded.values[1:])
    state = plant.start(run.references[0].pose, lengths=data.lengths_commanded.values[0])
    own = simulation_of(plant, plant.run(state, commands, run.period)).trajectory
    np.testing.assert_allclose(own.lengths_commanded.values, data.lengths_commanded.values, atol=1e-5)
    windows = Windows(read_recorded(robot, run.save(tmp_path / "run.nc")), None, 0.5)
    assert (windows.drive, windows.measured_command) == ("lengths", False)


def test_errors_are_measured_against_a_reference():
    found = plan("cogiro", {"path": {"kind": "line", "start": [0, 0, 1], "end": [0.3, 0, 1]}, "duration": 1})
    plant = Plant("cogiro", drive="tensions")
    times = np.linspace(0, 1, 101)
    tensions = np.stack(
        [np.interp(times, found.trajectory.time, each) for each in found.trajectory.tensions.values.T], 1
    )
    history = plant.run(plant.start([0, 0, 1, 0, 0, 0], tensions=tensions[0]), plant.command(tensions[:-1]), 0.01)
    run = simulation_of(plant, history, found)
    wanted = np.stack([np.interp(times, found.trajectory.time, each) for each in found.trajectory.pose.values.T], 1)
    expected = np.linalg.norm(plant.read(history.states).pose[:, :3] - wanted[:, :3], axis=1)
    np.testing.assert_allclose(run.error, expected, atol=2e-5)
    assert 0 < run.error.max() < 0.05


def test_a_cable_that_the_run_has_without_is_not_slack():
    plant = Plant("cogiro", drive="tensions")
    state = plant.cut(plant.start(tensions=np.full(8, 300.0)), 2)
    run = simulation_of(plant, plant.run(state, np.tile(plant.command(np.full(8, 300.0)), (20, 1)), 1e-3))
    assert run.slack_s == 0
    assert run.passed
    assert "cable 3 was cut at 0 s" in run.report()


def test_what_is_no_run_is_one_line(swing):
    plant, history = swing
    with pytest.raises(InputError, match="history must be of one run"):
        simulation_of(plant, history._replace(states=history.states[None]))
    with pytest.raises(InputError, match="history must be of one run"):
        simulation_of(Plant("cogiro"), history)
    with pytest.raises(InputError, match="equally spaced times"):
        simulation_of(plant, history._replace(times=history.times**2))
    with pytest.raises(InputError, match="reference must be a plan of robot"):
        simulation_of(plant, history, plan("cogiro", {"path": {"kind": "rest", "pose": [0, 0, 1]}, "duration": 1}))
    assert load("wang-flying").m == 6
