"""Robots in winds for `benchmarks.control`, their controllers, and the programs of predictive control in a run."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from typing_extensions import override

from ..base.errors import InputError
from ..control import ComputedTorque, Controller, OpenLoop, Predictive
from ..models import Robot, load
from ..simulation import simulate
from ..solvers import Horizon
from .control_contenders import FIELDS, Program, fill

STANDARD = "computed torque"


@dataclass(frozen=True)
class Task:
    """A robot in a wind, and the options of its controllers."""

    name: str
    robot: Callable[[], Robot]
    wind: tuple[float, float, float] | None  # mean [m/s]; None for a robot without drag
    gusts: float  # intensity [m/s]
    reach: float = 0.0  # how far carriers may leave their reference [m]; 0: the controllers' default
    stage: float | None = None  # of predictive control [s]; default: its own
    push: tuple[float, float, float] = (0.0, 0.0, 0.0)  # constant force on the platform [N]

    def conditions(self) -> dict[str, Any]:
        """Return the options of `simulate`."""
        return {"wind": self.wind, "gusts": self.gusts, "disturbance": (*self.push, 0.0, 0.0, 0.0)}

    @property
    def options(self) -> dict[str, Any]:
        """Return the options of predictive control."""
        return {"reach": (self.reach, 0.0) if self.reach else None, "stage": self.stage}

    def controllers(self) -> dict[str, Callable[[Robot], Controller]]:
        """Return what makes each controller."""
        reach = self.options["reach"]
        return {
            "open loop": OpenLoop,
            STANDARD: lambda robot: ComputedTorque(robot, reach=reach),
            "computed torque, gains of predictive": lambda robot: ComputedTorque(
                robot, 40.0, observer=60.0, reach=reach
            ),
            "predictive": lambda robot: Predictive(robot, **self.options),
        }


def _cogiro() -> Robot:
    """Return cogiro with cables of 1 MN, and the drag of a platform with a face of 4 m^2."""
    data = load("cogiro").model_dump(mode="json")
    data["platform"]["aero"] = {"air_density": 1.29, "drag": 1.0, "lift": 0.0, "area": 4.0}
    for cable in data["cables"]:
        cable["stiffness"], cable["damping"] = 1e6, 1e3
    return Robot.model_validate(data)


TASKS = (
    Task("wang-flying, free base", lambda: load("wang-flying"), (3, 2, 0.5), 1.0, 0.5, 0.03),
    Task("wang-flying, free base, at its limits", lambda: load("wang-flying"), (8, 5, 1), 2.0, 0.5, 0.03),
    Task("wang-flying-quadrotor", lambda: load("wang-flying-quadrotor"), (3, 2, 0.5), 1.0, 0.5),
    Task("cogiro, elastic", _cogiro, (6, 4, 1), 3.0),
    Task("multi-quadrotor-3, pushed", lambda: load("multi-quadrotor-3"), None, 0.0, push=(0.2, 0.1, 0.0)),
)


class Keeping(Horizon):
    """A horizon that keeps each program before it is solved, in `kept`, and begins with the one of another."""

    def __init__(self, other: Horizon):
        N, m, n = other.S.shape
        if other.d.shape[1]:
            raise InputError(f"other must be a horizon without soft rows, got {other.d.shape[1]} in a stage")
        super().__init__(N, n, m)
        self.kept: list[Program] = []
        self.tolerance, self.iterations_max = other.tolerance, other.iterations_max
        fill(self, other)

    @override
    def solve(self, shifted: bool = False, warm: bool = False) -> bool:
        """Keep the program, and solve it."""
        fields = {name: getattr(self, name).copy() for name in (*FIELDS, "states", "controls")}
        self.kept.append(Program(**fields, warm=warm))
        return super().solve(shifted, warm)


class Recording(Predictive):
    """Predictive control that keeps its programs, in `keeping.kept`."""

    batches = True  # so that a flight uses this one and no copy

    def __init__(self, robot: Robot, **options: Any):
        super().__init__(robot, **options)
        self._horizon = self.keeping = Keeping(self._horizon)


def record(task: Task, robot: Robot, steps: int) -> list[Program]:
    """Return the programs of a run.

    Raises `InputError` if predictive control does not accept the robot.
    """
    controller = Recording(robot, **task.options)
    simulate(robot, robot.home, controller, duration=steps * 1e-3, **task.conditions())
    return controller.keeping.kept
