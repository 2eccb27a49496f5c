"""Paper C's robots carry their load from one pose to another, in each of the three drive modes.

At both poses the load rests on taut cables. A robot with fewer than six cables can rest at few poses only, so they are
computed (`models.statics.equilibria`): with the lengths that the paper fixes, 1.2 m, and the robot-ends at home or
shifted together; or, where winches change the lengths, with 1.25 m and 1.1 m. The planner chooses the motion in
between, including the attitude of the load.
"""

from functools import cache
from typing import Any, Literal

import numpy as np

from ...models import Robot, load
from ...ocp import Plan, Task, plan
from ...statics.equilibria import equilibria

Drive = Literal["fixed-length", "variable-length", "both"]
DRIVES: tuple[Drive, ...] = ("fixed-length", "variable-length", "both")
FIXED, LONG, SHORT = 1.2, 1.25, 1.1  # lengths [m]
SHIFT = np.array([0.08, 0.1, 0.1])  # of all robot-ends [m], inside their boxes
TAUT = 0.1  # [N]: paper C requires tensions above zero
SECONDS = 2.0  # of a motion


@cache
def robot(name: str, drive: Drive) -> Robot:
    """Return a robot of the library with another drive and cables of 1.2 m, read from its file once."""
    data = load(name).model_dump(mode="json")
    cables = [{**cable, "length": FIXED} for cable in data["cables"]]
    return Robot.model_validate({**data, "drive": drive, "cables": cables})


def task(mover: Robot, steps: int = 50) -> Task:
    """Return the task to carry the load of `mover` between two rest poses with least effort."""
    home = mover.carrier_home
    stays = mover.drive == "variable-length"
    there = home if stays else home + np.concatenate([SHIFT, np.zeros(3)])
    lengths = (FIXED, FIXED) if mover.drive == "fixed-length" else (LONG, SHORT)
    start, end = (
        equilibria(mover, np.full(mover.m, length), places)[0].pose
        for length, places in zip(lengths, (home, there), strict=True)
    )
    names = [carrier.name for carrier in mover.carriers]
    around = {name: _line(*ends) for name, *ends in zip(names, home, there, strict=True)}
    return Task.model_validate(
        {
            "name": f"{mover.drive}-effort",
            "path": _line(start, end),
            "tube": {"position": "free", "attitude": "free", "ends": "exact"},
            "base": {"kind": "hold"} if stays else {"kind": "free", "ends": "exact", "around": around},
            "duration": SECONDS,
            "margin": TAUT,
            "steps": steps,
        }
    )


@cache
def planned(name: str, drive: Drive) -> Plan:
    """Return the plan with least effort of a robot of the library with a drive, computed once in a process."""
    mover = robot(name, drive)
    return plan(mover, task(mover))


def _line(start: np.ndarray, end: np.ndarray) -> dict[str, Any]:
    return {"kind": "line", "start": start.tolist(), "end": end.tolist()}
