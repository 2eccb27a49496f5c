"""Decide which regions are so thin that a motion may jump over them between two nodes: `swept`."""

import casadi as ca
import numpy as np

from ..limits import Limit
from ..tasks.scenario import POSITION, Scenario
from .rows import MANY, Mesh

STEPS = 4  # a motion is rarely that many times as fast as its reference


def swept(scenario: Scenario, mesh: Mesh) -> dict[Limit, ca.Function]:
    """Return the limits that the program keeps between nodes rather than at them, and their functions.

    They are distances from regions that are thinner than a few steps of the reference motion. The result is
    empty for teams, since four quadrotors took four times as long through a slot.
    """
    if scenario.count > MANY:
        return {}
    platform, carriers = scenario.references(scenario.scheme.shares(mesh.steps) * scenario.duration)
    ways = [np.diff(motion.pose[:, POSITION], axis=0) for motion in (platform, *carriers)]
    longest = max(float(np.linalg.norm(way, axis=1).max()) for way in ways)  # from node to node
    thin = [limit for limit in scenario.limits if limit.thickness < STEPS * longest]
    functions = {limit: scenario.limits.on_the_way(limit) for limit in thin}
    return {limit: function for limit, function in functions.items() if function is not None}
