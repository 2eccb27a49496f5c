"""Options that several commands share, how their text is read, and how results are printed."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib import import_module
from inspect import signature
from pathlib import Path
from textwrap import dedent
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, get_origin, get_type_hints

import typer
from typer.core import TyperCommand

from ..base.errors import InputError
from ..base.text import counted, in_columns

if TYPE_CHECKING:
    import numpy as np

# Rich takes half a second to load, squeezes help into columns, and takes units, [m], for its tags.
PLAIN: dict[str, Any] = {"rich_markup_mode": None, "add_completion": False}


F = TypeVar("F", bound=Callable[..., Any])


def parameters(text: str) -> Callable[[F], F]:
    """Declare the parameters of a command that are not `Annotated`, from an entry for each, in their order.

    An entry is `--name METAVAR: help`, or `METAVAR: help` for an argument; lines that continue it are indented more.
    """
    entries = [" ".join(entry.split()) for entry in re.split(r"\n(?! )", dedent(text).strip())]

    def declare(function: F) -> F:
        hints = get_type_hints(function, include_extras=True)
        plain = [name for name in signature(function).parameters if get_origin(hints[name]) is not Annotated]
        for name, entry in zip(plain, entries, strict=True):
            head, _, about = entry.partition(": ")
            names = [word.rstrip(",") for word in head.split() if word.startswith("--")]
            metavar = " ".join(word for word in head.split() if not word.startswith("--")) or None
            declared = typer.Option if names else typer.Argument
            info = declared(*names, metavar=metavar, help=about)
            function.__annotations__[name] = Annotated[hints[name], info]
        return function

    return declare


class Command(TyperCommand):
    """A command whose usage line names arguments without braces, and which begins without files that others read."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command; `check_outputs` looks at the files that it reads."""
        reading = sys.modules.get("towline.base.reading")  # nothing has been read where it was never loaded
        if reading is not None:
            reading.files_read.clear()
        return super().invoke(ctx)

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters; Typer would show the type of an argument that may be repeated as `<list[Path]>`."""
        found: list[Any] = super().get_params(ctx)
        for one in found:
            if one.nargs == -1:
                one.display_type = lambda _: "<path>"
        return found

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Return the parts of the usage line."""
        return [piece.replace("{", "").replace("}", "") for piece in super().collect_usage_pieces(ctx)]


def robot_names(incomplete: str) -> list[str]:
    """Return the robots of the library whose names complete what is typed; the shell completes files itself."""
    from ..models.library import available

    return [name for name in available() if name.startswith(incomplete)]


RobotArgument = Annotated[
    str,
    typer.Argument(metavar="ROBOT", help="A robot of the library, or a robot file (YAML).", autocompletion=robot_names),
]
CarrierPoseOption = Annotated[
    str | None,
    typer.Option(
        metavar="'six numbers; ...'",
        help="Pose of each carrier in {G} [m, rad], separated by ';'; default: their homes.",
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON on standard output and nothing else.")]


def _known_format(form: str) -> str:
    from ..base.inputs import one_of
    from ..figures.style import FORMATS

    return one_of("--format", form, FORMATS)


FormatOption = Annotated[
    str,
    typer.Option(
        "--format",
        metavar="FORMAT",
        callback=_known_format,
        help="Format of figures, which are as wide as a journal's column (88 mm): png, pdf or svg.",
    ),
]


ReportOption = Annotated[
    Path | None, typer.Option("--report", help="HTML file to write: the report with its figures, in one file.")
]
SPEED, FPS = 1.0, 20.0
SpeedOption = Annotated[float, typer.Option(help="With --animate: speed of the film; 1 is real time.")]
FpsOption = Annotated[float, typer.Option(help="With --animate: frames per second of the film.")]


def usual_file(*names: str) -> Path:
    """Return the file that a command writes by default, named by `names`, without the spaces that a task's may have."""
    return Path("-".join(names).replace(" ", "-"))


def check_animation(animate: Path | None, speed: float, fps: float) -> None:
    """Raise InputError if the film cannot be written, or if its options are given but no film is."""
    if animate is not None:
        from ..figures.animation import check_film

        check_film(animate, speed, fps)
        return
    options = (("--speed", speed, SPEED), ("--fps", fps, FPS))
    left_out({name: f"{value:g}" for name, value, default in options if value != default}, "without --animate")


def left_out(options: Mapping[str, object], when: str, got: bool = True) -> None:
    """Raise InputError if one of the options is given, by its value, that must be left out `when`."""
    from ..base.inputs import printable

    for name, value in options.items():
        if value not in (None, False):
            raise InputError(f"{name} must be left out {when}{f', got {printable(str(value))}' * got}")


def schema_option(files: str, package: str, model: str) -> Any:
    """Return --schema, which prints the JSON Schema of `files`, of a model of one of towline's packages."""

    def show(wanted: bool) -> None:
        if wanted:
            print_json(getattr(import_module(f"..{package}", __package__), model).model_json_schema())
            raise typer.Exit

    return typer.Option("--schema", callback=show, is_eager=True, help=f"Print the JSON Schema of {files}.")


def print_json(value: dict[str, Any]) -> None:
    """Print as JSON; numbers that are not finite become null, since JSON cannot express them, and paths become text."""
    import json
    import math
    import os

    def clean(item: Any) -> Any:
        if isinstance(item, dict):
            return {key: clean(inner) for key, inner in item.items()}
        if isinstance(item, list | tuple):
            return [clean(inner) for inner in item]
        return None if isinstance(item, float) and not math.isfinite(item) else item

    typer.echo(json.dumps(clean(value), indent=2, default=os.fspath))


def print_written(files: Iterable[object]) -> None:
    """Print the files that a command has written."""
    typer.echo("\n    ".join(["  Written", *map(str, files)]))


def print_result(
    as_json: bool, data: dict[str, Any], report: Callable[[], str] | None, files: Sequence[object] = ()
) -> None:
    """Print a result: as JSON, or its report, if it has one, and the files that a command has written."""
    if as_json:
        print_json(data)
        return
    if report is not None:
        typer.echo(report())
    if files:
        print_written(files)


def print_table(headings: Sequence[str], rows: Sequence[Sequence[str]], align: str) -> None:
    """Print a table; `align` has one letter for each column, l for left and r for right.

    The terminal wraps a wide table, because a number that is cut off would read as another number.
    """
    for line in in_columns([headings, *rows], [column for column, side in enumerate(align) if side == "r"]):
        typer.echo(line)


def numbers(option: str, text: str, count: int, rows: int | None = None) -> np.ndarray:
    """Read "1 2 3" or "1,2,3" as an array of `count` numbers, or as `rows` of them separated by ";".

    Raises `InputError` if the text is anything else.
    """
    import numpy as np

    from ..base.inputs import shown

    accepted = counted(count, "finite number") + (f" for each of {rows} carriers, separated by ';'" if rows else "")
    parts = text.split(";") if rows else [text]
    try:
        values = [[float(word) for word in part.replace(",", " ").split()] for part in parts]
    except ValueError:
        raise InputError(f"{option} must be {accepted}, got {shown(text)}") from None
    fits = all(len(row) == count for row in values) and (rows is None or len(values) == rows)
    if not fits or not np.isfinite(np.array(values)).all():
        raise InputError(f"{option} must be {accepted}, got {shown(text)}")
    return np.array(values) if rows else np.array(values[0])
