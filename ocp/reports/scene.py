"""`scene`: a plan as figures draw it in space, with anchors, attachments and carriers at given times."""

from __future__ import annotations

import numpy as np

from ...figures.animation import Scene
from ...figures.robot import box_edges
from ...models.rotor_discs import rotor_discs
from ..result import PlanData
from ..tasks.task_limits import AnyKeepOut, Block, ConvexMesh, Sphere

TRAIL = 10  # every so many audited instants have a point of the trail
ROUND = np.linspace(0.0, 2 * np.pi, 41)


def scene(plan: PlanData, times: np.ndarray) -> Scene:
    """Return the plan's robot at the audited instants nearest to `times` [s]; nothing is interpolated."""
    robot, audit = plan.scenario.robot, plan.audit
    step = audit.times[1] - audit.times[0]
    rows = np.clip(np.round(times / step).astype(int), 0, len(audit.times) - 1)
    poses, carriers = audit.motion.pose[rows], audit.carriers.pose[rows]
    of_cable = robot.carrier_of_cable
    shown = [index for index, carrier in enumerate(robot.carriers) if carrier.drawing.body]
    anchors, attachments = plan.scenario.dynamics.points(poses, carriers)
    return Scene(
        title=f"{robot.name}, {plan.scenario.task.name}: {plan.status.value}",
        anchors=anchors,
        attachments=attachments,
        path=audit.motion.pose[::TRAIL, :3],
        path_times=audit.times[::TRAIL],
        carriers=carriers[:, shown, :3],
        names=[robot.carriers[index].name for index in shown],
        bodies=[np.flatnonzero(of_cable == index) for index in shown],
        boxes=[(np.array(box.min), np.array(box.max)) for c in robot.carriers for box in c.drawing.boxes],
        obstacles=[outline(place) for place in plan.scenario.task.limits.keep_out if place.frame == "world"],
        tensions=audit.tensions[rows],
        t_min=robot.t_min,
        t_max=robot.t_max,
        rotors=rotor_discs(robot, carriers),
    )


def outline(place: AnyKeepOut) -> list[np.ndarray]:
    """Return lines (n, 3) in {G} [m] along the surface of a place to keep out of."""
    if isinstance(place, Block):
        return [place.centre + edge @ place.axes.T for edge in box_edges(-place.half, place.half)]
    if isinstance(place, ConvexMesh):
        return list(place.body.edges)
    if isinstance(place, Sphere):
        centre = np.array(place.centre)
        return [centre + ring for ring in _rings(place.radius, np.eye(3))]
    start, end = np.array(place.start), np.array(place.end)
    # The axis first: the rings across it sit at the ends, and straight lines join them.
    _, _, axes = np.linalg.svd(np.array([end - start]))
    rings = [at + ring for at in (start, end) for ring in _rings(place.radius, axes)]
    sides = [place.radius * sign * axis for axis in axes[1:] for sign in (1, -1)]
    return rings + [np.stack([start + side, end + side]) for side in sides]


def _rings(radius: float, axes: np.ndarray) -> list[np.ndarray]:
    """Return three circles about the origin, one across each axis of (3, 3)."""
    pairs = ((axes[1], axes[2]), (axes[2], axes[0]), (axes[0], axes[1]))
    return [radius * (np.cos(ROUND)[:, None] * u + np.sin(ROUND)[:, None] * v) for u, v in pairs]
