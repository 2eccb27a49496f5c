"""Play a replay: a time line with play and pause, steps, speed and loop, and charts with the same cursor."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any

import numpy as np

from ..figures import style
from .charts import Charts, curves
from .frames import Frames
from .replay import Replay
from .snapshot import Show

if TYPE_CHECKING:
    import viser

RATE = 25.0  # [1/s] of playing
TICK = 0.01  # [s] of the time line
ORANGE = style.colour(1)
NARROWEST = 0.004  # of the bar: a span that is seen
PANEL = 20.5  # [rem], the width of viser's panel, with a margin
STYLE = Template(Path(__file__).with_name("timeline.css").read_text(encoding="utf-8"))
SPEEDS = ("0.25x", "0.5x", "1x", "2x", "4x")


class TimeLine:
    """The controls of time on a viser server, until `close`.

    - `server`: its panel gets the controls, its command palette the keys.
    - `frames`: the marks of instants on it.
    - `replay`: the motion to play.
    - `show`: draws an instant.
    - `other`: charted with it, if given.
    """

    def __init__(
        self, server: viser.ViserServer, frames: Frames, replay: Replay, show: Show, other: Replay | None = None
    ):
        self._frames, self._replay, self._show = frames, replay, show
        self._playing, self._closed, self._busy = threading.Event(), threading.Event(), threading.Lock()
        self._index = -1
        gui: Any = server.gui
        first, last = float(replay.times[0]), float(replay.times[-1])
        with gui.add_folder("Time"):
            ticks = max(math.ceil((last - first) / TICK - 1e-6), 1)  # whole ones, so that the end is a round number
            end = first + round(ticks * TICK, 6)
            about = "Dots: the worst instant, the starts of phases, and events. Orange: infeasible."
            shown = curves(replay)
            gui.add_html(_style(shown.infeasible_spans))
            self._now = gui.add_slider("time [s]", first, end, TICK, first, marks=replay.marks, hint=about)
            self._play = gui.add_button("Play", hint="K")
            groups = (("step", ("back", "next")), ("go to", ("first", "worst", "last")))
            jumps = [gui.add_button_group(*group) for group in groups]
            self._loop = gui.add_checkbox("loop", True)
            self._speed = gui.add_dropdown("speed", SPEEDS, initial_value="1x")
            limits = np.concatenate([replay.robot.t_min, replay.robot.t_max])
            self._charts = Charts(gui, shown, limits, None if other is None else curves(other))
        self._now.on_update(self._dragged)
        self._play.on_click(lambda _: self._turn(not self._playing.is_set()))
        steps = {
            "first": ("home", lambda: 0),
            "back": ("J", lambda: self._index - 1),
            "worst": ("W", lambda: replay.worst),
            "next": ("L", lambda: self._index + 1),
            "last": ("end", lambda: len(replay.times) - 1),
        }
        for group in jumps:
            group.on_click(lambda _, group=group: self._jump(steps[group.value][1]))
        for word, (key, step) in steps.items():
            gui.add_command(f"Time: {word}", hotkey=key).on_trigger(lambda _, step=step: self._jump(step))
        gui.add_command("Time: play or pause", hotkey="K").on_trigger(lambda _: self._turn(not self._playing.is_set()))
        self._go(0)
        threading.Thread(target=self._keep_playing, daemon=True).start()

    def close(self) -> None:
        """Stop playing."""
        self._closed.set()

    def _turn(self, on: bool) -> None:
        (self._playing.set if on else self._playing.clear)()
        self._play.label = "Pause" if on else "Play"

    def _jump(self, index: Callable[[], int]) -> None:
        self._turn(False)
        self._go(index())

    def _dragged(self, event: viser.GuiEvent[Any]) -> None:
        if event.client_id is not None:  # otherwise it was moved by `_go`, which shows the instant itself
            self._turn(False)
            self._go(self._replay.index_at(float(self._now.value)), at=float(self._now.value))

    def _go(self, index: int, at: float | None = None, playing: bool = False) -> None:
        """Show an instant in scene, panel, charts and on the time line in one update.

        - `at`: position of the time line [s], between two instants; default: at the instant.
        - `playing`: do nothing if it was paused meanwhile: while this waited, a user may have gone elsewhere.
        """
        with self._busy:
            if playing and not self._playing.is_set():
                return
            index = min(max(index, 0), len(self._replay.times) - 1)
            instant = self._replay.at(index)
            with self._frames.instant():
                self._now.value = float(self._replay.times[index]) if at is None else at
                if index != self._index:
                    self._index = index
                    self._charts.move(float(self._replay.times[index]))
                    self._show(instant)

    def _keep_playing(self) -> None:
        first, last = float(self._replay.times[0]), float(self._replay.times[-1])
        last_look = time.monotonic()
        while not self._closed.wait(1 / RATE):
            passed, last_look = time.monotonic() - last_look, time.monotonic()
            if not self._playing.is_set():
                continue
            # viser's speeds are words, "0.5x".
            onward = float(self._now.value) + passed * float(self._speed.value.rstrip("x"))
            if onward > last:
                onward = first if self._loop.value else last
            self._go(self._replay.index_at(onward), at=onward, playing=True)
            if onward == last and not self._loop.value:
                self._turn(False)


def _style(spans: list[tuple[float, float]]) -> str:
    """Return HTML that moves the slider and the button after it to a bar below the scene, where there is room for one.

    Infeasible spans, shares of the duration, are orange in the slider.
    """
    stops = ["transparent 0%"]
    for first, last in spans:
        low, high = 100 * min(first, 1 - NARROWEST), 100 * max(last, first + NARROWEST)
        stops.append(f"transparent {low:.2f}%,{ORANGE} {low:.2f}%,{ORANGE} {high:.2f}%,transparent {high:.2f}%")
    style_of = STYLE.substitute(stops=",".join(stops), panel=PANEL)
    return f'<span class="towline-timeline"></span><style>{style_of}</style>'
