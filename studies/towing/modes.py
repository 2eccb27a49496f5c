"""Paper C's three ways to drive, for m = 3 to 6: a load carried between two poses where it rests, with least effort."""

from __future__ import annotations

import numpy as np

from ...figures.curves import Panel, curves
from ...figures.drawing import Drawing
from ...ocp import Plan, plan
from ..accounts.account import Chapter
from ..accounts.claim import Claim, Verdict, stated
from .equations import SIZES
from .plans import DRIVES, FIXED, Drive, robot, task

STEPS = 50
SAID = {
    "fixed-length": "by changing only the positions of the robot-ends, with cables of 1.2 m",
    "variable-length": "by changing only the cables' lengths",
    "both": "by changing robot-ends and lengths together",
}
SECTIONS = {"fixed-length": "5.1", "variable-length": "5.2", "both": "5.3"}


def chapter() -> Chapter:
    """A plan for every drive and every m."""
    plans: dict[Drive, dict[int, Plan]] = {
        drive: {m: plan(robot(name, drive), task(robot(name, drive), "effort", STEPS)) for m, name in SIZES.items()}
        for drive in DRIVES
    }
    claims = [_carried(drive, found) for drive, found in plans.items()]
    claims.append(_kept(plans["fixed-length"]))
    return Chapter(claims, {f"drive-{drive}": _drawing(drive, found[3]) for drive, found in plans.items()})


def _carried(drive: Drive, found: dict[int, Plan]) -> Claim:
    feasible = [one.feasible for one in found.values()]
    most = max(float(np.nanmax(one.trajectory["tensions"].values)) for one in found.values())
    least = min(float(np.nanmin(one.trajectory["tensions"].values)) for one in found.values())
    return stated(
        f"drive-{drive}",
        f"sections 2, {SECTIONS[drive]}",
        f"A load moves {SAID[drive]}, for m = 3, 4, 5, 6 (number of audited plans).",
        float(len(found)),
        float(sum(feasible)),
        holds=all(feasible),
        otherwise=Verdict.NOT_DETERMINED,
        agrees=f"Plans were found and audited, with tensions from {least:.1f} to {most:.1f} N.",
        differs="Not every m has a plan that was found and passed its audit, which proves nothing for the others.",
        figure=f"drive-{drive}",
    )


def _kept(found: dict[int, Plan]) -> Claim:
    """Lengths of the fixed drive between the nodes, as the audit sees them."""
    off = max(float(np.abs(one.trajectory["cable_lengths"].values - FIXED).max()) for one in found.values())
    return stated(
        "drive-fixed-kept",
        "section 5.1",
        "The lengths stay as they are (largest change on the way).",
        0.0,
        off,
        holds=off < 1e-4,
        agrees="To less than 0.1 mm, between the nodes of the plan too.",
        differs="They change by more than 0.1 mm between the nodes of the plan.",
        unit="m",
    )


def _drawing(drive: Drive, found: Plan) -> Drawing:
    t = found.trajectory
    moved = np.linalg.norm(t["carrier_pose"].values[:, :, :3] - t["carrier_pose"].values[0, :, :3], axis=2)
    names = [f"cable {i + 1}" for i in range(t.sizes["cable"])]
    panels = [
        Panel("tension [N]", dict(zip(names, t["tensions"].values.T, strict=True)), {"0 N": 0.0}),
        Panel("length [m]", dict(zip(names, t["cable_lengths"].values.T, strict=True))),
        Panel("robot-end moved [m]", dict(zip(names, moved.T, strict=True))),
    ]
    return Drawing(
        f"Three robots carry 10 kg in 2 s, least effort, drive: {drive}. Of cable i the robot-end is that of robot i.",
        curves(t["time"].values, "time [s]", panels),
    )
