"""A moving robot comes to rest where the planner chooses: `final: {velocity: 0}`."""

import numpy as np
import pytest

from towline import Dynamics, InputError, load, plan, read_task, solve
from towline.statics.distribution import wrench_problem

START = {"pose": [-2, -1, 1.5, 0, 0, 0], "velocity": [3, 1, 0, 0, 0, 0]}
HALT = {
    "name": "halt",
    "path": {"kind": "line", "start": [-2, -1, 1.5], "end": [2, 1, 2]},
    "tube": {"position": 3.0, "ends": "free"},
    "duration": 1.5,
    "initial": START,
    "final": {"velocity": 0},
}


@pytest.mark.parametrize("change", [{}, {"duration": {"min": 0.2, "max": 4}, "objective": {"time": 1}}])
def test_it_ends_at_rest_and_can_stay(change):
    robot, found = load("cogiro"), plan("cogiro", HALT | change)
    assert found.feasible
    motion = found.audit.motion
    np.testing.assert_allclose(motion.velocity[0], START["velocity"], atol=1e-6)
    np.testing.assert_allclose(motion.velocity[-1], 0.0, atol=1e-6)
    np.testing.assert_allclose(motion.acceleration[-1], 0.0, atol=1e-5)
    assert np.linalg.norm(motion.pose[-1, :3] - [2, 1, 2]) > 0.01  # no pose was asked for
    dynamics = Dynamics(robot)
    w = dynamics.required_wrench(motion.pose[-1], np.zeros(6), np.zeros(6))
    assert solve(wrench_problem(robot, dynamics.wrench_matrix(motion.pose[-1]), w)).status == "optimal"


def test_positions_agree_with_the_velocities_by_differences():
    found = plan("cogiro", HALT)
    times, motion = found.audit.times, found.audit.motion
    by_differences = np.gradient(motion.pose, times, axis=0)
    np.testing.assert_allclose(by_differences[1:-1], motion.velocity[1:-1], atol=2e-3)


def test_its_place_costs_no_more_than_a_given_one():
    here = plan("cogiro", HALT)
    there = plan("cogiro", HALT | {"final": {"pose": [1.5, 0.8, 1.9, 0, 0, 0]}})
    assert there.feasible
    assert here.objective <= there.objective * (1 + 1e-6)


def test_zero_stands_for_six_zeros_in_files_too(tmp_path):
    task = read_task(HALT)
    assert task.final.velocity == (0.0,) * 6
    assert read_task(task.save(tmp_path / "halt.yaml")) == task
    with pytest.raises(InputError, match=r"final.velocity"):
        read_task(HALT | {"final": {"velocity": 1}})


@pytest.mark.parametrize(
    "ends", [{"final": {"velocity": 0}}, {"final": None, "tube": {"position": 3.0, "ends": "rest"}}]
)
def test_a_free_duration_of_a_path_that_moves_at_its_end_is_refused_in_one_line(ends):
    path = HALT["path"] | {"timing": "uniform"}
    with pytest.raises(InputError, match="duration must be a number, because a velocity is given at the") as error:
        plan("cogiro", HALT | {"path": path, "initial": None, "duration": {"min": 0.2, "max": 4}} | ends)
    assert "\n" not in str(error.value)
