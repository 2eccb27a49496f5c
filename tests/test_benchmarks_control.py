"""The benchmark of control: its condensed programs, who solves them right, and its checks of random flights."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from towline.base.errors import InputError
from towline.benchmarks.control import CONTENDERS, TASKS, Task, measure, record, run
from towline.benchmarks.control_contenders import REFERENCE, TOWLINE, Contender, condense, horizon_of
from towline.cli.bench import app
from towline.control import Predictive
from towline.models import load
from towline.simulation import simulate

from .soak.predictive_steps import Checked, fly_random

pytestmark = pytest.mark.usefixtures("stable_at_home")
FREE, TEAM = TASKS[0], TASKS[-1]
LIMITS = Task("limits", lambda: load("wang-flying"), (8, 5, 1), 2.0, reach=0.5, stage=0.015)


@pytest.fixture(scope="module")
def at_limits():
    """Programs of a flight whose tensions reach their limits."""
    return record(LIMITS, LIMITS.robot(), 200)


def test_condensed_costs_are_those_of_the_stages(at_limits):
    """Differences of the cost, which is added up here from states and controls."""
    program, rng = at_limits[150], np.random.default_rng(0)
    cost, slope = condense(program)
    totals = []
    for scale in (0.0, 1.0, 10.0):
        u, states = scale * rng.normal(size=program.r.shape), [program.start]
        for A, B, c, each in zip(program.A, program.B, program.c, u, strict=True):
            states.append(A @ states[-1] + B @ each + c)
        x = np.array(states)
        total = 0.5 * np.einsum("ki,kij,kj->", x, program.Q, x) + (program.q * x).sum()
        total += 0.5 * np.einsum("ki,kij,kj->", u, program.R, u) + (program.r * u).sum()
        totals.append((total, 0.5 * u.ravel() @ cost @ u.ravel() + slope @ u.ravel()))
    (nothing, _), *others = totals
    for total, own in others:
        assert own == pytest.approx(total - nothing, rel=1e-8)


def test_programs_of_a_flight_at_its_limits_converge_from_a_cold_start(at_limits):
    """With a correction in each step 18 went in circles. The first ones are at rest: all that is left is rounding."""
    touched = 0
    for program in at_limits[3:]:
        horizon = horizon_of(program, 1e-8, 50)
        assert horizon.solve()
        touched += np.isclose(horizon.controls[:, :6], program.u_min[:, :6]).any()
    assert touched > 50


def test_a_robot_at_rest_costs_few_iterations():
    """At the reference there is nothing left to do but rounding."""
    calm = Task("calm", lambda: load("wang-flying"), None, 0.0, reach=0.5)
    program = record(calm, calm.robot(), 20)[-1]
    horizon = horizon_of(program, 1e-6, 50)
    horizon.states[:], horizon.controls[:] = program.states, program.controls
    horizon.solve(warm=True)
    assert horizon.iterations <= 15
    assert max(horizon.residuals) <= 1e-3


def test_who_is_right_is_measured_as_right(at_limits):
    """Count those that are off or give nothing; most reach the optimum, some at a coarse tolerance."""
    prepare = CONTENDERS[0].prepare

    def wrong(first):
        solver = prepare(first)
        return solver._replace(solve=lambda given: solver.solve(given) + 1.0)

    silent = Contender("silent", "", lambda first: prepare(first)._replace(solve=lambda given: None))
    who = [*CONTENDERS, Contender("wrong", "", wrong), silent]
    rows = {row.contender: row for row in measure("task", at_limits[150:180], who)}
    for name, row in rows.items():
        assert row.programs == 30
        assert 0 < row.median_us <= row.p99_us
        if name in ("wrong", "silent"):
            assert row.failures == 30
        elif name.startswith(("towline", "condensed, daqp", "daqp", "acados")):
            assert row.failures == 0, row
            assert row.max_error < 1e-3, row
            assert row.residual < 1e-3, row
    assert rows["silent"].max_error is None
    assert rows["wrong"].max_error > 1e-3
    assert rows[REFERENCE].ratio == rows[TOWLINE].ratio_to_horizon == 1.0


def test_the_command_prints_what_the_design_says(monkeypatch):
    report = run(12, 1, [FREE, TEAM])
    monkeypatch.setattr("towline.benchmarks.control.run", lambda steps, seeds, progress: report)
    data = json.loads(CliRunner().invoke(app, ["control", "--json"]).stdout)
    for row in data["rows"]:
        assert {"task", "contender", "median_us", "p99_us", "ratio", "max_error", "failures"} <= set(row)
    assert {row["contender"] for row in data["rows"]} == {each.name for each in CONTENDERS}
    steps = {(row["task"], row["controller"]): row for row in data["steps"]}
    assert steps[FREE.name, "predictive"]["ratio"] > 1.0
    assert steps[FREE.name, "computed torque"]["ratio"] == 1.0
    assert steps[TEAM.name, "open loop"]["detail"].startswith("refused: robot must have no carriers that fly")
    text = CliRunner().invoke(app, ["control"]).stdout
    assert f"| {FREE.name} | predictive |" in text
    assert data["machine"] in text


@pytest.mark.parametrize(("steps", "seeds", "name"), [(0, 1, "steps"), (10, 0, "seeds")])
def test_wrong_numbers_are_refused(steps, seeds, name):
    with pytest.raises(InputError, match=f"{name} must be a whole number from 1"):
        run(steps, seeds)


@pytest.mark.parametrize("name", ["cogiro", "wang-flying", "wang-flying-quadrotor", "wang-ctmrts-4"])
def test_random_flights_are_answered_as_promised(name):
    """A few; `python -m tests.soak predictive` flies many."""
    robot = load(name)
    for seed in range(2):
        answered, broken = fly_random(robot, seed)
        assert answered.sum() > 20
        assert broken == {}


@pytest.mark.parametrize(
    ("change", "promise"),
    [
        (lambda command: command._replace(tensions=command.tensions + 1e4), "inside limits"),
        (lambda command: command._replace(tensions=command.tensions + 0.5), "inside rates"),
        (lambda command: command._replace(carrier_pose=np.nan * command.carrier_pose), "finite"),
        (lambda command: command._replace(direction=np.eye(6)[0], shortfall=np.array(1.0)), "proof"),
    ],
)
def test_broken_promises_are_noticed(change, promise):
    class Broken(Predictive):
        def step(self, time, state, reference):
            command = super().step(time, state, reference)
            return change(command) if time > 4.5e-3 else command

    robot = load("cogiro")
    checked = Checked(Broken(robot, rate=100.0), np.full(robot.m, 100.0), 0)
    simulate(robot, robot.home, checked, duration=0.01)
    assert checked.broken[promise] == 5
