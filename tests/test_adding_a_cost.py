"""The page on adding a cost: its example runs, and own costs are worth what the same terms of the objective are."""

import re
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from towline import Task, load, plan, sweep
from towline.base.errors import InputError
from towline.models.parsing import parse_yaml, to_yaml
from towline.ocp.audits.violation import cost
from towline.ocp.costs import Cost, RateCost
from towline.ocp.tasks.scenario import cost_list

PAGE = (Path(__file__).parent.parent / "docs" / "adding-a-cost.md").read_text()
(CODE,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
REST = {"path": {"kind": "rest", "pose": [0, 0, 1]}, "duration": 1}


@pytest.fixture(scope="module")
def example():
    names = {}
    exec(CODE, names)
    return names


def power(found):
    """Mean sum of the squared powers of all winches [W^2], from lengths and tensions over time alone."""
    audit, robot = found.audit, found.scenario.robot
    lengths = found.scenario.dynamics.cable_lengths(audit.motion.pose, np.broadcast_to(robot.carrier_home, (1, 6)))
    speeds = np.gradient(lengths, audit.times, axis=0)
    return np.mean(np.sum((audit.tensions * speeds) ** 2, axis=1))


def test_the_example_is_short():
    assert len([line for line in CODE.splitlines() if line.strip()]) <= 30


def test_what_the_example_charges_gets_less_at_the_expense_of_the_rest(example):
    usual, result = example["usual"], example["result"]
    assert usual.feasible
    assert result.feasible
    assert power(result) < 0.9 * power(usual)
    assert (result.audit.tracking_error**2).mean() > (usual.audit.tracking_error**2).mean()


class Pull(Cost):
    name, unit = "pull", "N"

    def values(self, state):
        return state.tensions


class PullRate(RateCost):
    name, unit = "pull_rate", "N/s"

    def values(self, state):
        return state.tensions


class Away(Cost):
    name, unit = "away", "m"

    def values(self, state):
        return ca.vertcat(*(carrier.pose for carrier in state.offsets[1:]))


class Near(Cost):
    """The places of `multi-quadrotor-3` at home, on a circle of 1 m radius, 1.5 m above the load, turned by its yaw."""

    name, unit = "near", "m"

    def values(self, state):
        x, y, z, _, _, yaw = ca.vertsplit(state.platform.pose)
        angles = [yaw + 2 * np.pi * k / 3 for k in range(3)]
        places = [ca.vertcat(x + ca.cos(angle), y + ca.sin(angle), z + 1.5) for angle in angles]
        return ca.vertcat(*(body.pose[:3] - place for body, place in zip(state.carriers, places, strict=True)))


class Hurry(Cost):
    name, unit, squared = "hurry", "s", False

    def values(self, state):
        return state.duration


WAY = {"kind": "line", "start": [0, 0, 1], "end": [0.6, 0.3, 1.4]}
GROUND = {"path": WAY, "duration": 2, "steps": 30, "tube": {"position": 0.2}}
TEAM = {
    "path": {"kind": "line", "start": [0, 0, 0], "end": [1, 0, 0.5]},
    "duration": 4,
    "steps": 20,
    "base": {"kind": "free"},
    "tube": {"position": 0.1},
}
TURNING = TEAM | {"path": {"kind": "line", "start": [0, 0, 0, 0, 0, 0], "end": [1, 0, 0.5, 0, 0, 0.6]}}


@pytest.mark.parametrize(
    ("robot", "task", "given", "own", "same"),
    [
        # Twice the squares are those of an amount less by the root of two.
        ("ipanema-1", GROUND, {"tension": 100.0}, Pull(100.0), {"tension": 100 / np.sqrt(2)}),
        ("ipanema-1", GROUND, {"tension_rate": 50.0}, PullRate(50.0), {"tension_rate": 50 / np.sqrt(2)}),
        ("multi-quadrotor-3", TEAM, {"carrier_offset": 0.2}, Away(0.2), {"carrier_offset": 0.2 / np.sqrt(2)}),
        ("multi-quadrotor-3", TURNING, {"formation": 0.5}, Near(0.5), {"formation": 0.5 / np.sqrt(2)}),
        ("ipanema-1", GROUND | {"duration": {"min": 1, "max": 4}}, {"time": 0.5}, Hurry(0.5), {"time": 0.25}),
    ],
)
def test_a_cost_of_ones_own_is_worth_what_the_same_term_of_the_objective_is(robot, task, given, own, same):
    mine, other = (plan(robot, task | {"objective": each}) for each in (given | {"own": (own,)}, same))
    assert mine.feasible
    assert other.feasible
    assert mine.objective == pytest.approx(other.objective, rel=1e-6)
    tensions = other.audit.tensions[: len(mine.audit.tensions)]
    np.testing.assert_allclose(mine.audit.tensions, tensions, rtol=1e-3, atol=1e-9)  # what is slack has rounding


@pytest.mark.parametrize(
    ("robot", "base", "amount"),
    [
        ("multi-quadrotor-3", {"kind": "free"}, np.hypot(0.7, 1.45)),  # the length of its cables [m]
        ("multi-quadrotor-3", {"kind": "free", "around": {"quad1": {"kind": "rest", "pose": [1, 0, 1.5]}}}, None),
        ("multi-quadrotor-3", {"kind": "hold"}, None),
        ("wang-flying", {"kind": "free"}, None),  # one carrier
    ],
)
def test_several_free_carriers_without_a_reference_have_a_formation(robot, base, amount):
    task = Task.model_validate(REST | {"base": base})
    amounts = [each.amount for each in cost_list(load(robot), task).all if each.name == "formation"]
    assert amounts == ([] if amount is None else [pytest.approx(amount, rel=1e-9)])


def test_a_time_law_is_chosen_by_costs_of_ones_own_too():
    objective = {"tension": 100.0, "own": (Pull(50.0), PullRate(9.0))}
    found = plan("ipanema-1", {"path": WAY, "duration": 2, "objective": objective})
    tensions = found.audit.tensions
    rates = np.diff(tensions, axis=0) / np.diff(found.audit.times)[:, None]
    expected = (
        np.sum((tensions / 100) ** 2 + (tensions / 50) ** 2, axis=1).mean() + np.sum((rates / 9) ** 2, axis=1).mean()
    )
    assert cost(found) == pytest.approx(expected, rel=1e-9)


def test_a_plan_with_the_cost_is_saved_without_it_and_its_task_is_no_file(example, tmp_path):
    result = example["result"]
    result.save(tmp_path / "plan.nc")
    assert parse_yaml(result.trajectory.attrs["task"], Task, "task").objective.own == ()
    with pytest.raises(InputError, match=r"objective.own must be empty to be saved, .*'winch_power'"):
        to_yaml(result.scenario.task)
    assert "own" not in Task.model_json_schema()["$defs"]["Objective"]["properties"]


@pytest.mark.parametrize("wrong", ["winch_power", 3, Pull(0.0), Pull(-1.0), Pull(np.nan), Pull(np.inf)])
def test_what_is_no_cost_is_refused(wrong):
    with pytest.raises(InputError, match=r"objective.own|amount of cost 'pull' must be a number"):
        Task.model_validate(REST | {"objective": {"own": [wrong]}})


def test_a_sweep_keeps_the_cost():
    task = GROUND | {"objective": {"own": (Pull(10.0),)}}
    table = sweep("ipanema-1", task, {"duration": [1.5, 2.0]})
    assert float(table.rows[1].cost) == pytest.approx(plan("ipanema-1", task).objective, rel=1e-9)
