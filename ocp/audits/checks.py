"""Check all limits of a motion besides its tensions: each limit on its own, from the motion alone, densely.

Each check returns the limits that are exceeded, each at its worst instant (`Excess`); an empty list means that all are
kept. The formula of a limit is the one that the nonlinear program has (`limits`), evaluated here on the dense grid in
the limit's own unit, with no use of the program's points; all else is computed by NumPy, from the task's own numbers
and by differences, and shares nothing with the program.
"""

import numpy as np

from ...models.part import COORDINATES
from ...models.points import shortest_way
from ..limits.distance import Distance
from ..tasks.ends import at_rest_without_acceleration, carrier_ends, platform_ends
from ..tasks.paths import Motion
from ..tasks.scenario import ATTITUDE, POSITION, START_BAND
from ..tasks.task import FreeBase
from .excess import Excess
from .instants import Instants

START_TENSIONS = "initial.tensions"
UNITS = "m", "m/s", "m/s^2"  # of a motion and its derivatives

PATH_TOLERANCE = 1e-7  # [m, rad], of ends and waypoints
END_TOLERANCE = 1e-6  # [m, m/s, m/s^2], of where carriers and platform start and end
END_ACCELERATION_TOLERANCE = 1e-4  # [m/s^2, rad/s^2], of second differences
STILL_TOLERANCE = 1e-6  # [m/s, m/s^2, rad], of carriers that keep their place or attitude
LENGTH_TOLERANCE = 1e-4  # [m], of lengths that the drive keeps
DURATION_TOLERANCE = 1e-7  # relative
JUMP_TOLERANCE = 1e-6  # [m, rad]; ten times that of speeds [m/s, rad/s]: programs meet their equations to 1e-8
END_STEP = 1e-4  # [s], of differences at the ends: rounding divides by its square
# First and second derivative at the first of six points a step apart: exact for the polynomials of fifth degree that
# motions are between nodes.
FIRST = np.array([-137.0, 300.0, -300.0, 200.0, -75.0, 12.0]) / 60.0
SECOND = np.array([45.0, -154.0, 214.0, -156.0, 61.0, -10.0]) / 12.0

_UNITS = ("m", "m", "m", "rad", "rad", "rad")


def excesses(audited: Instants) -> list[Excess]:
    """Return all limits that are exceeded, hard and soft."""
    checks = (_still, _lengths, _initial, _tube_ends, _waypoints, _base_ends, _grounded, _locked, _duration, _jumps)
    return [excess for check in (_limits, *checks) for excess in check(audited)]


def _limits(audited: Instants) -> list[Excess]:
    """Check the limits of task, robot and carriers, hard and soft."""
    limits, exceeded = audited.scenario.limits, []
    # A limit of tensions is not checked where there are none; any other value that is nan exceeds its limit.
    there = np.where(np.isfinite(audited.tensions).all(axis=1, keepdims=True), 0.0, np.nan)
    for limit, values, place in zip(limits, audited.values, limits.places, strict=True):
        if isinstance(limit, Distance):
            continue  # `clearances` bounds them over all time
        beyond = np.maximum(limit.low - values, values - limit.high)
        unchecked: np.ndarray | bool = False
        if limit.name in limits.of_tensions:
            unchecked = np.isnan(limit.over(audited.times, np.repeat(there, place.stop - place.start, axis=1)))
        beyond = np.where(np.isnan(beyond), np.where(unchecked, -np.inf, np.inf), beyond)
        if beyond.max() <= limit.tolerance:
            continue
        row, which = np.unravel_index(beyond.argmax(), beyond.shape)
        exceeded.append(Excess.of(limit, int(which), audited.times[row], values[row, which]))
    return exceeded


def _still(audited: Instants) -> list[Excess]:
    """Check that carriers keep the coordinates that they cannot change, and their position if only winches move."""
    robot, exceeded = audited.scenario.robot, []
    for index, carrier in enumerate(robot.carriers):
        if not carrier.moves:
            continue
        pose, velocity, acceleration = (part[:, index] for part in audited.carriers)
        if not carrier.free_coordinates(robot.drive):
            moves = np.maximum(np.abs(velocity).max(axis=1), np.abs(acceleration).max(axis=1))
            why = f"the drive {robot.drive} moves only winches"
            exceeded += _above(audited, "drive", carrier.name, moves, STILL_TOLERANCE, "m/s", "speed", why)
        free, why = carrier.free_coordinates("both"), f"a carrier of kind {carrier.kind} cannot change it"
        for limit, coordinates, unit in (("carrier_position", POSITION, "m"), ("carrier_attitude", ATTITUDE, "rad")):
            kept = [i for i in coordinates if i not in free]
            if kept:
                off = np.abs(pose[:, kept] - np.array(carrier.home)[kept]).max(axis=1)
                exceeded += _above(audited, limit, carrier.name, off, STILL_TOLERANCE, unit, "distance from home", why)
    return exceeded


def _above(
    audited: Instants, limit: str, about: str, values: np.ndarray, tolerance: float, unit: str, what: str, why: str = ""
) -> list[Excess]:
    """Check that values (n,) that ought to be zero never exceed a tolerance."""
    row = int(values.argmax())
    return _missed(limit, about, audited.times[row], values[row], tolerance, unit, what, why)


def _missed(
    limit: str, about: str, time: float, value: float, tolerance: float, unit: str, what: str, why: str = ""
) -> list[Excess]:
    """Check that a value that ought to be zero is a number not above a tolerance."""
    if value <= tolerance:
        return []
    return [Excess(limit, about, float(time), float(value), 0.0, unit, "exactly", why, what)]


def _lengths(audited: Instants) -> list[Excess]:
    """Check that cables keep the lengths that the drive fixes."""
    kept = audited.scenario.robot.fixed_lengths
    if kept is None:
        return []
    lengths = audited.scenario.dynamics.cable_lengths(audited.motion.pose, audited.carriers.pose)
    off = np.abs(lengths - kept)
    exceeded = []
    for i in np.flatnonzero(off.max(axis=0) > LENGTH_TOLERANCE):
        row, why = int(off[:, i].argmax()), "the drive fixed-length keeps it constant"
        facts = (float(audited.times[row]), float(lengths[row, i]), float(kept[i]), "m", "exactly", why)
        exceeded.append(Excess("cable_length", f"cable {i + 1}", *facts))
    return exceeded


def _initial(audited: Instants) -> list[Excess]:
    """Check that the motion starts as measured, and ends in the state that the task gives."""
    task, exceeded = audited.scenario.task, list[Excess]()
    bodies: list[tuple[int | None, str, Motion]] = [(None, "platform", audited.motion)]
    for i, carrier in enumerate(audited.scenario.robot.carriers):
        bodies.append((i, carrier.name, audited.carriers.at(np.s_[:, i])))
    for end, name, state in ((0, "initial", task.initial), (-1, "final", task.final)):
        for owner, about, motion in bodies if state is not None else []:
            for order, value in state.of(owner) if state is not None else ():
                off = motion[order][end] - np.array(value)
                if order == 0:
                    off = shortest_way(off)
                unit = ("m, rad", "m/s, rad/s", "m/s^2, rad/s^2")[order]
                what = f"distance from the {'given end' if end else 'measured start'}"
                exceeded += _missed(name, about, audited.times[end], np.abs(off).max(), END_TOLERANCE, unit, what)
    if task.final is not None and task.final.rests_anywhere:
        kept = [at_rest_without_acceleration(audited.scenario.robot, None, i) for i in range(6)]
        worst = np.abs(audited.motion.acceleration[-1, kept]).max()
        facts = (worst, END_ACCELERATION_TOLERANCE, "m/s^2, rad/s^2", "acceleration", "it must rest there")
        exceeded += _missed("final", "platform", audited.times[-1], *facts)
    return exceeded + _start_tensions(audited)


def _start_tensions(audited: Instants) -> list[Excess]:
    """Check that the tensions start as measured."""
    scenario, first = audited.scenario, audited.tensions[0]
    measured = scenario.start_tensions
    if measured is None or not np.isfinite(first).all():
        return []
    off = np.abs(first - measured)
    worst = int(off.argmax())
    if off[worst] <= 2 * START_BAND * scenario.robot.force_scale:
        return []
    facts = (float(first[worst]), float(measured[worst]), "N", "exactly", "measured at the start")
    return [Excess(START_TENSIONS, f"cable {worst + 1}", 0.0, *facts)]


def _tube_ends(audited: Instants) -> list[Excess]:
    """Check that the platform starts and ends on its path and moves as it does there, by differences of position."""
    scenario, exceeded = audited.scenario, []
    word = platform_ends(scenario.task)
    if word == "periodic":
        off, *rates = (part[-1] - part[0] for part in audited.motion)
        worst = np.max(np.abs([shortest_way(off), *rates]))
        facts = (worst, END_TOLERANCE, "m, m/s, m/s^2", "difference from the start")
        return _missed("tube.ends", "platform", scenario.duration, *facts)
    if word not in ("rest", "exact"):
        return []
    ends = [(0.0, 1.0)] if scenario.task.initial is None else []
    final = scenario.task.final
    ends += [(scenario.duration, -1.0)] if final is None or (final.pose is None and final.velocity is None) else []
    for end, inwards in ends:
        step = _end_step(audited, 0 if inwards > 0 else -1)
        places = _off_path(audited, end + inwards * step * np.arange(len(FIRST)))
        at, speed, acceleration = places[0], FIRST @ places / (inwards * step), SECOND @ places / step**2
        # The motion itself rests, in the frame of its path; without freedom it moves as the path does.
        if word == "rest" and scenario.platform_free:
            of_path = scenario.path.at(np.array([end]), scenario.duration)
            speed, acceleration = speed + of_path.velocity[0], acceleration + of_path.acceleration[0]
        values_of = [(at, "", PATH_TOLERANCE), (speed, "/s", END_TOLERANCE)]
        values_of += [(acceleration, "/s^2", END_ACCELERATION_TOLERANCE)] * (word == "rest")
        for values, per, tolerance in values_of:
            for place, unit in ((POSITION, "m"), (ATTITUDE, "rad")):
                off = float(np.linalg.norm(values[place]))
                counts = word == "exact" or unit == "m" or per == "/s"
                counts |= per == "/s^2" and at_rest_without_acceleration(scenario.robot, None, place[0])
                if counts:
                    what = "distance from its path" if not per else "difference from the motion of its path"
                    if per and word == "rest":
                        what = "speed" if per == "/s" else "acceleration"
                    exceeded += _missed("tube.ends", "platform", end, off, tolerance, unit + per, what)
    return exceeded


def _end_step(audited: Instants, end: int) -> float:
    """Return the step of the differences at the start (0) or the end (-1): all are inside one interval of the nodes."""
    if audited.deviation is None:
        return END_STEP
    interval = float(np.diff(audited.deviation.nodes)[end])
    return max(min(END_STEP, interval / (len(FIRST) - 1)), END_STEP / 2)


def _waypoints(audited: Instants) -> list[Excess]:
    """Check that the platform passes through the task's points where it has to."""
    if audited.deviation is None:
        return []  # on its path, whatever the time law; `lay_out` accepts no path that misses its points then
    times, offsets = audited.scenario.passes()
    missed = shortest_way(_off_path(audited, times) - offsets)
    off, turned = np.linalg.norm(missed[:, :3], axis=1), np.linalg.norm(missed[:, 3:], axis=1)
    exceeded = []
    for k, time in enumerate(times):
        for value, unit in ((off[k], "m"), (turned[k], "rad")):
            facts = (time, value, PATH_TOLERANCE, unit, "distance")
            exceeded += _missed("tube.waypoints", f"platform at point {k + 2}", *facts)
    return exceeded


def _off_path(audited: Instants, times: np.ndarray) -> np.ndarray:
    """Return how far the platform is from its path at times (k,), (k, 6) [m, rad]."""
    return audited.scenario.off_path(times, *audited.scenario.motion(times, audited.deviation))


def _base_ends(audited: Instants) -> list[Excess]:
    """Check that free carriers start and end as the task requires."""
    scenario, base = audited.scenario, audited.scenario.task.base
    word = carrier_ends(scenario.task)
    if not isinstance(base, FreeBase) or word == "free":
        return []
    moving = sorted({index for index, _ in scenario.carrier_free})
    states = (0, scenario.task.initial), (-1, scenario.task.final)
    ends = [end for end, state in states if state is None or state.carrier_pose is None]
    if not ends:
        return []
    if word == "rest":
        off = [audited.carriers.velocity[:, moving]]
        if at_rest_without_acceleration(scenario.robot, moving[0], 0):
            off.append(audited.carriers.acceleration[:, moving, :3])
        units, what = UNITS[1:], ("speed", "acceleration")
    elif word == "periodic":
        off, ends = [part[:, moving] - part[0, moving] for part in audited.carriers], [-1]
        units, what = UNITS, ("difference from the start",) * 3
    else:
        references = scenario.references(audited.times)[1]
        off = [audited.carriers[k][:, i] - references[i][k] for i in moving for k in range(2)]
        units, what = UNITS[:2] * len(moving), ("difference from `around`",) * 2 * len(moving)
    exceeded = []
    for end in ends:
        sizes = [np.abs(part[end]).max() for part in off]
        worst = int(np.argmax(sizes))  # one that is nan, if there is any
        facts = (audited.times[end], sizes[worst], END_TOLERANCE, units[worst], what[worst])
        exceeded += _missed("base.ends", "carriers", *facts)
    return exceeded


def _grounded(audited: Instants) -> list[Excess]:
    """Check that the platform rests on its path where it is on the ground."""
    resting = audited.scenario.phases.resting(audited.times)
    if not resting.any():
        return []
    values = np.stack([audited.off_path, audited.motion.velocity, audited.motion.acceleration])
    off = np.where(resting[:, None], np.abs(values).max(axis=2).T, 0.0)  # (n, 3)
    worst = int(np.argmax(off.max(axis=0)))  # one that is nan, if there is any
    what = ("distance from its path", "speed", "acceleration")[worst]
    why = "on the ground it must rest on its path"
    return _above(audited, "phases.ground", "platform", off[:, worst], END_TOLERANCE, UNITS[worst], what, why)


def _locked(audited: Instants) -> list[Excess]:
    """Check that coordinates that the platform does not have stay as at home."""
    robot, exceeded = audited.scenario.robot, []
    off = np.abs(audited.motion.pose - robot.home)
    for i, name in enumerate(COORDINATES):
        if not robot.dof_mask[i]:
            facts = (PATH_TOLERANCE, _UNITS[i], "distance from home", f"`platform.dof` does not contain {name}")
            exceeded += _above(audited, "dof", f"platform {name}", off[:, i], *facts)
    return exceeded


def _duration(audited: Instants) -> list[Excess]:
    """Check that the motion lasts as long as the task requires."""
    scenario, span = audited.scenario, audited.scenario.duration_range
    low, high = (scenario.task.seconds,) * 2 if span is None else (span.min, span.max)
    lasts = [float(audited.times[-1])]
    if audited.deviation is not None:
        lasts.append(float(audited.deviation.nodes[-1]))
    for seconds in lasts:
        if seconds < low * (1 - DURATION_TOLERANCE):
            return [Excess("duration", "motion", None, seconds, low, "s", "at least")]
        if seconds > high * (1 + DURATION_TOLERANCE):
            return [Excess("duration", "motion", None, seconds, high, "s", "at most")]
    if np.ptp(lasts) > DURATION_TOLERANCE * high:
        return [Excess("duration", "motion", None, lasts[1], lasts[0], "s", "exactly")]
    return []


def _jumps(audited: Instants) -> list[Excess]:
    """Check that positions and velocities of platform and carriers are continuous between intervals."""
    deviation = audited.deviation
    if deviation is None:
        return []
    inner, exceeded = deviation.nodes[1:-1], []
    if not inner.size:
        return []
    shift = 1e-9 * deviation.nodes[-1]
    before, after = (audited.scenario.motion(inner + sign * shift, deviation) for sign in (-1, 1))
    for body, name in ((0, "platform"), (1, "carriers")):
        for k, unit, tolerance in ((0, "m", JUMP_TOLERANCE), (1, "m/s", 10 * JUMP_TOLERANCE)):
            steady = shift * (before[body][k + 1] + after[body][k + 1])
            jump = after[body][k] - before[body][k] - steady
            if k == 0:
                jump = shortest_way(jump)
            jump = np.abs(jump).reshape(len(inner), -1).max(axis=1)
            row = int(jump.argmax())
            what = ("jump of the position", "jump of the velocity")[k]
            exceeded += _missed("motion", name, inner[row], jump[row], tolerance, unit, what)
    return exceeded
