"""`towline import`: robots of other programs as towline robot files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import JsonOption, print_json

app = typer.Typer(help="Turn a robot of another program into a robot file.", no_args_is_help=True)


@app.command("caspr")
def caspr(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder with *_bodies.xml and *_cables.xml.")],
    cable_set: Annotated[str | None, typer.Option("--cable-set", help="Id of a set of cables; none: default.")] = None,
    out: Annotated[Path | None, typer.Option("--out", help="Robot file to write; none: standard output.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Turn a CASPR robot into a robot file, and say what it could not express."""
    from ..models.caspr import read_caspr
    from ..models.parsing import to_yaml
    from ..writing import whole_file

    found = read_caspr(folder, cable_set)
    text = to_yaml(found.robot)
    if out is not None:
        with whole_file(out) as temporary:
            temporary.write_text(text, encoding="utf-8")
    if as_json:
        print_json(
            {
                "name": found.robot.name,
                "cable_set": found.cable_set,
                "cable_sets": found.cable_sets,
                "notes": found.notes,
                "file": None if out is None else str(out),
                "robot": found.robot.model_dump(mode="json", exclude_none=True),
            }
        )
        return
    if out is None:
        typer.echo(text, nl=False)
    # Standard output may be a robot file on its way: what there is to say about it goes beside.
    for note in found.notes:
        typer.echo(f"note: {note}", err=True)
    others = [name for name in found.cable_sets if name != found.cable_set]
    if others:
        typer.echo(f"note: other cable sets: {', '.join(others)}", err=True)
    if out is not None:
        typer.echo(f"  {out}")
