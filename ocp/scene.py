"""A plan as figures draw it in space: where anchors, attachments and carriers are at given times."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..figures.animation import Scene
from ..models import kinematics
from ..models.robot import MobileCarrier

if TYPE_CHECKING:
    from .result import Plan


def scene(plan: Plan, times: np.ndarray) -> Scene:
    """The plan's robot at the audited instants nearest to `times` [s]; nothing is interpolated."""
    robot, audit = plan.scenario.robot, plan.audit
    step = audit.times[1] - audit.times[0]
    rows = np.clip(np.round(times / step).astype(int), 0, len(audit.times) - 1)
    poses, carriers = audit.motion.pose[rows], audit.carriers.pose[rows]
    of_cable = robot.carrier_of_cable
    shown = [index for index, carrier in enumerate(robot.carriers) if carrier.kind != "ground"]
    dm = kinematics.ca.DM
    return Scene(
        title=f"{robot.name}, {plan.scenario.task.name}: {plan.status.value}",
        anchors=np.stack([kinematics.anchors(robot.anchors, of_cable, dm(base)).full().T for base in carriers]),
        attachments=np.stack([kinematics.transform(dm(pose), robot.attachments).full().T for pose in poses]),
        position=poses[:, :3],
        carriers=carriers[:, shown, :3],
        names=[robot.carriers[index].name for index in shown],
        bodies=[np.flatnonzero(of_cable == index) for index in shown],
        boxes=[(np.array(c.reach.min), np.array(c.reach.max)) for c in robot.carriers if isinstance(c, MobileCarrier)],
        tensions=audit.tensions[rows],
        t_min=robot.t_min,
        t_max=robot.t_max,
    )
