"""`towline new`: a commented robot file and a feasible task for it, to edit."""

from pathlib import Path
from string import Template
from typing import Annotated

import typer

from ..base.inputs import InputError, one_of, shown
from .options import JsonOption, parameters, print_json, print_written

TEMPLATES = Path(__file__).parent / "templates"
KINDS = {
    "frame": "8 cables on a fixed frame, suspended, 6 degrees of freedom",
    "planar": "4 cables in front of a wall, 3 degrees of freedom",
    "drones": "three quadrotors with a load",
    "towing": "three mobile robots with a load",
}


@parameters("""
    NAME: Name of the robot and of its file, without .yaml.
""")
def new(
    name: str,
    kind: Annotated[
        str, typer.Option(metavar="KIND", help="; ".join(f"{kind}: {meaning}" for kind, meaning in KINDS.items()) + ".")
    ] = "frame",
    as_json: JsonOption = False,
) -> None:
    """Write a commented robot file and a feasible task for it, to edit.

    The files are NAME.yaml and NAME-task.yaml in this folder. Existing files are never overwritten.
    """
    from ..base.writing import whole_file

    one_of("--kind", kind, KINDS)
    _check_name(name)
    files = {
        Path(f"{name}.yaml"): TEMPLATES / f"{kind}.yaml",
        Path(f"{name}-task.yaml"): TEMPLATES / f"{kind}-task.yaml",
    }
    for file in files:
        if file.exists() or file.is_symlink():
            raise InputError(f"{file} must be a new file, got one that exists")
    for file, template in files.items():
        with whole_file(file) as temporary:
            temporary.write_text(Template(template.read_text(encoding="utf-8")).substitute(name=name), encoding="utf-8")
    robot, task = files
    commands = [f"towline robots {robot}", f"towline plan {robot} {task}"]
    if as_json:
        print_json({"kind": kind, "robot": robot, "task": task, "next": commands})
        return
    print_written(files)
    typer.echo("\n".join(["  Edit them, and run", *(f"    {command}" for command in commands)]))


def _check_name(name: str) -> None:
    """Check that a robot may have this name; raise InputError if not."""
    from pydantic import TypeAdapter, ValidationError

    from ..models.part import Name

    try:
        TypeAdapter(Name).validate_python(name)
    except ValidationError:
        name_is = "at most 64 letters, digits and any of _.-, of which the first is a letter or digit"
        raise InputError(f"NAME must be {name_is}, got {shown(name)}") from None
    if name.endswith((".yaml", ".yml")):
        raise InputError(f"NAME must be without an ending, got {shown(name)}")
