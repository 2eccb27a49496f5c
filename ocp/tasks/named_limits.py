"""The limits of a scenario beside tensions and wrench balance, each by its name in the task.

A limit is an expression of everything that there is at one instant (`State`), with bounds in its own unit. The program
keeps it at its nodes, the audit evaluates the same expression on its dense grid, which shows a limit that holds at the
nodes and not between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import casadi as ca
import numpy as np

from ...models import Robot, kinematics
from ...models.cables.pulley import Exit
from ...models.forward import pull_on_carrier
from ...models.rotation import body_rate, rotation
from .clearance import between_cables, between_points, cable_outside, point_outside
from .scenario import Scenario
from .task_limits import KeepOut

__all__ = ["Limit", "NamedLimits", "named_limits"]

LEAST_COSINE = 1e-4  # less of a cosine is no scale: of angles below a hundredth of a radian

Motion = tuple[ca.SX, ca.SX, ca.SX]  # pose, velocity, acceleration, (6, 1) each


class Limit(NamedTuple):
    """Values that stay between bounds.

    Attributes
    ----------
    name
        Its name in the task or the robot's file.
    unit
        Of values and bounds.
    values
        (k, 1).
    low, high
        The bounds of each; infinite: no bound.
    labels
        What each value is about: "cable 3", "quad1".
    scale
        A typical size in this unit.
    soft
        Excess that adds one to the objective, or None if the limit is hard.
    cosine
        Whether values and bounds are cosines of the angle that `unit` is of: they have derivatives where it is zero.
    """

    name: str
    unit: str
    values: ca.SX
    low: float
    high: float
    labels: list[str]
    scale: float
    soft: float | None = None
    cosine: bool = False

    @property
    def equation(self) -> bool:
        """Return whether it is met at the nodes, and between them only nearly."""
        return self.low == self.high


@dataclass(frozen=True)
class State:
    """Everything that a limit may be about, at one instant, in {G}."""

    robot: Robot
    platform: Motion
    carriers: list[Motion]
    tensions: ca.SX  # (m, 1) [N]

    @cached_property
    def carrier_poses(self) -> ca.SX:
        """Return the poses of all carriers, (c, 6)."""
        return ca.vertcat(*(carrier[0].T for carrier in self.carriers))

    @cached_property
    def anchors(self) -> ca.SX:
        """Return the anchors, (3, m) [m]."""
        return kinematics.anchors(self.robot.anchors, self.robot.carrier_of_cable, self.carrier_poses)

    @cached_property
    def attachments(self) -> ca.SX:
        """Return the attachments, (3, m) [m]."""
        return kinematics.transform(self.platform[0], self.robot.attachments)

    @cached_property
    def run(self) -> Exit:
        """Return directions, leaving points and lengths of the cables."""
        axes = kinematics.axes(self.robot.pulley_axes, self.robot.carrier_of_cable, self.carrier_poses)
        return kinematics.cables(self.robot.attachments, self.platform[0], self.anchors, axes, self.robot.pulley_radii)

    def rate(self, values: ca.SX) -> ca.SX:
        """Return the time derivative of an expression of the poses, which are symbols."""
        bodies = (self.platform, *self.carriers)
        return sum((ca.jtimes(values, pose, velocity) for pose, velocity, _ in bodies), ca.SX.zeros(*values.shape))


class NamedLimits(NamedTuple):
    """All limits of a scenario, and the function that evaluates them.

    Attributes
    ----------
    function
        Of the platform's motion in {G} (18: pose, velocity, acceleration), those of all carriers (18 each) and the
        tensions [N] to all values one after another.
    """

    all: list[Limit]
    function: ca.Function


def named_limits(scenario: Scenario) -> NamedLimits:
    """Return all limits of `scenario`, with symbols of their own."""
    robot = scenario.robot
    bodies = [ca.SX.sym(f"body{i}", 18) for i in range(1 + len(robot.carriers))]
    # Pieces of one symbol are no symbols: derivatives are taken with respect to these.
    motions: list[Motion] = [(ca.SX.sym("x", 6), ca.SX.sym("v", 6), ca.SX.sym("a", 6)) for _ in bodies]
    tensions = ca.SX.sym("tensions", robot.m)
    limits = _all(scenario, State(robot, motions[0], motions[1:], tensions))
    inner = ca.Function(
        "limits_of_parts",
        [*(part for motion in motions for part in motion), tensions],
        [ca.vertcat(*(limit.values for limit in limits))],
    )
    parts = [part for body in bodies for part in ca.vertsplit(body, 6)]
    return NamedLimits(limits, ca.Function("limits", [*bodies, tensions], [inner(*parts, tensions)]))


def _all(scenario: Scenario, state: State) -> list[Limit]:
    limits = [*_of_cables(scenario, state), *_of_platform(scenario, state)]
    limits += [*_of_carriers(scenario, state), *_soft_of_carriers(scenario, state)]
    limits += [limit for place in scenario.task.limits.keep_out for limit in _of_place(state, place)]
    limits += [
        limit
        for index, carrier in enumerate(scenario.robot.carriers)
        if carrier.efforts
        for limit in _of_efforts(state, index)
    ]
    return [_softened(limit, scenario.task.limits.soft) for limit in limits]


def _softened(limit: Limit, soft: dict[str, float]) -> Limit:
    amount = soft.get(limit.name)
    if amount is not None and limit.cosine:
        amount *= float(np.sqrt(1 - limit.low**2))  # what the cosine changes by as the angle does
    return limit._replace(soft=amount)


def _cables(m: int) -> list[str]:
    return [f"cable {i + 1}" for i in range(m)]


def _of_cables(scenario: Scenario, state: State) -> list[Limit]:
    given, robot = scenario.task.limits, scenario.robot
    limits = []
    if given.cable_speed is not None:
        speed = given.cable_speed
        limits.append(
            Limit("cable_speed", "m/s", state.rate(state.run.lengths), -speed, speed, _cables(robot.m), speed)
        )
    if given.cable_length is not None:
        low, high = given.cable_length.min, given.cable_length.max
        size = max(abs(low), abs(high), 1e-3)
        limits.append(Limit("cable_length", "m", state.run.lengths, low, high, _cables(robot.m), size))
    if "margin" in given.soft:
        # Hard it bounds the tensions themselves.
        low, high = ca.DM(robot.t_min), ca.DM(robot.t_max)
        for inside in (state.tensions - low, high - state.tensions):
            least = scenario.task.margin
            limits.append(Limit("margin", "N", inside, least, np.inf, _cables(robot.m), robot.force_scale))
    if given.cable_clearance is not None:
        values, labels = [], []
        for i, j in combinations(range(robot.m), 2):
            if _share_an_end(robot, i, j):
                continue
            ends = (state.attachments[:, i], state.anchors[:, i], state.attachments[:, j], state.anchors[:, j])
            values.append(between_cables(*ends))
            labels.append(f"cables {i + 1} and {j + 1}")
        if values:
            clear = given.cable_clearance
            limits.append(Limit("cable_clearance", "m", ca.vertcat(*values), clear, np.inf, labels, clear))
    return limits


def _share_an_end(robot: Robot, i: int, j: int) -> bool:
    same_anchor = robot.carrier_of_cable[i] == robot.carrier_of_cable[j] and np.array_equal(
        robot.anchors[i], robot.anchors[j]
    )
    return same_anchor or np.array_equal(robot.attachments[i], robot.attachments[j])


def _of_platform(scenario: Scenario, state: State) -> list[Limit]:
    given = scenario.task.limits
    pose, velocity, acceleration = state.platform
    limits = []
    for name, value, bound, unit in (
        ("platform_speed", velocity[:3], given.platform_speed, "m/s"),
        ("platform_acceleration", acceleration[:3], given.platform_acceleration, "m/s^2"),
        ("platform_turn", body_rate(pose[3:6], velocity[3:6]), given.platform_turn, "rad/s"),
    ):
        if bound is not None:
            limits.append(Limit(name, unit, _size(value, bound), 0.0, bound, ["platform"], bound))
    if given.platform_tilt is not None:
        limits.append(_tilt("platform_tilt", pose, given.platform_tilt, "platform"))
    if given.platform_box is not None:
        for axis, low, high in zip(range(3), given.platform_box.min, given.platform_box.max, strict=True):
            limits.append(Limit("platform_box", "m", pose[axis], low, high, [f"platform {'xyz'[axis]}"], 1.0))
    return limits


def _size(value: ca.SX, bound: float) -> ca.SX:
    """Return |value|, smooth at zero, where a motion rests and a norm has a corner; at the bound 5e-7 too large."""
    return ca.sqrt(ca.sumsqr(value) + (1e-3 * bound) ** 2)


def _tilt(name: str, pose: ca.SX, most: float, about: str) -> Limit:
    """Limit the cosine of the tilt, whose derivative exists when level too; its scale is its change up to the bound."""
    upright, low = ca.cos(pose[3]) * ca.cos(pose[4]), float(np.cos(most))
    return Limit(name, "rad", upright, low, np.inf, [about], max(1.0 - low, LEAST_COSINE), cosine=True)


def _soft_of_carriers(scenario: Scenario, state: State) -> list[Limit]:
    """Return the carriers' limits that the task makes soft; the hard ones hold between the nodes too (`interval`)."""
    limits, soft = [], scenario.task.limits.soft
    for index, limit in scenario.limits.items():
        name = scenario.robot.carriers[index].name
        pose, velocity, acceleration = state.carriers[index]
        for quantity, value, bound, unit in (
            ("carrier_speed", velocity, limit.speed, "m/s"),
            ("carrier_acceleration", acceleration, limit.acceleration, "m/s^2"),
        ):
            if quantity in soft and bound is not None:
                limits.append(Limit(quantity, unit, _size(value[:3], bound), 0.0, bound, [name], bound))
        if "carrier_turn_acceleration" in soft and (turn := limit.turn_acceleration) is not None:
            labels = [f"{name} roll", f"{name} pitch"]
            limits.append(Limit("carrier_turn_acceleration", "rad/s^2", acceleration[3:5], -turn, turn, labels, turn))
        if "carrier_tilt" in soft and limit.tilt is not None:
            limits.append(_tilt("carrier_tilt", pose, limit.tilt, name))
        if "carrier_reach" in soft and np.isfinite(limit.low).all():
            for axis in range(3):
                bounds = float(limit.low[axis]), float(limit.high[axis])
                limits.append(Limit("carrier_reach", "m", pose[axis], *bounds, [f"{name} {'xyz'[axis]}"], 1.0))
    return limits


def _of_carriers(scenario: Scenario, state: State) -> list[Limit]:
    apart = scenario.task.limits.carrier_separation
    pairs = list(combinations(range(len(state.carriers)), 2))
    if apart is None or not pairs:
        return []
    values = [between_points(state.carriers[i][0][:3], state.carriers[j][0][:3]) for i, j in pairs]
    names = [carrier.name for carrier in scenario.robot.carriers]
    labels = [f"{names[i]} and {names[j]}" for i, j in pairs]
    return [Limit("carrier_separation", "m", ca.vertcat(*values), apart, np.inf, labels, apart)]


def _of_place(state: State, place: KeepOut) -> list[Limit]:
    robot, riding = state.robot, place.frame == "platform"
    anchors, attachments = state.anchors, state.attachments
    carriers = ca.horzcat(*(carrier[0][:3] for carrier in state.carriers))
    if riding:
        R, origin = rotation(state.platform[0][3:6]), state.platform[0][:3]
        anchors, carriers = (R.T @ (points - ca.repmat(origin, 1, points.shape[1])) for points in (anchors, carriers))
        attachments = ca.SX(ca.DM(robot.attachments.T))
    com = kinematics.transform(state.platform[0], np.array([robot.platform.com]))
    of_platform = ca.horzsplit(ca.horzcat(com, attachments))
    bodies = [
        ("keep_out", place.platform, [] if riding else [(point_outside(place, p), "platform") for p in of_platform]),
        (
            "carrier_platform_clearance" if riding else "keep_out",
            place.carriers,
            [
                (point_outside(place, carriers[:, i]), carrier.name)
                for i, carrier in enumerate(robot.carriers)
                if carrier.moves
            ],
        ),
        (
            "cable_platform_clearance" if riding else "keep_out",
            place.cables,
            [(cable_outside(place, attachments[:, i], anchors[:, i]), f"cable {i + 1}") for i in range(robot.m)],
        ),
    ]
    limits = []
    for name, distance, outside in bodies:
        if distance is not None and outside:
            values, labels = zip(*outside, strict=True)
            about = [f"{label} outside {place.name}" for label in labels]
            limits.append(Limit(name, "m", ca.vertcat(*values), distance, np.inf, about, 1.0))
    return limits


def _of_efforts(state: State, index: int) -> list[Limit]:
    """Limit the efforts that motion and cables require of a carrier."""
    carrier, motion = state.robot.carriers[index], state.carriers[index]
    pull = pull_on_carrier(state.robot, index, state.run, motion[0], state.tensions)
    return [
        Limit(
            effort.name,
            effort.unit,
            effort.values,
            effort.low,
            effort.high,
            [f"{carrier.name} {axis}".rstrip() for axis in effort.axes],
            effort.scale or state.robot.force_scale,
        )
        for effort in carrier.required_effort(*motion, pull, np.array(state.robot.gravity))
    ]
