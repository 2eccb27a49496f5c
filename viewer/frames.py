"""Show all that belongs to one instant in one frame of a browser: scene, table, charts and clock.

viser applies what a server sends in three steps: it moves bodies when it draws, changes text as soon as it can, and
gives lines their new points after it has drawn. Where drawing takes long, each picture then has bodies, cables and
numbers of several instants. So the page gets a script, and each instant is sent between two marks.
"""

from __future__ import annotations

import contextlib
import gzip
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import viser
    from websockets.http11 import Response

BEGUN, ENDED = "/frames/begun", "/frames/ended"

_SCRIPT = Path(__file__).with_name("frames.js").read_text(encoding="utf-8")
ATOMIC = f"<script>{_SCRIPT}</script>".replace("BEGUN", BEGUN).replace("ENDED", ENDED)


class Frames:
    """The marks of instants on a viser server."""

    def __init__(self, server: viser.ViserServer):
        self._server, self._count = server, 0
        self._begun, self._ended = (server.scene.add_frame(name, show_axes=False) for name in (BEGUN, ENDED))

    @contextlib.contextmanager
    def instant(self) -> Iterator[None]:
        """Send what is changed in this block so that a browser shows all of it in one frame.

        Even an atomic block of viser can be cut in two: its server stops reading one when the next begins.
        """
        with self._server.atomic():
            self._count += 1
            self._begun.position = (self._count, 0, 0)
            try:
                yield
            finally:
                self._ended.position = (self._count, 0, 0)


def with_script(document: str) -> str:
    """Return a page of viser's client with the script."""
    head, found, rest = document.partition("<head>")
    return f"{head}{found}{ATOMIC}{rest}" if found else document


def add_script(response: Response) -> None:
    """Add the script to a response of viser's server if it is the page."""
    if not response.headers.get("Content-Type", "").startswith("text/html") or not response.body:
        return
    zipped = response.headers.get("Content-Encoding") == "gzip"
    response.body = _with_script(bytes(response.body), zipped)
    if "Content-Length" in response.headers:
        del response.headers["Content-Length"]
        response.headers["Content-Length"] = str(len(response.body))


@lru_cache(maxsize=2)
def _with_script(body: bytes, zipped: bool) -> bytes:
    """Return the body of a response with the script, zipped as before."""
    document = with_script((gzip.decompress(body) if zipped else body).decode()).encode()
    return gzip.compress(document) if zipped else document
