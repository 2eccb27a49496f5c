"""Random flights of predictive control: whether each command is finite, and inside limits and rates.

    python -m tests.soak predictive [--start 0] [--count 100000] [--only wang-flying,...]

Each robot of the library that `Predictive` accepts is flown in short flights with random pushes, wind and gusts,
sensors that have noise, bias and delay and report nonsense now and then, references that rest or move, cables that
tear, winches that stop, carriers that lose their thrust, and steps that the controller misses. Limits of rates, reach,
bandwidth and horizon are random too. For each broken promise the first case is printed: robot, seed and step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from typing_extensions import override

from towline.base.errors import InputError
from towline.benchmarks.harness import head, row
from towline.control import ANSWERS, Command, Controller, Predictive, Reference, State
from towline.models import Robot, load
from towline.plant.steps import default_drive
from towline.simulation import simulate

from .control_steps import kept

__all__ = ["Checked", "fly_random"]

PERIODS, PERIOD = 200, 1e-3
NONSENSE = 0.005  # of the steps


class Checked(Controller):
    """Predictive control whose commands are checked, and whose sensors report nonsense now and then.

    Attributes:
        answered: How many steps were answered in each way of `ANSWERS`.
        broken: The step in which each promise was broken first.
    """

    batches = True  # so that a flight uses this one and no copy

    def __init__(self, controller: Predictive, rate: np.ndarray, seed: int):
        self._controller, self._rate, self._rng = controller, rate, np.random.default_rng([seed, 7])
        self.answered = np.zeros(len(ANSWERS), dtype=np.int64)
        self.broken: dict[str, int] = {}
        self._last: tuple[np.ndarray, float] | None = None

    @override
    def reset(self) -> None:
        self._controller.reset()

    @override
    def follow(self, references: Sequence[Reference], period: float, start: float = 0.0) -> None:
        if self._rng.random() < 0.8:  # without, it sees only the reference of now
            self._controller.follow(references, period, start)

    @override
    def step(self, time: float, state: State, reference: Reference) -> Command:
        """Return the checked command."""
        if self._rng.random() < NONSENSE:
            state = self._nonsense(state)
        command = self._controller.step(time, state, reference)
        for promise, well in kept(self._controller, command, self._rate, time, self._last).items():
            if not well.all():
                self.broken.setdefault(promise, int(self.answered.sum()))
        self.answered[int(command.answered)] += 1
        self._last = command.tensions.copy(), time
        return command

    def _nonsense(self, state: State) -> State:
        parts = [np.array(part) for part in (state.pose, state.velocity, state.carrier_pose, state.carrier_velocity)]
        part = parts[self._rng.integers(4)]
        huge = 10.0 ** self._rng.uniform(1, 308)
        part.flat[self._rng.integers(part.size)] = self._rng.choice([np.nan, np.inf, -np.inf, huge, -huge])
        return State(parts[0], parts[1], parts[2], parts[3], state.tensions)


def fly_random(robot: Robot, seed: int) -> tuple[np.ndarray, dict[str, int]]:
    """Fly once, and return the counts of answers, (4,), and the first step in which each promise was broken.

    Raises:
        InputError: If predictive control does not accept the robot.
    """
    rng, span = np.random.default_rng(seed), robot.t_max - robot.t_min
    rate = span / 10 ** rng.uniform(-2.5, 0) if rng.random() < 0.5 else np.full(robot.m, np.inf)
    controller = Predictive(
        robot,
        bandwidth=10 ** rng.uniform(0, 2),
        stages=int(rng.integers(1, 25)),
        stage=10 ** rng.uniform(-3, -1),
        reach=(rng.choice([0.0, 0.5]), rng.choice([0.0, 0.2])),
        rate=None if np.isinf(rate).all() else rate,
        observer=rng.choice([0.0, 10.0, 60.0]),
    )
    checked = Checked(controller, rate, seed)
    try:
        simulate(robot, _reference(robot, rng), checked, seed=seed, period=PERIOD, **_conditions(robot, rng))
    except InputError:  # of a command that no plant can follow
        if not checked.broken:
            raise
    return checked.answered, checked.broken


def _reference(robot: Robot, rng: np.random.Generator) -> Any:
    """Return a rest off home, or a circle of any size."""
    size = 0.2 * float(np.ptp(np.vstack([robot.home_anchors, robot.home[None, :3]]), axis=0).max()) or 0.2
    mask = robot.dof_mask.astype(bool)
    if rng.random() < 0.5 or not mask[:2].all():
        return robot.home + 10 ** rng.uniform(-3, 0) * size * np.repeat([1.0, 0.3], 3) * rng.normal(size=6) * mask
    centre, radius = robot.home[:3].tolist(), size * 10 ** rng.uniform(-1, 0)
    return {"kind": "circle", "centre": centre, "radius": radius, "rate": rng.uniform(0.1, 6.0)}


def _conditions(robot: Robot, rng: np.random.Generator) -> dict[str, Any]:
    """Return what `simulate` is given beside the reference."""
    duration = PERIODS * PERIOD
    weight, arm = 9.81 * robot.platform.mass, 0.1 * robot.length
    given: dict[str, Any] = {"duration": duration}
    if rng.random() < 0.7:
        size = weight * 10 ** rng.uniform(-3, 0.3)
        given["disturbance"] = size * np.repeat([1.0, arm], 3) * rng.normal(size=6) * robot.dof_mask
    if robot.platform.aero is not None:
        given |= {"wind": 5 * rng.normal(size=3), "gusts": rng.choice([0.0, 1.0, 4.0])}
    if rng.random() < 0.7:
        low = 10 ** rng.uniform(-5, -2)
        given["noise"] = {
            "position": low,
            "attitude": low,
            "velocity": 10 * low,
            "attitude_rate": 10 * low,
            "tension": 10 * low * float(robot.t_max.max()),
            "position_bias": low,
            "delay": float(rng.choice([0.0, 0.002, 0.02])),
        }
    flying = [carrier.name for carrier in robot.carriers if carrier.actuators]
    sticks = robot.fixed_lengths is None and default_drive(robot) != "tensions"
    kinds = ["cut", *["stick"] * sticks, *["miss"] * 4, *["lose"] * bool(flying)]
    faults = []
    for _ in range(rng.integers(0, 4)):
        kind, at = rng.choice(kinds), rng.uniform(0, 0.95 * duration)
        part = f"{rng.integers(robot.m) + 1}"
        if kind == "miss":
            part = f"{10 ** rng.uniform(-3, -1):.6f}"
        elif kind == "lose":
            part = str(rng.choice(flying))
        faults.append(f"{kind} {part} at {at:.6f}")
    return given | {"events": faults}


def soak(start: int, count: int, robots: Sequence[str]) -> bool:
    """Fly `count` steps of all robots together, print a table, and return whether each keeps every promise."""
    print(head(" | ".join(["robot", *ANSWERS, "broken promises"])))
    flights, well = -(-count // (PERIODS * len(robots))), True
    for number, name in enumerate(robots):
        robot, answered, firsts = load(name), np.zeros(len(ANSWERS), dtype=np.int64), dict[str, str]()
        try:
            Predictive(robot, stages=1)
        except InputError as error:
            print(row(name, *["-"] * len(ANSWERS), f"left out: {error}"))
            continue
        first = start + number * flights
        for seed in range(first, first + flights):
            counts, broken = fly_random(robot, seed)
            answered += counts
            for promise, step in broken.items():
                firsts.setdefault(promise, f"not {promise}: seed {seed}, step {step}")
        well &= not firsts
        print(row(name, *answered, ", ".join(firsts.values()) or "none"), flush=True)
    return well
