"""Random steps of closed loops over all robots: whether each is answered, inside limits and rates, and how.

    python -m tests.soak control [--start 0] [--count 1000000] [--only wang-flying,...]

Each robot of the library is simulated in a batch whose platforms are kicked and displaced, while sensors report
nonsense now and then and references jump. Every command must be finite and inside the limits of tensions, rates and
actuators; every direction in which wrench is missing is checked against the step's problem.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from towline.benchmarks import harness
from towline.control import ANSWERS, Command, ComputedTorque, Predictive, Reference, State
from towline.models import Robot, load
from towline.plant import Plant
from towline.plant.steps import Periods

__all__ = ["KINDS", "Steps", "kept", "random_steps", "soak"]

KINDS = ("kicked", "far off", "at an anchor", "no number", "huge", "wrong tensions")
ROWS = 250  # robots side by side
PERIOD = 1e-3

Array = NDArray[np.float64]


class Steps(NamedTuple):
    """Counts over a robot's steps.

    Attributes:
        answered: How many steps were answered in each way of `ANSWERS`, (4,).
        proofs: How many directions were checked.
        faults: How many steps broke a promise, by the promise; empty if none did.
        seconds: Of the controller, a step.
    """

    answered: NDArray[np.int64]
    proofs: int
    faults: dict[str, int]
    seconds: float


class Crowd:
    """Many of one robot, each with a state of its own: what sensors report of them, and what commands do to them."""

    def __init__(self, robot: Robot, rows: int, seed: int):
        self._robot, self._rng, self._rows = robot, np.random.default_rng(seed), rows
        self._plant = Plant(robot, drive="tensions")
        self._periods = Periods(self._plant, PERIOD, 1)
        ends = np.vstack([robot.home_anchors, robot.home[None, :3]])
        self._size = float(np.ptp(ends, axis=0).max()) or 1.0
        self._states = self._begun(rows)
        self._tensions = np.tile(robot.t_min, (rows, 1))

    def _begun(self, count: int) -> Array:
        """Return states near home, at rest."""
        pose = self._robot.home + self._rng.normal(size=(count, 6)) * 0.01 * self._robot.dof_mask
        return self._plant.start(pose, tensions=np.tile(self._robot.t_min, (count, 1)))

    def measure(self) -> State:
        """Return the truth, but for a third of the robots one of `KINDS`."""
        rng, robot, rows = self._rng, self._robot, self._rows
        now = self._plant.read(self._states)
        parts = [np.array(part) for part in (now.pose, now.velocity, now.carrier_pose, now.carrier_velocity)]
        pose, velocity, carriers, moving = parts
        tensions = np.maximum(self._tensions + rng.normal(size=(rows, robot.m)) * 1e-3 * robot.t_max, 0.0)
        kind = np.where(rng.random(rows) < 0.35, rng.integers(len(KINDS), size=rows), -1)

        def chosen(name: str) -> NDArray[np.intp]:
            return np.flatnonzero(kind == KINDS.index(name))

        kicked, far, at = chosen("kicked"), chosen("far off"), chosen("at an anchor")
        velocity[kicked] += 10.0 ** rng.uniform(-2, 2, (kicked.size, 1)) * rng.normal(size=(kicked.size, 6))
        scale = self._size * 10.0 ** rng.uniform(-2, 3, (far.size, 1))
        pose[far, :3] += scale * rng.normal(size=(far.size, 3))
        pose[far, 3:] = rng.uniform(-7, 7, (far.size, 3))
        carriers[far] += scale[:, None] * rng.normal(size=carriers[far].shape)
        cable = rng.integers(robot.m, size=at.size)
        pose[at, :3], pose[at, 3:] = robot.home_anchors[cable] - robot.attachments[cable], 0.0
        carriers[at] = robot.carrier_home
        for name in ("no number", "huge"):
            for row in chosen(name):
                part = parts[rng.integers(4)][row]
                huge = rng.choice([-1, 1]) * 10.0 ** rng.uniform(3, 308)
                part.flat[rng.integers(part.size)] = huge if name == "huge" else rng.choice([np.nan, np.inf, -np.inf])
        tensions[chosen("wrong tensions")] = rng.choice([np.nan, 0.0, np.inf, 1e300])
        return State(pose, velocity, carriers, moving, tensions)

    def reference(self) -> Reference:
        """Return a reference for each robot: home, moved and with motions from none to impossible ones."""
        rng, robot, rows = self._rng, self._robot, self._rows
        mask = robot.dof_mask
        size = 10.0 ** rng.uniform(-4, 2, (3, rows, 1)) * (rng.random((3, rows, 1)) < 0.3)
        pose = robot.home + 0.1 * size[0] * rng.normal(size=(rows, 6)) * mask
        velocity, acceleration = size[1:] * rng.normal(size=(2, rows, 6)) * mask
        carriers, still = np.tile(robot.carrier_home, (rows, 1, 1)), np.zeros((rows, len(robot.carriers), 6))
        tensions = robot.t_min + rng.random((rows, robot.m)) * 0.3 * (robot.t_max - robot.t_min)
        return Reference(pose, velocity, acceleration, carriers, still, still, tensions)

    def move(self, command: Command) -> None:
        """Go through a period, and begin again with those that have gone too far."""
        given = (command.tensions, command.actuation, command.carrier_pose, command.carrier_velocity)
        rows = self._plant.command(*given, command.carrier_acceleration)
        history, self._tensions = np.zeros((self._rows, 2, self._plant.size)), command.tensions
        self._periods.run(self._states, rows[:, None], history, np.zeros((self._rows, 2, self._robot.m)))
        self._states = history[:, 1].copy()
        gone = ~(np.abs(self._states).max(axis=1) < 1e3 * self._size) | (self._rng.random(self._rows) < 1e-3)
        if gone.any():
            self._states[gone] = self._begun(int(gone.sum()))


def kept(
    controller: ComputedTorque | Predictive, command: Command, rate: Array, now: float, last: tuple[Array, float] | None
) -> dict[str, NDArray[np.bool_]]:
    """Return whether each robot's command, of one or of many, keeps each promise, (rows,).

    `rate` limits the tensions [N/s], and `last` has tensions and time of the command before. A direction proves that
    wrench is missing if no tensions inside the bounds give as much along it as is required.
    """
    robot, t = controller.robot, np.atleast_2d(command.tensions)
    rows = len(t)
    parts = (t, command.carrier_pose, command.carrier_velocity, command.carrier_acceleration)
    ways, direction = np.atleast_1d(command.answered), np.atleast_2d(command.direction)
    problems = controller.problems
    along = np.einsum("nj,nji->ni", direction, problems.A)
    most = np.where(along > 0, along * problems.bounds[1], along * problems.bounds[0]).sum(axis=1)
    found: dict[str, Any] = {
        "finite": np.all([np.isfinite(part).reshape(rows, -1).all(axis=1) for part in parts], axis=0),
        "inside limits": ((t >= robot.t_min) & (t <= robot.t_max)).all(axis=1),
        "answered": (ways >= 0) & (ways < len(ANSWERS)),
        "proof": ~np.isfinite(direction).all(axis=1) | (np.einsum("nj,nj->n", direction, problems.w) > most),
    }
    if last is not None:
        near = np.abs(t - last[0]) <= rate * (now - last[1]) + 1e-12 * robot.t_max
        found["inside rates"] = (controller.cut | near).all(axis=1)
    if command.actuation is not None:
        ends = [(a.low, a.high) for carrier in robot.carriers for a in carrier.actuators]
        (weakest, strongest), orders = np.array(ends).reshape(-1, 2).T, command.actuation.reshape(rows, -1)
        found["actuators"] = ((orders >= weakest) & (orders <= strongest)).all(axis=1)  # false for nan
    return found


def random_steps(robot: Robot, count: int, seed: int) -> Steps:
    """Simulate at least `count` steps of a robot, a miss of the controller now and then."""
    rng, rate = np.random.default_rng([seed, 1]), (robot.t_max - robot.t_min) / 0.02
    crowd, controller = Crowd(robot, ROWS, seed), ComputedTorque(robot, rate=rate, reach=(0.3, 0.2))
    broken = Counter[str]()
    answered, proofs, seconds, now, last = np.zeros(len(ANSWERS), dtype=np.int64), 0, 0.0, 0.0, None
    steps = -(-count // ROWS)
    for _ in range(steps):
        state, reference = crowd.measure(), crowd.reference()
        start = time.process_time()
        command = controller.step(now, state, reference)
        seconds += time.process_time() - start
        broken.update({name: int((~well).sum()) for name, well in kept(controller, command, rate, now, last).items()})
        answered += np.bincount(np.asarray(command.answered), minlength=len(ANSWERS))
        proofs += int(np.isfinite(command.direction).all(axis=1).sum())
        last = command.tensions, now
        crowd.move(command)
        now += PERIOD * (rng.integers(2, 60) if rng.random() < 0.02 else 1)
    return Steps(answered, proofs, {name: n for name, n in broken.items() if n}, seconds / (steps * ROWS))


def soak(start: int, count: int, robots: Sequence[str]) -> bool:
    """Simulate `count` steps of all robots together, print a table, and return whether each keeps every promise."""
    print(harness.head(" | ".join(["robot", *ANSWERS, "directions proven", "broken promises", "controller [us]"])))
    well = True
    for seed, name in enumerate(robots, start):
        steps = random_steps(load(name), -(-count // len(robots)), seed)
        well &= not steps.faults
        faults = ", ".join(f"{count} not {promise}" for promise, count in steps.faults.items()) or "none"
        print(harness.row(name, *steps.answered, steps.proofs, faults, f"{1e6 * steps.seconds:.2f}"), flush=True)
    return well
