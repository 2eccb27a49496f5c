"""`Live`: what a server shows, which a list of robots and links replace."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING
from urllib.parse import parse_qs

import numpy as np

from ..models import available
from .panel import Panel
from .stage import Stage
from .subject import Subject, read

if TYPE_CHECKING:
    import viser

MOST_NUMBERS = 600  # of a link


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
