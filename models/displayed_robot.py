"""`DisplayedRobot`: what a terminal or a notebook shows of a robot."""

from collections.abc import Iterable
from itertools import combinations
from typing import Any

import numpy as np

from ..base.display import BLUE, ORANGE, Curve, Fact, picture
from ..base.inputs import printable
from ..base.text import quantity, quantity_range, quantity_row
from .part import Part

PLANES = {"x": [[0, 0], [1, 0], [0, 1]], "y": [[1, 0], [0, 0], [0, 1]], "z": [[1, 0], [0, 1], [0, 0]]}  # without it
OBLIQUE = [[0.9, -0.25], [-0.45, -0.45], [0.0, 0.95]]  # (3, 2), from above


class DisplayedRobot(Part):
    """The base of `Robot`, whose numbers its headline, facts and picture show."""

    def _headline(self) -> str:
        robot: Any = self
        kinds = [carrier.kind for carrier in robot.carriers]
        carriers = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
        return f"{robot.name}: {robot.m} cables; carriers: {carriers}"

    def _facts(self) -> Iterable[Fact]:
        robot: Any = self
        return [
            ("mass", quantity(robot.platform.mass, "kg")),
            ("moves", ", ".join(robot.platform.dof)),
            ("home", f"({quantity_row(robot.home)}) [m, rad]"),
            ("cables there", quantity_range(np.linalg.norm(robot.home_anchors - robot.home_attachments, axis=1), "m")),
            ("t_min", quantity_range(robot.t_min, "N")),
            ("t_max", quantity_range(robot.t_max, "N")),
            ("drive", robot.drive),
            ("source", printable(robot.source)),
        ]

    def _picture(self) -> str:
        """Return cables and platform at home, in the plane of a planar robot, else obliquely from above."""
        robot: Any = self
        flat = [plane for name, plane in PLANES.items() if name not in robot.platform.dof]
        view = np.array(flat[0] if flat else OBLIQUE)
        anchors, attachments = robot.home_anchors @ view, robot.home_attachments @ view  # (m, 2)
        rows = [i for pair in combinations(range(robot.m), 2) for i in (*pair, 0)] or [0]
        body = attachments[rows]
        body[2::3] = np.nan
        cables: list[Curve] = [(*np.stack([a, b]).T, BLUE) for a, b in zip(anchors, attachments, strict=True)]
        return picture([(*body.T, ORANGE), *cables], equal=True)
