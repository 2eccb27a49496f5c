"""`towline`: the commands, and the one place where errors become a line and an exit code.

Exit codes: 0, what was asked holds; 1, it does not (infeasible, not found); 2, wrong input.
"""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from .. import __version__
from ..errors import TowlineError
from . import bench, demo, export, import_, plan, reproduce, robots, tension, time, view, workspace
from .stopping import end, requested

app = typer.Typer(
    help="Optimal control and tension distribution of cable robots.",
    no_args_is_help=True,
    rich_markup_mode="markdown",  # Rich's own markup takes units, [m], for its tags
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("demo")(demo.demo)
app.command("robots")(robots.robots)
app.command("tension")(tension.tension)
app.command("plan")(plan.plan)
app.command("time")(time.time)
app.command("workspace")(workspace.workspace)
app.command("view")(view.view)
app.add_typer(import_.app, name="import")
app.command("reproduce")(reproduce.reproduce)
app.command("export")(export.export)
app.add_typer(bench.app, name="bench")


def _print_version(asked: bool) -> None:
    if asked:
        typer.echo(f"towline {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Optimal control and tension distribution of cable robots."""


def main() -> None:
    """Run the command line; towline's own errors are one line on standard error and exit code 2."""
    try:
        app()
        sys.stdout.flush()
    except BaseException as error:
        if requested() or isinstance(error, KeyboardInterrupt):
            end()  # whatever the interrupt has become meanwhile
        if not isinstance(error, (TowlineError, OSError, MemoryError)):
            raise
        typer.echo(f"towline: {str(error) or 'out of memory'}", err=True)
        sys.exit(2)


if __name__ == "__main__":
    main()
