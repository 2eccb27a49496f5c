"""Teams past obstacles: slowly first, on few steps, and what lies between the nodes tightened there."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline import Task, plan
from towline.models import load
from towline.ocp.nlp import solver
from towline.ocp.nlp.program import build
from towline.ocp.nlp.rows import Mesh
from towline.ocp.tasks.lay_out import lay_out

from .soak.random_families import random_task


def test_a_minimum_time_past_a_ball_is_found_from_a_slow_motion():
    robot, task = random_task("team", 4)
    planned = plan(robot, task.model_copy(update={"steps": 24}))
    assert planned.feasible
    ball = task.limits.keep_out[0]
    times = np.linspace(0.0, planned.scenario.duration, 4001)
    platform, carriers = planned.scenario.motion(times, planned.deviation)
    centre = np.array(ball.centre)
    assert np.linalg.norm(platform.pose[:, :3] - centre, axis=1).min() >= ball.radius + ball.platform - 1e-6
    assert np.linalg.norm(carriers.pose[..., :3] - centre, axis=2).min() >= ball.radius + ball.carriers - 1e-6
    # What the first solution exceeds between nodes did not take a finer mesh.
    assert any(stage.name.startswith("program with linear distances") for stage in planned.stages)
    audits = [stage.message for stage in planned.stages if stage.name == "audit"]
    assert len(audits) > 1
    assert audits[-1] == "passed"
    assert {stage.name.split(", ")[1] for stage in planned.stages if stage.name.startswith("nonlinear")} == {"24 steps"}


def test_an_equation_missed_between_nodes_takes_finer_meshes_each_once():
    """The thrust of a quadrotor points along its axis at the nodes: tighter bounds of that change nothing between."""
    towed = {
        "path": {"kind": "line", "start": [0, 0, -1], "end": [0.25, 0.1, -0.8]},
        "duration": 1.0,
        "steps": 20,
        "scheme": "linear",
        "base": {"kind": "free", "ends": "rest"},
        "tube": {"position": "free", "attitude": 0.3, "ends": "exact"},
        "objective": {"deviation": 0.3},
    }
    planned = plan("wang-flying-quadrotor", towed)
    assert planned.feasible
    steps = [int(stage.name.split()[2]) for stage in planned.stages if stage.name.startswith("nonlinear")]
    assert len(steps) > 1
    assert steps == sorted(set(steps))
    # By default the same nodes are tried once with the scheme hermite.
    del towed["scheme"]
    again = plan("wang-flying-quadrotor", towed)
    assert again.feasible
    assert again.scenario.scheme.name == "hermite"
    steps = [int(stage.name.split()[2]) for stage in again.stages if stage.name.startswith("nonlinear")]
    assert steps[1:] == sorted(set(steps))
    # By Newton's law the thrust is along the axis at all instants, but for a thousandth of the weight.
    robot, seen = planned.scenario.robot, planned.audit
    anchors, attachments = planned.scenario.dynamics.points(seen.motion.pose, seen.carriers.pose)
    pulls = (
        (attachments - anchors) / np.linalg.norm(attachments - anchors, axis=2)[..., None] * seen.tensions[..., None]
    )
    weight = robot.carriers[0].mass * np.array(robot.gravity)
    force = robot.carriers[0].mass * seen.carriers.acceleration[:, 0, :3] - weight - pulls.sum(axis=1)
    axis = Rotation.from_euler("ZYX", seen.carriers.pose[:, 0, 5:2:-1]).apply([0, 0, 1])
    across = force - (force * axis).sum(axis=1)[:, None] * axis
    assert np.linalg.norm(across, axis=1).max() <= 2e-3 * np.linalg.norm(weight)


def team():
    task = {
        "path": {"kind": "line", "start": [0, 0, 0], "end": [1.5, 0, 0.3]},
        "duration": 1.5,
        "base": {"kind": "free", "ends": "rest"},
        "tube": {"position": 0.1, "attitude": 0.2},
    }
    return "multi-quadrotor-3", task


def past_a_ball():
    ball = {"kind": "sphere", "centre": [0, 0.1, 1.5], "radius": 0.5, "platform": 0.1, "cables": None}
    task = {
        "path": {"kind": "line", "start": [-3, 0, 1.5], "end": [3, 0.5, 1.5]},
        "duration": 8,
        "tube": {"position": "free", "attitude": 0.2, "ends": "rest"},
        "limits": {"keep_out": [ball]},
    }
    return "cogiro", task


@pytest.mark.parametrize("case", [team, past_a_ball])
def test_near_an_optimum_a_run_ends_at_one_barrier_a_thousandth_above_the_least(case, monkeypatch):
    """Interior points of a convex program are above its least objective by the barrier for each bound."""
    name, task = case()
    scenario = lay_out(load(name), Task.model_validate(task))
    coarse = solver.Solver(build(scenario, Mesh(15))).solve(None)
    program = build(scenario, Mesh(45))
    start = coarse.deviation.at(program.shares * coarse.duration)

    def ended(above):
        monkeypatch.setattr(solver, "ABOVE", above)
        run = solver.Solver(program)
        first = run.solve(start, coarser=True)
        run.program = program.tightened(Mesh(45, shrink=1e-3))
        return first, run.solve(None)

    near, least = ended(solver.ABOVE), ended(0.0)
    for one, other in zip(near, least, strict=True):
        assert one.success
        assert other.success
        assert other.objective < one.objective < 1.001 * other.objective
    assert near[0].iterations < 0.8 * least[0].iterations
    assert near[1].iterations <= 4  # from the solution at the same barrier; with a smaller one it takes twice as many
    assert solver.Solver(program).solve(start).objective > (1 - 1e-6) * least[0].objective
