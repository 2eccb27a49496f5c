"""What a person wants to know of a plan, in sections of named facts; as text. `report_page` has them as HTML."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...models import Robot
from ...models.robot import COORDINATES, Vector3
from ...solvers import Certificate
from ..tasks.task import Task
from ..tasks.wind_set import WindBox
from .finding import Finding

LEAST_SHARE = 0.05  # of a direction: what turns it less is not put into words
Fact = tuple[str, str]  # its name, and the fact with its unit


class Section(NamedTuple):
    """Facts that belong together."""

    title: str
    facts: list[Fact]


class Table(NamedTuple):
    """Rows of equal kind under named columns."""

    title: str
    columns: tuple[str, ...]
    rows: list[tuple[str, ...]]


def verdict(plan: Finding) -> str:
    """The answer in one line: robot, task, status, and what decided it."""
    return f"{plan.scenario.robot.name}, {plan.scenario.task.name}: {plan.status.value.upper()}, {_decisive(plan)}"


def sections(plan: Finding) -> list[Section]:
    """All that the report tells below its first line; sections without facts are left out."""
    titles = {"infeasible": "Why there is none", "not-found": "What the closest motion misses"}
    found = [
        Section(titles.get(plan.status.value, "Limits"), _why(plan)),
        Section("Soft limits passed", [("limit", str(excess)) for excess in plan.audit.soft_excess]),
        Section("Tensions", _tensions(plan)),
        Section("Motion", _motion(plan)),
        Section("Carriers", _carriers(plan)),
        Section("Audit", _audit(plan)),
        Section("Stages", [(stage.name, f"{stage.verdict} ({stage.seconds:.3f} s)") for stage in plan.stages]),
        Section("Computation", _computation(plan)),
    ]
    return [section for section in found if section.facts]


def missing(plan: Finding) -> Table | None:
    """When the motion lacks wrench, which cables bind then, and what is needed and available along the certificate.

    None of a motion that lacks nothing.
    """
    rows = []
    for span in plan.missing:
        certificate = span.certificate
        most = describe_direction(certificate, plan.scenario.robot).partition(", ")[0]
        numbers = (certificate.demand, certificate.support, certificate.shortfall)
        times = (f"{time:.3f}" for time in (span.start, span.end, span.at))
        rows.append((*times, most, _binding(certificate), *(_short(number) for number in numbers)))
    columns = ("from [s]", "to [s]", "worst [s]", "along", "cables that bind")
    columns += ("needed [N]", "available [N]", "short by [N]")
    return Table("When wrench is missing", columns, rows) if rows else None


def as_text(plan: Finding) -> str:
    """The whole report for a terminal."""
    parts = sections(plan)
    width = max(len(name) for section in parts for name, _ in section.facts)
    lines = [verdict(plan)]
    for index, (title, facts) in enumerate(parts):
        lines.append(f"  {title}")
        lines += [f"    {name:<{width}}  {fact}" for name, fact in facts]
        table = missing(plan) if index == 0 else None
        if table is not None:
            lines += _in_columns(table)
    return "\n".join(lines)


def _in_columns(table: Table) -> list[str]:
    """A table's lines, columns as wide as they need."""
    rows = [table.columns, *table.rows]
    widths = [max(len(row[k]) for row in rows) for k in range(len(table.columns))]
    told = ["  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    return [f"  {table.title}", *(f"    {line}" for line in told)]


def _binding(certificate: Certificate) -> str:
    """The cables at their limits along the certificate, counted from 1."""
    at = (("t_min", certificate.at_min), ("t_max", certificate.at_max))
    return "; ".join(f"{name}: {_listed(cables + 1)}" for name, cables in at if cables.size) or "none pulls so"


def _decisive(plan: Finding) -> str:
    if plan.feasible:
        return f"every tension inside its limits, by {_short(plan.margin)} N at least"
    certificate, excess = plan.audit.certificate, plan.audit.excess
    broken = f"{len(excess)} other limit{'s' * (len(excess) > 1)} broken" if excess else ""
    if certificate is None:
        return broken or "see the solver's message"
    short = f"short by {_short(certificate.shortfall)} N at t = {plan.audit.certificate_time:.3f} s"
    if (wind := plan.audit.certificate_wind) is not None:
        short += f" at wind {_wind(wind)}"
    return f"{short}, {broken}" if broken else short


def _why(plan: Finding) -> list[Fact]:
    if plan.feasible:
        return []
    facts: list[Fact] = []
    certificate, robot = plan.audit.certificate, plan.scenario.robot
    if certificate is not None:
        pulled = ": the cables can but pull the other way"
        facts += [
            ("time", f"t = {plan.audit.certificate_time:.3f} s of {plan.scenario.duration:g} s"),
            *([("wind", _wind(wind))] if (wind := plan.audit.certificate_wind) is not None else []),
            ("constraint", _constraint(plan, certificate)),
            ("wrench direction", describe_direction(certificate, robot)),
            ("as a vector", _vector(certificate)),
            ("needed", f"{_short(certificate.demand)} N along it"),
            ("available", f"{_short(certificate.support)} N at most" + pulled * (certificate.support < 0)),
            ("short by", f"{_short(certificate.shortfall)} N"),
        ]
    facts += [("limit broken", str(excess)) for excess in plan.audit.excess]
    if (relaxed := plan.relaxed) is not None:
        asked, possible = (f"{value:.4g} {relaxed.unit}" for value in (relaxed.asked, relaxed.possible))
        facts.append(("would do", f"a {relaxed.name} of {possible} instead of {asked}, planned and audited"))
    return facts


def _constraint(plan: Finding, certificate: Certificate) -> str:
    if certificate.singular:
        return "wrench balance: no cable pulls along the direction, however large its tension"
    low, high = plan.scenario.bounds()
    at = [("t_min", certificate.at_min, low), ("t_max", certificate.at_max, high)]
    told = [
        f"{name} in {'cables' if len(cables) > 1 else 'cable'} {_listed(cables + 1)} ({_values(bound[cables])} N)"
        for name, cables, bound in at
        if cables.size
    ]
    margin = plan.scenario.hard_margin
    return f"tension limits, {'; '.join(told)}" + (f", with the margin of {margin:g} N" if margin else "")


def describe_direction(certificate: Certificate, robot: Robot) -> str:
    """Which way a certificate points: its parts of 5 % and more, the largest first, with their shares.

    A share is the square of a component of the direction, moments over `Robot.length`: they sum up to 100 %.
    """
    direction = certificate.direction
    names = COORDINATES if direction.size == 6 else robot.platform.dof
    turning = np.array([name in COORDINATES[3:] for name in names])
    parts = direction * np.where(turning, certificate.length, 1.0)
    shares = parts**2 / (parts @ parts)
    said = []
    for i in np.argsort(-shares):
        if shares[i] >= LEAST_SHARE:
            axis, sign = COORDINATES.index(names[i]) % 3, "+" if parts[i] > 0 else "-"
            kind = "moment about" if turning[i] else "force along"
            sense = "" if turning[i] else _sense(robot, axis, float(parts[i]))
            said.append(f"{100 * shares[i]:.0f} % {kind} {sign}{'xyz'[axis]}{sense}")
    return ", ".join(said)


def _sense(robot: Robot, axis: int, part: float) -> str:
    """Up or down, where gravity says so."""
    gravity = np.array(robot.gravity)
    if abs(gravity[axis]) < 0.99 * np.linalg.norm(gravity) or not gravity.any():
        return ""
    return " (up)" if part * gravity[axis] < 0 else " (down)"


def _vector(certificate: Certificate) -> str:
    direction = certificate.direction
    if direction.size != 6:
        return f"({_listed(direction, '.3f')})"
    return f"force ({_listed(direction[:3], '.3f')}), moment ({_listed(direction[3:], '.3f')})/m"


def _tensions(plan: Finding) -> list[Fact]:
    robot, seen = plan.scenario.robot, plan.audit
    there = np.isfinite(seen.tensions).all(axis=1)
    facts: list[Fact] = []
    if not there.all():
        missing = seen.times[~there]
        share = f"{100 * (~there).mean():.3g} % of the time"
        facts.append(("none inside limits", f"{share}, between t = {missing[0]:.3f} s and t = {missing[-1]:.3f} s"))
    if there.any():
        times, values = seen.times[there], seen.tensions[there]
        inside = np.minimum(values - robot.t_min, robot.t_max - values)

        def told(index: int, which: np.ndarray) -> str:
            row, cable = np.unravel_index(index, which.shape)
            return f"{_short(which[row, cable])} N in cable {cable + 1} at t = {times[row]:.3f} s"

        nearest = np.unravel_index(int(inside.argmin()), inside.shape)
        limit = "t_min" if values[nearest] - robot.t_min[nearest[1]] == inside[nearest] else "t_max"
        wanted = plan.scenario.task.margin
        facts += [
            ("smallest", told(int(values.argmin()), values)),
            ("largest", told(int(values.argmax()), values)),
            ("margin", f"{told(int(inside.argmin()), inside)} from {limit}" + (f", {wanted:g} N asked" * (wanted > 0))),
        ]
    limits = zip(robot.t_min, robot.t_max, strict=True)
    pairs = list(dict.fromkeys(f"{low:g} N to {high:g} N" for low, high in limits))
    facts.append(("limits", pairs[0] if len(pairs) == 1 else f"{pairs[0]} and {len(pairs) - 1} more, by cable"))
    return facts


def _motion(plan: Finding) -> list[Fact]:
    task, seen = plan.scenario.task, plan.audit
    worst = int(seen.tracking_error.argmax())
    error = f"{_short(plan.tracking_error_max * 1e3)} mm at most"
    if seen.tracking_error[worst] > 0:
        error += f", at t = {seen.times[worst]:.3f} s"
    speed, acceleration = (
        np.linalg.norm(part[:, :3], axis=1).max() for part in (seen.motion.velocity, seen.motion.acceleration)
    )
    law = "" if plan.scenario.path is task.path else ", by the fastest time law"
    return [
        ("duration", f"{plan.scenario.duration:.6g} s"),
        ("path", f"{task.path.kind} in {'{G}' if task.path.frame == 'world' else task.path.frame}{law}"),
        ("tracking error", error),
        ("platform", f"up to {_short(speed)} m/s and {_short(acceleration)} m/s^2"),
        *([("wind", _asked_wind(task))] if task.wind is not None else []),
    ]


def _wind(wind: Vector3) -> str:
    return f"({_listed(np.array(wind), 'g')}) m/s"


def _asked_wind(task: Task) -> str:
    """The task's wind, or its box and whose tensions are told."""
    if isinstance(task.wind, WindBox):
        box = task.wind
        return f"any from {_wind(box.min)} to {_wind(box.max)}; the tensions are those in {_wind(box.middle)}"
    return "" if task.wind is None else _wind(task.wind)


def _carriers(plan: Finding) -> list[Fact]:
    """The largest speed, acceleration and tilt of each carrier that could move, against its limits."""
    facts = []
    seen = plan.audit.carriers
    for index, carrier in enumerate(plan.scenario.robot.carriers):
        if carrier.kind == "ground":
            continue
        limit = plan.scenario.limits.get(index)
        speed, acceleration = (
            np.linalg.norm(part[:, index, :3], axis=1) for part in (seen.velocity, seen.acceleration)
        )
        if not (seen.velocity[:, index].any() or seen.acceleration[:, index].any()):
            facts.append((carrier.name, "at rest"))
            continue
        facts.append((carrier.name, _against(speed, limit and limit.speed, "m/s", plan.audit.times)))
        facts.append(("", _against(acceleration, limit and limit.acceleration, "m/s^2", plan.audit.times)))
        if limit is not None and limit.tilt is not None:
            upright = np.cos(seen.pose[:, index, 3]) * np.cos(seen.pose[:, index, 4])
            tilt = np.degrees(np.arccos(np.clip(upright, -1, 1)))
            facts.append(("", _against(tilt, float(np.degrees(limit.tilt)), "degrees of tilt", plan.audit.times)))
    return facts


def _against(values: np.ndarray, limit: float | None, unit: str, times: np.ndarray) -> str:
    row = int(values.argmax())
    bound = "no limit" if limit is None else f"limit {limit:.4g} {unit.partition(' ')[0]}"
    return f"up to {_short(values[row])} {unit} at t = {times[row]:.3f} s ({bound})"


def _audit(plan: Finding) -> list[Fact]:
    seen = plan.audit
    facts = [
        ("rate", f"{seen.rate:.6g} Hz, {len(seen.times)} instants, by code that is not the planner's"),
        ("worst violation", f"{float(seen.violation.max()):.3g} N at t = {seen.times[seen.worst]:.3f} s"),
        ("counts as none", f"up to {seen.tolerance:.2g} N"),
    ]
    if (drift := seen.drift) is not None:
        away = f"{drift.window_position * 1e3:.3g} mm, {drift.window_attitude * 1e3:.3g} mrad"
        facts.append((f"pulled as planned for {drift.window:.2g} s", f"{away} off the plan at most"))
        whole = f"{drift.position * 1e3:.3g} mm, {drift.attitude * 1e3:.3g} mrad"
        facts.append(("pulled as planned throughout", f"{whole} off the plan at most"))
    return facts


def _computation(plan: Finding) -> list[Fact]:
    facts = [("build", f"{plan.build_s:.3f} s"), ("solve", f"{plan.solve_s:.3f} s")]
    if plan.deviation is None:
        fixed = plan.scenario.is_fixed
        why = "the task fixes the motion, the audit alone decides" if fixed else "a stage before it knew the answer"
        return [*facts, ("solver", f"none: {why}")]
    starts = sum(row[0] == 0 for row in plan.iterates)
    runs = f", run {starts} of {starts}" if starts > 1 else ""
    return [*facts, ("solver", f"{plan.iterations} iterations{runs}: {plan.message}")]


def _short(value: float | None) -> str:
    """Four digits; what is but rounding beside a newton or a metre is zero."""
    return "-" if value is None else f"{0.0 if abs(value) < 1e-9 else value:.4g}"


def _listed(values: np.ndarray, form: str = "d") -> str:
    return ", ".join(f"{value:{form}}" for value in values).replace("-0.000", "0.000")


def _values(values: np.ndarray) -> str:
    return ", ".join(f"{value:g}" for value in np.unique(values))
