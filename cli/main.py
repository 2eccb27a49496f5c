"""`towline`: the commands, and the one place where errors become a line and an exit code.

A command's module is imported only when the command runs or shows its help, so that `towline --help` starts at once.

Exit codes: 0, the result is positive (feasible, tensions exist); 1, it is negative; 2, wrong input; 3, an error in
towline itself; 130, stopped by Ctrl-C; 143, by SIGTERM; 141, the reader of the output has closed it, as `| head -1`
does.
"""

import difflib
import os
import select
import sys
import warnings
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from ..base.errors import InputError, TowlineError
from ..base.version import __version__
from .options import PLAIN, Command
from .stopping import end, requested

COMMANDS = {
    "demo": "Plan, draw and simulate a circle of a flying cable robot.",
    "robots": "List the robots of the library, or diagnose one.",
    "new": "Write a commented robot file and a feasible task for it, to edit.",
    "tension": "Compute the cable tensions at one pose, by every method.",
    "pose": "Estimate the pose of the platform from its cable lengths.",
    "plan": "Plan a motion that keeps every tension inside its limits.",
    "time": "Compute the fastest motion along a path.",
    "simulate": "Simulate a plan in closed loop, with wind, noise and events.",
    "workspace": "Sample the poses at which a condition holds.",
    "log": "List what logs of a robot contain.",
    "design": "Find anchors, attachments and limits that meet requirements.",
    "calibrate": "Calibrate a robot from measured cable lengths.",
    "view": "Show robots, plans, simulations and workspaces in the browser.",
    "import": "Convert a robot of another program to a robot file.",
    "reproduce": "Recompute a paper's results, claim by claim.",
    "export": "Export a robot as a MuJoCo model, C code or an FMU.",
    "bench": "Compare towline with other solvers on this machine.",
}
MODULES = {"import": "import_"}  # where the module is not named like the command
TRACEBACK = "TOWLINE_TRACEBACK"  # environment variable: show the traceback of an error in towline itself
LONGEST = 1000  # characters of a message; the lists of robots and of keys are long
CLOSED = 141  # 128 and SIGPIPE, as of the tools that this signal ends
COMPLETION = "_TOWLINE_COMPLETE"  # environment variable: the shell completes a line, and Typer ends the process
UsageError = typer.BadParameter.__bases__[0]  # the base of all that Typer reports about a command line


class Commands(TyperGroup):
    """The group of all commands; each is imported when it is first used."""

    def list_commands(self, ctx: Any) -> list[str]:
        """List the names of the commands."""
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Import a command by its name.

        Raises `InputError` if no command has that name.
        """
        if cmd_name not in COMMANDS:
            if ctx.resilient_parsing:
                return None
            close = difflib.get_close_matches(cmd_name, COMMANDS, n=1)
            hint = f", did you mean {close[0]!r}" if close else ""
            raise InputError(f"{cmd_name!r} is not a command{hint}; the commands are {', '.join(COMMANDS)}")
        module = import_module(f".{MODULES.get(cmd_name, cmd_name)}", __package__)
        if hasattr(module, "app"):
            group = module.app
        else:
            group = typer.Typer(**PLAIN)
            group.command(cmd_name, cls=Command)(getattr(module, cmd_name))
        return typer.main.get_command(group)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands into the help, without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


app = typer.Typer(
    cls=Commands,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def _print_version(requested: bool) -> None:
    if requested:
        typer.echo(f"towline {__version__}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _options(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Plan motions of cable robots and distribute the tensions of their cables.

    The exit code is 0 if the result is positive (feasible, tensions exist), 1 if it is negative, 2 for wrong input, 3
    for an error in towline itself, 130 after Ctrl-C, 143 after SIGTERM, and 141 if the reader of the output closes it
    (| head -1).
    """
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def main() -> None:
    """Run the command line; an error is one line on standard error."""
    warnings.showwarning = _warn
    try:
        code = typer.main.get_command(app).main(prog_name="towline", standalone_mode=False)
        sys.stdout.flush()
    except BaseException as error:
        if requested() or isinstance(error, KeyboardInterrupt):
            end()  # whatever the interrupt has become meanwhile
        if isinstance(error, SystemExit) and COMPLETION in os.environ:
            raise
        code = _report(error)
    if requested():
        end()
    sys.exit(code)


def _warn(message: Warning | str, *_: object, **__: object) -> None:
    """Print a warning as one line, without the place in the code at which Python would show it."""
    typer.echo(f"towline: warning: {message}", err=True)


def _report(error: BaseException) -> int:
    """Print an error as one line; return the exit code."""
    if isinstance(error, SystemExit) and isinstance(error.__context__, BrokenPipeError):
        error = error.__context__  # of which Typer makes exit code 1, which here means no
    if isinstance(error, BrokenPipeError) and _reader_is_gone():
        _to_nobody(1)
        return CLOSED
    code = 2
    if isinstance(error, UsageError):
        message = error.format_message().rstrip(".")
        hint = f"; see {error.ctx.command_path} --help" if error.ctx is not None else ""
        message = f"{message[:1].lower()}{message[1:]}{hint}"
    elif isinstance(error, TowlineError | OSError | MemoryError):
        message = str(error) or "out of memory"
        if isinstance(error, OSError):
            _to_nobody(1)  # a full disk, where standard output is a file
    elif os.environ.get(TRACEBACK):
        raise error
    else:
        code = 3
        message = f"an error in towline itself: {type(error).__name__}: {error} ({TRACEBACK}=1 shows where)"
    line = " ".join(message.split())
    if len(line) > LONGEST or not line.isprintable():  # Typer repeats arguments as they were given
        from ..base.inputs import printable

        line = printable(line, LONGEST)
    try:
        typer.echo(f"towline: {line}", err=True)
    except OSError:  # standard error is full or closed: the exit code is all that can be reported
        _to_nobody(2)
    return code


def _reader_is_gone() -> bool:
    """Return whether nobody reads standard output any more; other pipes of this process may break too."""
    if not hasattr(select, "poll"):
        return True
    watched = select.poll()
    watched.register(1, 0)
    return any(event & (select.POLLERR | select.POLLHUP) for _, event in watched.poll(0))


def _to_nobody(stream: int) -> None:
    """Send what is still to be written to a standard stream nowhere; else Python fails once more, with code 120."""
    handle = os.open(os.devnull, os.O_WRONLY)
    os.dup2(handle, stream)
    os.close(handle)


if __name__ == "__main__":
    main()
