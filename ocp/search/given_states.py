"""Offer what a given state off the path needs: a wider tube, or lower speeds; each is planned and audited."""

import numpy as np

from ...base.text import quantity
from ..audits.audit import Audit
from ..plan import Plan
from ..proofs.infeasible_ends import infeasible_ends
from ..result import Relaxed
from ..tasks.lay_out import lay_out
from ..tasks.scenario import Scenario
from .relaxations import BEYOND, planned, rounded
from .search import Search

HALVINGS = 5  # of the speeds: each solves a program
STATES = "initial", "final"


def near_given_states(search: Search, scenario: Scenario, audit: Audit) -> list[Relaxed]:
    """Return a wider tube for states outside it, or else the highest speeds of the states that are feasible."""
    return _wider_tube(search, scenario, audit) or _lower_speeds(search, scenario)


def _wider_tube(search: Search, scenario: Scenario, audit: Audit) -> list[Relaxed]:
    """Return the radius of the tube that reaches the state farthest outside it."""
    tube = scenario.task.tube
    off = max((excess.value for excess in audit.excess if excess.limit == "tube.position"), default=0.0)
    if off <= tube.radius:
        return []
    radius = rounded((1 + BEYOND) * off, up=True)
    wider = {"tube": tube.model_copy(update={"position": radius})}
    plan = _unless_proven(search, lay_out(scenario.robot, scenario.task.model_copy(update=wider)))
    return [] if plan is None else [Relaxed("tube.position", "m", tube.radius, radius, plan)]


def _lower_speeds(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the highest given speed with which the motion is feasible; others change by the same factor."""
    task = scenario.task
    moving = [name for name in STATES if any(getattr(getattr(task, name), "velocity", None) or ())]
    given = [getattr(getattr(task, name), key, None) for name in STATES for key in ("velocity", "acceleration")]
    changed = np.any([np.abs(rates) > 0 for rates in given if rates is not None], axis=0)
    if not moving or not set(np.flatnonzero(changed)) <= set(scenario.platform_free):
        return []  # what the path prescribes there cannot change
    velocity = np.array(getattr(task, moving[0]).velocity)
    part, unit = (velocity[:3], "m/s") if velocity[:3].any() else (velocity[3:], "rad/s")
    speed = float(np.linalg.norm(part))
    low, high, best = 0.0, 1.0, None
    for _ in range(HALVINGS):
        share = rounded(speed * (low + high) / 2, up=False) / speed
        states = {}
        for name in STATES:
            state = getattr(task, name)
            given = [key for key in ("velocity", "acceleration") if getattr(state, key, None) is not None]
            slower = {key: tuple(share * value for value in getattr(state, key)) for key in given}
            states[name] = None if state is None else state.model_copy(update=slower)
        plan = _unless_proven(search, lay_out(scenario.robot, task.model_copy(update=states)))
        low, high, best = (low, share, best) if plan is None else (share, high, plan)
    if best is None:
        return []
    others = "; all given speeds and accelerations by the same factor"
    name, detail = f"{moving[0]}.velocity", f"instead of {quantity(speed, unit)}{others}"
    return [Relaxed(name, unit, speed, low * speed, best, detail)]


def _unless_proven(search: Search, scenario: Scenario) -> Plan | None:
    """Return the plan of a scenario, if one is found; the program of one that is proven infeasible is not solved."""
    return planned(search, scenario, "audit, other states") if infeasible_ends(scenario) is None else None
