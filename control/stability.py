"""`grows`: whether small errors at home grow in the whole closed loop; `closed_loop`: its motion, step by step."""

import hashlib
import pickle
from collections import deque
from collections.abc import Iterator

import numpy as np

from ..models.robot import Robot
from ..plant import Plant, Reading
from ..solvers import TensionSolution
from .computed_torque import ComputedTorque
from .controller import OTHERWISE, Command, Controller, Reference, State
from .lag import Lag

PERIOD = 2e-3  # [s] between steps
SLOWEST = 1e-3  # [rad/s]
LEAST, SLOW, MOST = 400, 4.0, 1500  # steps, time constants of the errors, and steps again
FAR = 0.3  # of the robot's length: errors that have grown
MORE = 1.2  # of the velocities in the second third of the steps are in the last: a motion nobody damps has as many
MORE_STEPS = 100  # at a time, if velocities have grown by less
PUSH, PUSHED = 0.01, 0.05  # of the robot's weight, and for how long [s]: so little that the loop is linear

_KEPT: dict[tuple[type[ComputedTorque], bytes], bool] = {}


def grows(
    controller: ComputedTorque, robot: Robot, rest: TensionSolution, bandwidth: float, age: float, lag: float
) -> bool:
    """Return whether a small error at rest at home grows in the closed loop, with the rotation of flying carriers.

    The loop is closed around `Plant` after a small push in all coordinates, in which unstable modes soon dominate.
    So all states are included: attitudes of carriers, delayed commands, observers. The controller of the robot is reset
    before and afterwards. The result is kept for later controllers that are equal to this one.

    - `rest`: tensions at home.
    - `bandwidth`: with which errors of the pose decay [rad/s].
    - `age`, `lag`: age of states without a time, and time constant of actuators, as the controller knows them [s].

    False without a test if the load cannot rest there, for example under a rough formation.
    """
    if not rest.residual <= PUSH * robot.force_scale:
        return False
    given = controller, robot, np.asarray(rest.tensions), bandwidth, age, lag
    try:
        state = pickle.dumps(given)
    except (AttributeError, TypeError, pickle.PicklingError):  # as of a class that is defined in a function
        return _simulated(*given)
    # A class that is defined anew is another one, though its name is the same.
    key = type(controller), hashlib.sha256(state).digest()
    if key not in _KEPT:
        _KEPT[key] = _simulated(*pickle.loads(state))
    return _KEPT[key]


def _simulated(
    controller: ComputedTorque, robot: Robot, tensions: np.ndarray, bandwidth: float, age: float, lag: float
) -> bool:
    scale = np.repeat([1.0, robot.length], 3) * robot.dof_mask
    push = np.random.default_rng(0).normal(size=6)
    push -= push @ controller.uncontrolled.T @ controller.uncontrolled  # a load that spins below a cable is let alone
    push *= PUSH * robot.force_scale * scale
    steps = int(np.clip(SLOW / max(bandwidth, SLOWEST) / PERIOD, LEAST, MOST))
    sizes, before, grown = np.zeros(MOST), np.zeros(6), False
    for k, (now, command) in enumerate(closed_loop(controller, robot, tensions, push, age, lag)):
        off, change = np.linalg.norm(scale * (now.pose - robot.home)), scale * (now.velocity - before)
        # At the turning points of a swing, where nothing moves, accelerations are largest.
        sizes[k] = np.linalg.norm([scale * now.velocity, change / (PERIOD * max(bandwidth, SLOWEST))])
        before = now.velocity
        if not off < FAR * robot.length or command.answered == OTHERWISE:
            grown = True
            break
        if k + 1 >= steps:
            second, last = np.linalg.norm(sizes[: steps // 3 * 3].reshape(3, -1)[1:], axis=1)
            grown = last > MORE * second
            if grown or not last > second:
                break
            steps += MORE_STEPS
    controller.reset()
    return bool(grown)


def closed_loop(
    controller: Controller,
    robot: Robot,
    tensions: np.ndarray,
    push: np.ndarray | None = None,
    age: float = 0.0,
    lag: float = 0.0,
    lost: int | None = None,
) -> Iterator[tuple[Reading, Command]]:
    """Close the loop around a `Plant` at rest at home, and yield what is read and commanded in each of `MOST` steps.

    - `tensions`: tensions at home, (m,) [N].
    - `push`: wrench on the platform during the first `PUSHED` [N, N m], (6,); default: none.
    - `age`, `lag`: age of the states, and time constant of actuators [s].
    - `lost`: index of a carrier whose actuators give nothing; default: none.
    """
    plant = Plant(robot, drive="tensions" if robot.fixed_lengths is None else "lengths")
    still = np.zeros_like(robot.carrier_home)
    reference = Reference(robot.home, np.zeros(6), np.zeros(6), robot.carrier_home, still, still, tensions)
    state, pulls, drives, held = plant.start(tensions=tensions), tensions, Lag(lag), np.ones(robot.m, dtype=bool)
    fixed = plant.read(state).lengths  # those of the file fit a rounded home only nearly
    late = deque([State(robot.home, np.zeros(6), robot.carrier_home, still, tensions)] * round(age / PERIOD))
    controller.reset()
    controller.follow([reference, reference], PERIOD)
    for k in range(MOST):
        now = plant.read(state)
        late.append(State(now.pose, now.velocity, now.carrier_pose, now.carrier_velocity, pulls))
        command = controller.step(PERIOD * k, late.popleft(), reference)
        yield now, command
        if command.released is not None:
            for cable in np.flatnonzero(held & command.released):
                state, held[cable] = plant.cut(state, int(cable)), False
        cables = command.tensions if robot.fixed_lengths is None else fixed
        given = None if command.actuation is None else drives.follow(command.actuation, PERIOD)
        if given is not None and lost is not None:
            given[lost] = 0.0
        wrench = push if PERIOD * k < PUSHED else None
        run = plant.run(state, plant.command(cables, given, *command[1:4], wrench=wrench)[None], PERIOD)
        state, pulls = run.states[-1], run.tensions.mean(axis=0)
