"""Write what stands beside the scene of a page without a server; and the page of a robot that computes in the browser.

That page runs the numeric core, compiled to WebAssembly. live/robot_at_rest.wasm is compiled by `make live`, because
the C compilers of most machines cannot, and is part of the repository; a test compares it with its sources.
"""

import json
from base64 import b64encode
from html import escape
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from ..figures import style
from ..figures.perspective import ALONG, floor_grid
from ..figures.robot import box_edges
from ..figures.scene import faces
from ..figures.tension_colours import NO_TENSION, place, rgb, shades
from ..models import Robot
from ..models.record import record_of
from ..models.shapes import surface
from . import labels
from .geometry import posts, rotors
from .posing import few_cables, opening_pose
from .sliders import sliders
from .snapshot import Snapshot
from .subject import Subject

SCRIPT, CAMERA = (Path(__file__).with_name(name).read_text(encoding="utf-8") for name in ("page.js", "camera.js"))
FOLDER = Path(__file__).with_name("live")
SHADES = 65  # of the colour scale
PART = (150, 150, 150)
NEARER = 0.85  # than in the viewer, whose panel lies over the scene


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
    data = json.dumps(_frames_data(subject.robot, frames)).replace("<", "\\u003c")
    return (
        '<aside style="position:fixed;left:8px;bottom:52px;max-width:280px;max-height:80%;overflow:auto;z-index:1;'
        'pointer-events:none;color:#222;background:#ffffffcc;font-family:system-ui,sans-serif"><details open>'
        '<summary style="padding:4px 12px;font-weight:600;pointer-events:auto;cursor:pointer">'
        f'{escape(subject.title)}</summary><div style="{labels.BODY}">{status}{clock}{table}</div>'
        f"{labels.legend(subject, cell)}</details></aside><script>const FRAMES = {data};\n{SCRIPT}</script>"
    )


def _frames_data(robot: Robot, frames: list[Snapshot]) -> dict[str, Any]:
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


def live_page(subject: Subject) -> str:
    """Return the page of a robot, with the points of its workspace if there are any, as one HTML document.

    Raises `InputError` if the robot is too large for the core, or the robot cannot be drawn.
    """
    data, geometry = _data(subject), subject.geometry
    moving = any(it.carrier is not None and it.coordinate < 3 for it in sliders(subject.robot, geometry))
    return Template((FOLDER / "live.html").read_text(encoding="utf-8")).substitute(
        title=escape(subject.title),
        carriers=" or a carrier" if moving else "",
        cell=f"{geometry.extent.cell:g}",
        data=json.dumps(data).replace("<", "\\u003c"),
        script=(FOLDER / "live.js").read_text(encoding="utf-8"),
    )


def _data(subject: Subject) -> dict[str, Any]:
    robot, geometry, cloud = subject.robot, subject.geometry, subject.cloud
    extent, cell = geometry.extent, geometry.extent.cell
    platform = robot.attachments if robot.platform.body is None else surface(robot.platform.body)
    return {
        "name": robot.name,
        "core": b64encode((FOLDER / "robot_at_rest.wasm").read_bytes()).decode(),
        "record": b64encode(record_of(robot).tobytes()).decode(),
        "t_min": robot.t_min.tolist(),
        "t_max": robot.t_max.tolist(),
        "length": robot.length,
        "com": list(robot.platform.com),
        "pose": opening_pose(robot, geometry).tolist(),
        "carriers": robot.carrier_home.tolist(),
        "sliders": [it._asdict() | {"label": it.label} for it in sliders(robot, geometry)],
        "bodies": [
            _body("platform", platform, rgb(style.colour(4)), []),
            *(_carrier(robot, index) for index in range(len(robot.carriers))),
        ],
        "posts": [ends.tolist() for ends in posts(robot, extent.floor)],
        "boxes": [
            edge.tolist()
            for carrier in robot.carriers
            for box in carrier.drawing.boxes
            for edge in box_edges(np.array(box.min), np.array(box.max))
        ],
        "grid": [line.tolist() for line in floor_grid(extent.low - cell, extent.high + cell, cell, extent.floor)],
        "cloud": []
        if cloud is None
        else [[place, _css(hue)] for place, hue in zip(cloud.positions.tolist(), cloud.colours, strict=True)],
        "reach": style.colour(3),
        "centre": extent.centre.tolist(),
        "size": extent.size,
        "distance": NEARER * extent.nearest,
        "few": few_cables(robot),
        "weight": robot.weight,
        "view": [float(np.arctan2(ALONG[1], ALONG[0])), float(np.arcsin(ALONG[2]))],
        "flat": not set(robot.platform.dof) - {"x", "z", "pitch"},
        "typical": robot.force_scale,
        "shades": [_css(shade) for shade in shades(np.linspace(0.0, 1.0, SHADES))],
        "noTension": NO_TENSION,
    }


def _carrier(robot: Robot, index: int) -> dict[str, Any]:
    carrier = robot.carriers[index]
    lines = rotors(float(robot.carrier_radius[index])) if carrier.drawing.rotors else []
    corners = robot.anchors[robot.carrier_of_cable == index] if carrier.drawing.body else np.zeros((0, 3))
    return _body(carrier.name, corners, PART, lines)


def _body(name: str, corners: np.ndarray, colour: tuple[int, ...], lines: list[np.ndarray]) -> dict[str, Any]:
    return {
        "name": name,
        "corners": corners.tolist(),
        "faces": [face.tolist() for face in faces(corners)],
        "colour": colour,
        "lines": [line.tolist() for line in lines],
    }


def _css(colour: np.ndarray) -> str:
    return "#" + bytes(colour).hex()
