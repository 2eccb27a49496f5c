"""`towline view`: a robot, a plan or a workspace in the browser, or as a page that needs no server."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import JsonOption, print_json, robot_names
from .stopping import unlisten

LOOPBACK = ("127.0.0.1", "localhost", "::1")


def view(
    target: Annotated[
        str,
        typer.Argument(
            metavar="TARGET",
            help="A robot (name or YAML file), or a plan or workspace file (NetCDF).",
            autocompletion=robot_names,
        ),
    ],
    html: Annotated[
        Path | None, typer.Option("--html", help="HTML file to write instead: it plays anywhere, without a server.")
    ] = None,
    robot: Annotated[
        str | None, typer.Option("--robot", help="Of a workspace whose robot is not of the library: its file.")
    ] = None,
    host: Annotated[str, typer.Option(help="Who can look: 127.0.0.1 this machine only.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Where; if it is taken, one that follows; 0: any.")] = 8080,
    as_json: JsonOption = False,
) -> None:
    """Look at a robot and move it, play a plan, or turn a workspace, in the browser (extra viewer)."""
    import threading

    from ..viewer import read, save_page, serve
    from ..writing import check_writable

    if html is not None:
        check_writable(html)
    subject = read(target, robot)
    told = {"kind": subject.kind, "robot": subject.robot.name}
    if html is not None:
        written = save_page(subject, html)
        if as_json:
            print_json({**told, "file": str(written)})
        else:
            typer.echo(str(written))
        return
    with serve(subject, host, port) as url:
        if as_json:
            print_json({**told, "url": url})
        else:
            typer.echo(f"{subject.title}\n{url}   (Ctrl-C ends it)")
        if host not in LOOPBACK:
            typer.echo("towline: whoever reaches this address can look and move the sliders", err=True)
        unlisten()
        try:
            threading.Event().wait()
        except KeyboardInterrupt:
            typer.echo("", err=True)
