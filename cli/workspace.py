"""`towline workspace`: which poses are reachable."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError
from .options import JsonOption, RobotArgument, numbers, print_json

if TYPE_CHECKING:
    import xarray as xr

    from ..models import Robot
    from ..workspace import Condition
    from ..workspace.boundary_mesh import Mesh
    from ..workspace.run import Progress


def workspace(
    robot: RobotArgument,
    condition: Annotated[
        list[str] | None,
        typer.Option(help="A kind, or JSON with its keys; several: all hold. None: static-equilibrium."),
    ] = None,
    box: Annotated[
        str | None, typer.Option(help="Positions: 'x y z; x y z', lowest; highest [m]; none: about the robot.")
    ] = None,
    attitude: Annotated[
        str | None, typer.Option(help="'roll pitch yaw', or lowest; highest [rad]; none: that of home.")
    ] = None,
    carriers: Annotated[str, typer.Option(help="home, or reach: mobile carriers anywhere in their boxes.")] = "home",
    lengths: Annotated[
        str | None, typer.Option(help="'min max' of three cables [m], instead of positions, which follow from them.")
    ] = None,
    samples: Annotated[float, typer.Option(help="How many; 1e8 is a number too.")] = 60_000,
    method: Annotated[str, typer.Option(help="random, sobol, halton, grid or adaptive.")] = "random",
    seed: Annotated[int, typer.Option(help="Of the random streams.")] = 0,
    size: Annotated[float | None, typer.Option(help="Of adaptive: edge of the smallest cells [m].")] = None,
    workers: Annotated[int, typer.Option(help="Processes of this machine.")] = 1,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="A Dask scheduler, tcp://host:8786 (extra cluster).")
    ] = None,
    checkpoint: Annotated[Path | None, typer.Option("--checkpoint", help="New file to append the answers to.")] = None,
    resume: Annotated[
        Path | None, typer.Option("--resume", metavar="FILE", help="Checkpoint to go on with, or to begin.")
    ] = None,
    keep: Annotated[
        str, typer.Option(help="Samples in the file, a million at most: accepted, all, none.")
    ] = "accepted",
    out: Annotated[
        Path | None,
        typer.Option("--out", help="NetCDF file, or .zarr folder, to write; none: ROBOT-workspace.nc in this folder."),
    ] = None,
    figure: Annotated[Path | None, typer.Option("--figure", help="PNG file to draw what was reached in.")] = None,
    mesh: Annotated[
        Path | None,
        typer.Option("--mesh", help="STL file for the boundary at one attitude, carriers at home (extra mesh)."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Sample where a robot's platform can be, or find that it can be nowhere (exit code 1)."""
    from ..figures import style
    from ..figures.workspace import reached
    from ..models import load
    from ..workspace import sample, save
    from ..writing import check_writable

    loaded = load(robot)
    asked = _condition(condition)
    region = _region(box, attitude, carriers, lengths)
    target = out if out is not None else Path(f"{loaded.name}-workspace.nc")
    if checkpoint is not None and resume is not None:
        raise InputError(f"--checkpoint: {checkpoint} beside --resume {resume}; accepted: one of them")
    if mesh is not None and ((attitude is not None and ";" in attitude) or carriers != "home" or lengths is not None):
        raise InputError(f"--mesh: {mesh} of a region whose attitude or carriers vary; accepted: positions that vary")
    taken = {kept.resolve(): "the checkpoint" for kept in (checkpoint, resume) if kept is not None}
    if target.suffix == ".zarr" and target.exists():
        raise InputError(f"--out: {target} is there already; accepted: a new .zarr folder, or a NetCDF file")
    for what, file in (("--out", target), ("--figure", figure), ("--mesh", mesh)):
        place = None if file is None else check_writable(file)
        if place in taken:
            raise InputError(f"{what}: {file} is {taken[place]}; accepted: another file for what is found")
        if place is not None:
            taken[place] = f"{what} already"
    # Before the samples, so that what is wrong with it is told before hours of work.
    surface = None if mesh is None else _boundary(loaded, asked, region)
    with _progress(f"sampling {loaded.name}", quiet=as_json) as progress:
        found = sample(
            loaded,
            asked,
            region,
            _count(samples),
            method,
            seed,
            size=size,
            workers=workers,
            scheduler=scheduler,
            checkpoint=checkpoint or resume,
            resume=resume is not None,
            progress=progress,
            keep=keep,
        )
    written = [save(found, target)]
    if figure is not None:
        written.append(style.save(reached(found), figure))
    if mesh is not None and surface is not None:
        written.append(surface.save(mesh))
    summary = _summary(found)
    if as_json:
        print_json({**summary, "file": str(target), "figure": _name(figure), "mesh": _name(mesh)})
    else:
        _show(found, summary, size)
        typer.echo("  Written")
        for path in written:
            typer.echo(f"    {path}")
    if not summary["accepted"]:
        raise typer.Exit(1)


def _boundary(robot: Robot, condition: Condition, data: dict[str, Any]) -> Mesh:
    from ..workspace import Region, boundary
    from ..workspace.domain import Domain

    domain = Domain.of(robot, Region.model_validate(data))
    return boundary(robot, condition, *domain.box, attitude=domain.low[3:6])


def _name(file: Path | None) -> str | None:
    return None if file is None else str(file)


def _condition(texts: list[str] | None) -> Condition:
    import json

    from ..workspace import AllOf, StaticEquilibrium, condition_from

    conditions = []
    for text in texts or []:
        data: Any = {"kind": text}
        if text.lstrip().startswith("{"):
            try:
                data = json.loads(text)
            except json.JSONDecodeError as error:
                raise InputError(
                    f"--condition: {text!r} is not JSON ({error.msg}, character {error.pos + 1}); accepted: a kind, or "
                    'JSON as {"kind": ...}'
                ) from None
        conditions.append(condition_from(data))
    if not conditions:
        return StaticEquilibrium()
    return conditions[0] if len(conditions) == 1 else AllOf(conditions=tuple(conditions))


def _region(box: str | None, attitude: str | None, carriers: str, lengths: str | None) -> dict[str, Any]:
    region: dict[str, Any] = {"carriers": carriers}
    if box is not None:
        region["position"] = _ends("--box", box)
    if attitude is not None:
        region["attitude"] = _ends("--attitude", attitude) if ";" in attitude else tuple(_three("--attitude", attitude))
    if lengths is not None:
        least, most = numbers("--lengths", lengths, 2).tolist()
        region["lengths"] = {"min": least, "max": most}
    return region


def _ends(option: str, text: str) -> dict[str, tuple[float, ...]]:
    parts = text.split(";")
    if len(parts) != 2:
        raise InputError(f"{option}: {text!r}; accepted: the lowest and the highest, apart by ';'")
    return {"min": tuple(_three(option, parts[0])), "max": tuple(_three(option, parts[1]))}


def _three(option: str, text: str) -> list[float]:
    return numbers(option, text, 3).tolist()


def _count(samples: float) -> int:
    if not float(samples).is_integer() or samples > 1e15:
        raise InputError(f"--samples: is {samples:g}; accepted: a whole number from 1 on")
    return int(samples)


@contextmanager
def _progress(what: str, quiet: bool) -> Iterator[Progress]:
    """A bar with rate and remaining time on standard error, if a person is watching."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    to = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=20),
        TaskProgressColumn(),
        TextColumn("{task.fields[told]}", markup=False),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=to, transient=True, disable=quiet or not to.is_terminal) as shown:
        line = shown.add_task(what, told="", total=None)

        def tell(done: int, total: int, accepted: int) -> None:
            task = shown.tasks[line]
            rate = task.speed or task.finished_speed or 0.0
            told = f"{rate:,.0f}/s  accepted {accepted / max(done, 1):.2%}"
            shown.update(line, completed=done, total=total, told=told)

        yield tell


def _summary(found: xr.Dataset) -> dict[str, Any]:
    low, high = found["bounds"].values.tolist()
    return {
        "robot": found.attrs["robot"],
        "samples": found.attrs["samples"],
        "accepted": found.attrs["accepted"],
        "volume": float(found["volume"]),
        "volume_interval": found["volume_interval"].values.tolist(),
        "volume_unit": found["volume"].attrs["units"],
        "bounds": {name: [low[i], high[i]] for i, name in enumerate("xyz")},
        "seconds": found.attrs["seconds"],
        "poses_per_s": found.attrs["poses_per_s"],
        "method": found.attrs["method"],
        "seed": found.attrs["seed"],
        "condition": found.attrs["condition"],
        "region": found.attrs["region"],
    }


def _show(found: xr.Dataset, summary: dict[str, Any], size: float | None) -> None:
    import math

    accepted, samples = summary["accepted"], summary["samples"]
    typer.echo(f"{summary['robot']}: {accepted:,} of {samples:,} samples accepted ({accepted / samples:.2%})")
    low, high = summary["volume_interval"]
    unit = summary["volume_unit"].replace("1", "")
    between = "" if math.isnan(low) else f", between {low:.6g} and {high:.6g} ({found['volume_interval'].long_name})"
    typer.echo(f"  volume {summary['volume']:.6g} {unit}{between}")
    if "cell_edges" in found:
        longest = float(found["cell_edges"].max())
        more = f", not {size:g} m: that takes more samples" if size is not None and longest > size * (1 + 1e-9) else ""
        typer.echo(f"  smallest cells {longest:.3g} m long{more}")
    if accepted:
        for name, (least, most) in summary["bounds"].items():
            typer.echo(f"  {name} from {least:.4g} to {most:.4g} m")
    typer.echo(f"  {summary['poses_per_s']:,.0f} poses/s, {summary['seconds']:.2f} s with start-up")
