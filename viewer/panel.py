"""Show controls and readouts beside the scene, sliders for a robot or a time line, and replace what is shown."""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast
from urllib.parse import parse_qs

import numpy as np

from ..base.errors import InputError, TowlineError
from ..figures.animation import FASTEST, draw, timing
from ..models import available
from ..statics.scene import scene
from ..workspace.surface import Surface, surface as surface_of
from . import labels
from .frames import Frames
from .geometry import FARTHEST
from .posing import Posing
from .replay import Replay
from .sliders import whole_steps
from .snapshot import Snapshot
from .stage import VIEWS, Stage
from .subject import Subject, read
from .timeline import TimeLine

if TYPE_CHECKING:
    import viser

PATIENCE = 60.0  # [s] for a browser to draw a picture
FINE = 2.0  # times the size in the browser: of a saved picture
RATE = 12.5  # [1/s]
LONGEST = 12.0  # [s] of the film: longer motions are shown faster
MOST_NUMBERS = 600  # of a link


class Panel:
    """The controls of a subject on a viser server, until `close`; for a robot with a list of `robots` to switch to."""

    def __init__(
        self,
        server: viser.ViserServer,
        subject: Subject,
        stage: Stage,
        robots: Sequence[str],
        switch: Callable[[str], None],
    ):
        self._subject, self._stage = subject, stage
        self._server, self._gui = server, cast("Any", server.gui)
        self._gui.configure_theme(control_width="medium", show_logo=False, show_share_button=False)
        self._gui.main_panel.dock_right()
        self._gui.set_panel_label(subject.title)
        if subject.kind == "robot":
            chosen = self._gui.add_dropdown("robot", robots, initial_value=subject.robot.name)
            chosen.on_update(lambda event: None if event.client_id is None else switch(event.target.value))
        self._readout = self._gui.add_html("")
        frames = Frames(server)
        self._gui.add_html(labels.NARROW)
        self._controls: Posing | TimeLine
        if subject.replay is None:
            self._controls = Posing(server, frames, subject.geometry, self._show, self._refuse)
        else:
            self._controls = TimeLine(server, frames, subject.replay, self._show, subject.other)
        with self._gui.add_folder("Picture"):
            view = self._gui.add_button_group("view", tuple(VIEWS))
            view.on_click(lambda event: _look(event.client, stage, view.value))
            numbers = self._gui.add_checkbox("numbers at the cables", True)
            numbers.on_update(lambda _: stage.show_numbers(numbers.value))
            if subject.cloud is not None:
                self._add_cuts(subject.cloud.positions)
            save = self._gui.add_button("Save picture")
            save.on_click(lambda event: self._send_picture(event.client, f"{subject.robot.name}.png"))
            if subject.replay is not None:
                self._add_film(subject.replay)
        with self._gui.add_folder("Legend"):
            self._gui.add_html(labels.legend(subject, stage.extent.cell))

    def _add_cuts(self, positions: np.ndarray) -> None:
        """Add a switch for the points (n, 3) of a workspace, and a slider for each axis to cut away those beyond it."""
        points = self._gui.add_checkbox("points", True)
        surface = self._gui.add_checkbox("surface", False, disabled=True)
        scale = self._gui.add_html("")
        cuts: list[Any] = []
        found: list[Surface] = []
        drawing, latest = threading.Lock(), 0
        for name, column in zip("xyz", positions.T if len(positions) else np.zeros((3, 1)), strict=True):
            low, high, step = whole_steps(float(column.min()), float(column.max()))
            cuts.append(self._gui.add_slider(f"{name} up to [m]", low, high, step, high))

        def cut(_: Any) -> None:
            nonlocal latest
            latest = number = latest + 1
            # viser calls this from many threads, and its updates are no locks: two would leave bands of both.
            with drawing, self._server.atomic():
                if number != latest:  # the later one reads the sliders too
                    return
                most = np.array([it.value for it in cuts])
                self._stage.show_cloud(points.value, most)
                if found:
                    self._stage.show_bands(found[0].bands(most) if surface.value else [])

        def compute() -> None:
            """Add the surface once it is computed."""
            assert self._subject.cloud is not None
            try:
                there = surface_of(self._subject.cloud.dataset, self._subject.robot, FARTHEST)
            except InputError as error:
                scale.content = labels.note(str(error))
                return
            if there is None:
                scale.content = labels.note("The samples are too few, or too flat, for a surface.")
                return
            found.append(there)
            scale.content = labels.margin_scale(there.largest)
            surface.disabled, surface.value, points.value = False, True, False
            cut(None)

        for control in (points, surface, *cuts):
            control.on_update(cut)
        threading.Thread(target=compute, daemon=True).start()

    def _add_film(self, replay: Replay) -> None:
        """Add a button that draws a film in a thread of its own, while the view goes on."""
        button, drawing = self._gui.add_button("Save film"), threading.Lock()

        def save(client: viser.ClientHandle | None) -> None:
            if not drawing.acquire(blocking=False):  # clicked again before a browser had disabled the button
                return
            button.disabled, button.label = True, "Drawing a film ..."
            try:
                drawn = film(replay)
                if client is not None:
                    client.send_file_download(f"{replay.robot.name}.gif", drawn, save_immediately=True)
            except TowlineError as error:
                self._refuse(str(error))
            finally:
                button.disabled, button.label = False, "Save film"
                drawing.release()

        # A daemon, so that the process ends at Ctrl-C without waiting for it.
        button.on_click(lambda event: threading.Thread(target=save, args=(event.client,), daemon=True).start())

    def _send_picture(self, client: viser.ClientHandle | None, name: str) -> None:
        """Let a browser download its view of the scene without handles, twice as large as it is shown, on white."""
        if client is None:
            return
        import io

        from matplotlib.image import imsave

        size = (round(FINE * client.camera.image_height), round(FINE * client.camera.image_width))
        hidden = self._controls.without_handles() if isinstance(self._controls, Posing) else nullcontext()
        try:
            with hidden:
                picture = client.get_render(*size, transport_format="png", timeout=PATIENCE) / 255.0
        except RuntimeError:  # the browser has left
            return
        opaque = picture[..., 3:]
        file = io.BytesIO()
        imsave(file, np.clip(picture[..., :3] * opaque + 1.0 - opaque, 0.0, 1.0), format="png")
        client.send_file_download(name, file.getvalue(), save_immediately=True)

    def pose(self, numbers: np.ndarray) -> None:
        """Move a robot to the pose of its platform, (6,), and of its carriers, (6 c,), by default at home.

        Other sizes and subjects are ignored.
        """
        home = self._subject.robot.carrier_home
        if numbers.size == 6:
            numbers = np.concatenate([numbers, home.ravel()])
        if isinstance(self._controls, Posing) and numbers.size == home.size + 6:
            self._controls.open(numbers[:6], numbers[6:].reshape(-1, 6))

    def close(self) -> None:
        """Stop playing and shading."""
        self._controls.close()

    def _refuse(self, reason: str) -> None:
        """Show why there is no instant to draw."""
        self._readout.content = labels.refusal(reason)

    def _show(self, instant: Snapshot) -> None:
        """Draw an instant in scene and panel."""
        other = self._subject.other_at(instant)
        self._stage.show(instant, other)
        self._readout.content = labels.readout(instant, self._subject.robot, other)


def _look(client: viser.ClientHandle | None, stage: Stage, view: str) -> None:
    """Point the camera of a browser at the robot from one of the sides."""
    if client is not None:
        stage.frame(client.camera, client.camera.image_width, client.camera.image_height, view)


def film(replay: Replay) -> bytes:
    """Return a film of the saved instants of a replay as GIF."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.gif"
        speed = min(max(replay.duration / LONGEST, 1.0), FASTEST)
        when = timing(path, replay.duration, float(f"{speed:.2g}"), RATE)
        return draw(scene(replay.robot, replay.dataset, when.times), when, path).read_bytes()


class Live:
    """Scene and panel of a subject on a viser server, until `close`."""

    def __init__(self, server: viser.ViserServer, subject: Subject):
        self._server, self._busy, self._first = server, threading.RLock(), subject
        self._robots = tuple(dict.fromkeys([*available(), subject.robot.name]))
        self._show(subject)
        server.on_client_connect(lambda client: self._stage.fit_to_screen(client))

    def _show(self, subject: Subject) -> None:
        self._subject = subject
        self._stage = Stage(self._server, subject, captioned=False)
        self._panel = Panel(self._server, subject, self._stage, self._robots, self.switch)

    def switch(self, robot: str) -> None:
        """Show a robot of the library, or the one that the view began with, instead."""
        with self._busy:
            if robot != self._subject.robot.name and robot in self._robots:
                self.replace(self._first if robot == self._first.robot.name else read(robot))

    def replace(self, subject: Subject) -> None:
        """Show another subject instead, and point all cameras at it."""
        with self._busy:
            self._panel.close()
            self._stage.leave()
            self._server.gui.reset()
            self._server.scene.reset()
            self._show(subject)
            for client in self._server.get_clients().values():
                self._stage.fit_to_screen(client, frame=True)

    def follow(self, query: str) -> None:
        """Show the robot and the pose of a link, in a thread of its own; what is no link of ours is ignored."""
        asked = parse_qs(query)
        try:
            numbers = np.array([float(word) for word in asked.get("pose", [""])[0].split(",", MOST_NUMBERS)])
        except ValueError:
            return
        if not np.isfinite(numbers).all():
            return

        def go() -> None:
            if self._subject.kind == "robot":
                self.switch(asked.get("robot", [""])[0])
            if asked.get("robot") == [self._subject.robot.name]:
                self._panel.pose(numbers)

        threading.Thread(target=go, daemon=True).start()

    def close(self) -> None:
        """Stop playing and shading."""
        self._panel.close()
