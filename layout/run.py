"""`design`: the layout of a robot that meets requirements with the largest margin or the weakest winches."""

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..base.inputs import InputError, shown
from ..models import Robot
from ..models.files import AnyRobot, as_robot
from ..ocp.planner import plan
from .evaluation import NO_BOUNDS, Evaluation, rows_of, with_tasks
from .goal import goal_of
from .growth import grow
from .impossibility import find_impossibility
from .judgement import judge, judged_margin, reasons
from .pairings import best_pairing, with_attachments
from .requirements import Free, Requirement, Requirements, read_requirements
from .result import Design
from .room import room_of
from .search import ROOM_AUDITED, Found, Progress, audited_rows, few, search
from .variables import Variables, variables_of

USUAL_SHARE = 0.1  # of the robot's weight: the margin if that is less than the usual one


def design(
    robot: AnyRobot,
    free: Sequence[Free | dict[str, Any]] | None = None,
    require: Sequence[Requirement | dict[str, Any]] | None = None,
    maximise: str = "margin",
    *,
    requirements: Requirements | dict[str, Any] | str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> Design:
    """Find anchors, attachments and tension limits with the largest capacity margin at the worst pose.

    Simulated annealing on a few poses proposes layouts, sequential linear programs on all poses improve them, and
    audits at 100 000 random poses add the worst ones to the poses. The result is at best a local optimum. Carriers are
    at home.

    - `robot`: a `Robot`, the name of one in the library, or the path of a robot file.
    - `free`: numbers to choose: `Free`, or mappings with its keys.
    - `require`: poses and wrenches: `Requirement`, or mappings with its keys.
    - `maximise`: objective: "margin", "natural_frequency" or "volume" (of the boxes). With the option minimise="t_max"
      or "cost", the mean t_max or the cost is minimised instead, and the option `margin` is the smallest accepted one.
    - `requirements`: instead of all of these: `Requirements`, a mapping, or the path of a file.
    - `progress`: called with a description of the step, the elapsed share of the time, and the best margin so far [N].
    - `options`: all other keys of `Requirements`, such as minimise, prices, margin, clearance, natural_frequency, tasks
      and time_limit.

    After an interrupt the result is the best so far; it has a certificate if the requirements are impossible.

    Raises:
        InputError: If an argument is wrong, or the requirements do not fit the robot.
    """
    chosen = as_robot(robot)
    if requirements is not None:
        given = {"free": free, "require": require, "maximise": maximise, **options}
        for name, value in given.items():
            if value is not None and not (name == "maximise" and isinstance(value, str) and value == "margin"):
                raise InputError(f"{name} must be left out with requirements, which contain it")
        wanted = read_requirements(requirements)
    else:
        lists = {name: value for name, value in (("free", free), ("require", require)) if value is not None}
        for name, value in lists.items():
            if isinstance(value, str | dict) or not isinstance(value, Sequence):
                raise InputError(f"{name} must be a list of mappings, got {shown(value)}")
        wanted = read_requirements(
            {**{name: list(value) for name, value in lists.items()}, "maximise": maximise, **options}
        )
    if chosen.drive == "fixed-length":
        raise InputError(f"robot {chosen.name!r} must have winches, got cables of fixed length")
    if chosen.m < (count := int(chosen.dof_mask.sum())):
        wanted_cables = f"at least {count} cables for its {count} coordinates"
        raise InputError(f"robot {chosen.name!r} must have {wanted_cables}, got {chosen.m}")
    if "margin" not in wanted.model_fields_set:  # 1 N is more than the cables of a light robot can give
        wanted = wanted.model_copy(update={"margin": min(wanted.margin, USUAL_SHARE * chosen.force_scale)})
    variables, _ = variables_of(chosen, wanted), room_of(chosen, wanted)
    grid = rows_of(chosen, wanted.require, [each.places() for each in wanted.require])
    # The boxes of the robot's own points prove nothing about other pairings.
    impossible = None if wanted.free[0].pairing else find_impossibility(variables, grid)
    if impossible is not None:
        before, clearance = judged_margin(chosen, chosen.length, grid), judge(chosen, grid, NO_BOUNDS, False).clearance
        return Design(
            chosen, chosen, wanted, "infeasible", before, before, clearance, None,
            None, None, impossible, len(grid.pose_of), 0, 0, False,
        )  # fmt: skip
    if wanted.free[0].pairing:
        cables = tuple(number - 1 for number in wanted.free[0].cables or range(1, chosen.m + 1))
        grid = with_tasks(grid, chosen, wanted.tasks)
        attachment_of, count = best_pairing(chosen, grid, cables, wanted)
        paired = variables_of(with_attachments(chosen, attachment_of), wanted)
        best = Found(goal_of(paired, wanted), np.zeros(0), grid, starts=count)
        return _designed(chosen, paired, wanted, best, len(grid.pose_of))
    on_progress, largest = progress or (lambda what, share, best: None), None
    if wanted.maximise == "volume":
        largest = grow(variables, wanted, on_progress)
        wanted, found = largest.requirements, largest.found
    else:
        found = search(variables, wanted, on_progress)
    count = len(grid.pose_of)
    try:
        result = _best_of(chosen, variables, wanted, found, count)
    except KeyboardInterrupt:  # judged again, without the plans of tasks, which take long
        result = _best_of(chosen, variables, wanted, replace(found, stopped=True), count)
    if largest is not None:
        result = replace(result, size=largest.size, size_before=largest.size_before)
    return result


def _best_of(chosen: Robot, variables: Variables, wanted: Requirements, found: Found, count: int) -> Design:
    """Return the layout that was found; if the robot itself is nearer to the requirements, that."""
    result = _designed(chosen, variables, wanted, found, count)
    if result.feasible:
        return result
    room = room_of(chosen, wanted)

    def rank(each: Design) -> tuple[bool, bool, float]:
        fits = each.judgement is not None and each.judgement.keeps(room)
        return each.feasible, fits, min(each.margin, wanted.margin)

    own = replace(found, y=variables.of_robot())
    return max(result, _designed(chosen, variables, wanted, own, count), key=rank)


def _designed(before: Robot, variables: Variables, wanted: Requirements, found: Found, count: int) -> Design:
    """Judge a layout, whose search had `count` rows, at all rows and at new random poses, and find the reasons."""
    y, rows, goal, room = found.y, found.rows, found.goal, room_of(before, wanted)
    robot = variables.robot_at(y)
    random = np.random.default_rng([wanted.seed, 1])
    audited = audited_rows(before, wanted, random)
    every = rows.joined(audited)
    margin = judged_margin(robot, before.length, every)
    placed = Evaluation(variables, rows.joined(few(audited, random, ROOM_AUDITED)), room)
    counts = room.frequency > 0.0 or goal.per_hertz > 0.0
    judgement = judge(robot, placed.rows, room, counts)
    feasible = margin >= wanted.margin and placed.missing(y) <= 0.0 and judgement.keeps(room)
    plans = tuple(plan(robot, task) for task in wanted.tasks) if feasible and not found.stopped else ()
    feasible &= len(plans) == len(wanted.tasks) and all(each.feasible for each in plans)
    why = reasons(Evaluation(variables, rows, room), goal, y)
    return Design(
        robot, before, wanted, "feasible" if feasible else "not-found", margin,
        judged_margin(before, before.length, every), float(placed.distances(y).min(initial=np.inf)), judgement,
        judge(before, placed.rows, room, counts), why, None, count, len(audited.pose_of),
        found.starts, found.stopped, plans,
    )  # fmt: skip
