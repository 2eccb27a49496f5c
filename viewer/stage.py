"""Draw a robot as a viser scene: fixed parts once, moving parts by `show`."""

from __future__ import annotations

import threading
from collections import deque
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..base.text import quantity
from ..figures import style
from ..figures.perspective import ALONG
from ..figures.robot import box_edges, drawn_ends
from ..figures.scene import faces
from ..figures.tension_colours import place, rgb, shades
from ..models.shapes import surface
from . import labels
from .geometry import FIELD_OF_VIEW, Extent, posts, rotors, sheaves
from .snapshot import Snapshot, arrow
from .subject import Subject

if TYPE_CHECKING:
    import viser

WIDE = 1.4  # width over height of a picture
CABLE_WIDTH = 4.0  # [pixels]
THIN = 1.5
BLACK, GREY = (0, 0, 0), (150, 150, 150)
DOT = 0.008  # of the robot's size: diameter of the ends of cables
HEAD = 0.25  # of an arrow's length
BARBS = 12
VIEWS = {"all": ALONG, "top": (0.0, -1e-3, 1.0), "front": (0.0, -1.0, 0.0), "side": (1.0, 0.0, 0.0)}  # to the camera
AIMS = 50  # of a camera that are remembered

GRID: dict[str, Any] = {"cell_color": (225, 225, 225), "section_color": (200, 200, 200), "shadow_opacity": 0.0}
DOTS: dict[str, Any] = {"point_shape": "circle", "precision": "float32"}
# The shaders of other materials keep a machine without a GPU busy for ten seconds.
MATERIAL: dict[str, Any] = {"material": "toon3", "side": "double", "cast_shadow": False, "receive_shadow": False}

Colour = tuple[int, int, int]


class Stage:
    """A subject's robot on a viser server.

    - `server`: only its scene and camera are used.
    - `subject`: the robot, plan or workspace to show.
    - `captioned`: show time, status and margin in the scene, for a page without a panel.
    """

    def __init__(self, server: viser.ViserServer, subject: Subject, captioned: bool):
        # viser calls what minds cameras from many threads.
        self._scene, self._left, self._turning = server.scene, False, threading.RLock()
        self._robot = subject.robot
        extent = subject.replay.extent if subject.replay else subject.geometry.extent
        if subject.other is not None:
            extent = Extent.of(*extent, *subject.other.extent)
        self.extent = extent  # box around what is shown; the initial camera looks at its centre
        self._size = extent.size
        self.frame(server.initial_camera, WIDE, 1.0)
        self._draw_surroundings(subject)
        self._make_actors(captioned)
        if subject.other is not None:
            self._make_shadow(subject.other.path)

    def show(self, instant: Snapshot, other: Snapshot | None = None) -> None:
        """Draw an instant, and one of another plan or simulation as a shadow."""
        if other is not None:
            move(self._other_platform, other.pose)
            ways = np.where(np.isfinite(other.points.exits), other.points.exits, other.points.anchors)
            self._other_cables.points = np.stack([ways, other.points.attachments], axis=1).astype(np.float32)
        points = instant.points
        colours = shades(place(instant.tensions, self._robot.t_min, self._robot.t_max))
        exits = np.where(np.isfinite(points.exits), points.exits, points.anchors)
        ends = drawn_ends(points.anchors, points.attachments, instant.cut)
        if instant.cut is not None:  # nothing runs over the pulley of a cable that has been cut
            exits, colours = np.where(instant.cut[:, None], points.anchors, exits), colours.copy()
            colours[instant.cut] = GREY
        ways = np.stack([points.anchors, exits, exits, ends], axis=1).reshape(-1, 2, 2, 3)
        for cable, way, colour in zip(self._cables, ways.astype(np.float32), colours, strict=True):
            cable.points = way
            cable.colors = colour
        rings = sheaves(self._robot, points)
        self._sheaves.visible = len(rings) > 0
        if len(rings):
            self._sheaves.points = rings.astype(np.float32)
        for dots, ends in zip(self._ends, (points.anchors, points.attachments), strict=True):
            dots.points = ends.astype(np.float32)
        move(self._platform, instant.pose)
        for index, handle in self._carriers.items():
            move(handle, instant.carriers[index])
        # Not all at one height, for cables that run close to each other.
        along = (np.arange(self._robot.m) % 2 * 0.2 + 0.3)[:, None]
        middles = (1 - along) * exits + along * ends
        for index, (label, tension) in enumerate(zip(self._numbers, instant.tensions, strict=True)):
            label.position = middles[index]
            text = f"{index + 1}: {quantity(tension, 'N', 3)}" if np.isfinite(tension) else f"{index + 1}"
            _write(label, f"{index + 1}: cut" if instant.cut is not None and instant.cut[index] else text)
        self._point(instant)
        if self._caption is not None:
            _write(self._caption, labels.caption(instant))

    def show_cloud(self, shown: bool, most: np.ndarray) -> None:
        """Show or hide the points of a workspace whose coordinates are at most `most` (3,) in {G} [m]."""
        if self._cloud is None or self._points is None:
            return
        kept = (self._points.positions <= most).all(axis=1)
        self._cloud.visible = shown and bool(kept.any())
        if kept.any():
            self._cloud.points = self._points.positions[kept].astype(np.float32)
            self._cloud.colors = self._points.colours[kept]

    def show_bands(self, bands: list[tuple[np.ndarray, np.ndarray]]) -> None:
        """Draw the surface of a workspace, vertices and faces of each band of margins from small to large; or none."""
        for old in self._bands:
            old.remove()
        colours = shades(np.linspace(0.0, 1.0, max(len(bands), 1)))
        self._bands = [
            self._mesh(f"/surface/{number}", vertices, faces, tuple(colour.tolist()), 0.75, flat=False)
            for number, ((vertices, faces), colour) in enumerate(zip(bands, colours, strict=False), 1)
            if len(faces)
        ]

    def show_numbers(self, shown: bool) -> None:
        """Show or hide number and tension at the cables."""
        for label in self._numbers:
            label.visible = shown

    def _point(self, instant: Snapshot) -> None:
        """Draw the arrow of the certificate."""
        ends = arrow(instant, self._size, self._robot.force_scale)
        self._arrow.visible = self._short.visible = ends is not None
        if ends is not None:
            self._arrow.points = _strokes(*ends).astype(np.float32)
            self._short.position = ends[1]
            _write(self._short, labels.shortfall(instant))

    def frame(self, camera: Any, width: float, height: float, view: str = "all") -> None:
        """Point a camera at the whole robot, by default from the front, a little from the side and above.

        In portrait pictures, as on a phone, the camera is farther away, and the robot above the panel.

        - `camera`: viser's initial camera, or a client's.
        - `width`, `height`: of its picture [pixels].
        - `view`: one of `VIEWS`.
        """
        along = np.array(VIEWS[view])
        along /= np.linalg.norm(along)
        free = 1.0 - labels.SHEET_SHARE if width < height else 1.0
        away = self.extent.nearest / min(width / height, free, 1.0)
        side = np.cross([0.0, 0.0, 1.0], along)
        upwards = np.cross(along, side / np.linalg.norm(side))
        # The centre of the part that the panel leaves free is above the centre of the picture.
        centre = self.extent.centre - (1.0 - free) * away * np.tan(FIELD_OF_VIEW / 2) * upwards
        camera.position = centre + away * along
        camera.look_at = centre
        camera.fov = FIELD_OF_VIEW
        camera.near, camera.far = 1e-3 * self._size, 50 * self._size

    def leave(self) -> None:
        """Leave cameras alone, because the scene belongs to another stage from now on."""
        with self._turning:
            self._left = True

    def fit_to_screen(self, client: viser.ClientHandle, frame: bool = False) -> None:
        """Fit the camera to portrait screens, now and whenever a screen is turned.

        The initial camera may reach a browser after this one, and a user can return to it. A camera that a user has
        pointed elsewhere stays. With `frame`, it is pointed at the robot first.
        """
        camera = client.camera
        framed, aims = (WIDE, 1.0), deque([self.extent.centre], AIMS)

        def point(shape: tuple[float, float]) -> None:
            nonlocal framed
            framed = shape
            self.frame(camera, *shape)
            aims.append(np.array(camera.look_at))

        def fit() -> None:
            if self._left:
                return
            shape, looked_at = (float(camera.image_width), float(camera.image_height)), camera.look_at
            # An update may be older than the framing before it, so the places before count too.
            untouched = min(np.abs(looked_at - aim).max() for aim in (self.extent.centre, *aims)) < 1e-3 * self._size
            initial = np.abs(looked_at - self.extent.centre).max() < 1e-3 * self._size
            upright, was_upright = shape[0] < shape[1], framed[0] < framed[1]
            if untouched and ((upright and initial) or (shape != framed and (upright or was_upright))):
                point(shape)

        def turn(first: bool = False) -> None:
            with self._turning:
                if first:
                    point((float(camera.image_width), float(camera.image_height)))
                fit()

        turn(frame)
        camera.on_update(lambda _: turn())

    def _draw_surroundings(self, subject: Subject) -> None:
        scene, cell = self._scene, self.extent.cell
        # Shadows tell little here, and their shaders keep a machine without a GPU busy for seconds.
        scene.configure_default_lights(cast_shadow=False)
        width = 2 * cell * np.ceil(self._size / cell)
        floor = np.array([*(np.round(self.extent.centre[:2] / cell) * cell), self.extent.floor])
        sizes = {"width": width, "height": width, "cell_size": cell, "section_size": 5 * cell}
        scene.add_grid("/grid", position=floor, fade_distance=100 * self._size, **sizes, **GRID)
        scene.add_frame("/G", axes_length=0.08 * self._size, axes_radius=0.004 * self._size, origin_radius=0.0)
        scene.add_label("/G/name", "{G}", anchor="top-right", font_screen_scale=0.8)
        self._lines("/posts", posts(self._robot, floor[2]), GREY)
        boxes = [box for carrier in self._robot.carriers for box in carrier.drawing.boxes]
        edges = [edge for box in boxes for edge in box_edges(np.array(box.min), np.array(box.max))]
        self._lines("/reach", edges, rgb(style.colour(3)))
        if subject.replay is not None:
            self._lines("/path", [subject.replay.path], rgb(style.colour(0)), 2 * THIN)
            if subject.replay.reference is not None:
                self._lines("/reference", [subject.replay.reference], rgb(labels.GHOST), THIN)
            self._lines("/carrier_paths", subject.replay.carrier_paths, GREY)
            for index, lines in enumerate(subject.replay.obstacles):
                self._lines(f"/keep_out/{index + 1}/edges", lines, rgb(style.colour(5)))
                self._body(f"/keep_out/{index + 1}/body", np.concatenate(lines), rgb(style.colour(5)), opacity=0.25)
        self._cloud, self._points = None, subject.cloud
        self._bands: list[Any] = []
        if subject.cloud is not None and len(subject.cloud.positions):
            places, colours = subject.cloud.positions.astype(np.float32), subject.cloud.colours
            self._cloud = scene.add_point_cloud("/workspace", places, colours, point_size=0.004 * self._size, **DOTS)

    def _lines(self, name: str, lines: list[np.ndarray], colour: Colour, width: float = THIN) -> None:
        """Draw lines, (k, 3) each [m]."""
        parts = [np.stack([line[:-1], line[1:]], axis=1) for line in lines if len(line) > 1]
        if parts:
            self._segments(name, np.concatenate(parts), colour, width)

    def _segments(self, name: str, ends: np.ndarray, colour: Colour, width: float = THIN) -> viser.LineSegmentsHandle:
        """Draw lines from end to end, (k, 2, 3) [m], in one colour."""
        return self._scene.add_line_segments(
            name, ends.astype(np.float32), colour, thickness=width, thickness_units="screen"
        )

    def _make_actors(self, captioned: bool) -> None:
        scene, robot, size = self._scene, self._robot, self._size
        # An object each: viser shows one colour as it is, but colours of single segments too pale.
        nowhere = np.zeros((2, 2, 3))
        self._cables = [self._segments(f"/cables/{index + 1}", nowhere, BLACK, CABLE_WIDTH) for index in range(robot.m)]
        ends = np.zeros((robot.m, 3), np.float32)
        # Dots would hide a platform that is much smaller than the robot.
        small = min(DOT * size, 0.25 * float(np.ptp(robot.attachments, axis=0).max()) or DOT * size)
        self._ends = [
            scene.add_point_cloud(name, ends, BLACK, point_size=dot, **DOTS)
            for name, dot in (("/ends/anchors", DOT * size), ("/ends/attachments", small))
        ]
        self._sheaves = self._segments("/pulleys", nowhere, BLACK, 2 * THIN)
        self._platform = scene.add_frame("/platform", show_axes=False)
        corners = robot.attachments if robot.platform.body is None else surface(robot.platform.body)
        self._body("/platform/body", corners, rgb(style.colour(4)))
        com = np.array([robot.platform.com], np.float32)
        scene.add_point_cloud("/platform/com", com, rgb(style.colour(0)), point_size=1.5 * small, point_shape="circle")
        self._carriers: dict[int, viser.FrameHandle] = {}
        for index, carrier in enumerate(robot.carriers):
            if not carrier.drawing.body:
                continue
            name, axes = f"/carriers/{carrier.name}", carrier.drawing.axes
            self._carriers[index] = scene.add_frame(
                name, axes, axes_length=0.05 * size, axes_radius=0.003 * size, origin_radius=0.008 * size
            )
            self._body(f"{name}/body", robot.anchors[robot.carrier_of_cable == index], GREY)
            if carrier.drawing.rotors:
                self._lines(f"{name}/rotors", rotors(float(robot.carrier_radius[index])), BLACK, 2 * THIN)
            scene.add_label(f"{name}/name", carrier.name, anchor="bottom-center", font_screen_scale=0.8)
        self._numbers = [
            scene.add_label(f"/tensions/{index + 1}", "", anchor="center-center", font_screen_scale=0.8)
            for index in range(robot.m)
        ]
        self._arrow = self._segments("/missing", np.zeros((1 + BARBS, 2, 3)), rgb(style.colour(1)), 1.5 * CABLE_WIDTH)
        self._arrow.visible = False
        self._short = scene.add_label("/shortfall", "", anchor="bottom-center", visible=False)
        above = np.array([*self.extent.centre[:2], self.extent.high[2] + 0.12 * size])
        self._caption = scene.add_label("/caption", "", position=above, anchor="bottom-center") if captioned else None

    def _make_shadow(self, path: np.ndarray) -> None:
        colour = rgb(labels.OTHER)
        self._other_platform = self._scene.add_frame("/other/platform", show_axes=False)
        self._body("/other/platform/body", self._robot.attachments, colour, opacity=0.35)
        self._other_cables = self._segments("/other/cables", np.zeros((self._robot.m, 2, 3)), colour)
        self._lines("/other/path", [path], colour)

    def _body(self, name: str, corners: np.ndarray, colour: Colour, opacity: float = 0.7) -> None:
        """Draw the convex hull of corners (k, 3) [m] in the frame above `name`, if it has a volume or an area."""
        triangles = [[face[0], *pair] for face in faces(corners) for pair in pairwise(face[1:])]
        if triangles:
            self._mesh(name, corners, np.array(triangles), colour, opacity, flat=True)

    def _mesh(
        self, name: str, places: np.ndarray, triangles: np.ndarray, colour: Colour, opacity: float, flat: bool
    ) -> viser.MeshHandle:
        """Draw triangles (n, 3), by the indices of their corners among `places` (k, 3) [m]."""
        corners, look = places.astype(np.float32), {"color": colour, "opacity": opacity, "flat_shading": flat}
        return self._scene.add_mesh_simple(name, corners, triangles.astype(np.uint32), **MATERIAL, **look)


def _strokes(start: np.ndarray, tip: np.ndarray) -> np.ndarray:
    """Return an arrow as line segments (1 + BARBS, 2, 3): its shaft, and a head of lines around it."""
    along = tip - start
    _, _, axes = np.linalg.svd(along[None])
    angles = np.linspace(0.0, 2 * np.pi, BARBS, endpoint=False)[:, None]
    around = np.cos(angles) * axes[1] + np.sin(angles) * axes[2]
    ends = tip - HEAD * along + HEAD / 3 * np.linalg.norm(along) * around
    return np.concatenate([[[start, tip]], np.stack([np.tile(tip, (BARBS, 1)), ends], axis=1)])


def move(handle: viser.FrameHandle | viser.TransformControlsHandle, pose: np.ndarray) -> None:
    """Move a frame or a handle to a pose (6,) in {G}."""
    handle.position = pose[:3]
    handle.wxyz = Rotation.from_euler("ZYX", pose[:2:-1]).as_quat(scalar_first=True)


def _write(label: viser.LabelHandle, text: str) -> None:
    if label.text != text:
        label.text = text
