"""Serve a subject live, or record it as one HTML page; the only module that imports viser."""

from __future__ import annotations

import contextlib
import io
import os
import socket
from collections.abc import Callable, Iterator
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.inputs import InputError, file_path, required, shown, whole_number
from ..base.quiet import quiet
from ..base.writing import whole_file
from ..figures.perspective import ALONG
from .access import guarded
from .frames import Frames, with_script
from .page import aside, camera, live_page
from .panel import Live
from .replay import Replay
from .stage import Stage
from .subject import Subject

if TYPE_CHECKING:
    import viser

LOOPBACK = "127.0.0.1"
PORT = 8080
FRAME_RATE = 25.0  # [1/s] of a page


@contextlib.contextmanager
def serve(subject: Subject, host: str = LOOPBACK, port: int = PORT) -> Iterator[str]:
    """Serve a subject until the block ends; yield the address to open in a browser.

    Args:
        subject: From `read`.
        host: The address to listen on: 127.0.0.1 for this machine only. There is no password: on any other address,
            anyone who can reach it can watch. Pages of other web sites never can.
        port: The port; if it is in use, one of the next. 0 selects any free port.

    Raises `InputError` if `subject` is not a `Subject`, viser is not installed, or the host or port is invalid.
    """
    required("subject", subject, Subject)
    _check_address(host, port)
    with _viewing(subject, host, port) as (address, _):
        yield address


@contextlib.contextmanager
def _viewing(subject: Subject, host: str, port: int) -> Iterator[tuple[str, Live]]:
    """Serve a subject until the block ends; yield the address, and the view, which can show another subject."""
    # Quiet about connections that break off and messages that are none.
    links: list[Live] = []  # the view, once it is there

    def follow(query: str) -> None:
        for live in links:
            live.follow(query)

    with (
        quiet("websockets.server", "asyncio"),
        _started(host, port, follow) as server,
        contextlib.closing(Live(server, subject)) as live,
    ):
        links.append(live)
        # An address of IPv6 has colons of its own.
        yield f"http://{f'[{host}]' if ':' in host else host}:{server.get_port()}", live


def save_page(subject: Subject, file: str | os.PathLike[str]) -> Path:
    """Write a subject as one HTML file that loads nothing and needs no server; a failure leaves no partial file.

    A plan or a simulation is played. A robot, with the points of its workspace if there are any, opens at home, or at
    the feasible pose nearest to it, and its platform and carriers can be dragged: the page computes tensions, margin
    and certificate.

    Args:
        subject: From `read`.
        file: The file to write.

    Raises `InputError` if `subject` is not a `Subject`, viser is not installed and the subject is a plan or a
    simulation, the robot is too large for the core, or the file cannot be written.
    """
    required("subject", subject, Subject)
    path = file_path("file", file)
    document = live_page(subject) if subject.replay is None else _film(subject, subject.replay)
    with whole_file(path) as temporary:
        temporary.write_text(document, encoding="utf-8")
    return path


def _film(subject: Subject, replay: Replay) -> str:
    # viser records what a server is told, so there is one, on a port that nobody is told.
    with _started(LOOPBACK, 0) as server:
        stage = Stage(server, subject, captioned=True)
        frames = [replay.at(int(index)) for index in replay.frames(FRAME_RATE)]
        marks = Frames(server)
        with marks.instant():
            stage.show(frames[0], subject.other_at(frames[0]))
        recording = server.get_scene_serializer()
        for before, instant in pairwise(frames):
            recording.insert_sleep((instant.time or 0.0) - (before.time or 0.0))
            with marks.instant():
                stage.show(instant, subject.other_at(instant))
        document = with_script(recording.as_html())
    title = escape(subject.title)
    head, _, rest = document.partition("<head>")
    body, end, tail = rest.rpartition("</body>")
    own = f"<title>{title}</title>{camera(stage.extent.centre, ALONG, stage.extent.nearest)}"
    return f"{head}<head>{own}{body}{aside(subject, frames, stage.extent.cell)}{end}{tail}"


def _check_address(host: str, port: int) -> None:
    """Raise InputError if no server can listen on the address, because viser would wait for ever."""
    whole_number("--port", port, 0, 65535)
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind, protocol) as trial:
            trial.bind(address)
    except (OSError, TypeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(
            f"--host must be {LOOPBACK} or another address of this machine, got {shown(host)} ({reason})"
        ) from None


@contextlib.contextmanager
def _started(host: str, port: int, asked: Callable[[str], None] | None = None) -> Iterator[viser.ViserServer]:
    """Run a server until the block ends. Suppress what viser prints then, because --json prints JSON only.

    `asked` is called with what follows the question mark in the address of a page that is opened.
    """
    try:
        import viser
    except ImportError:
        raise InputError("viser is not installed; install the extra viewer: pip install 'towline[viewer]'") from None

    class Unshared(viser.ViserServer):
        """A server that refuses to open a tunnel through a third party's server."""

        def request_share_url(self, verbose: bool = True) -> str | None:
            return None

    with contextlib.redirect_stdout(io.StringIO()), guarded(host, asked) as guards:
        server = Unshared(host=host, port=port, verbose=False)
    try:
        if not guards:
            accepted = "viser must start its server with websockets.serve"
            raise InputError(f"{accepted}; install the version of constraints.txt")
        yield server
    finally:
        with contextlib.redirect_stdout(io.StringIO()):
            server.stop()
