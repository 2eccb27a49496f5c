"""Show controls and readouts beside the scene: sliders for a robot, a time line for a plan."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, cast

from ..errors import TowlineError
from ..models import Dynamics
from . import words
from .geometry import Geometry
from .instant import Instant, at_rest
from .sliders import poses, sliders
from .timeline import TimeLine

if TYPE_CHECKING:
    import viser

    from .stage import Stage
    from .subject import Subject


class Panel:
    """The controls of a subject on a viser server, until `close`."""

    def __init__(self, server: viser.ViserServer, subject: Subject, geometry: Geometry, stage: Stage):
        self._subject, self._stage, self._geometry = subject, stage, geometry
        self._server, self._gui = server, cast("Any", server.gui)
        self._busy = threading.Lock()
        self._shown: tuple[float, ...] | None = None
        self._time_line: TimeLine | None = None
        self._gui.configure_theme(control_width="medium", show_logo=False, show_share_button=False)
        self._gui.main_panel.dock_right()
        self._gui.set_panel_label(subject.title)
        self._readout = self._gui.add_html("")
        if subject.replay is None:
            self._add_sliders()
        else:
            self._time_line = TimeLine(server, subject.replay, self._show)
        with self._gui.add_folder("Picture"):
            numbers = self._gui.add_checkbox("numbers at the cables", True)
            numbers.on_update(lambda _: stage.show_numbers(numbers.value))
            if subject.cloud is not None:
                points = self._gui.add_checkbox("points", True)
                points.on_update(lambda _: stage.show_cloud(points.value))
            self._gui.add_html(words.legend(subject, stage.cell))

    def close(self) -> None:
        """Stop playing."""
        if self._time_line is not None:
            self._time_line.close()

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
            self._show(found)

    def _show(self, instant: Instant) -> None:
        """Draw an instant in scene and panel, in one update, so that both agree in every frame."""
        with self._server.atomic():
            self._stage.show(instant)
            self._readout.content = words.readout(instant, self._subject.robot)
