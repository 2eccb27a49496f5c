"""`towline log`: what logs contain, and what they can be used for."""

from pathlib import Path
from typing import Annotated

import typer

from .options import JsonOption, parameters, print_result

FieldsOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE.yaml",
        help="Names of the log's fields, such as 'lengths: /winches/position[*]'; default: usual names.",
    ),
]

FixOption = Annotated[
    bool,
    typer.Option(
        "--fix", help="Correct probable input errors of the log first (order of cables, units, conventions, frames)."
    ),
]


@parameters("""
    LOG: CSV, NetCDF or MCAP files, or bags of ROS 1 (.bag) or ROS 2 (folder).
    --robot ROBOT: Robot of the logs; the poses of its moving carriers are then listed too.
""")
def log(logs: list[Path], fields: FieldsOption = None, robot: str | None = None, as_json: JsonOption = False) -> None:
    """List what logs contain (topics, rates, gaps, fields, units), which fields towline uses, and what for.

    The exit code is 1 if the logs cannot be used because they contain no cable lengths, or because the lengths of some
    cables are missing in more than a fifth of the lines. For a robot with cables of fixed length (--robot), positions
    of the platform or directions of the cables suffice.
    """
    from ..estimation.logs import read_map, recordings
    from ..estimation.logs.listing import listing, report
    from ..models import load

    given = None if fields is None else read_map(fields)
    data = listing(recordings(logs), given, None if robot is None else load(robot))
    print_result(as_json, data, lambda: report(data).text())
    if data["uses"]["pose from lengths"]:
        raise typer.Exit(1)
