"""Measure how long planning again takes in flight, and what jumps.

    python -m tests.soak replanning [--start 0] [--count 100]

Paper F's robot flies the circle of 1 m that its quadrotor can follow, in gusts, with predictive control. On the way the
rest is planned `--count` times from where the robot is, and the controller continues with the new plan. It is wrong if
a plan is not feasible, if a new plan does not start where the robot is or with the tensions of the last one, if a
tension that is commanded changes faster than its limit, or if a call after the first takes longer than 50 ms.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from typing_extensions import override

from towline.control import Command, Controller, Predictive, Reference, State
from towline.models import load
from towline.ocp import Plan, Planner
from towline.simulation import Simulation, simulate

__all__ = ["CIRCLE", "Replanned", "Replanning", "fly"]

ROBOT = "wang-flying"
HOVER = [50, 50, 100, 0, 0, 0]
CIRCLE: dict[str, Any] = {
    "name": "circle",
    "path": {"kind": "circle", "centre": [50, 50, 99], "radius": 1.0, "rate": 0.2 * np.pi},
    "base": {
        "kind": "free",
        "around": {"quad": {"kind": "rest", "pose": HOVER}},
        "acceleration_max": 3.0,
        "ends": "periodic",
    },
}
PERIOD = 1e-3  # [s]
RATE = 200.0  # [N/s], of commanded tensions
WIND, GUSTS = [3.0, 2.0, 0.3], 1.5  # [m/s]
BANDWIDTH, OBSERVER = 8.0, 1.0  # [rad/s], so low that the wind moves the platform by centimetres
LONGEST = 0.05  # [s]
SAME = 1e-9  # [m, rad, and per second], of where a plan starts
TENSION = 2e-3  # [N], of what it starts with


class Replanned(NamedTuple):
    """One call of `replan`: what it took, how far the robot was off its path, and what jumps.

    Attributes:
        seconds, processor: Wall time, and time of the processor, which does not depend on what else the machine does
            [s].
        off: Distance of the platform from the circle [m].
        gap: Largest difference of pose and velocity between the start of the plan and the state [m, rad, and per
            second].
        jump: Largest difference of the tensions between the last plan and the start of this one [N].
    """

    seconds: float
    processor: float
    feasible: bool
    off: float
    gap: float
    jump: float


class Replanning(Controller):
    """Predictive control that plans the rest of the motion again at given times.

    Args:
        planner, first: Whose `plan` led to the first plan.
        times: When to plan again [s].
    """

    batches = True  # so that it is not copied, as its planner cannot be; it flies alone

    def __init__(self, planner: Planner, first: Plan, times: np.ndarray):
        self._planner, self._first, self._times = planner, first, times
        robot = first.scenario.robot
        self._control = Predictive(robot, BANDWIDTH, rate=RATE, observer=OBSERVER)
        self.replanned: list[Replanned] = []
        self.rate_max = 0.0  # of commanded tensions [N/s]
        self._take(first, 0.0)

    def _take(self, plan: Plan, start: float) -> None:
        """Follow a plan from now on."""
        self.last, self._start = plan, start
        self._references = references(plan, PERIOD)
        self._control.follow(self._references, PERIOD, start)

    @override
    def reset(self) -> None:
        self._control.reset()
        self.replanned, self._last = [], None
        self._take(self._first, 0.0)

    @override
    def step(self, time: float, state: State, reference: Reference) -> Command:
        if len(self.replanned) < len(self._times) and time >= self._times[len(self.replanned)] - PERIOD / 2:
            self._replan(time, state)
        k = min(round((time - self._start) / PERIOD), len(self._references) - 1)
        command = self._control.step(time, state, self._references[k])
        if self._last is not None:
            self.rate_max = max(self.rate_max, float(np.abs(command.tensions - self._last).max()) / PERIOD)
        self._last = command.tensions
        return command

    def _replan(self, now: float, state: State) -> None:
        """Plan the rest; measured tensions hold against the wind, of which the plan does not know, and are left out."""
        before = time.perf_counter(), time.process_time()
        plan = self._planner.replan(state._replace(tensions=None), now)
        seconds, processor = time.perf_counter() - before[0], time.process_time() - before[1]
        old = self._references[min(round((now - self._start) / PERIOD), len(self._references) - 1)]
        on_path = self._first.scenario.path.at(np.array([now]), self._first.scenario.duration).pose[0]
        off = float(np.linalg.norm(state.pose[:3] - on_path[:3]))
        self.replanned.append(Replanned(seconds, processor, plan.feasible, off, np.inf, np.inf))
        if plan.feasible:
            self._take(plan, now)
            new = self._references[0]
            gap = max(np.abs(new.pose - state.pose).max(), np.abs(new.velocity - state.velocity).max())
            assert new.tensions is not None
            assert old.tensions is not None
            jump = float(np.abs(new.tensions - old.tensions).max())
            self.replanned[-1] = self.replanned[-1]._replace(gap=float(gap), jump=jump)


def references(plan: Plan, period: float) -> list[Reference]:
    """Return the references of a plan, one for each period."""
    times = period * np.arange(round(plan.scenario.duration / period) + 1)
    times = np.minimum(times, plan.scenario.duration)
    platform, carriers = plan.scenario.motion(times, plan.deviation)
    tensions = np.stack([np.interp(times, plan.audit.times, its) for its in plan.audit.tensions.T], axis=1)
    return [Reference(*row) for row in zip(*platform, *carriers, tensions, strict=True)]


def fly(times: np.ndarray, duration: float | None = None, seed: int = 0) -> tuple[Replanning, Simulation]:
    """Return the controller of a flight that plans again at `times`, and the flight."""
    robot = load(ROBOT)
    planner = Planner(robot, CIRCLE)
    first = planner.plan()
    controller = Replanning(planner, first, times)
    flight = simulate(robot, first, controller, wind=WIND, gusts=GUSTS, duration=duration, period=PERIOD, seed=seed)
    return controller, flight


def soak(start: int, count: int, _: Sequence[str]) -> bool:
    """Plan `count` times in a flight, whose gusts have the seed `start`, and return whether all is well."""
    controller, _flight = fly(np.linspace(0.05, 9.6, count), seed=start)
    replanned = controller.replanned
    seconds = 1e3 * np.array([one.seconds for one in replanned])
    processor = 1e3 * np.array([one.processor for one in replanned])
    feasible = sum(one.feasible for one in replanned)
    off = 1e3 * np.array([one.off for one in replanned])
    gap, jump = (max(getattr(one, name) for one in replanned) for name in ("gap", "jump"))
    print(f"{len(replanned)} calls, {feasible} feasible; the first took {seconds[0]:.0f} ms")
    print(f"the others: median {np.median(seconds[1:]):.1f} ms, worst {seconds[1:].max(initial=0.0):.1f} ms")
    print(f"of the processor: median {np.median(processor):.1f} ms, worst {processor[1:].max(initial=0.0):.1f} ms")
    print(f"off the circle: median {np.median(off):.1f} mm, worst {off.max():.1f} mm")
    print(f"new plan and state differ by at most {gap:.1e} m, rad, and per second")
    print(f"new and last plan differ by at most {jump:.1e} N")
    print(f"tensions that were commanded changed by at most {controller.rate_max:.0f} N/s, of {RATE:.0f} N/s")
    good = feasible == len(replanned) and gap <= SAME and jump <= TENSION
    return bool(good and controller.rate_max <= RATE * (1 + 1e-9) and seconds[1:].max(initial=0.0) <= 1e3 * LONGEST)
