"""Decide which requests a viewer's server answers: those of its own page, under its own name.

A browser sends requests to this machine for any page that it has open. Two headers, which no page can forge, separate
the viewer's page from the others:

- `Origin` names the page that opens a socket. It must be the address under which the server is reached.
- `Host` is that address. It must be a number, this machine's name or the host of the command, because a foreign name
  may be made to lead here (DNS rebinding), and a page of that name would then have the server's origin.
"""

from __future__ import annotations

import contextlib
import http
import ipaddress
import socket
import threading
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from .frames import add_script

if TYPE_CHECKING:
    from websockets.datastructures import Headers

LOOPBACK = ("127.0.0.1", "localhost", "::1")
_ONE_AT_A_TIME = threading.Lock()


def refusal(headers: Headers, listening: str) -> str | None:
    """Return why a request must be refused, or None if it may be answered.

    - `headers`: of the request, of `websockets`.
    - `listening`: the host that the server listens on, as the user gave it.
    """
    hosts = headers.get_all("Host")
    name = _host_name(hosts[0]) if len(hosts) == 1 else None
    if name is None or not _is_own(name, listening):
        return "Host must be the address of this server"
    opens_a_socket = bool(headers.get_all("Upgrade"))
    origins = headers.get_all("Origin")
    if (opens_a_socket or origins) and [origin.lower() for origin in origins] != [f"http://{hosts[0]}".lower()]:
        return "Origin must be the address of this server"
    return None


@contextlib.contextmanager
def guarded(listening: str, asked: Callable[[str], None] | None = None) -> Iterator[list[bool]]:
    """Make a viser server that starts in this block refuse the requests for which `refusal` has a reason.

    `asked` is called with what follows the question mark in the address of a page that is opened.

    viser passes no check of its own to `websockets.serve`, so that function is replaced while the server starts. The
    list that this yields stays empty if the server started by other means, and so answers everyone.
    """
    import websockets.asyncio.server as websockets_server

    original: Any = websockets_server.serve
    started: list[bool] = []

    class Guarded(original):
        """A server that checks each request before viser answers it."""

        def __init__(self, *args: Any, process_request: Callable[..., Any], **options: Any):
            started.append(True)
            super().__init__(*args, process_request=_checked(process_request, listening, asked), **options)

    with _ONE_AT_A_TIME:
        websockets_server.serve = Guarded  # pyrefly: ignore[bad-assignment]
        try:
            yield started
        finally:
            websockets_server.serve = original


def _checked(answer: Callable[..., Any], listening: str, asked: Callable[[str], None] | None) -> Callable[..., Any]:
    """Return viser's `process_request` with the check before it, and headers that keep its page out of others.

    The page gets the script of `frames` too.
    """

    def process_request(connection: Any, request: Any) -> Any:
        reason = refusal(request.headers, listening)
        if reason is not None:
            return connection.respond(http.HTTPStatus.FORBIDDEN, f"{reason}\n")
        parts = urlsplit(request.path)
        if asked is not None and parts.path == "/" and parts.query and not request.headers.get_all("Upgrade"):
            asked(parts.query)
        response = answer(connection, request)
        if response is not None:
            response.headers["Content-Security-Policy"] = "frame-ancestors 'self'"
            response.headers["X-Content-Type-Options"] = "nosniff"
            add_script(response)
        return response

    return process_request


def _host_name(host: str) -> str | None:
    """Return the name in a header such as "localhost:8080", or None if it has none."""
    try:
        parts = urlsplit(f"//{host}")
        port = parts.port  # raises for what is not a number
    except ValueError:
        return None
    plain = parts.netloc == host and "@" not in host and port != 0
    return parts.hostname if plain else None


def _is_own(name: str, listening: str) -> bool:
    if name in LOOPBACK or name == listening.lower():
        return True
    if listening in LOOPBACK:
        return False
    if name == socket.gethostname().lower():
        return True
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
