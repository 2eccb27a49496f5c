"""`towline import`: robots of other programs as towline robot files."""

from pathlib import Path

import typer

from ..base.inputs import check_ending
from .options import PLAIN, Command, JsonOption, parameters, print_json, print_written
from .outputs import check_outputs

app = typer.Typer(**PLAIN)


@app.callback()
def _import() -> None:
    """Convert a robot of another program to a robot file."""


@app.command("caspr", cls=Command)
@parameters("""
    DIR: Folder with *_bodies.xml and *_cables.xml.
    --cable-set ID: The set of cables; default: CASPR's own default.
    --out FILE: Robot file to write; default: standard output.
""")
def caspr(folder: Path, cable_set: str | None = None, out: Path | None = None, as_json: JsonOption = False) -> None:
    """Convert a CASPR robot to a robot file, and list what is lost."""
    from ..base.writing import whole_file
    from ..models.caspr import read_caspr
    from ..models.parsing import to_yaml

    if out is not None:
        check_ending("--out", out, ".yaml", ".yml")
    result = read_caspr(folder, cable_set)
    check_outputs({"--out": out})
    text = to_yaml(result.robot)
    if out is not None:
        with whole_file(out) as temporary:
            temporary.write_text(text, encoding="utf-8")
    if as_json:
        fields = {name: getattr(result, name) for name in ("cable_set", "cable_sets", "notes")}
        converted = result.robot.model_dump(mode="json", exclude_none=True)
        print_json({"name": result.robot.name, **fields, "file": out, "robot": converted})
        return
    if out is None:
        typer.echo(text, nl=False)
    else:
        print_written([out])
    # Standard output may be the robot file itself: notes go to standard error.
    for note in result.notes:
        typer.echo(f"note: {note}", err=True)
    others = [name for name in result.cable_sets if name != result.cable_set]
    if others:
        typer.echo(f"note: other cable sets: {', '.join(others)}", err=True)
