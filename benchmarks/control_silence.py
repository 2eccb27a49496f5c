"""How often `Predictive` hands over to computed torque in flights with nothing wrong: never, if its rules are right.

    python -m towline.benchmarks.control_silence [--runs 100] [--robots cogiro,...]

Each run holds home, with a push of up to 5 % of the weight, a mass up to 5 % off the robot's file, and noise up to that
of `ENCODERS` or `CAPTURE`. The exit code is 0 if no run is handed over.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser
from collections.abc import Sequence

import numpy as np

from ..control import Predictive
from ..models import Robot, load
from ..simulation import Simulation, simulate

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


def run(runs: int, robots: Sequence[str] = ROBOTS) -> list[tuple[str, int, float]]:
    """Return robot, seed and time [s] of the runs that were handed over."""
    reported: list[tuple[str, int, float]] = []
    known = {name: load(name) for name in robots}
    controllers = {name: Predictive(robot) for name, robot in known.items()}
    for seed in range(runs):
        name = robots[seed % len(robots)]
        over = fly(known[name], controllers[name], seed).handed_over
        if over is not None:
            reported.append((name, seed, over))
    return reported


def main(arguments: Sequence[str] | None = None) -> None:
    """Fly and print."""
    parser = ArgumentParser(prog="python -m towline.benchmarks.control_silence", description="Good flights.")
    parser.add_argument("--runs", type=int, default=100, help="default: 100")
    parser.add_argument("--robots", default=",".join(ROBOTS), help="names, by commas")
    given = parser.parse_args(arguments)
    reported = run(given.runs, given.robots.split(","))
    for name, seed, time in reported:
        print(f"{name}, seed {seed}: computed torque from t = {time:.3f} s on")
    print(f"{len(reported)} of {given.runs} runs were handed over")
    sys.exit(bool(reported))


if __name__ == "__main__":
    main()
