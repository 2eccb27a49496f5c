"""Teams past obstacles: slowly first, on few steps, and what lies between the nodes tightened there."""

import numpy as np
from scipy.spatial.transform import Rotation

from towline import plan

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
