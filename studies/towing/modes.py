"""Paper C's three drives for m = 3 to 6: a load is carried between two rest poses with least effort."""

import numpy as np

from ...figures.curves import Panel, curves
from ...figures.drawing import Drawing
from ...ocp import Plan
from ..accounts.claim import Chapter, Verdict
from .claims import claim
from .equations import SIZES
from .plans import DRIVES, FIXED, Drive, planned

CHANGES = {
    "fixed-length": "by changing only the positions of the robot-ends, with cables of 1.2 m",
    "variable-length": "by changing only the lengths of the cables",
    "both": "by changing robot-ends and lengths together",
}
SECTIONS = {"fixed-length": "5.1", "variable-length": "5.2", "both": "5.3"}


def chapter() -> Chapter:
    """Plan for every drive and every m."""
    plans = {drive: {m: planned(name, drive) for m, name in SIZES.items()} for drive in DRIVES}
    claims = []
    for drive, by_m in plans.items():
        feasible = [one.feasible for one in by_m.values()]
        tensions = np.concatenate([one.trajectory["tensions"].values for one in by_m.values()], axis=None)
        carried = claim("drive-{drive}").stated(
            sum(feasible),
            all(feasible),
            printed=len(by_m),
            otherwise=Verdict.NOT_DETERMINED,
            drive=drive,
            section=SECTIONS[drive],
            changes=CHANGES[drive],
            least=np.nanmin(tensions),
            most=np.nanmax(tensions),
        )
        claims.append(carried)
    fixed = plans["fixed-length"].values()
    off = max(np.abs(one.trajectory["cable_lengths"].values - FIXED).max() for one in fixed)  # on the audit's grid
    claims.append(claim("drive-fixed-kept").stated(off, off < 1e-4))
    return Chapter(claims, {f"drive-{drive}": _drawing(drive, by_m[3]) for drive, by_m in plans.items()})


def _drawing(drive: Drive, planned: Plan) -> Drawing:
    t = planned.trajectory
    moved = np.linalg.norm(t["carrier_pose"].values[:, :, :3] - t["carrier_pose"].values[0, :, :3], axis=2)
    panels = [
        Panel.of_cables("tension [N]", t["tensions"].values, {"0 N": 0.0}),
        Panel.of_cables("length [m]", t["cable_lengths"].values),
        Panel.of_cables("robot-end moved [m]", moved),
    ]
    return Drawing(
        f"Three robots carry 10 kg in 2 s with least effort, drive {drive}. Robot i holds cable i.",
        curves(t["time"].values, "time [s]", panels),
    )
