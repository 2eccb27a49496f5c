"""What a motion must keep beside its tensions: each limit on its own, from the motion alone, densely.

Each check gives the limits that are passed, worst instant each (`Excess`); an empty list says that all is kept. The
expressions of `limits`, the same as the nonlinear program's, are evaluated here on the dense grid; all else is computed
by NumPy, from the task's own numbers and by differences, and shares nothing with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...models.robot import COORDINATES
from ..tasks.limits import limits
from ..tasks.path import Motion, WaypointPath
from ..tasks.scenario import Deviation, Scenario
from ..tasks.task import FreeBase
from .excess import Excess

__all__ = ["END_TOLERANCE", "LIMIT_TOLERANCE", "OF_TENSIONS", "UNDERACTUATED_TOLERANCE", "Seen", "excesses"]

UNDERACTUATED_TOLERANCE = 1e-3  # of the weight, for robots with fewer independent cables than degrees of freedom
LIMIT_TOLERANCE = 1e-6  # relative, of the carriers' own limits
PATH_TOLERANCE = 1e-7  # [m, rad], of the tube, its ends and its waypoints
END_TOLERANCE = 1e-6  # [m, m/s, m/s^2], of where carriers and platform start and end
RATE_TOLERANCE = 1e-3  # relative, of tension rates: the audited tensions are the planned ones but for the wrench's rest
LENGTH_TOLERANCE = 1e-4  # [m], of lengths that the drive keeps
DURATION_TOLERANCE = 1e-7  # relative
ANGLE_TOLERANCE = 1e-6  # [rad]
JUMP_TOLERANCE = 1e-6  # [m, rad]; ten times that of speeds [m/s, rad/s]: programs meet their equations to 1e-8
STEP = 1e-5  # [s], of differences

# Limits that depend on which tensions give the wrench: where cables are redundant others may keep them.
OF_TENSIONS = frozenset({"tension_rate", "thrust", "torque", "force across the thrust"})

_UNITS = ("m", "m", "m", "rad", "rad", "rad")


@dataclass(frozen=True)
class Seen:
    """What there is to check: a motion on a dense grid, its tensions, and what it was made of."""

    scenario: Scenario
    deviation: Deviation | None
    times: np.ndarray  # (n,) [s]
    motion: Motion  # of the platform in {G}, (n, 6) each
    carriers: Motion  # (n, c, 6) each
    tensions: np.ndarray  # (n, m) [N], nan where there are none
    off_path: np.ndarray  # (n, 6) [m, rad], along the path's axes


def excesses(seen: Seen) -> list[Excess]:
    """All limits that are passed, hard and soft."""
    checks = (_carriers, _lengths, _tube, _tube_ends, _waypoints, _base_ends, _locked, _duration, _jumps, _tension_rate)
    return [excess for check in (*checks, _named_limits) for excess in check(seen)]


def _carriers(seen: Seen) -> list[Excess]:
    """Limits of carriers that are hard; the soft ones are among `limits`."""
    found = []
    robot, soft, times = seen.scenario.robot, seen.scenario.task.limits.soft, seen.times
    for index, limit in seen.scenario.limits.items():
        name = robot.carriers[index].name
        pose, velocity, acceleration = (part[:, index] for part in seen.carriers)
        tilt = np.arccos(np.clip(np.cos(pose[:, 3]) * np.cos(pose[:, 4]), -1, 1))
        checks = {
            "carrier_acceleration": (np.linalg.norm(acceleration[:, :3], axis=1), limit.acceleration, "m/s^2"),
            "carrier_speed": (np.linalg.norm(velocity[:, :3], axis=1), limit.speed, "m/s"),
            "carrier_tilt": (tilt, limit.tilt, "rad"),
            "carrier_turn_acceleration": (np.abs(acceleration[:, 3:5]).max(axis=1), limit.turn_acceleration, "rad/s^2"),
        }
        for quantity, (values, bound, unit) in checks.items():
            if quantity in soft or bound is None:
                continue
            row = int(values.argmax())
            # Of a small angle the cosine, which programs bound, tells less than a millionth of it.
            spare = ANGLE_TOLERANCE if quantity == "carrier_tilt" else bound * LIMIT_TOLERANCE
            if not values[row] <= bound + spare:
                found.append(Excess(quantity, name, float(times[row]), float(values[row]), bound, unit))
        if "carrier_reach" not in soft:
            for axis in range(3):
                about = f"{name} {'xyz'[axis]}"
                found += _outside(seen, "carrier_reach", about, pose[:, axis], limit.low[axis], limit.high[axis])
        if limit.attitude is None:
            continue
        if robot.drive == "variable-length":
            moves = np.maximum(np.abs(velocity).max(axis=1), np.abs(acceleration).max(axis=1))
            why = "with the drive variable-length only winches move"
            found += _above(seen, "drive", name, moves, LIMIT_TOLERANCE, "m/s", why)
        turned = np.abs(pose[:, 3:] - limit.attitude).max(axis=1)
        why = "a mobile carrier keeps its attitude"
        found += _above(seen, "carrier_attitude", name, turned, LIMIT_TOLERANCE, "rad", why)
    return found


def _above(
    seen: Seen, limit: str, about: str, values: np.ndarray, tolerance: float, unit: str, why: str = ""
) -> list[Excess]:
    """Whether what ought to be zero, (n,), is more than a tolerance anywhere."""
    row = int(values.argmax())
    if values[row] <= tolerance:
        return []
    return [Excess(limit, about, float(seen.times[row]), float(values[row]), 0.0, unit, "exactly", why)]


def _outside(
    seen: Seen, limit: str, about: str, values: np.ndarray, low: float, high: float, tolerance: float = LIMIT_TOLERANCE
) -> list[Excess]:
    """Whether values (n,) in metres leave a range anywhere."""
    beyond = np.maximum(low - values, values - high)
    row = int(beyond.argmax())
    if beyond[row] <= tolerance:
        return []
    value = float(values[row])
    side, bound = ("at least", low) if value < low else ("at most", high)
    return [Excess(limit, about, float(seen.times[row]), value, float(bound), "m", side)]


def _lengths(seen: Seen) -> list[Excess]:
    """Cables that leave the length that the drive keeps."""
    kept = seen.scenario.robot.fixed_lengths
    if kept is None:
        return []
    lengths = seen.scenario.dynamics.cable_lengths(seen.motion.pose, seen.carriers.pose)
    off = np.abs(lengths - kept)
    found = []
    for i in np.flatnonzero(off.max(axis=0) > LENGTH_TOLERANCE):
        row, why = int(off[:, i].argmax()), "with the drive fixed-length it stays"
        told = (float(seen.times[row]), float(lengths[row, i]), float(kept[i]), "m", "exactly", why)
        found.append(Excess("cable_length", f"cable {i + 1}", *told))
    return found


def _tube(seen: Seen) -> list[Excess]:
    """Whether the platform leaves its tube."""
    tube, found = seen.scenario.task.tube, []
    away, turned = np.linalg.norm(seen.off_path[:, :3], axis=1), np.abs(seen.off_path[:, 3:]).max(axis=1)
    for limit, values, bound, unit in (
        ("tube.position", away, tube.radius, "m"),
        ("tube.attitude", turned, tube.turn, "rad"),
    ):
        row = int(values.argmax())
        if not values[row] <= bound + PATH_TOLERANCE:
            told = (float(seen.times[row]), float(values[row]), bound, unit)
            found.append(Excess(limit, "platform off its path", *told))
    return found


def _tube_ends(seen: Seen) -> list[Excess]:
    """Whether the platform starts and ends on its path and along with it, by differences of where it is."""
    scenario, found = seen.scenario, []
    if scenario.task.tube.ends != "exact":
        return []
    for end, inwards in ((0.0, STEP), (scenario.duration, -STEP)):
        at, near, far = _off_path(seen, end + inwards * np.arange(3))
        speed = (-3 * at + 4 * near - far) / (2 * inwards)
        for values, units, tolerance in (
            (at, _UNITS, PATH_TOLERANCE),
            (speed, [f"{unit}/s" for unit in _UNITS], END_TOLERANCE),
        ):
            for place, unit in ((slice(0, 3), units[0]), (slice(3, 6), units[3])):
                off = float(np.linalg.norm(values[place]))
                if not off <= tolerance:
                    found.append(Excess("tube.ends", "platform off its path", end, off, 0.0, unit, "exactly"))
    return found


def _waypoints(seen: Seen) -> list[Excess]:
    """Whether the platform passes the task's points where it has to, as the task has them."""
    scenario, path = seen.scenario, seen.scenario.task.path
    if scenario.task.tube.waypoints != "exact" or not isinstance(path, WaypointPath):
        return []
    knots = np.clip(path.knots(scenario.duration), 0.0, scenario.duration)[1:-1]
    off = np.linalg.norm(_off_path(seen, knots)[:, :3], axis=1)
    turned = np.linalg.norm(_off_path(seen, knots)[:, 3:], axis=1)
    found = []
    for k, time in enumerate(knots):
        about = f"platform off point {k + 2}"
        for value, unit in ((off[k], "m"), (turned[k], "rad")):
            if not value <= PATH_TOLERANCE:
                found.append(Excess("tube.waypoints", about, float(time), float(value), 0.0, unit, "exactly"))
    return found


def _off_path(seen: Seen, times: np.ndarray) -> np.ndarray:
    """How far the platform is from its path at times (k,), (k, 6) [m, rad]."""
    return seen.scenario.off_path(times, *seen.scenario.motion(times, seen.deviation))


def _base_ends(seen: Seen) -> list[Excess]:
    """Whether free carriers start and end as the task says."""
    scenario, base = seen.scenario, seen.scenario.task.base
    if not isinstance(base, FreeBase) or base.ends == "free":
        return []
    found = []
    moving = sorted({index for index, _ in scenario.carrier_free})
    ends = [0, -1]
    if base.ends == "rest":
        off = [np.abs(seen.carriers.velocity[end, moving]).max() for end in ends]
        about, unit, why = "carriers", "m/s", "an end at which they should be at rest"
    elif base.ends == "periodic":
        off = [max(np.abs(part[0, moving] - part[-1, moving]).max() for part in seen.carriers)]
        ends, about, unit, why = [-1], "carriers", "m, m/s, m/s^2", "away from where they started"
    else:
        references = scenario.references(seen.times[ends])[1]
        off = [
            max(np.abs(seen.carriers[k][end, i] - references[i][k][end]).max() for i in moving for k in range(2))
            for end in ends
        ]
        about, unit, why = "carriers", "m, m/s", "away from `around`"
    for end, value in zip(ends, off, strict=True):
        if not value <= END_TOLERANCE:
            found.append(Excess("base.ends", about, float(seen.times[end]), float(value), 0.0, unit, "exactly", why))
    return found


def _locked(seen: Seen) -> list[Excess]:
    """Coordinates that move though the platform does not have them: they stay as at home."""
    robot, found = seen.scenario.robot, []
    off = np.abs(seen.motion.pose - robot.home)
    for i, name in enumerate(COORDINATES):
        if not robot.dof_mask[i]:
            why = "it is none of the platform's degrees of freedom"
            found += _above(seen, "dof", f"platform {name}", off[:, i], PATH_TOLERANCE, _UNITS[i], why)
    return found


def _duration(seen: Seen) -> list[Excess]:
    """Whether the motion lasts as long as the task says."""
    scenario, asked = seen.scenario, seen.scenario.duration_range
    low, high = (scenario.task.seconds,) * 2 if asked is None else (asked.min, asked.max)
    lasts = [float(seen.times[-1])]
    if seen.deviation is not None:
        lasts.append(float(seen.deviation.nodes[-1]))
    for seconds in lasts:
        if seconds < low * (1 - DURATION_TOLERANCE):
            return [Excess("duration", "motion", None, seconds, low, "s", "at least")]
        if seconds > high * (1 + DURATION_TOLERANCE):
            return [Excess("duration", "motion", None, seconds, high, "s", "at most")]
    if np.ptp(lasts) > DURATION_TOLERANCE * high:
        return [Excess("duration", "motion", None, lasts[1], lasts[0], "s", "exactly")]
    return []


def _jumps(seen: Seen) -> list[Excess]:
    """Whether platform and carriers get from each interval into the next without a jump of place or speed."""
    deviation = seen.deviation
    if deviation is None:
        return []
    inner, found = deviation.nodes[1:-1], []
    if not inner.size:
        return []
    shift = 1e-9 * deviation.nodes[-1]
    before, after = (seen.scenario.motion(inner + sign * shift, deviation) for sign in (-1, 1))
    for body, name in ((0, "platform"), (1, "carriers")):
        for k, unit, tolerance in ((0, "m", JUMP_TOLERANCE), (1, "m/s", 10 * JUMP_TOLERANCE)):
            steady = shift * (before[body][k + 1] + after[body][k + 1])
            jump = after[body][k] - before[body][k] - steady
            if k == 0:
                jump[..., 3:] = np.arctan2(np.sin(jump[..., 3:]), np.cos(jump[..., 3:]))
            jump = np.abs(jump).reshape(len(inner), -1).max(axis=1)
            row = int(jump.argmax())
            if not jump[row] <= tolerance:
                told = (float(inner[row]), float(jump[row]), 0.0, unit, "exactly", "a jump of place or speed")
                found.append(Excess("motion", name, *told))
    return found


def _tension_rate(seen: Seen) -> list[Excess]:
    most = seen.scenario.task.limits.tension_rate
    rates = np.abs(np.diff(seen.tensions, axis=0)) / np.diff(seen.times)[:, None]
    if most is None or not np.nanmax(rates, initial=0.0) > most * (1 + RATE_TOLERANCE):
        return []
    row, cable = np.unravel_index(np.nanargmax(rates), rates.shape)
    return [Excess("tension_rate", f"cable {cable + 1}", float(seen.times[row]), float(rates[row, cable]), most, "N/s")]


def _named_limits(seen: Seen) -> list[Excess]:
    """Those of `limits`, on the dense grid."""
    found = limits(seen.scenario)
    if not found.all:
        return []
    carriers, passed = seen.carriers, []
    bodies = [np.hstack(part) for part in (seen.motion, *zip(*(np.moveaxis(p, 1, 0) for p in carriers), strict=True))]
    values = found.function.map(len(seen.times))(*(body.T for body in bodies), seen.tensions.T).full().T
    there = np.isfinite(seen.tensions).all(axis=1, keepdims=True)
    at = 0
    for limit in found.all:
        mine = values[:, at : at + len(limit.labels)]
        at += len(limit.labels)
        beyond = np.maximum(limit.low - mine, mine - limit.high)
        # Without tensions nothing is said of what depends on them; any other nan keeps no limit.
        beyond = np.where(np.isnan(beyond), np.where(there, np.inf, -np.inf), beyond)
        tolerance = UNDERACTUATED_TOLERANCE if limit.equation else LIMIT_TOLERANCE
        if beyond.max() <= tolerance * limit.scale:
            continue
        row, which = np.unravel_index(beyond.argmax(), beyond.shape)
        value, time = float(mine[row, which]), float(seen.times[row])
        side, bound = ("at least", limit.low) if value < limit.low else ("at most", limit.high)
        if limit.equation:
            side = "exactly"
        elif limit.cosine:
            value, bound = (float(np.arccos(np.clip(number, -1, 1))) for number in (value, bound))
            side = "at most"
        passed.append(Excess(limit.name, limit.labels[which], time, value, bound, limit.unit, side))
    return passed
