"""Control steps: predictive control against computed torque, and its quadratic programs against other solvers.

    towline bench control [--steps 500] [--seeds 3] [--json]

Each robot holds its position in gusts, with elastic cables and a controller every millisecond. Three tables: how long
the steps of each controller take, whole steps from state to command; how long each solver takes for the programs that
predictive control had in such a run, alternating every few programs; and how far each controller lets the platform go.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from typing_extensions import override

from ..base.inputs import InputError, whole_number
from ..control import ComputedTorque, Controller, OpenLoop, Predictive
from ..models import Robot, load
from ..simulation import simulate
from ..solvers import Horizon
from .control_contenders import CONTENDERS, FIELDS, REFERENCE, TOWLINE, Array, Contender, Program, condense, exact, fill
from .harness import alternating, machine, ratio, table

STANDARD = "computed torque"
Progress = Callable[[str, int, int], None]
Makers = dict[str, Callable[[Robot], Controller]]  # of controllers by name
TIMED = ("casadi", "daqp", "osqp", "numpy")
FAILED = 1e-3  # controls this far off are a failure, in units of their range
BLOCK = 25  # programs of a turn


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

    def controllers(self) -> Makers:
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
        self.keeping = Keeping(self._horizon)
        self._horizon = self.keeping  # pyrefly: ignore[bad-override-mutable-attribute]


def record(task: Task, robot: Robot, steps: int) -> list[Program]:
    """Return the programs of a run.

    Raises `InputError` if predictive control does not accept the robot.
    """
    controller = Recording(robot, **task.options)
    simulate(robot, robot.home, controller, duration=steps * 1e-3, **task.conditions())
    return controller.keeping.kept


@dataclass(frozen=True)
class Row:
    """A solver at the programs of a task; errors are in units of the range of a control.

    `residual` is the largest step of a control of any stage along its gradient, over its curvature, inside its bounds.
    """

    task: str
    contender: str
    tolerance: str  # the accuracy required
    median_us: float  # of a program [us]
    p99_us: float
    ratio: float  # to condensing and `daqp.solve`, median over the turns
    ratio_to_horizon: float  # to `Horizon` as it was simulated, likewise
    max_error: float | None  # of the first stage's controls
    residual: float | None
    failures: int  # programs, of `programs`, without a result or with an error above `FAILED`
    programs: int  # how many it was given


@dataclass(frozen=True)
class Step:
    """A controller's steps: times [us], and the ratio of medians to computed torque; without, why there are none."""

    task: str
    controller: str
    median_us: float | None = None
    p99_us: float | None = None
    ratio: float | None = None
    detail: str = ""


@dataclass(frozen=True)
class Error:
    """A controller's errors over all seeds; distances are from the reference [mm]."""

    task: str
    controller: str
    rms_mm: float
    max_mm: float  # of all runs
    ratio: float  # median over the seeds of the largest error over that of computed torque with the same wind
    soft: float  # share of the steps without tensions for the wrench, or without a new solution
    slack: float  # share of the steps in which a cable was slack


@dataclass(frozen=True)
class Report:
    """Rows, and what they were measured on and with."""

    rows: list[Row]
    steps: list[Step]
    errors: list[Error]
    machine: str
    count: int
    seeds: int

    def to_dict(self) -> dict[str, Any]:
        """Return plain lists and numbers, ready for JSON."""
        return asdict(self)


def run(steps: int = 500, seeds: int = 3, tasks: Sequence[Task] = TASKS, progress: Progress | None = None) -> Report:
    """Fly and measure robots in winds, in runs of `steps` of a millisecond; errors are those of all `seeds` of gusts.

    `progress` is called with the task's name and how many of how many parts are done. Raises `InputError` if a number
    is out of range.
    """
    for name, value, most in (("steps", steps, 1_000_000), ("seeds", seeds, 10_000)):
        whole_number(name, value, 1, most)
    rows, whole, errors = list[Row](), list[Step](), list[Error]()
    for number, task in enumerate(tasks):

        def show(part: int, at: int = 3 * number, name: str = task.name) -> None:
            if progress is not None:
                progress(name, at + part, 3 * len(tasks))

        robot = task.robot()
        accepted, refused = _accepted(task, robot)
        show(0)
        if "predictive" in accepted:
            rows += measure(task.name, record(task, robot, steps), CONTENDERS)
        show(1)
        whole += _steps(task, robot, steps, accepted)
        whole += [Step(task.name, name, detail=why) for name, why in refused.items()]
        show(2)
        errors += _errors(task, robot, steps, seeds, accepted)
    return Report(rows, whole, errors, machine=machine(TIMED), count=steps, seeds=seeds)


def _accepted(task: Task, robot: Robot) -> tuple[Makers, dict[str, str]]:
    """Return what makes the controllers that accept the robot, and why others do not."""
    accepted, refused = {}, {}
    for name, make in task.controllers().items():
        try:
            make(robot)
        except InputError as error:
            refused[name] = f"refused: {error}"
        else:
            accepted[name] = make
    return accepted, refused


def _steps(task: Task, robot: Robot, steps: int, accepted: Makers) -> list[Step]:
    """Measure the steps of one run with each controller, after one that is not counted."""
    times = {}
    for _ in range(2):
        for name, make in accepted.items():
            flight = simulate(robot, robot.home, make(robot), duration=steps * 1e-3, **task.conditions())
            times[name] = 1e6 * flight.seconds
    standard = float(np.median(times[STANDARD]))
    return [
        Step(task.name, name, float(np.median(of)), float(np.percentile(of, 99)), float(np.median(of)) / standard)
        for name, of in times.items()
    ]


def _errors(task: Task, robot: Robot, steps: int, seeds: int, accepted: Makers) -> list[Error]:
    """Fly all seeds with each controller."""
    given: dict[str, Any] = {**task.conditions(), "duration": steps * 1e-3, "runs": seeds}
    flown = {name: simulate(robot, robot.home, make(robot), **given) for name, make in accepted.items()}
    known, rows = flown[STANDARD]["error_max"].values, []
    for name, flights in flown.items():
        largest, rms, answers = (flights[part].values for part in ("error_max", "error_rms", "answered"))
        rows.append(
            Error(
                task=task.name,
                controller=name,
                rms_mm=float(1e3 * np.sqrt((rms**2).mean())),
                max_mm=float(1e3 * largest.max()),
                ratio=float(np.median(largest / np.maximum(known, 1e-12))),
                soft=float(answers[:, 1:].sum() / answers.sum()),
                slack=float(flights["slack_s"].values.sum() / flights["duration"].values.sum()),
            )
        )
    return rows


def measure(task: str, programs: Sequence[Program], contenders: Sequence[Contender]) -> list[Row]:
    """Measure contenders at the programs of one run, alternating every few; `TOWLINE` and `REFERENCE` among them."""
    solvers = {each.name: each.prepare(programs[0]) for each in contenders}
    for solver in solvers.values():  # imports belong to no program
        solver.solve(solver.arrange(programs[0]))
    count = len(programs)
    spent: dict[str, dict[int, list[float]]] = {name: {} for name in solvers}  # [us] by turn
    errors, residuals = ({name: np.full(count, np.nan) for name in solvers} for _ in range(2))
    of_turn, known = -1, list[tuple[Array, Array, Array]]()
    for turn, (name, solver) in alternating([*solvers.items()], -(-count // BLOCK)):
        block = range(turn * BLOCK, min((turn + 1) * BLOCK, count))
        if turn != of_turn:
            of_turn, known = turn, [_known(programs[k]) for k in block]
        spent[name][turn] = []
        for k, (best, cost, slope) in zip(block, known, strict=True):
            given = solver.arrange(programs[k])
            start = time.perf_counter_ns()
            controls = solver.solve(given)
            spent[name][turn].append((time.perf_counter_ns() - start) / 1e3)
            if controls is not None:
                errors[name][k] = (np.abs(controls[0] - best[0]) / _range(programs[k])[0]).max()
                residuals[name][k] = _residual(programs[k], controls, cost, slope)
    rows = []
    for each in contenders:
        off, answered = errors[each.name], np.isfinite(errors[each.name])
        times = np.concatenate([*spent[each.name].values()])
        rows.append(
            Row(
                task=task,
                contender=each.name,
                tolerance=each.tolerance,
                median_us=float(np.median(times)),
                p99_us=float(np.percentile(times, 99)),
                ratio=ratio(spent[each.name], spent[REFERENCE]),
                ratio_to_horizon=ratio(spent[each.name], spent[TOWLINE]),
                max_error=float(off[answered].max()) if answered.any() else None,
                residual=float(residuals[each.name][answered].max()) if answered.any() else None,
                failures=int((~(off <= FAILED)).sum()),
                programs=count,
            )
        )
    return rows


def _known(program: Program) -> tuple[Array, Array, Array]:
    """Return the best solution that is known, (N, m), by its residual, and the condensed cost."""
    cost, slope = condense(program)
    return min(exact(program), key=lambda u: _residual(program, u, cost, slope)), cost, slope


def _range(program: Program) -> Array:
    """Return the range of each control, (N, m); 1 for a control that is fixed or has no limits."""
    width = program.u_max - program.u_min
    return np.where((width > 0) & np.isfinite(width), width, 1.0)


def _residual(program: Program, controls: Array, cost: Array, slope: Array) -> float:
    """Return how far each control alone would move to lower the cost inside its bounds, by the condensed cost."""
    u = controls.ravel()
    moved = np.clip(u - (cost @ u + slope) / np.diag(cost), program.u_min.ravel(), program.u_max.ravel())
    return float((np.abs(moved - u) / _range(program).ravel()).max())


def markdown(report: Report) -> str:
    """Return the report as a page."""
    steps, programs, errors = [], [], []
    for row in report.steps:
        cells = [row.detail or "-", "-", "-"]
        if row.median_us is not None:
            cells = [f"{row.median_us:.0f}", f"{row.p99_us:.0f}", f"{row.ratio:.1f}"]
        steps.append((row.task, row.controller, *cells))
    order = list(dict.fromkeys(row.task for row in report.rows))
    for row in sorted(report.rows, key=lambda row: (order.index(row.task), row.ratio)):
        off = ["-" if value is None else f"{value:.0e}" for value in (row.max_error, row.residual)]
        ratios = f"{row.ratio:.2f}", f"{row.ratio_to_horizon:.2f}"
        cells = [f"{row.median_us:.0f}", f"{row.p99_us:.0f}", *ratios, *off, f"{row.failures} of {row.programs}"]
        programs.append((row.task, row.contender, row.tolerance, *cells))
    for row in report.errors:
        cells = [f"{row.rms_mm:.3g}", f"{row.max_mm:.3g}", f"{row.ratio:.2g}"]
        errors.append((row.task, row.controller, *cells, f"{100 * row.soft:.1f} %", f"{100 * row.slack:.1f} %"))
    columns = "task | solver | required | median us | p99 us | ratio | to Horizon | error | residual | failures"
    tables = {
        "steps": table("task | controller | median us | p99 us | ratio", steps, 2),
        "programs": table(columns, programs, 3),
        "errors": table("task | controller | rms mm | largest mm | ratio | not as planned | slack", errors, 2),
    }
    given = {"machine": report.machine, "count": report.count, "seeds": report.seeds, "failed": FAILED, "block": BLOCK}
    given |= {"standard": STANDARD, "reference": REFERENCE, "towline": TOWLINE}
    text = Path(__file__).with_name("control_report.md").read_text(encoding="utf-8")
    return text.format(**given, **{name: "\n".join(lines) for name, lines in tables.items()})
