"""A film has one scene, whether it is drawn of a plan, of a simulation, or of the file of either."""

import dataclasses

import numpy as np
import pytest
import xarray as xr

from towline import load, plan, simulate
from towline.models import Dynamics
from towline.statics.scene import scene

BALL = {"kind": "sphere", "centre": [3, 0, 2], "radius": 0.5}
POST = {"kind": "box", "min": [-4, -4, 0], "max": [-3, -3, 3]}
LINE = {"kind": "line", "start": [0, 0, 2], "end": [0.1, 0, 2]}


@pytest.fixture(scope="module")
def planned():
    return plan("cogiro", {"path": LINE, "duration": 1, "limits": {"keep_out": [BALL, POST]}})


@pytest.fixture(scope="module")
def simulated(planned):
    return simulate("cogiro", planned, duration=0.1, events=["cut 3 at 0.05"])


@pytest.mark.parametrize("name", ["planned", "simulated"])
def test_a_file_has_all_that_a_film_draws(name, request, tmp_path):
    result, times = request.getfixturevalue(name), np.array([0.0, 0.04, 0.1])
    saved = xr.load_dataset(result.save(tmp_path / "result.nc"), engine="h5netcdf")
    own, of_file = (dataclasses.asdict(scene(load("cogiro"), dataset, times)) for dataset in (result.trajectory, saved))
    np.testing.assert_equal(of_file, own)
    assert own["title"] == {"planned": "cogiro, task: feasible", "simulated": "cogiro, simulation: passed"}[name]


def test_what_is_drawn_is_where_the_robot_was(simulated):
    drawn = scene(simulated.robot, simulated.trajectory, np.array([0.02]))
    row = round(0.02 / simulated.period)
    pose, carriers = simulated.record.motions[row, 0, :6], simulated.record.motions[row, 1:, :6]
    lengths = Dynamics(load("cogiro")).cable_lengths(pose, carriers)
    np.testing.assert_allclose(np.linalg.norm(drawn.anchors - drawn.attachments, axis=2)[0], lengths, rtol=1e-12)
    np.testing.assert_array_equal(drawn.tensions[0], simulated.record.tensions[row])


def test_a_simulation_draws_the_regions_that_its_plan_keeps_out_of(planned, simulated):
    ball, post = scene(simulated.robot, simulated.trajectory, np.zeros(1)).obstacles
    np.testing.assert_allclose(np.linalg.norm(np.vstack(ball) - BALL["centre"], axis=1), BALL["radius"])
    np.testing.assert_array_equal(np.ptp(np.vstack(post), axis=0), [1, 1, 3])
    assert len(post) == 12
    assert "keep_out" not in simulate("cogiro", planned.scenario.path, duration=0.01).trajectory
