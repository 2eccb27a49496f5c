"""Teams past obstacles: slowly first, on few steps, and what lies between the nodes tightened there."""

import numpy as np

from towline import plan

from .soak.random_families import random_task


def test_a_minimum_time_past_a_ball_is_found_from_a_slow_motion():
    # From a guess at moderate speed the program ended after 400 iterations without a solution.
    name, task = random_task("team", 17)
    planned = plan(name, task)
    assert planned.feasible
    ball = task.limits.keep_out[0]
    times = np.linspace(0.0, planned.scenario.duration, 4001)
    platform, carriers = planned.scenario.motion(times, planned.deviation)
    centre = np.array(ball.centre)
    assert np.linalg.norm(platform.pose[:, :3] - centre, axis=1).min() >= ball.radius + ball.platform - 1e-6
    assert np.linalg.norm(carriers.pose[..., :3] - centre, axis=2).min() >= ball.radius + ball.carriers - 1e-6
    # What the first solution exceeds between nodes did not take a finer mesh.
    audits = [stage.message for stage in planned.stages if stage.name == "audit"]
    assert len(audits) > 1
    assert audits[-1] == "passed"
    assert {stage.name.split(", ")[1] for stage in planned.stages if stage.name.startswith("nonlinear")} == {"50 steps"}
