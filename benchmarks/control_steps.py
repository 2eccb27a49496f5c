"""Random steps of closed loops over all robots: whether each is answered, inside limits and rates, and how.

    python -m towline.benchmarks.control_steps [--count 1000000] [--robots wang-flying,...] [--seed 0]

Each robot of the library is simulated in a batch whose platforms are kicked and displaced, while sensors report
nonsense now and then and references jump. Every command must be finite and inside the limits of tensions, rates and
actuators; every direction in which wrench is missing is checked against the step's problem.
"""

from __future__ import annotations

import argparse
import sys
import time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..control import ANSWERS, Command, ComputedTorque, Reference, State
from ..models import Robot, available, load
from ..plant import Plant
from ..plant.periods import Periods
from .machine import machine

__all__ = ["KINDS", "Steps", "random_steps"]

KINDS = ("kicked", "far off", "at an anchor", "no number", "huge", "wrong tensions")
ROWS = 250  # robots side by side
PERIOD = 1e-3

Array = NDArray[np.float64]


class Steps(NamedTuple):
    """Counts over a robot's steps.

    Attributes
    ----------
    answered
        How many steps were answered in each way of `ANSWERS`, (4,).
    proofs
        How many directions were checked.
    faults
        How many steps broke a promise, by the promise; empty if none did.
    seconds
        Of the controller, a step.
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


def random_steps(robot: Robot, count: int, seed: int) -> Steps:
    """Simulate at least `count` steps of a robot, a miss of the controller now and then."""
    rng, low, high = np.random.default_rng([seed, 1]), robot.t_min, robot.t_max
    rate = (high - low) / 0.02
    crowd, rows = Crowd(robot, ROWS, seed), ROWS
    controller = ComputedTorque(robot, rate=rate, reach=(0.3, 0.2))
    ends = [(a.low, a.high) for carrier in robot.carriers for a in carrier.actuators]
    weakest, strongest = np.array(ends).reshape(-1, 2).T if ends else np.zeros((2, 0))
    broken = dict.fromkeys(("finite", "inside limits", "inside rates", "actuators", "answered", "proof"), 0)
    answered, proofs, seconds, now, last = np.zeros(len(ANSWERS), dtype=np.int64), 0, 0.0, 0.0, None
    steps = -(-count // rows)
    for _ in range(steps):
        state, reference = crowd.measure(), crowd.reference()
        start = time.process_time()
        command = controller.step(now, state, reference)
        seconds += time.process_time() - start
        t, cut = command.tensions, controller.cut
        parts = (t, command.carrier_pose, command.carrier_velocity, command.carrier_acceleration)
        finite = [np.isfinite(part).reshape(rows, -1).all(axis=1) for part in parts]
        broken["finite"] += int((~np.logical_and.reduce(finite)).sum())
        inside = ((t >= low) & (t <= high)).all(axis=1)
        broken["inside limits"] += int((~inside).sum())
        if last is not None:
            near = cut | (np.abs(t - last[0]) <= rate * (now - last[1]) + 1e-12 * high)
            broken["inside rates"] += int((~near.all(axis=1)).sum())
        if command.actuation is not None:
            orders = command.actuation.reshape(rows, -1)
            well = (orders >= weakest) & (orders <= strongest)  # false for nan
            broken["actuators"] += int((~well.all(axis=1)).sum())
        ways = np.asarray(command.answered)
        broken["answered"] += int(((ways < 0) | (ways >= len(ANSWERS))).sum())
        answered += np.bincount(ways, minlength=len(ANSWERS))
        proven = np.flatnonzero(np.isfinite(command.direction).all(axis=1))
        problems = controller.problems
        A, w, bounds = problems.A[proven], problems.w[proven], problems.bounds[:, proven]
        along = np.einsum("nj,nji->ni", command.direction[proven], A)
        most = np.where(along > 0, along * bounds[1], along * bounds[0]).sum(axis=1)
        needed = np.einsum("nj,nj->n", command.direction[proven], w)
        proofs += proven.size
        broken["proof"] += int((~(needed > most)).sum())
        last = t, now
        crowd.move(command)
        now += PERIOD * (rng.integers(2, 60) if rng.random() < 0.02 else 1)
    return Steps(answered, proofs, {name: n for name, n in broken.items() if n}, seconds / (steps * rows))


def read_options(description: str | None, count: int) -> tuple[int, list[str], int]:
    """Return how many steps, of which robots and from which seed the command line requires; `count` by default."""
    parser = argparse.ArgumentParser(description=(description or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=count, help="steps of all robots together")
    parser.add_argument("--robots", default=",".join(available()), help="names, separated by commas")
    parser.add_argument("--seed", type=int, default=0, help="the first one; all are different")
    options = parser.parse_args()
    names = options.robots.split(",")
    if options.count < 1:
        parser.error(f"--count must be at least 1, got {options.count}")
    if unknown := set(names) - {*available()}:
        parser.error(f"--robots must be among {', '.join(available())}, got {', '.join(sorted(unknown))}")
    return options.count, names, options.seed


def main() -> None:
    """Run and report."""
    count, names, first = read_options(__doc__, 1_000_000)
    print(f"# Random steps of closed loops\n\nMeasured on {machine()}.\n")
    heads = [*ANSWERS, "directions proven", "broken promises", "controller [us]"]
    print(f"| robot | {' | '.join(heads)} |\n|---|{'---:|' * len(heads)}")
    total, well = 0, True
    for seed, name in enumerate(names, first):
        steps = random_steps(load(name), -(-count // len(names)), seed)
        total, well = total + int(steps.answered.sum()), well and not steps.faults
        faults = ", ".join(f"{count} not {promise}" for promise, count in steps.faults.items()) or "none"
        cells = [*steps.answered, steps.proofs, faults, f"{1e6 * steps.seconds:.2f}"]
        print(f"| {name} | {' | '.join(map(str, cells))} |", flush=True)
    print(f"\n{total} steps, {'each answered as promised' if well else 'some not as promised'}.")
    sys.exit(not well)


if __name__ == "__main__":
    main()
