"""Check all that a motion must keep beside its tensions: each limit on its own, from the motion alone, densely.

Each check returns the limits that are exceeded, each at its worst instant (`Excess`); an empty list means that all are
kept. The expressions of `named_limits` are the same as the nonlinear program's, evaluated here on the dense grid; all
else is computed by NumPy, from the task's own numbers and by differences, and shares nothing with the program.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...models.part import COORDINATES
from ..tasks.named_limits import named_limits
from ..tasks.path import Motion, WaypointPath
from ..tasks.scenario import Deviation, Scenario
from ..tasks.task import FreeBase
from .excess import Excess

__all__ = ["END_TOLERANCE", "LIMIT_TOLERANCE", "OF_TENSIONS", "UNDERACTUATED_TOLERANCE", "AuditedMotion", "excesses"]

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
class AuditedMotion:
    """A motion on a dense grid with its tensions, and the scenario and deviation that it was made from."""

    scenario: Scenario
    deviation: Deviation | None
    times: np.ndarray  # (n,) [s]
    motion: Motion  # of the platform in {G}, (n, 6) each
    carriers: Motion  # (n, c, 6) each
    tensions: np.ndarray  # (n, m) [N], nan where there are none
    off_path: np.ndarray  # (n, 6) [m, rad], along the path's axes


def excesses(audited: AuditedMotion) -> list[Excess]:
    """Return all limits that are exceeded, hard and soft."""
    checks = (_carriers, _lengths, _tube, _tube_ends, _waypoints, _base_ends, _locked, _duration, _jumps, _tension_rate)
    return [excess for check in (*checks, _named_limits) for excess in check(audited)]


def _carriers(audited: AuditedMotion) -> list[Excess]:
    """Check the hard limits of carriers; the soft ones are among `named_limits`."""
    exceeded = []
    robot, soft, times = audited.scenario.robot, audited.scenario.task.limits.soft, audited.times
    for index, limit in audited.scenario.limits.items():
        name = robot.carriers[index].name
        pose, velocity, acceleration = (part[:, index] for part in audited.carriers)
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
            # Programs bound the cosine, which resolves a small angle to no better than this.
            spare = ANGLE_TOLERANCE if quantity == "carrier_tilt" else bound * LIMIT_TOLERANCE
            if not values[row] <= bound + spare:
                exceeded.append(Excess(quantity, name, float(times[row]), float(values[row]), bound, unit))
        if "carrier_reach" not in soft:
            for axis in range(3):
                about = f"{name} {'xyz'[axis]}"
                exceeded += _outside(audited, "carrier_reach", about, pose[:, axis], limit.low[axis], limit.high[axis])
        if limit.attitude is None:
            continue
        if robot.drive == "variable-length":
            moves = np.maximum(np.abs(velocity).max(axis=1), np.abs(acceleration).max(axis=1))
            why = "with the drive variable-length only winches move"
            exceeded += _above(audited, "drive", name, moves, LIMIT_TOLERANCE, "m/s", why)
        turned = np.abs(pose[:, 3:] - limit.attitude).max(axis=1)
        why = "a mobile carrier keeps its attitude"
        exceeded += _above(audited, "carrier_attitude", name, turned, LIMIT_TOLERANCE, "rad", why)
    return exceeded


def _above(
    audited: AuditedMotion, limit: str, about: str, values: np.ndarray, tolerance: float, unit: str, why: str = ""
) -> list[Excess]:
    """Check that values (n,) that ought to be zero never exceed a tolerance."""
    row = int(values.argmax())
    if values[row] <= tolerance:
        return []
    return [Excess(limit, about, float(audited.times[row]), float(values[row]), 0.0, unit, "exactly", why)]


def _outside(
    audited: AuditedMotion,
    limit: str,
    about: str,
    values: np.ndarray,
    low: float,
    high: float,
    tolerance: float = LIMIT_TOLERANCE,
) -> list[Excess]:
    """Check that values (n,) [m] never leave a range."""
    beyond = np.maximum(low - values, values - high)
    row = int(beyond.argmax())
    if beyond[row] <= tolerance:
        return []
    value = float(values[row])
    side, bound = ("at least", low) if value < low else ("at most", high)
    return [Excess(limit, about, float(audited.times[row]), value, float(bound), "m", side)]


def _lengths(audited: AuditedMotion) -> list[Excess]:
    """Check that cables keep the lengths that the drive fixes."""
    kept = audited.scenario.robot.fixed_lengths
    if kept is None:
        return []
    lengths = audited.scenario.dynamics.cable_lengths(audited.motion.pose, audited.carriers.pose)
    off = np.abs(lengths - kept)
    exceeded = []
    for i in np.flatnonzero(off.max(axis=0) > LENGTH_TOLERANCE):
        row, why = int(off[:, i].argmax()), "with the drive fixed-length it stays"
        facts = (float(audited.times[row]), float(lengths[row, i]), float(kept[i]), "m", "exactly", why)
        exceeded.append(Excess("cable_length", f"cable {i + 1}", *facts))
    return exceeded


def _tube(audited: AuditedMotion) -> list[Excess]:
    """Check that the platform stays in its tube."""
    tube, exceeded = audited.scenario.task.tube, []
    away, turned = np.linalg.norm(audited.off_path[:, :3], axis=1), np.abs(audited.off_path[:, 3:]).max(axis=1)
    for limit, values, bound, unit in (
        ("tube.position", away, tube.radius, "m"),
        ("tube.attitude", turned, tube.turn, "rad"),
    ):
        row = int(values.argmax())
        if not values[row] <= bound + PATH_TOLERANCE:
            facts = (float(audited.times[row]), float(values[row]), bound, unit)
            exceeded.append(Excess(limit, "platform", *facts))
    return exceeded


def _tube_ends(audited: AuditedMotion) -> list[Excess]:
    """Check that the platform starts and ends on its path and at its speed, by differences of position."""
    scenario, exceeded = audited.scenario, []
    if scenario.task.tube.ends != "exact":
        return []
    for end, inwards in ((0.0, STEP), (scenario.duration, -STEP)):
        at, near, far = _off_path(audited, end + inwards * np.arange(3))
        speed = (-3 * at + 4 * near - far) / (2 * inwards)
        for values, units, tolerance in (
            (at, _UNITS, PATH_TOLERANCE),
            (speed, [f"{unit}/s" for unit in _UNITS], END_TOLERANCE),
        ):
            for place, unit in ((slice(0, 3), units[0]), (slice(3, 6), units[3])):
                off = float(np.linalg.norm(values[place]))
                if not off <= tolerance:
                    why = "off its path at an end"
                    exceeded.append(Excess("tube.ends", "platform", end, off, 0.0, unit, "exactly", why))
    return exceeded


def _waypoints(audited: AuditedMotion) -> list[Excess]:
    """Check that the platform passes through the task's points where it has to."""
    scenario, path = audited.scenario, audited.scenario.task.path
    if scenario.task.tube.waypoints != "exact" or not isinstance(path, WaypointPath):
        return []
    knots = np.clip(path.knots(scenario.duration), 0.0, scenario.duration)[1:-1]
    off = np.linalg.norm(_off_path(audited, knots)[:, :3], axis=1)
    turned = np.linalg.norm(_off_path(audited, knots)[:, 3:], axis=1)
    exceeded = []
    for k, time in enumerate(knots):
        about = f"platform at point {k + 2}"
        for value, unit in ((off[k], "m"), (turned[k], "rad")):
            if not value <= PATH_TOLERANCE:
                exceeded.append(Excess("tube.waypoints", about, float(time), float(value), 0.0, unit, "exactly"))
    return exceeded


def _off_path(audited: AuditedMotion, times: np.ndarray) -> np.ndarray:
    """Return how far the platform is from its path at times (k,), (k, 6) [m, rad]."""
    return audited.scenario.off_path(times, *audited.scenario.motion(times, audited.deviation))


def _base_ends(audited: AuditedMotion) -> list[Excess]:
    """Check that free carriers start and end as the task requires."""
    scenario, base = audited.scenario, audited.scenario.task.base
    if not isinstance(base, FreeBase) or base.ends == "free":
        return []
    exceeded = []
    moving = sorted({index for index, _ in scenario.carrier_free})
    ends = [0, -1]
    if base.ends == "rest":
        off = [np.abs(audited.carriers.velocity[end, moving]).max() for end in ends]
        about, unit, why = "carriers", "m/s", "an end at which they should be at rest"
    elif base.ends == "periodic":
        off = [max(np.abs(part[0, moving] - part[-1, moving]).max() for part in audited.carriers)]
        ends, about, unit, why = [-1], "carriers", "m, m/s, m/s^2", "away from where they started"
    else:
        references = scenario.references(audited.times[ends])[1]
        off = [
            max(np.abs(audited.carriers[k][end, i] - references[i][k][end]).max() for i in moving for k in range(2))
            for end in ends
        ]
        about, unit, why = "carriers", "m, m/s", "away from `around`"
    for end, value in zip(ends, off, strict=True):
        if not value <= END_TOLERANCE:
            exceeded.append(
                Excess("base.ends", about, float(audited.times[end]), float(value), 0.0, unit, "exactly", why)
            )
    return exceeded


def _locked(audited: AuditedMotion) -> list[Excess]:
    """Check that coordinates that the platform does not have stay as at home."""
    robot, exceeded = audited.scenario.robot, []
    off = np.abs(audited.motion.pose - robot.home)
    for i, name in enumerate(COORDINATES):
        if not robot.dof_mask[i]:
            why = "it is not one of the platform's degrees of freedom"
            exceeded += _above(audited, "dof", f"platform {name}", off[:, i], PATH_TOLERANCE, _UNITS[i], why)
    return exceeded


def _duration(audited: AuditedMotion) -> list[Excess]:
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


def _jumps(audited: AuditedMotion) -> list[Excess]:
    """Check that platform and carriers continue from each interval into the next without a jump of place or speed."""
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
                jump[..., 3:] = np.arctan2(np.sin(jump[..., 3:]), np.cos(jump[..., 3:]))
            jump = np.abs(jump).reshape(len(inner), -1).max(axis=1)
            row = int(jump.argmax())
            if not jump[row] <= tolerance:
                facts = (float(inner[row]), float(jump[row]), 0.0, unit, "exactly", "a jump of place or speed")
                exceeded.append(Excess("motion", name, *facts))
    return exceeded


def _tension_rate(audited: AuditedMotion) -> list[Excess]:
    """Check how fast the tensions change."""
    most = audited.scenario.task.limits.tension_rate
    rates = np.abs(np.diff(audited.tensions, axis=0)) / np.diff(audited.times)[:, None]
    if most is None or not np.nanmax(rates, initial=0.0) > most * (1 + RATE_TOLERANCE):
        return []
    row, cable = np.unravel_index(np.nanargmax(rates), rates.shape)
    return [
        Excess("tension_rate", f"cable {cable + 1}", float(audited.times[row]), float(rates[row, cable]), most, "N/s")
    ]


def _named_limits(audited: AuditedMotion) -> list[Excess]:
    """Check the limits of `named_limits` on the dense grid."""
    named = named_limits(audited.scenario)
    if not named.all:
        return []
    carriers, exceeded = audited.carriers, []
    bodies = [
        np.hstack(part) for part in (audited.motion, *zip(*(np.moveaxis(p, 1, 0) for p in carriers), strict=True))
    ]
    values = named.function.map(len(audited.times))(*(body.T for body in bodies), audited.tensions.T).full().T
    there = np.isfinite(audited.tensions).all(axis=1, keepdims=True)
    at = 0
    for limit in named.all:
        mine = values[:, at : at + len(limit.labels)]
        at += len(limit.labels)
        beyond = np.maximum(limit.low - mine, mine - limit.high)
        # Without tensions what depends on them is not checked; any other nan exceeds its limit.
        beyond = np.where(np.isnan(beyond), np.where(there, np.inf, -np.inf), beyond)
        tolerance = UNDERACTUATED_TOLERANCE if limit.equation else LIMIT_TOLERANCE
        if beyond.max() <= tolerance * limit.scale:
            continue
        row, which = np.unravel_index(beyond.argmax(), beyond.shape)
        value, time = float(mine[row, which]), float(audited.times[row])
        side, bound = ("at least", limit.low) if value < limit.low else ("at most", limit.high)
        if limit.equation:
            side = "exactly"
        elif limit.cosine:
            value, bound = (float(np.arccos(np.clip(number, -1, 1))) for number in (value, bound))
            side = "at most"
        exceeded.append(Excess(limit.name, limit.labels[which], time, value, bound, limit.unit, side))
    return exceeded
