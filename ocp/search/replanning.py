"""Replan the remainder of a motion from measured states: `Replanner`."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ...base.inputs import InputError, number
from ...models import Robot
from ...models.points import shortest_way
from ..nlp.rows import Mesh
from ..nlp.solver import Progress, Solver
from ..plan import Plan
from ..tasks.deviation import Deviation
from ..tasks.ends import Word, carrier_ends, platform_ends
from ..tasks.initial import Final, Initial, check_ends
from ..tasks.lay_out import carrier_paths, initial_of
from ..tasks.paths import AnyPath, Motion, RestPath, ReturnPath
from ..tasks.paths.sequence import decay
from ..tasks.scenario import Scenario
from ..tasks.task import FreeBase, GivenBase
from .search import Search

LEAST = 1e-3  # [s], of what is left
RESERVE = 1e-4  # of the weight, from the tension limits: between nodes motions need some 1e-5


class Replanner:
    """Replan the remainder of a motion.

    One program with parameters serves all calls: references, start and length change, and each starts from the last
    solution and its multipliers. `first` is the plan of the whole motion, and `climb` plans from scratch whenever the
    program with parameters does not lead to a plan.

    Raises `InputError` if the remainder of its task cannot be planned.
    """

    def __init__(self, first: Plan, climb: Callable[[Search, Deviation | None], Plan]):
        _check(first.scenario)
        self._whole, self._climb = first.scenario, climb
        self._last, self._begun = first, 0.0
        self._final = final_of(first)
        self._solvers: dict[Mesh, Solver] = {}

    def search(self, state: Any, time: Any, settle: Any, progress: Progress | None) -> tuple[Search, Deviation | None]:
        """Return the search for the remainder of the motion from `time` [s] on, and a guess.

        Raises `InputError` if an argument does not fit.
        """
        at = number("time", time, self._begun, self._whole.duration - LEAST)
        return_s = number("settle", settle, LEAST, 1e6)
        initial = initial_of(self._whole, state, at, "state")
        check_ends(self._whole.robot, initial, None, "world", "replan")
        left, guess = remainder(self._whole, self._final, self._last, self._begun, at, initial, return_s)
        return Search(left, self._solvers, progress), guess

    def plan(self, search: Search, guess: Deviation | None, time: float) -> Plan:
        """Return the plan of a search; the next remainder is taken from this plan if it is feasible."""
        plan = self._by_last_solution(search, guess)
        if plan is None:
            anew = Search(search.scenario, {}, search.progress, search.seconds_left)
            plan = self._climb(anew, guess)
            search.stages += anew.stages
        plan = replace(plan, stages=tuple(search.stages))
        if plan.feasible:
            self._last, self._begun = plan, float(time)
        return plan

    def _by_last_solution(self, search: Search, guess: Deviation | None) -> Plan | None:
        """Plan with the program that has parameters; None if that is not possible, or leads to none."""
        scenario, mesh = search.scenario, Mesh(search.scenario.task.steps, RESERVE * search.scenario.robot.force_scale)
        if guess is None or scenario.scheme.smooth:
            return None
        outcome = search.solve_again(mesh, guess)
        return search.best() if outcome.success and search.audit(outcome).passed else None


def _check(scenario: Scenario) -> None:
    """Refuse motions whose rest cannot be planned."""
    task = scenario.task
    where = f"task {task.name!r}"
    if scenario.phases.all:
        raise InputError(f"{where}: phases must be left out to replan, got {len(scenario.phases.all)}")
    if task.robust is not None:
        raise InputError(f"{where}: robust must be left out to replan, got {task.robust:g}")
    if task.stop_within is not None:
        raise InputError(f"{where}: stop_within must be left out to replan, got {task.stop_within:g} s")
    if scenario.relative:
        raise InputError(f"{where}: path.frame must be world to replan, got {scenario.path.frame!r}")
    if task.tube.waypoints == "exact":
        raise InputError(f"{where}: tube.waypoints must be free to replan, got exact")
    if isinstance(scenario.path, ReturnPath):
        raise InputError(f"{where}: path must be one that is followed from its beginning, got one of kind return")


def _open(ends: Word) -> Word:
    """Return how a remainder ends: a cycle's remainder does not end where it starts."""
    return "free" if ends == "periodic" else ends


def final_of(plan: Plan) -> Final | None:
    """Return the state in which a plan ends, as far as the task leaves it to the planner; None if it leaves nothing.

    Accelerations only of robots that can have any: with few cables or fixed lengths they follow from the rest.
    """
    scenario = plan.scenario
    robot = scenario.robot
    platform, carriers = scenario.motion(np.array([scenario.duration]), plan.deviation)
    given: dict[str, Any] = {}
    names = ("pose", "velocity", "acceleration")[: 3 if is_agile(robot) else 2]
    if scenario.platform_free and platform_ends(scenario.task) in ("free", "periodic"):
        given |= {name: tuple(part[0].tolist()) for name, part in zip(names, platform, strict=False)}
    if scenario.carrier_free and carrier_ends(scenario.task) in ("free", "periodic"):
        given |= {f"carrier_{name}": _rows(part[0]) for name, part in zip(names, carriers, strict=False)}
    return Final(**given) if given else None


def remainder(
    whole: Scenario, final: Final | None, last: Plan, begun: float, time: float, initial: Initial, settle: float
) -> tuple[Scenario, Deviation | None]:
    """Lay out the rest of the motion of `whole` from `time` [s] on, for a robot in the state `initial`.

    `final` is how it ends, beside what its task requires, and `last` the plan that the robot followed, which `begun` at
    that time [s]. The way back to the path takes `settle` [s] at most. The second result is the last plan, with the
    carriers' deviations from it decaying; None if the task fixes the motion.
    """
    left = whole.duration - time
    at = np.array([time - begun])
    platform, carriers = last.scenario.motion(at, last.deviation)
    state = _completed(initial, last, at, carriers)
    offset = _offset(whole, last, at, time, state, platform)
    names = ("offset", "offset_velocity", "offset_acceleration")
    shares: dict[str, Any] = {name: tuple(part.tolist()) for name, part in zip(names, offset, strict=True)}
    path = _from(whole.path, whole.duration, time, min(settle, left), shares)
    task, base = whole.task, whole.task.base
    if isinstance(base, GivenBase):
        base = base.model_copy(update={"paths": _shifted(base.paths, whole.duration, time)})
    elif isinstance(base, FreeBase):
        around = _shifted(base.around, whole.duration, time)
        base = base.model_copy(update={"around": around, "ends": _open(carrier_ends(task))})
    task = task.model_copy(
        update={
            "path": path,
            "duration": left,
            "base": base,
            "tube": task.tube.model_copy(update={"ends": _open(platform_ends(task))}),
            "initial": state,
            "final": final,
        }
    )
    scenario = replace(whole, task=task, path=path, carrier_paths=carrier_paths(whole.robot, task), duration=left)
    return scenario, _guess(scenario, last, at, carriers, min(settle, left))


def _completed(initial: Initial, last: Plan, at: np.ndarray, carriers: Motion) -> Initial:
    """Return the state with carriers and tensions as planned, if they were not measured.

    Not the tensions of robots with few cables or fixed lengths, whose balance has hardly any others than those that the
    program computes.
    """
    fields: dict[str, Any] = {}
    if initial.carrier_pose is None:
        fields["carrier_pose"], fields["carrier_velocity"] = (_rows(part[0]) for part in carriers[:2])
    robot, audit = last.scenario.robot, last.audit
    if initial.tensions is None and initial.acceleration is None and is_agile(robot):
        planned = [float(np.interp(at[0], audit.times, its)) for its in audit.tensions.T]
        fields["tensions"] = tuple(planned)
    return initial.model_copy(update=fields) if fields else initial


def is_agile(robot: Robot) -> bool:
    """Return whether the cables can give any acceleration, and whatever the tensions are, an acceleration follows."""
    return robot.fixed_lengths is None and robot.m >= len(robot.platform.dof)


def _offset(whole: Scenario, last: Plan, at: np.ndarray, time: float, state: Initial, planned: Motion) -> np.ndarray:
    """Return how far the state is from the path and from what the last plan deviates from it, (3, 6)."""
    robot = whole.robot
    reference = [part[0] for part in whole.references(np.array([time]))[0]]
    if last.deviation is not None:
        for part, value in zip(reference, last.deviation.evaluate(at)[:3], strict=True):
            part += value[0] @ whole.spread(None).T
    pose, velocity = np.array(state.pose), np.array(state.velocity)
    acceleration = planned.acceleration[0] if state.acceleration is None else np.array(state.acceleration)
    if state.acceleration is None and state.tensions is not None:
        low, high = (bound[0] for bound in whole.bounds_at(np.array([time])))
        tensions = np.clip(state.tensions, low, high)
        acceleration = whole.dynamics.acceleration(
            pose, velocity, tensions, np.array(state.carrier_pose), None if whole.wind is None else np.array(whole.wind)
        )
    off = np.stack([pose, velocity, acceleration]) - np.stack(reference)
    off[0] = shortest_way(off[0])
    return off * robot.dof_mask


def _from(path: AnyPath, duration: float, time: float, settle: float, offset: dict[str, Any]) -> ReturnPath:
    """Return the remainder of a path."""
    given = {"path": path, "duration": duration, "start": time, "settle": settle}
    return ReturnPath(kind="return", frame=path.frame, **given, **offset)


def _shifted(paths: dict[str, AnyPath], duration: float, time: float) -> dict[str, AnyPath]:
    """Return the rests of the paths of carriers."""
    return {
        name: path if isinstance(path, RestPath) else _from(path, duration, time, duration - time, {})
        for name, path in paths.items()
    }


def _guess(scenario: Scenario, last: Plan, at: np.ndarray, carriers: Motion, settle: float) -> Deviation | None:
    """Return the last plan from now on, with what the carriers are off it decaying."""
    if last.deviation is None:
        return None
    shares = scenario.scheme.shares(scenario.task.steps)
    nodes = scenario.duration * shares
    theirs = last.deviation
    guess = theirs.at(np.minimum(at + nodes, theirs.nodes[-1]))
    initial = scenario.task.initial
    if initial is None or initial.carrier_pose is None or initial.carrier_velocity is None:
        return replace(guess, nodes=nodes)
    away = np.array([initial.carrier_pose, initial.carrier_velocity]) - [carriers.pose[0], carriers.velocity[0]]
    away[0] = shortest_way(away[0])
    off = scenario.free_of(np.zeros((3, 6)), np.concatenate([away, np.zeros_like(away[:1])]))
    q, v, a = (mine + more for mine, more in zip((guess.q, guess.v, guess.a), decay(nodes, settle, off), strict=True))
    return replace(guess, nodes=nodes, q=q, v=v, a=a)


def _rows(values: np.ndarray) -> Any:
    return tuple(map(tuple, values.tolist()))
