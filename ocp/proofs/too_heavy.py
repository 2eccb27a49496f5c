"""Prove that a load is too heavy, or flying carriers are too weak: `too_heavy`, `too_weak_carriers`.

From one rest of the platform to another the mean of its acceleration is zero, so the mean of the force on it is its
weight with its load. No cable gives more than its largest tension in any direction, and no actuator more than its
largest force. If the carriers are at rest at both times too, their actuators hold the weight of all.

The force of the cables on the platform is what thrusts and weights of the carriers leave after accelerating them:

    A t = F = sum of (thrust + m g - m a)      forces in {G}

Along any direction d each thrust gives at most as much as its cone of permitted tilts lets it, and -m a at most m times
the largest acceleration. A force F beyond the sum along d is out of reach, wherever the carriers are.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ...base.text import quantity
from ..audits.excess import Excess
from ..limits.carriers import CarrierAcceleration, CarrierTilt
from ..tasks.paths import Motion
from ..tasks.scenario import Scenario

OF_WEIGHT = ("t_max", "thrust_max")  # limits that are too small together
CERTAIN = 1e-6  # of the weight
OF_DURATION = "duration"
DIRECTIONS = np.linspace(-np.pi / 2, np.pi / 2, 181)  # above the horizontal, in the vertical plane of the force
TINY = 1e-300  # [N]: a vertical force has no direction ahead; shorter vectors in its place bound no less
HALVINGS = 30  # of the range of durations


class _Span(NamedTuple):
    """A time from one rest of the platform to another, in which it hangs with one load [kg]."""

    start: float
    end: float
    load: float
    carriers_rest: bool


def too_heavy(scenario: Scenario, rests: np.ndarray) -> Iterator[Excess]:
    """Yield the largest forces that are too small together.

    `rests` states which of platform and carriers are at rest, in {G}, at the start and at the end: (2, 1 + c) of bool.
    """
    robot = scenario.robot
    gravity = float(np.linalg.norm(np.array(robot.gravity) * robot.dof_mask[:3]))
    spans = list(_spans(scenario, rests))
    if scenario.wind is not None or not gravity or not spans:
        return
    platform = gravity * robot.platform.mass
    yield from _unless(platform, float(robot.t_max.sum()), "t_max", "cables", "platform and load", gravity, spans)
    bodies = [carrier.body for carrier in robot.carriers]
    held = [span for span in spans if span.carriers_rest]
    if held and robot.dof_mask[:3].all() and all(body is not None for body in bodies):
        weight = platform + gravity * sum(body.mass for body in bodies if body is not None)
        most = sum(carrier.force_max for carrier in robot.carriers)
        yield from _unless(weight, most, "thrust_max", "carriers", "platform, load and carriers", gravity, held)


def _unless(
    weight: float, most: float, limit: str, what: str, of: str, gravity: float, spans: list[_Span]
) -> Iterator[Excess]:
    """Yield an excess if `most` [N] is less than `weight` [N] with the heaviest load."""
    span = max(spans, key=lambda span: span.load)
    needed = weight + gravity * span.load
    if most < needed * (1 - CERTAIN):
        why = f"the bound is the weight of {of}"
        yield Excess(limit, f"all {what} together", span.start, most, needed, "N", "at least", why)


def _spans(scenario: Scenario, rests: np.ndarray) -> Iterator[_Span]:
    phases = scenario.phases.all
    if not phases:
        if rests[:, 0].all():
            yield _Span(0.0, scenario.duration, 0.0, bool(rests.all()))
        return
    on_ground = np.array([True] + [False] * (rests.shape[1] - 1))
    first = 0
    for index, phase in enumerate(phases):
        last = index + 1 == len(phases)
        if phase.rests:
            first = index + 1
        elif last or phases[index + 1].rests:
            begins, ends = rests[0] if first == 0 else on_ground, rests[1] if last else on_ground
            loads = [each.load for each in phases[first : index + 1]]
            if begins[0] and ends[0] and all(np.array_equal(loads[0], load) for load in loads):
                yield _Span(phases[first].start, phase.end, float(loads[0][0]), bool((begins & ends).all()))


class Carrier(NamedTuple):
    """Bounds of the force of a carrier."""

    thrust: float  # largest [N]
    tilt: float  # largest, of the thrust [rad]
    mass: float  # [kg]
    acceleration: float  # largest [m/s^2]


def too_weak_carriers(scenario: Scenario, times: np.ndarray, platform: Motion, carriers: Motion) -> list[Excess]:
    """Return the shortest duration in which carriers are strong enough, if the task's is shorter, else nothing.

    `platform` and `carriers` have a given motion of the platform at `times` (n,) [s]; the carriers' motion is free.
    """
    robot, known = scenario.robot, carriers_of(scenario)
    fixed = scenario.relative or scenario.phases.all or scenario.task.wind is not None or not scenario.stretches
    if known is None or fixed or not robot.dof_mask[:3].all() or not len(times):
        return []
    gravity = np.array(robot.gravity)

    def missing(longer: float) -> float:
        """Return the largest missing force [N] if the duration is multiplied by `longer`."""
        slower = Motion(platform.pose, platform.velocity / longer, platform.acceleration / longer**2)
        forces = scenario.required_wrench(times, slower, carriers)[:, :3]
        return _missing(forces, known, gravity)

    enough = CERTAIN * robot.force_scale
    if missing(1.0) <= enough:
        return []
    low, high = 1.0, 2.0
    while missing(high) > enough and high < 2.0**HALVINGS:
        low, high = high, 2 * high
    if missing(high) > enough:  # a longer duration does not help
        return []
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if missing(middle) > enough else (low, middle)
    short = quantity(missing(1.0), "N")
    why = f"even the largest thrusts of all carriers together are {short} too small for the force on the platform"
    return [Excess(OF_DURATION, "motion", None, scenario.duration, low * scenario.duration, "s", "at least", why)]


def carriers_of(scenario: Scenario) -> list[Carrier] | None:
    """Return what bounds the forces of all carriers; None if one carrier's bound is not known."""
    found = []
    for carrier in scenario.robot.carriers:
        hard = [limit for limit in scenario.limits if limit.soft is None and carrier.name in limit.labels]
        fastest = min((limit.high for limit in hard if isinstance(limit, CarrierAcceleration)), default=np.inf)
        tilts = [limit for limit in hard if isinstance(limit, CarrierTilt)]
        if carrier.body is None or not carrier.efforts or not np.isfinite(fastest):
            return None
        thrusts = [one for one in carrier.actuators if any(one.wrench[:3])]
        upward = all(one.low >= 0 and one.wrench[2] >= 0 and not any(one.wrench[:2]) for one in thrusts)
        tilt = min((limit.high for limit in tilts), default=np.pi) if upward else np.pi
        found.append(Carrier(carrier.force_max, tilt, carrier.body.mass, fastest))
    return found


def _missing(forces: np.ndarray, carriers: list[Carrier], gravity: np.ndarray) -> float:
    """Return by how much forces (n, 3) exceed at most what all carriers can give along any direction [N]."""
    ahead = forces[:, :2] / np.maximum(np.linalg.norm(forces[:, :2], axis=1, keepdims=True), TINY)
    flat, up = np.cos(DIRECTIONS), np.sin(DIRECTIONS)
    directions = np.concatenate([ahead[:, None] * flat[:, None], np.tile(up[:, None], (len(forces), 1, 1))], axis=2)
    return float((np.einsum("nkj,nj->nk", directions, forces) - strongest(carriers, directions, gravity)).max())


def strongest(carriers: list[Carrier], directions: np.ndarray, gravity: np.ndarray) -> np.ndarray:
    """Return the largest force of all carriers on the platform along directions (..., 3), (...) [N]."""
    from_vertical = np.arccos(np.clip(directions[..., 2], -1, 1))
    most = np.zeros(directions.shape[:-1])
    for carrier in carriers:
        beyond = np.clip(from_vertical - carrier.tilt, 0, np.pi / 2)
        most += carrier.thrust * np.cos(beyond) + carrier.mass * (directions @ gravity + carrier.acceleration)
    return most
