"""Changes of the forces: less margin or wind, lighter loads or platforms, other tension limits."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ...base.text import quantity
from ...models import Robot
from ..tasks.lay_out import lay_out, with_task
from ..tasks.phase import Load
from ..tasks.scenario import Scenario
from .largest_share import Change, Variation
from .refinement import rounded

STRONGEST = 100.0  # times t_max: a motion that needs more is not one that stronger cables make feasible


def less_margin(scenario: Scenario) -> Change | None:
    """Return the change of the margin of tensions to a smaller one."""
    margin = scenario.hard_margin

    def with_margin(share: float) -> Variation:
        varied = with_task(scenario, margin=rounded(share * margin, up=False))
        return varied, share * margin, f"instead of {quantity(margin, 'N')}"

    return Change("margin", "N", with_margin) if margin else None


def less_wind(scenario: Scenario) -> Change | None:
    """Return the change of the wind, or set of winds, to a weaker one from the same directions."""
    wind = scenario.task.wind
    given = {} if wind is None else {"wind": wind} if isinstance(wind, tuple) else wind.model_dump()
    fastest = max((float(np.linalg.norm(value)) for value in given.values()), default=0.0)
    if wind is None or not fastest:
        return None

    def with_wind(share: float) -> Variation:
        fields: Any = {name: (share * np.array(value)).tolist() for name, value in given.items()}
        weaker = tuple(fields["wind"]) if isinstance(wind, tuple) else type(wind).model_validate(fields)
        return with_task(scenario, wind=weaker), share * fastest, f"instead of {quantity(fastest, 'm/s')}"

    return Change("wind", "m/s", with_wind)


def lighter_load(scenario: Scenario) -> Change | None:
    """Return the change of the loads of phases to lighter ones by one factor, with moments of inertia in proportion."""
    phases = scenario.task.phases or ()
    masses = [0.0 if phase.load is None else phase.load.mass for phase in phases]
    mass = max(masses, default=0.0)
    if mass == 0.0:
        return None
    others = "in each phase" if len({*masses, 0.0}) == 2 else "the others by the same factor"
    every = f", {others}" if sum(each > 0 for each in masses) > 1 else ""

    def with_loads(share: float) -> Variation:
        def lighter(load: Load) -> Load:
            inertia = tuple(share * value for value in load.inertia)
            return load.model_copy(update={"mass": share * load.mass, "inertia": inertia})

        return _carrying(scenario, lighter), share * mass, f"instead of {quantity(mass, 'kg')}{every}"

    return Change(f"phases[{masses.index(mass)}].load.mass", "kg", with_loads)


def surer_load(scenario: Scenario) -> Change | None:
    """Return the change of the tolerances of the loads to smaller ones, all in proportion to the task's."""
    if not scenario.phases.extremes:
        return None

    def with_loads(share: float) -> Variation:
        def surer(load: Load) -> Load:
            x, y, z = (share * tolerance for tolerance in load.com_tolerance)
            return load.model_copy(update={"mass_tolerance": share * load.mass_tolerance, "com_tolerance": (x, y, z)})

        return _carrying(scenario, surer), 100 * share, "of the task's"

    return Change("mass_tolerance and com_tolerance of the loads", "%", with_loads)


def _carrying(scenario: Scenario, change: Callable[[Load], Load]) -> Scenario:
    """Return the scenario with other loads, laid out."""
    carried = tuple(
        phase if phase.load is None else phase.model_copy(update={"load": change(phase.load)})
        for phase in scenario.task.phases or ()
    )
    return with_task(scenario, phases=carried)


def lighter_platform(scenario: Scenario) -> Change:
    """Return the change of the platform to a lighter one, with moments of inertia in proportion."""
    given, mass = scenario.robot.model_dump()["platform"], scenario.robot.platform.mass

    def with_mass(share: float) -> Variation:
        inertia = None if given["inertia"] is None else [share * value for value in given["inertia"]]
        varied = _with_robot(scenario, platform=given | {"mass": share * mass, "inertia": inertia})
        return varied, share * mass, f"instead of {quantity(mass, 'kg')}"

    return Change("platform.mass", "kg", with_mass)


def _other_limits_of_cables(scenario: Scenario, limit: str) -> Change | None:
    """Return the change of all t_max to larger ones, or of all t_min to smaller ones, by one factor."""
    given, values = scenario.robot.model_dump()["cables"], getattr(scenario.robot, limit)
    largest, others = float(values.max()), "" if np.ptp(values) == 0 else ", the others by the same factor"
    stronger = limit == "t_max"
    if largest == 0.0:
        return None

    def with_limits(share: float) -> Variation:
        factor = 1 + (STRONGEST - 1) * (1 - share) ** 4 if stronger else share  # fine steps near one
        varied = _with_robot(scenario, cables=[cable | {limit: factor * cable[limit]} for cable in given])
        return varied, factor * largest, f"instead of {quantity(largest, 'N')}{others}"

    return Change(f"cables.{limit}", "N", with_limits, up=stronger)


def _with_robot(scenario: Scenario, **changes: Any) -> Scenario:
    """Return the scenario of a robot with other masses or tension limits, laid out for the same task."""
    limits = scenario.limits
    of_points = not (limits.of_tensions or scenario.task.limits.own)  # the same for both robots
    robot = Robot.model_validate(scenario.robot.model_dump() | changes)
    return lay_out(robot, scenario.task, limits=limits if of_points else None)


larger_t_max = partial(_other_limits_of_cables, limit="t_max")
smaller_t_min = partial(_other_limits_of_cables, limit="t_min")
