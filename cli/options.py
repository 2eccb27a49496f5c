"""Options that several commands share, and how their text is read."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError

if TYPE_CHECKING:
    import numpy as np


def robot_names(incomplete: str) -> list[str]:
    """What a shell completes a robot's name to: those of the library, and files that shells know by themselves."""
    from ..models import available

    return [name for name in available() if name.startswith(incomplete)]


RobotArgument = Annotated[
    str,
    typer.Argument(metavar="ROBOT", help="A robot of the library, or a robot file (YAML).", autocompletion=robot_names),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON on standard output and nothing else.")]


def print_json(value: dict[str, Any]) -> None:
    """Print as JSON; numbers that are not finite become null, which JSON has no name for."""
    import json
    import math

    def clean(item: Any) -> Any:
        if isinstance(item, dict):
            return {key: clean(inner) for key, inner in item.items()}
        if isinstance(item, list | tuple):
            return [clean(inner) for inner in item]
        return None if isinstance(item, float) and not math.isfinite(item) else item

    typer.echo(json.dumps(clean(value), indent=2))


def numbers(option: str, text: str, count: int, rows: int | None = None) -> np.ndarray:
    """Read "1 2 3" or "1,2,3" as an array of `count` numbers, or rows of it apart by ";".

    Raises
    ------
    InputError
        Naming the option, what it was given and what is accepted.
    """
    import numpy as np

    expected = f"{count} finite numbers" + (f" for each of {rows} carriers, apart by ';'" if rows else "")
    parts = text.split(";") if rows else [text]
    try:
        values = [[float(word) for word in part.replace(",", " ").split()] for part in parts]
    except ValueError:
        raise InputError(f"{option}: {text!r} is not a list of numbers; accepted: {expected}") from None
    fits = all(len(row) == count for row in values) and (rows is None or len(values) == rows)
    if not fits or not np.isfinite(np.array(values)).all():
        raise InputError(f"{option}: {text!r}; accepted: {expected}")
    return np.array(values) if rows else np.array(values[0])
