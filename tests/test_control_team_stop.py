"""Stops of teams of quadrotors: balance, lengths and thrusts by the equations of motion, and a simulation of each."""

import json

import numpy as np
import pytest

from towline import Dynamics, InputError, Robot, load, plan, simulate
from towline.control import Predictive, longest_stop, references, stop
from towline.control.planned_references import planned
from towline.statics.team_stops import team_stop_along

from .warm import towline as run


@pytest.fixture(scope="module")
def made():
    line = {"kind": "line", "start": [0, 0, 0], "end": [2.0, 0.2, 0.1]}
    found = plan("multi-quadrotor-3", {"path": line, "duration": 3.0, "base": {"kind": "free"}, "steps": 20})
    assert found.feasible
    return load("multi-quadrotor-3"), found


def test_stops_of_teams_obey_the_equations_of_motion(made):
    robot, found = made
    dynamics, g = Dynamics(robot), np.array(robot.gravity)
    fine = np.stack([each.pose for each in references(found, 2e-4)])
    for time in np.random.default_rng(1).uniform(0.0, found.duration, 3):
        its = stop(found, time)
        assert its.feasible
        assert its.duration <= found.duration - time + 1e-9
        (pose, velocity, acceleration), (carriers, _, bends) = its.platform, its.carriers
        A = dynamics.wrench_matrix(pose, carriers)
        missing = dynamics.required_wrench(pose, velocity, acceleration) - (A @ its.tensions[..., None])[..., 0]
        assert np.abs(missing @ np.diag(robot.wrench_scale)).max() < 0.02 * robot.weight
        lengths = dynamics.cable_lengths(pose, carriers)
        np.testing.assert_allclose(lengths, np.broadcast_to(robot.fixed_lengths, lengths.shape), atol=2e-3)
        assert (its.tensions > robot.t_min - 0.02 * robot.t_max).all()
        assert (its.tensions < 1.02 * robot.t_max).all()
        directions = A[:, :3].swapaxes(1, 2)
        for index, carrier in enumerate(robot.carriers):
            pull = -its.tensions[:, [index]] * directions[:, index]
            thrust = np.linalg.norm(carrier.mass * (bends[:, index, :3] - g) - pull, axis=1)
            assert (thrust < 1.02 * carrier.thrust_max).all()
            # The acceleration is that of the positions, by a formula of fourth order.
            x, h = carriers[:, index, :3], its.times[1]
            four = (-x[:-4] + 16 * x[1:-3] - 30 * x[2:-2] + 16 * x[3:-1] - x[4:]) / (12 * h**2)
            assert np.abs(four - bends[2:-2, index, :3]).max() < 0.25
        off = np.linalg.norm(fine[None, :, :3] - pose[:, None, :3], axis=2).min(axis=1)
        assert off.max() < 1e-3
        each = references(found, 1e-3, start=time)[0]
        for motion, first in zip((*its.platform, *its.carriers), each[:6], strict=True):
            np.testing.assert_allclose(motion[0], first, atol=1e-6)
        assert np.abs(its.platform[1][-1]).max() < 1e-3
        assert np.abs(its.carriers[1][-1]).max() < 1e-3


def test_a_team_stops_in_a_simulation(made):
    robot, found = made
    its = stop(found, 0.4 * found.duration)
    assert its.duration < 0.55 * found.duration
    flown = simulate(robot, its, Predictive(robot), duration=its.duration + 0.3, period=2e-3)
    assert flown.passed
    assert flown.error.max() < 0.01
    assert flown.answered["as planned"] > 0.99 * len(flown.error)


def test_a_team_goes_on_to_its_end_where_no_stop_is_shorter(made):
    _, found = made
    its = stop(found, found.duration - 0.15)
    assert its.feasible
    assert its.duration <= 0.2
    assert its.ends <= found.duration + 0.01
    assert longest_stop(found, 0.5).duration >= stop(found, 1.0).duration


def test_the_rest_of_a_plan_for_stronger_cables_is_no_feasible_stop(made):
    robot, found = made
    begins = found.duration - 0.15
    highest = stop(found, begins).tensions.max()
    cables = [{**cable.model_dump(), "t_max": 0.9 * highest} for cable in robot.cables]
    weak = Robot.model_validate({**robot.model_dump(), "cables": cables})
    its = team_stop_along(weak, planned(found)[1], begins)
    cable = int(its.tensions.max(axis=0).argmax())
    share = (its.tensions.max() - weak.t_max[cable]) / (weak.t_max[cable] - weak.t_min[cable])
    assert its.excess == pytest.approx(share, rel=1e-6)
    assert its.limit.startswith(f"tension {cable + 1}: ")


def test_an_event_stops_a_team_from_the_command_line(made, tmp_path):
    robot, found = made
    found.save(tmp_path / "line.nc")
    done = run("simulate", robot.name, "line.nc", "--event", "stop at 0.6", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["passed"]


def test_what_is_no_such_team_is_refused_in_one_line():
    found = plan("flycrane", {"path": {"kind": "line", "start": [0, 0, 0], "end": [0.5, 0, 0]}, "duration": 4.0,
                              "base": {"kind": "free"}})  # fmt: skip
    with pytest.raises(InputError, match=r"with one cable of fixed length each, .* got 'flycrane'") as error:
        stop(found, 1.0)
    assert "\n" not in str(error.value)
