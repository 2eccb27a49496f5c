"""How a plant is driven and stepped by default, and `Periods`: steps in arrays of the caller, for closed loops."""

import math

import numpy as np

from ..core import run_plant
from ..models.dynamics import dynamics_of
from ..models.part import inertia_matrix
from ..models.record import record_of
from ..models.robot import Robot
from . import layout
from .plant import Plant

ANGLE = 1.0  # what the fastest motion of the cables may turn or decay by in a step; Runge-Kutta is stable up to 2.8
TIED = 2.0  # what a winch with a constant rate may add to the mass that its cable moves, of that mass
DRIVE_PERIOD = 1e-3  # longest period of drives that compute motor forces from tensions [s]
HELD = 0.4  # largest phase of the fastest motion of the cables in such a period [rad]


def default_drive(robot: Robot) -> str:
    """Return the type of command of a robot's plant unless another is chosen, see `Plant`."""
    if all(cable.winch is not None for cable in robot.cables):
        return "forces"
    if robot.fixed_lengths is not None:
        return "lengths"
    return "lengths" if all(cable.stiffness for cable in robot.cables) else "tensions"


def steps_in(period: float, plant: Plant) -> int:
    """Return the number of steps per period [s] that resolves the fastest motion of elastic cables."""
    return max(1, math.ceil(period * max(fastest_motion(plant)) / ANGLE))


def windings_in(period: float, plant: Plant) -> int:
    """Return the number of parts of a period [s] that last about as long as the `winding_time`."""
    return max(1, math.floor(period / winding_time(plant) + 0.5))


def winding_time(plant: Plant) -> float:
    """Return for how long winches without a model keep a rate towards commanded tensions [s]; infinite without them.

    Winches measure tensions more often than a controller commands them. While a winch keeps its rate for a time h, its
    cable ties the bodies at its ends to each other, as if they had h (C + h K) more mass along it
    (core/plant/winch_lengths.c). In one long period, a light carrier would hardly move relative to its load.
    """
    frequency, decay = fastest_motion(plant)
    if plant.drive == "forces":
        return min(DRIVE_PERIOD, HELD / frequency if frequency else math.inf)
    if plant.drive != "lengths":
        return math.inf
    return 2 * TIED / (decay + math.sqrt(decay**2 + 4 * TIED * frequency**2)) if frequency else math.inf


def fastest_motion(plant: Plant) -> tuple[float, float]:
    """Return the highest frequency and decay of elastic cables at home [rad/s]; 0 if not all of them are elastic.

    With the elongations e of taut cables, d2e/dt2 = -G (K e + C de/dt), where G has the accelerations along the cables
    that unit tensions cause, including those of winches with commanded forces; the largest eigenvalues of G K
    and G C bound frequency and decay.
    """
    cables = plant.record["cable"][: plant.robot.m]
    stiffness, damping = cables["stiffness"], cables["damping"]
    if plant.drive == "tensions" or not stiffness.all():
        return 0.0, 0.0
    robot = plant.robot
    A, mask = dynamics_of(robot).wrench_matrix(robot.home, robot.carrier_home), robot.dof_mask
    inverse = np.zeros((6, 6))
    inverse[:3, :3] = np.eye(3) / robot.platform.mass
    inverse[3:, 3:] = np.linalg.pinv(robot.inertia)
    A = A * mask[:, None]
    G = A.T @ inverse @ A
    for index, carrier in enumerate(robot.carriers):
        if carrier.body is not None:
            its = robot.carrier_of_cable == index
            u = A[:3] * its
            arms = (robot.home_anchors - robot.carrier_home[index, :3]).T * its
            moments = np.cross(arms, u, axis=0)
            G += u.T @ u / carrier.body.mass
            G += moments.T @ np.linalg.solve(inertia_matrix(carrier.body.inertia), moments)
    if plant.drive == "forces":
        G += np.diag([1 / cable.winch.inertia if cable.winch else 0.0 for cable in robot.cables])
    lengths = np.linalg.norm(robot.home_anchors - robot.home_attachments, axis=1)
    frequency = math.sqrt(float(np.abs(np.linalg.eigvals(G * (stiffness / lengths))).max()))
    decay = float(np.abs(np.linalg.eigvals(G * damping)).max())
    return frequency, decay


class Periods:
    """Run many simulations of a plant in parallel.

    `record` is the robot as the core reads it, which events change in place; `period` is the duration of one [s].
    """

    def __init__(self, plant: Plant, period: float, substeps: int):
        self.record, self._settings = plant.record.copy(), plant.settings
        self.period, self._substeps, self._m = period, substeps, plant.robot.m
        self._conditions = layout.BODY * (1 + len(plant.robot.carriers)) + layout.CONDITION * self._m

    def lose(self, carrier: int) -> None:
        """Disable the actuators of a carrier from the next period on."""
        self.record["body"]["actuator"][1 + carrier] = 0

    def carry(self, states: np.ndarray, robot: Robot) -> np.ndarray:
        """Take the platform's mass, CoM and inertia from a robot, and return states (N, n) of the same motion.

        States describe the CoM of the platform: where it is now, and how fast it moves there.
        """
        new, states = record_of(robot), states.copy()
        arm = new["com"] - self.record["com"]
        for name in ("mass", "com"):
            self.record[name] = new[name]
        for name in ("mass", "inverse_mass", "inertia", "inverse_inertia"):
            self.record["body"][name][0] = new["body"][name][0]
        w, axis = states[:, [layout.QUATERNION]], states[:, layout.QUATERNION + 1 : layout.VELOCITY]

        def turned(vectors: np.ndarray) -> np.ndarray:
            return vectors + 2 * np.cross(axis, np.cross(axis, vectors) + w * vectors)

        rate = states[:, layout.RATE : layout.BODY]
        states[:, layout.VELOCITY : layout.RATE] += turned(np.cross(rate, arm))
        states[:, : layout.QUATERNION] += turned(np.tile(arm, (len(states), 1)))
        return states

    def release(self, states: np.ndarray, which: np.ndarray) -> None:
        """Cut cables of states (N, n) in place: those that are true in `which`, (m,) or (N, m)."""
        conditions = states[:, self._conditions : self._conditions + self._m]
        conditions[np.broadcast_to(which, conditions.shape) != 0] = layout.CUT

    def run(
        self,
        states: np.ndarray,
        commands: np.ndarray,
        history: np.ndarray,
        tensions: np.ndarray,
        means: np.ndarray | None = None,
        count: int = 1,
    ) -> None:
        """Write states and tensions at the beginning and at the end of some periods, and the mean tensions in them.

        - `states`, `commands`: (N, n) and (N, K, k), see `Plant`: each period has a command; carriers move on to
          another.
        - `count`: number of periods.
        - `history`, `tensions`: results, (N, 2, n) and (N, 2, m) [N].
        - `means`: results, (N, m) [N], with which the momentum of the bodies changes but for impacts.
        """
        of_rows = (states, commands, history, tensions, means)
        run_plant(self.record, self._settings, *of_rows, count, self.period, self._substeps, count)
