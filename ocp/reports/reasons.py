"""Why a motion is infeasible, as rows of its report: `reasons`."""

import numpy as np

from ...base.display import Fact
from ...base.text import numbered, quantity, quantity_range, quantity_row
from ...solvers import Certificate
from ..audits.excess import TENSIONS, Excess
from ..result import PlanData
from .motion_facts import wind

LEVEL = 1e-3  # [rad]: of a smaller attitude nothing is said


def reasons(plan: PlanData) -> list[Fact]:
    """Return what the motion of an infeasible plan violates, and where; empty for a feasible one."""
    if plan.feasible:
        return []
    facts: list[Fact] = []
    if plan.law is not None and not plan.law.exists:
        place = f"s = {plan.law.at:.4g} of the path (0 at its start, 1 at its end)"
        if plan.law.certificate is None:
            facts.append(("search ended at", place))
        else:
            facts.append(("worst position", f"{place}, where no time law is feasible"))
        facts.append(
            ("motion", f"the path, shown by a motion of {quantity(plan.duration, 's')} without a feasible time law")
        )
    if (certificate := plan.certificate) is not None:
        text, phase = certificate.text(up(plan)), in_phase(plan, certificate.time)
        facts += [
            *([("cause", cause)] if (cause := _cause(plan, certificate)) else []),
            ("time", f"t = {certificate.time:.3f} s of {quantity(plan.scenario.duration, 's')}{phase}"),
            ("pose", _pose_then(plan, certificate.time)),
            *([("wind", wind(certificate.wind))] if certificate.wind is not None else []),
            *([("load", certificate.load_text)] if certificate.load is not None else []),
            ("direction", text.along),
            ("needed", text.needed),
            ("available", text.available),
            ("short by", text.short_by),
            ("limits", _bounds(plan, certificate) or text.limits),
        ]
    facts += [("limit exceeded", f"{excess}{in_phase(plan, excess.time)}") for excess in exceeded(plan)]
    return facts


def exceeded(plan: PlanData) -> list[Excess]:
    """Return the limits that a motion exceeds; a certificate says more than a wrench error."""
    return [each for each in plan.audit.excess if plan.certificate is None or each.limit != TENSIONS]


def _cause(plan: PlanData, certificate: Certificate) -> str:
    """Return in a sentence where the platform is and which tensions would help; empty where no cable pulls."""
    scenario, time = plan.scenario, certificate.time
    low, high = scenario.bounds_in(None if time is None else scenario.phases.at(time))
    ways = [
        f"{_one_of(cables, scenario.robot.m)} would have to go {way} {quantity_range(bound[cables], 'N')}"
        for way, cables, bound in (("below", certificate.at_min, low), ("above", certificate.at_max, high))
        if cables.size
    ]
    nothing = f"no cable pulls along {certificate.text(up(plan)).along.partition('; ')[0]}"
    return f"at {_pose_then(plan, time)}, {', or '.join(ways) or nothing}"


def _one_of(cables: np.ndarray, m: int) -> str:
    """Return "cable 3", "cable 3 or 5", "one of cables 1, 3, 4" or "one of the cables"."""
    numbers = [str(k + 1) for k in cables]
    if len(numbers) < 3:
        return f"cable {' or '.join(numbers)}"
    return "one of the cables" if len(numbers) == m else f"one of cables {', '.join(numbers)}"


def _pose_then(plan: PlanData, time: float | None) -> str:
    """Return where the platform is at a time, and its attitude if it is not level."""
    row = int(np.argmin(np.abs(plan.audit.times - (0.0 if time is None else time))))
    pose = plan.audit.motion.pose[row]
    place = f"({', '.join(f'{value + 0.0:.4g}' for value in np.round(pose[:3], 6))}) m"
    turned = ", ".join(f"{np.rad2deg(value) + 0.0:.3g}" for value in np.round(pose[3:], 6))
    return place if np.abs(pose[3:]).max() < LEVEL else f"{place}, roll, pitch, yaw ({turned}) degrees"


def _bounds(plan: PlanData, certificate: Certificate) -> str:
    """Return the tension limits of a certificate with their values; empty if no cable pulls along it."""
    scenario, time = plan.scenario, certificate.time
    low, high = scenario.bounds_in(None if time is None else scenario.phases.at(time))
    limits = [
        f"{name} of {numbered('cable', cables)} ({quantity_row(np.unique(bound[cables]), 'N')})"
        for name, cables, bound in (("t_min", certificate.at_min, low), ("t_max", certificate.at_max, high))
        if cables.size
    ]
    margin = plan.scenario.hard_margin
    return "; ".join(limits) + (f", with a margin of {quantity(margin, 'N')}" if limits and margin else "")


def in_phase(plan: PlanData, time: float | None) -> str:
    """Return the phase of a time, to follow it; empty for a task without phases."""
    phase = None if time is None else plan.scenario.phases.at(time)
    return "" if phase is None else f" in phase {phase.name!r}"


def up(plan: PlanData) -> np.ndarray:
    """Return the direction against gravity in {G}, (3,)."""
    return -np.array(plan.scenario.robot.gravity)
