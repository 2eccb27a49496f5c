"""How often `Predictive` hands over to computed torque in flights with nothing wrong: never, if its rules are right.

    python -m tests.soak silence [--start 0] [--count 100] [--only cogiro,...]

Each run holds home, with a push of up to 5 % of the weight, a mass up to 5 % off the robot's file, and noise up to that
of `ENCODERS` or `CAPTURE`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from towline.control import Predictive
from towline.models import Robot, load
from towline.simulation import Simulation, simulate

ROBOTS = (
    "wang-flying",
    "cogiro",
    "ipanema-1",
    "wang-ctmrts-6",
    "wang-ctmrts-4",
    "multi-quadrotor-3",
    "multi-quadrotor-4",
)
DURATION = 0.3  # [s]
# Standard deviations of sensors: of encoders, and of motion capture for teams and towing robots [m, rad, s, 1].
ENCODERS = {"position": 1e-4, "attitude": 1e-4, "velocity": 1e-3, "attitude_rate": 1e-3}
CAPTURE = {"position": 1e-3, "attitude": 1e-3, "velocity": 1e-2, "attitude_rate": 1e-2}
PUSH, MASS, TENSION = 0.05, 0.05, 0.01  # of the weight, of the mass, and of the weight as noise of tensions


def heavier(robot: Robot, share: float) -> Robot:
    """Return a robot whose platform has `share` more mass and inertia."""
    data = robot.model_dump(mode="json")
    data["platform"]["mass"] *= 1 + share
    data["platform"]["inertia"] = [(1 + share) * each for each in data["platform"]["inertia"]]
    return Robot.model_validate(data)


def fly(robot: Robot, controller: Predictive, seed: int) -> Simulation:
    """Fly a run, which its seed determines."""
    rng = np.random.default_rng([seed, 5])
    correct = robot.fixed_lengths is not None or robot.m < len(robot.platform.dof)
    noise = {name: rng.uniform() * most for name, most in (CAPTURE if correct else ENCODERS).items()}
    noise["tension"] = rng.uniform() * TENSION * robot.weight
    push = np.append(PUSH * robot.weight * rng.uniform(-1, 1, 3), np.zeros(3))
    true = heavier(robot, MASS * rng.uniform(-1, 1))
    return simulate(true, robot.home, controller, duration=DURATION, noise=noise, disturbance=push, seed=seed)


def soak(start: int, count: int, robots: Sequence[str]) -> bool:
    """Fly `count` runs, print those that were handed over, and return whether none was."""
    known = {name: load(name) for name in robots}
    controllers = {name: Predictive(robot) for name, robot in known.items()}
    reported = 0
    for seed in range(start, start + count):
        name = robots[seed % len(robots)]
        over = fly(known[name], controllers[name], seed).handed_over
        if over is not None:
            reported += 1
            print(f"{name}, seed {seed}: computed torque from t = {over:.3f} s on", flush=True)
    print(f"{reported} of {count} runs were handed over")
    return not reported
