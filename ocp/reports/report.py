"""The report of a plan, in sections of named facts."""

from collections.abc import Callable, Iterable

import numpy as np

from ...base.display import Fact
from ...base.text import at_most, column, counted, quantity
from ...figures.drawing import Drawing
from ...figures.report import Report, Section, Table
from ...models.parsing import to_yaml
from ..result import PlanData, Relaxed
from ..tasks.phase import SAME_TIME
from ..timing.timed_task import can_be_timed
from .reasons import exceeded, ideas, in_phase, motion_facts, reasons, units, up, wind

WORTH_A_NUMBER = 1e-3  # [N], of a margin
RESOLVED = 1e-3  # [mm, mrad]: a smaller error of a simulation is rounding
SAME_LENGTH = 1e-9  # [m]
FEW = 3  # pairs of tension limits that are written out
AT_REST = 1e-5  # [m/s]: a smaller speed of a cable is rounding
TRY = "What you can try"


def headline(plan: PlanData) -> str:
    """Return the result in one line: robot, task, status, and what decided it."""
    about = f"{plan.scenario.robot.name}, {plan.scenario.task.name}"
    return f"{about}: {plan.status.value.upper()}, {decisive(plan)}"


def decisive(plan: PlanData) -> str:
    """Return the decisive fact of the result, in one line."""
    because = f"{plan.reason}; closest motion: " if plan.reason else ""
    return f"{because}{_of_the_motion(plan)}"


def sections(plan: PlanData) -> list[Section]:
    """Return the report below its first line; sections without facts are left out."""
    titles = {"infeasible": "Why it is infeasible", "not-found": "What the closest motion violates"}
    bottlenecks = [] if plan.law is None else [("", each.describe()) for each in plan.law.bottlenecks]
    every = [
        Section(titles.get(plan.status.value, "Limits"), reasons(plan)),
        Section(TRY, units(plan) + [_relaxation(plan, relaxed) for relaxed in plan.relaxations] + ideas(plan)),
        Section("Warnings", [("warning", sentence) for sentence in plan.warnings]),
        Section("Active limits along the path (s = 0 at its start, 1 at its end)", bottlenecks),
        Section("Soft limits exceeded", [("limit", str(excess)) for excess in plan.audit.soft_excess]),
        Section("Tensions", _tensions(plan)),
        Section("Uncertain geometry", _robots(plan)),
        Section("Motion", motion_facts(plan)),
        Section("Carriers", _carriers(plan)),
        Section("Audit", _audit(plan)),
        Section("Computation", _computation(plan)),
    ]
    return [section for section in every if section.facts]


def facts_at_once(plan: PlanData) -> list[Fact]:
    """Return the facts that need no further plans or motions, the most important first."""
    certificate = plan.certificate
    why = [] if certificate is None else certificate.text(up(plan))._asdict().items()
    facts = [*why, *_tensions(plan), *motion_facts(plan), *_audit(plan), *_computation(plan)]
    return [(name.replace("_", " "), fact) for name, fact in facts]


def spans_table(plan: PlanData) -> Table | None:
    """Return the table of the time spans without tensions, with needed and available at the worst instant of each.

    None for a motion with fewer than two: a single one is described by the certificate of the plan.
    """
    rows = []
    for certificate in plan.infeasible_spans:
        text = certificate.text(up(plan))
        start, end = certificate.span or (certificate.time, certificate.time)
        times = tuple(f"{time:.3f}" for time in (start, end, certificate.time))
        numbers = (certificate.demand, certificate.support, certificate.shortfall)
        direction = text.along.partition("; ")[0]
        rows.append((*times, direction, *(quantity(number) for number in numbers), text.limits))
    columns = ("from [s]", "to [s]", "worst at [s]", "direction")
    columns += ("needed [N]", "available [N]", "short by [N]", "limits")
    return Table("Time spans with no feasible tensions", columns, rows) if len(rows) > 1 else None


def cables_table(plan: PlanData) -> Table | None:
    """Return the table of what each winch must do; None if no cable changes its length."""
    audit, m = plan.audit, plan.scenario.robot.m
    lengths = plan.scenario.dynamics.cable_lengths(audit.motion.pose, audit.carriers.pose)
    if np.ptp(lengths, axis=0).max() < SAME_LENGTH:
        return None
    passed = np.diff(audit.times)
    moves = passed > 0  # phases meet at two instants of one time
    speeds = np.abs(np.diff(lengths, axis=0)[moves] / passed[moves, None]).max(axis=0)
    speeds[speeds < AT_REST] = 0.0
    tensions = audit.tensions[_have_tensions(plan)]
    extremes = (tensions.min(axis=0), tensions.max(axis=0)) if len(tensions) else (np.full(m, np.nan),) * 2
    every = [lengths[0], lengths[-1], lengths.min(axis=0), lengths.max(axis=0), speeds, *extremes]
    written = zip(*(column(values.tolist()) for values in every), strict=True)
    rows = [(str(k + 1), *row) for k, row in enumerate(written)]
    lengths_are = ("initial length [m]", "final [m]", "shortest [m]", "longest [m]", "top speed [m/s]")
    return Table("Cables", ("cable", *lengths_are, "smallest tension [N]", "largest [N]"), rows, range(8))


def phases_table(plan: PlanData) -> Table | None:
    """Return the table of the phases; None for a task without."""
    rows = []
    for phase in plan.phases:
        extremes = ("none" if value is None else quantity(value) for value in (phase.tension_min, phase.tension_max))
        reaction = "in the air" if phase.reaction_max is None else quantity(phase.reaction_max)
        times = f"{phase.start:.3f}", f"{phase.end:.3f}"
        rows.append((phase.name, *times, quantity(phase.load), *extremes, reaction))
    columns = ("phase", "from [s]", "to [s]", "load [kg]", "smallest tension [N]", "largest tension [N]")
    return Table("Phases", (*columns, "largest ground reaction [N]"), rows) if rows else None


def stages_table(plan: PlanData) -> Table | None:
    """Return the table of the planner's stages; None if there is none. A stage without a message is left out."""
    rows = [
        (stage.name, quantity(stage.seconds, "s", digits=2), stage.message) for stage in plan.stages if stage.message
    ]
    return Table("Stages", ("stage", "computed in", "result"), rows) if rows else None


def report(plan: PlanData, drawings: Callable[[], Iterable[Drawing]] = tuple) -> Report:
    """Return the report of a plan; the spans without tensions follow the sections why, and what to try."""
    robot, task, every, spans = plan.scenario.robot, plan.scenario.task, sections(plan), spans_table(plan)
    first = 1 + any(section.title == TRY for section in every)
    tables = [table for table in (cables_table(plan), phases_table(plan), stages_table(plan)) if table is not None]
    return Report(
        about=f"{robot.name}, {task.name}",
        status=plan.status.value,
        summary=decisive(plan),
        parts=[*every[:first], *([] if spans is None else [spans]), *every[first:], *tables],
        drawings=drawings,
        folded=("Audit", "Computation", "Stages"),
        files=[
            ("The robot's file", lambda: to_yaml(robot)),
            ("Complete task, defaults included (frame: world is {G})", lambda: to_yaml(task.in_file())),
        ],
    )


def _of_the_motion(plan: PlanData) -> str:
    if plan.law is not None and not plan.law.exists:
        if (proof := plan.law.certificate) is None:
            return "the motion only shows the path"
        short = f"{quantity(proof.shortfall, 'N')} short of the required wrench"
        return f"{short} at s = {plan.law.at:.4g}, whatever the speed"
    if plan.law is not None and plan.feasible:
        return f"shortest duration {quantity(plan.duration, 's', 6)}"
    if plan.feasible:
        # The planned tensions are those of one wind and load; with the others they exist, with the required margin.
        where = ", in every wind of the task" if plan.scenario.wind_set is not None else ""
        where = ", with every load of the task" if plan.scenario.phases.extremes else where
        margin = plan.scenario.hard_margin if where else plan.margin
        if margin is None or margin < WORTH_A_NUMBER:
            return f"every tension inside its limits{where}"
        return f"every tension at least {quantity(margin, 'N')} inside its limits{where}"
    certificate, excess = plan.certificate, exceeded(plan)
    if certificate is None and excess:
        return f"{excess[0]}{in_phase(plan, excess[0].time)}{_more(len(excess) - 1)}"
    if certificate is None:
        return "see the stages"
    short = f"{quantity(certificate.shortfall, 'N')} short of the required wrench at t = {certificate.time:.3f} s"
    short += in_phase(plan, certificate.time)
    if certificate.wind is not None:
        short += f" in wind {wind(certificate.wind)}"
    short += "" if certificate.load is None else f" with {certificate.load_text}"
    return f"{short}{_more(len(excess))}"


def _more(count: int) -> str:
    """Return the number of limits that a sentence leaves out, to follow it; empty for none."""
    return f", {counted(count, 'other limit')} exceeded" if count else ""


def _relaxation(plan: PlanData, relaxed: Relaxed) -> Fact:
    fact = f"{quantity(relaxed.possible, relaxed.unit)}{relaxed.detail and f' {relaxed.detail}'} (audited)"
    others = [each.name for each in plan.relaxations if each.plan is relaxed.plan and each is not relaxed]
    if others:
        return f"feasible {relaxed.name}", f"{fact}, together with {', '.join(others)}"
    if relaxed.name == "duration":
        longer = relaxed.possible > relaxed.requested
        side = "shortest" if longer else "longest"
        timed = longer and can_be_timed(plan.scenario.robot, plan.scenario.task)
        other = "; `towline time` computes the fastest time law" if timed else ""
        close = "" if relaxed.detail else f", close to the {side} feasible one for this time law"
        return "feasible duration", f"{fact}{close}{other}"
    return f"feasible {relaxed.name}", fact


def _have_tensions(plan: PlanData) -> np.ndarray:
    """Return at which instants of the audit there are feasible tensions, (n,)."""
    audit = plan.audit
    exist = np.asarray(np.isfinite(audit.tensions).all(axis=1))
    if plan.scenario.wind_set is None and not plan.scenario.phases.extremes:
        exist &= audit.violation <= audit.tolerance  # near singular poses the tensions are the closest ones
    return exist


def _tensions(plan: PlanData) -> list[Fact]:
    robot, audit = plan.scenario.robot, plan.audit
    relaxed = bool(robot.t_min.any()) and any(phase.slack for phase in plan.scenario.phases.all)
    exist = _have_tensions(plan)
    facts: list[Fact] = []
    if not exist.all():
        without = audit.times[~exist]
        most = 100.0 * (~exist).mean()
        share = f"for {quantity(min(most, 99.9) if exist.any() else most, digits=3)} % of the motion"
        facts.append(("no feasible tensions", f"{share}, first at {without[0]:.3f} s, last at {without[-1]:.3f} s"))
    if exist.any():
        times, values = audit.times[exist], audit.tensions[exist]
        t_min = plan.scenario.t_min_at(times)
        inside = np.minimum(values - t_min, robot.t_max - values)

        def located(index: int, which: np.ndarray, side: str = "") -> str:
            row, cable = np.unravel_index(index, which.shape)
            return f"{quantity(which[row, cable], 'N')}{side} in cable {cable + 1} at t = {times[row]:.3f} s"

        nearest = np.unravel_index(int(inside.argmin()), inside.shape)
        above = values[nearest] - t_min[nearest] == inside[nearest]
        side = " above t_min" if above else " below t_max"
        required = plan.scenario.task.margin
        part = "" if exist.all() else " elsewhere"
        also = f" ({quantity(required, 'N')} required{' where no cable may be slack' * relaxed})" * (required > 0)
        facts += [
            (f"smallest{part}", located(int(values.argmin()), values)),
            (f"largest{part}", located(int(values.argmax()), values)),
            (f"tension margin{part}", f"{located(int(inside.argmin()), inside, side)}{also}"),
        ]
    limits = zip(robot.t_min, robot.t_max, strict=True)
    pairs = list(dict.fromkeys(f"{quantity(low, 'N')} to {quantity(high, 'N')}" for low, high in limits))
    slack = "; at least 0 N where cables may be slack" if relaxed else ""
    more = f", and {len(pairs) - FEW} more" * (len(pairs) > FEW) + " (by cable)" * (len(pairs) > 1)
    return [*facts, ("limits", f"{', '.join(pairs[:FEW])}{more}{slack}"), *_jumps(plan)]


def _robots(plan: PlanData) -> list[Fact]:
    """Return the spread of tensions due to the geometric uncertainty, and how many sampled robots keep the limits."""
    margin = plan.robust
    if margin is None:
        return []
    row, cable = np.unravel_index(int(margin.reach.argmax()), margin.reach.shape)
    share = f"{quantity(100 * margin.share, '%')} of the robots"
    at = f"in cable {cable + 1} at t = {plan.audit.times[row]:.3f} s"
    kept = f"to first order, tensions {'' if margin.holds else 'do not always '}stay inside their limits"
    drawn = plan.share_of_robots().holds
    return [
        (share, kept),
        (
            "tension spread",
            f"up to {quantity(margin.reach.max(), 'N')} {at}, which is {margin.factor:.3g} standard deviations",
        ),
        ("random samples", f"{int(drawn.sum())} of {len(drawn)} robots have tensions inside their limits throughout"),
    ]


def _jumps(plan: PlanData) -> list[Fact]:
    """Return where the tensions jump, because the load changes in the air."""
    facts = []
    for time in plan.scenario.phases.jumps:
        after = int(np.searchsorted(plan.audit.times, time * (1 - SAME_TIME)))
        rise = np.abs(plan.audit.tensions[after] - plan.audit.tensions[after - 1]).max()
        if np.isfinite(rise):  # tensions exist before and after
            why = "the load changes between two phases off the ground"
            facts.append(("jump", f"by up to {quantity(rise, 'N')} at t = {time:.3f} s, where {why}"))
    return facts


def _carriers(plan: PlanData) -> list[Fact]:
    """Return the largest speed, acceleration and tilt of each carrier that could move, against its limits."""
    facts = []
    motion, times = plan.audit.carriers, plan.audit.times
    for index, carrier in enumerate(plan.scenario.robot.carriers):
        if not carrier.moves:
            continue
        limits = {limit.name: limit.high for limit in plan.scenario.limits if limit.labels == (carrier.name,)}
        if not (motion.velocity[:, index].any() or motion.acceleration[:, index].any()):
            facts.append((carrier.name, "at rest"))
            continue
        speed, acceleration = (
            np.linalg.norm(part[:, index, :3], axis=1) for part in (motion.velocity, motion.acceleration)
        )
        facts.append((carrier.name, _against(speed, limits.get("carrier_speed"), "m/s", times)))
        facts.append(("", _against(acceleration, limits.get("carrier_acceleration"), "m/s^2", times)))
        for limit in plan.scenario.limits:
            if limit.name == "carrier_tilt" and limit.labels == (carrier.name,):
                tilt, most = np.degrees(plan.audit.limiting(limits=[limit])[0][:, 0]), float(np.degrees(limit.high))
                facts.append(("", _against(tilt, most, "degrees of tilt", times)))
    return facts


def _against(values: np.ndarray, limit: float | None, unit: str, times: np.ndarray) -> str:
    row = int(values.argmax())
    bound = "no limit" if limit is None else f"limit {quantity(limit, unit.partition(' ')[0])}"
    return f"up to {quantity(values[row], unit)} at t = {times[row]:.3f} s ({bound})"


def _audit(plan: PlanData) -> list[Fact]:
    audit = plan.audit
    worst = quantity(audit.violation.max(), "N")
    if not worst.startswith("0 "):
        worst += f" at t = {audit.times[audit.worst]:.3f} s"
    if plan.law is not None and not plan.law.exists:
        worst += " of the motion shown"
    facts = [
        ("instants", f"{quantity(len(audit.times))}, one every {quantity(1e3 / audit.rate, 'ms')}"),
        ("largest wrench error", f"{worst} (tolerance {quantity(audit.tolerance, 'N', digits=2)})"),
    ]
    if names := list(dict.fromkeys(limit.name for limit in plan.scenario.limits if limit.shown)):
        facts.append(("other limits checked", ", ".join(names)))
    if (drift := audit.drift) is not None:
        window = _error(drift.window_position, drift.window_attitude)
        after = f"platform error after {quantity(drift.window, 's', digits=2)} with the planned tensions: {window}"
        facts.append(("open-loop simulation", after))
        facts.append(("", f"over the whole plan: {_error(drift.position, drift.attitude)}"))
    return facts


def _error(position: float, attitude: float) -> str:
    """Return the largest error of a simulated platform, from [m] and [rad]."""
    if not np.isfinite([position, attitude]).all():
        return "the simulation diverges"
    return f"{at_most(position * 1e3, 'mm', RESOLVED)} and {at_most(attitude * 1e3, 'mrad', RESOLVED)}"


def _computation(plan: PlanData) -> list[Fact]:
    """Return the times for the nonlinear programs; a plan that needed none has no facts."""
    if plan.build_s == 0:
        return []
    parts = (("building programs", plan.build_s), ("solving programs", plan.solve_s))
    return [(name, quantity(seconds, "s", digits=3)) for name, seconds in parts]
