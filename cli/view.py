"""`towline view`: show a robot, plan, simulation or workspace in the browser, or write a page that needs no server."""

from pathlib import Path
from typing import Annotated

import typer

from ..base.inputs import InputError, check_ending
from .options import JsonOption, left_out, parameters, print_result, robot_names
from .outputs import check_outputs
from .stopping import end_at_once, requested, unlisten

HOST, PORT = "127.0.0.1", 8080
LOOPBACK = ("127.0.0.1", "localhost", "::1")


@parameters("""
    OTHER: A second plan or simulation file, for comparison.
    --html: HTML file to write instead of serving a page. The file works without a server, and for a robot or a
        workspace also without the extra viewer.
    --robot: Robot file of a workspace whose robot is not in the library.
    --host: Address to listen on; 127.0.0.1 accepts only this machine.
    --port: Port to listen on; if it is taken, the next free port is used; 0: any free port.
""")
def view(
    target: Annotated[
        str | None,
        typer.Argument(
            metavar="TARGET",
            help="A robot (name or YAML file), or a plan, simulation or workspace file (NetCDF); default: the "
            "first robot of the library. The others can be selected in the browser.",
            autocompletion=robot_names,
        ),
    ] = None,
    other: str | None = None,
    html: Path | None = None,
    robot: str | None = None,
    host: str = HOST,
    port: int = PORT,
    as_json: JsonOption = False,
) -> None:
    """Show a robot, a plan, a simulation or a workspace in the browser, or compare two motions (extra viewer)."""
    import threading

    from ..models import available
    from ..viewer import read, save_page, serve

    if html is not None:
        when = "with --html: a page needs no server"
        left_out({"--host": host != HOST, "--port": port != PORT}, when, got=False)
        check_ending("--html", html, ".html", ".htm")
    if target is None:
        if html is not None or robot is not None:
            raise InputError(f"TARGET must be given with {'--robot' if html is None else '--html'}, got none")
        target = available()[0]
    subject = read(target, robot, other)
    check_outputs({"--html": html})
    summary = {"kind": subject.kind, "robot": subject.robot.name} | ({} if other is None else {"other": other})
    if html is not None:
        written = save_page(subject, html)
        print_result(as_json, {**summary, "file": written}, None, [written])
        return
    with serve(subject, host, port) as url:
        unlisten()
        try:
            print_result(as_json, {**summary, "url": url}, lambda: f"{subject.title}\n{url}   (Ctrl-C ends it)")
            if host not in LOOPBACK:
                typer.echo("towline: anyone who can connect to this address can watch and move the sliders", err=True)
            threading.Event().wait()
        except KeyboardInterrupt:
            if requested():  # SIGTERM
                raise
            typer.echo("", err=True)
            end_at_once(0)  # the server ends its threads one by one, and nothing is left to be written
