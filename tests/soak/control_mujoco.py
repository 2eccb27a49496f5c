"""Controllers on robots that are not as their files have them, in MuJoCo: errors, and how the steps were answered.

    python -m tests.soak mujoco [--start 0] [--count N] [--only wang-flying,...]

Each task is a motion of a robot in gusts, each case something that differs from the robot's file (`mujoco_plant`). Both
controllers fly each case with their default gains. `Predictive` is good if its error is at most 1.2 times that of
`ComputedTorque`, or if the run reports that the robot does not move as predicted, and continues with computed torque.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from towline.benchmarks.harness import head, row
from towline.control import ANSWERS, ComputedTorque, Controller, Predictive, Reference
from towline.control.trajectory import read_trajectory
from towline.models import Robot, air, load
from towline.models.dynamics import dynamics_of
from towline.ocp import plan
from towline.solvers import solve_batch

from .mujoco_plant import Hardware, World

PERIOD = 1e-3  # [s]
WORSE = 1.2  # than computed torque
CONTROLLERS = {"computed torque": ComputedTorque, "predictive": Predictive}


@dataclass(frozen=True)
class Task:
    """A motion in gusts.

    Attributes:
        robot: The robot as its controllers know it.
        references: One for each period.
        reach: Of carriers that help the tensions [m]; default: that of the controllers.
        hardware: The robot where a case names nothing else.
        wind, gusts, area: Mean wind and intensity [m/s] on the platform, and its area times the drag coefficient [m^2].
        period: Of the controller [s].
    """

    robot: Robot
    references: list[Reference]
    reach: tuple[float, float] | None
    hardware: Hardware
    wind: tuple[float, float, float]
    gusts: float
    area: float
    period: float = PERIOD


@dataclass(frozen=True)
class Flown:
    """A flight: distances from the reference [m] and answers of all steps, and whether it lasted."""

    error: np.ndarray
    answered: np.ndarray
    lasted: bool
    unexplained: np.ndarray

    @property
    def rms(self) -> float:
        """Return the root of the mean square of the error [m]."""
        return float(np.sqrt((self.error**2).mean()))


def wang_flying() -> Task:
    """Return a circle of 1 m at 0.63 m/s under a base that flies the same circle, 3 s."""
    robot, times = load("wang-flying"), PERIOD * np.arange(3000)
    rate = 0.2 * np.pi
    cos, sin, zero = np.cos(rate * times), np.sin(rate * times), 0 * times
    place = np.stack([cos - 1, sin, *[zero] * 4], axis=1)
    speed = rate * np.stack([-sin, cos, *[zero] * 4], axis=1)
    return _task(robot, (place, speed, -(rate**2) * np.stack([cos, sin, *[zero] * 4], axis=1)), True,
                 reach=(0.5, 0.0), hardware=Hardware(stiffness=13e3, damping=200.0),
                 wind=(3, 2, 0.5), gusts=1.0, area=0.45 * 0.16)  # fmt: skip


def cogiro() -> Task:
    """Return pick and place: 3.6 m in 4 s, 0.5 m up and down again on the way."""
    robot, times = load("cogiro"), PERIOD * np.arange(4000)
    s = times / 4.0
    # s^3 (10 - 15 s + 6 s^2), and 64 s^3 (1 - s)^3 for the way up and down
    across = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
    up = np.polynomial.Polynomial([0, 0, 0, 64]) * np.polynomial.Polynomial([1, -1]) ** 3
    motion = []
    for order in range(3):
        along = 3.6 * across.deriv(order)(s) if order else 3.6 * (across(s) - 0.5)
        rise = 0.5 * (up.deriv(order)(s) if order else up(s))
        zero = 0 * s
        motion.append(np.stack([along, zero, rise, zero, zero, zero], axis=1) / 4.0**order)
    return _task(robot, tuple(motion), False, reach=None, hardware=Hardware(stiffness=2e5, damping=500.0),
                 wind=(6, 4, 1), gusts=3.0, area=4.0)  # fmt: skip


def team(name: str) -> Task:
    """Return a line of 3.2 m in 4 s, planned with free quadrotors, and a second at its end."""
    robot = load(name)
    line = {"kind": "line", "start": [0, 0, 0], "end": [3.2, 0, 0]}
    made = plan(robot, {"path": line, "duration": 4.0, "base": {"kind": "free"}, "steps": 30})
    trajectory, times = read_trajectory(robot, made, 5.0), PERIOD * np.arange(5000)
    assert trajectory.tensions is not None
    platform, carriers = trajectory.at(times)
    rows = zip(*platform, *carriers, trajectory.tensions(times), strict=True)
    references = [Reference(*row) for row in rows]
    return Task(robot, references, None, Hardware(stiffness=2e4, damping=50.0), (2, 1.5, 0.3), 1.0, 0.1)


def _task(robot: Robot, motion: Any, carried: bool, **rest: Any) -> Task:
    """Return a task whose carriers move along with the platform if it is `carried`, with the least tensions."""
    place, speed, bend = motion
    along, count = float(carried), len(robot.carriers)
    carriers = [
        np.repeat(along * part[:, None], count, axis=1) + (robot.carrier_home if order == 0 else 0.0)
        for order, part in enumerate(motion)
    ]
    pose = robot.home + place
    dynamics, mask = dynamics_of(robot), robot.dof_mask
    A = dynamics.wrench_matrix(pose, carriers[0]) * mask[:, None]
    w = dynamics.required_wrench(pose, speed, bend, *carriers) * mask
    tensions = solve_batch(A, w, robot.t_min, robot.t_max, length=robot.length, rho=1e8).tensions
    return Task(robot, [Reference(*row) for row in zip(pose, speed, bend, *carriers, tensions, strict=True)], **rest)


WINCHES = {
    "ideal": {},
    "winch loop 2 ms": {"winch": "loop", "lag": 0.002},
    "winch loop 20 ms": {"winch": "loop", "lag": 0.02},
    "winch loop, stiffness 0.8": {"winch": "loop", "lag": 0.02, "stretch": 0.8},
    "tension lag 20 ms": {"lag": 0.02},
    "mass +10 %": {"mass": 1.1},
    "friction": {"friction": 1.0},
    "delay 5 ms": {"delay": 0.005},
    "delay 10 ms": {"delay": 0.01},
    "encoder": {"resolution": (1e-4, 2e-4)},
    "gain 0.9": {"gain": 0.9},
    "gain 0.9, no tension sensor": {"gain": 0.9, "sensor": None},
    "sensor reads 0.9": {"sensor": 0.9},
    "50 Hz, 30 ms late": {"held": 0.02, "delay": 0.03},
    "delay 5 ms, with times": {"delay": 0.005, "stamped": True},
    "50 Hz, 30 ms late, with times": {"held": 0.02, "delay": 0.03, "stamped": True},
}
ALL = {"mass": 1.1, "delay": 0.005, "friction": 1.0, "resolution": (1e-4, 2e-4)}
WINCHES |= {
    "all, source": {**ALL, "lag": 0.02},
    "all, winch loop": {**ALL, "winch": "loop", "lag": 0.02, "stretch": 0.8},
    "all, source, no tension sensor": {**ALL, "lag": 0.02, "sensor": None},
    "no encoder, winch loop, gain 0.9, with times": {
        **ALL,
        "resolution": (0.0, 0.0),
        "winch": "loop",
        "lag": 0.02,
        "stretch": 0.8,
        "gain": 0.9,
        "stamped": True,
    },
    "length winch": {"winch": "lengths", "lag": 0.02},
}
TEAMS = {
    "ideal": {},
    "rotor lag 30 ms": {"rotor_lag": 0.03},
    "rotor lag 60 ms": {"rotor_lag": 0.06},
    "load +10 %": {"mass": 1.1},
    "load +50 %": {"mass": 1.5},
    "delay 5 ms": {"delay": 0.005},
    "delay 20 ms": {"delay": 0.02},
    "delay 20 ms, with times": {"delay": 0.02, "stamped": True},
    "mocap 1 mm": {"noise": (1e-3, 1e-3)},
    "sensor reads 0.9": {"sensor": 0.9},
    "wind on quadrotors": {"air_of_carriers": 0.02},
    "lost quad": {"lost": (0, 1.0)},
}
TEAMS["all"] = {"mass": 1.1, "delay": 0.005, "noise": (1e-3, 1e-3), "rotor_lag": 0.03, "air_of_carriers": 0.02}
FRICTION = {"wang-flying": 0.3, "cogiro": 20.0}
TASKS: dict[str, tuple[Callable[[], Task], dict[str, dict[str, Any]]]] = {
    "wang-flying": (wang_flying, WINCHES),
    "cogiro": (cogiro, {name: row for name, row in WINCHES.items() if name not in ("length winch",)}),
    "multi-quadrotor-3": (lambda: team("multi-quadrotor-3"), TEAMS),
    "multi-quadrotor-4": (
        lambda: team("multi-quadrotor-4"),
        {k: TEAMS[k] for k in ("ideal", "rotor lag 30 ms", "lost quad")},
    ),
}


def fly(task: Task, controller: Controller, seed: int = 0, air_of_carriers: float = 0.0, **differs: Any) -> Flown:
    """Fly a task with a controller on a robot that differs, and return what happened."""
    friction = FRICTION.get(task.robot.name, 0.0)
    if "friction" in differs:
        differs = differs | {"friction": friction * differs["friction"]}
    hardware, first = replace(task.hardware, **differs), task.references[0]
    motion = np.zeros((1 + len(task.robot.carriers), 12))
    motion[0, :6], motion[0, 6:] = first.pose, first.velocity
    motion[1:, :6], motion[1:, 6:] = first.carrier_pose, first.carrier_velocity
    assert first.tensions is not None
    world = World(task.robot, hardware, motion, first.tensions, task.period, seed)
    times = task.period * np.arange(len(task.references))
    wind = air.dryden(times, task.wind, (task.gusts, task.gusts, task.gusts / 2), seed=seed)
    controller.reset()
    controller.follow(task.references, task.period)
    error, answered = np.full(len(times), np.nan), np.zeros(len(times), dtype=int)
    unexplained = np.zeros(len(times))
    for k, reference in enumerate(task.references):
        now = world.motions()
        error[k] = np.linalg.norm(now[0, :3] - reference.pose[:3])
        if not error[k] < 1e3:
            return Flown(np.append(error[:k], 1e3), answered[:k], False, unexplained[:k])
        command = controller.step(times[k], world.state(), reference)
        answered[k] = command.answered
        unexplained[k] = command.unexplained
        off = wind[k] - now[:, 6:9]
        drag = 0.5 * 1.29 * np.linalg.norm(off, axis=1, keepdims=True) * off
        world.run(command, np.append(task.area * drag[0], np.zeros(3)), air_of_carriers * drag[1:])
    return Flown(error, answered, True, unexplained)


def soak(start: int, count: int, tasks: Sequence[str]) -> bool:
    """Fly `count` cases of these tasks from number `start` on, print a table, and return whether all are good."""
    columns = "rms mm | largest mm | end mm | unexplained g | handed over s | "
    print(head(f"number | task | case | controller | steps | {columns}", 5))
    cases = [(name, case) for name in tasks for case in TASKS[name][1]]
    made, well = dict[str, Task](), True
    for number, (name, case) in list(enumerate(cases))[start : start + count]:
        task = made[name] = made.get(name) or TASKS[name][0]()
        standard = np.inf
        for kind, make in CONTROLLERS.items():
            controller = make(task.robot, reach=task.reach)
            flown = fly(task, controller, **TASKS[name][1][case])
            over = getattr(controller, "handed_over", None)
            standard = flown.rms if make is ComputedTorque else standard
            good = flown.rms <= WORSE * standard or over is not None
            well &= good
            counts = np.bincount(flown.answered, minlength=len(ANSWERS))
            answers = ", ".join(f"{n} {way}" for way, n in zip(ANSWERS, counts, strict=True) if n)
            part = float(np.nanmax(flown.unexplained, initial=0.0)) * task.robot.platform.mass / task.robot.force_scale
            errors = [f"{1e3 * error:.3g}" for error in (flown.rms, flown.error.max(), flown.error[-1])]
            late = "-" if over is None else f"{over.time:.3f}"
            last = f"{part:.3f}", late, "" if good else "WORSE"
            print(row(number, name, case, kind, answers, *errors, *last), flush=True)
    return well
