"""Show controls and readouts beside the scene: sliders for a robot, a time line for a plan."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ..errors import TowlineError
from ..models import Dynamics
from . import words
from .geometry import Geometry
from .instant import Instant, at_rest
from .sliders import poses, sliders

if TYPE_CHECKING:
    import viser

    from .replay import Replay
    from .stage import Stage
    from .subject import Subject

RATE = 25.0  # [1/s] of playing
TICK = 0.01  # [s] of the time line
SPEEDS = ("0.25x", "0.5x", "1x", "2x", "4x")


class Panel:
    """The controls of a subject on a viser server, until `close`."""

    def __init__(self, server: viser.ViserServer, subject: Subject, geometry: Geometry, stage: Stage):
        self._subject, self._stage, self._geometry = subject, stage, geometry
        self._gui: Any = server.gui
        self._busy = threading.Lock()
        self._shown: tuple[float, ...] | None = None
        self._closed = threading.Event()
        self._gui.configure_theme(control_width="medium", show_logo=False, show_share_button=False)
        self._gui.main_panel.dock_right()
        self._gui.set_panel_label(subject.title)
        self._readout = self._gui.add_html("")
        if subject.replay is None:
            self._add_sliders()
        else:
            self._add_time_line(subject.replay)
        with self._gui.add_folder("Picture"):
            numbers = self._gui.add_checkbox("numbers at the cables", True)
            numbers.on_update(lambda _: stage.show_numbers(numbers.value))
            if subject.cloud is not None:
                points = self._gui.add_checkbox("points", True)
                points.on_update(lambda _: stage.show_cloud(points.value))
            self._gui.add_html(words.legend(subject, stage.cell))

    def close(self) -> None:
        """Stop playing."""
        self._closed.set()

    def _add_sliders(self) -> None:
        robot = self._subject.robot
        dynamics, settings = Dynamics(robot), sliders(robot, self._geometry)
        handles = []
        owners = {setting.carrier: None for setting in settings}
        for owner in owners:
            name = "Platform" if owner is None else f"Carrier {robot.carriers[owner].name}"
            # Teams of six would fill the screen.
            with self._gui.add_folder(name, expand_by_default=owner is None or len(owners) < 3):
                handles += [
                    self._gui.add_slider(it.label, it.low, it.high, it.step, it.home)
                    for it in settings
                    if it.carrier == owner
                ]
        home = self._gui.add_button("Home")

        def values() -> tuple[float, ...]:
            return tuple(float(handle.value) for handle in handles)

        def instant(set_to: tuple[float, ...]) -> Instant:
            return at_rest(dynamics, self._geometry, *poses(robot, settings, list(set_to)))

        def go_home(_: Any) -> None:
            for handle, setting in zip(handles, settings, strict=True):
                handle.value = setting.home

        for handle in handles:
            handle.on_update(lambda _: self._update(values, instant))
        home.on_click(go_home)
        self._update(values, instant)

    def _add_time_line(self, replay: Replay) -> None:
        first, last = float(replay.times[0]), float(replay.times[-1])
        with self._gui.add_folder("Time"):
            play = self._gui.add_button("Play")
            now = self._gui.add_slider("time [s]", first, _whole(last - first, TICK) + first, TICK, first)
            speed = self._gui.add_dropdown("speed", SPEEDS, initial_value="1x")
        playing = threading.Event()

        def turn(on: bool) -> None:
            (playing.set if on else playing.clear)()
            play.label = "Pause" if on else "Play"

        def moved(event: viser.GuiEvent[Any]) -> None:
            if event.client_id is not None:
                turn(False)
            self._update(lambda: (float(now.value),), lambda at: replay.at(replay.index_at(at[0])))

        def keep_playing() -> None:
            last_look = time.monotonic()
            while not self._closed.wait(1 / RATE):
                passed, last_look = time.monotonic() - last_look, time.monotonic()
                if playing.is_set():
                    # viser's speeds are words, "0.5x".
                    onward = float(now.value) + passed * float(speed.value.rstrip("x"))
                    now.value = onward if onward <= last else first

        play.on_click(lambda _: turn(not playing.is_set()))
        now.on_update(moved)
        self._update(lambda: (first,), lambda at: replay.at(replay.index_at(at[0])))
        threading.Thread(target=keep_playing, daemon=True).start()

    def _update(self, values: Callable[[], tuple[float, ...]], instant: Callable[[tuple[float, ...]], Instant]) -> None:
        """Show the current values of the controls; return early if a previous event has already shown them."""
        with self._busy:
            wanted = values()
            if wanted == self._shown:
                return
            self._shown = wanted
            try:
                found = instant(wanted)
            except TowlineError as error:
                self._readout.content = words.refusal(str(error))
                return
            self._stage.show(found)
            self._readout.content = words.readout(found, self._subject.robot)


def _whole(length: float, step: float) -> float:
    """Return the number of whole steps that cover a length, at least one, so that the end is a round number."""
    return round(max(math.ceil(length / step - 1e-6), 1) * step, 6)
