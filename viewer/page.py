"""Write what stands beside the scene of a page without a server: title, tensions of the shown instant, legend."""

import json
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from ..figures.tension_colours import place, shades
from ..models import Robot
from . import labels
from .snapshot import Snapshot
from .subject import Subject

SCRIPT, CAMERA = (Path(__file__).with_name(name).read_text(encoding="utf-8") for name in ("page.js", "camera.js"))


def camera(centre: np.ndarray, along: np.ndarray, nearest: float) -> str:
    """Return the script that moves the initial camera away from the robot on portrait screens.

    It looks at `centre` from the direction `along`, (3,) each in {G} [m], at the distance `nearest` [m] on a screen
    that is wider than high.
    """
    values = {"CENTRE": centre.tolist(), "ALONG": along.tolist(), "NEAREST": nearest}
    constants = ", ".join(f"{name} = {json.dumps(value)}" for name, value in values.items())
    return f"<script>{{ const {constants};\n{CAMERA}}}</script>"


def aside(subject: Subject, frames: list[Snapshot], cell: float) -> str:
    """Return the HTML beside a scene that shows these instants one after the other; a title that folds the rest."""
    start = frames[0]
    # What follows the clock is replaced by the script; of the rest only the first instant is known.
    table = labels.table(start, subject.robot)
    status = f'<b class="towline-status">{escape(start.status)}</b>'
    clock = f'<div class="towline-time">t = {start.time or 0.0:.2f} s</div>'
    data = json.dumps(_data(subject.robot, frames)).replace("<", "\\u003c")
    return (
        '<aside style="position:fixed;left:8px;bottom:52px;max-width:280px;max-height:80%;overflow:auto;z-index:1;'
        'pointer-events:none;color:#222;background:#ffffffcc;font-family:system-ui,sans-serif"><details open>'
        '<summary style="padding:4px 12px;font-weight:600;pointer-events:auto;cursor:pointer">'
        f'{escape(subject.title)}</summary><div style="{labels.BODY}">{status}{clock}{table}</div>'
        f"{labels.legend(subject, cell)}</details></aside><script>const FRAMES = {data};\n{SCRIPT}</script>"
    )


def _data(robot: Robot, frames: list[Snapshot]) -> dict[str, Any]:
    """Return what the table of each frame has."""
    tensions, digits = np.array([frame.tensions for frame in frames]), labels.decimals(robot)
    places = place(tensions, robot.t_min, robot.t_max)
    return {
        "clocks": [f"t = {frame.time or 0.0:.2f} s" for frame in frames],
        "digits": digits,
        "statuses": [frame.status for frame in frames],
        "tensions": [[round(t, digits) if np.isfinite(t) else None for t in row] for row in tensions.tolist()],
        "widths": np.nan_to_num(np.round(100 * places)).astype(int).tolist(),
        "colours": [["#" + bytes(shade).hex() for shade in row] for row in shades(places)],
    }
