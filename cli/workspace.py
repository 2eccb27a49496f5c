"""`towline workspace`: sample which poses are reachable."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from ..base.inputs import InputError, check_ending
from .options import JsonOption, RobotArgument, numbers, parameters, print_json, print_written
from .outputs import check_outputs
from .stopping import add_to_message, requested
from .watching import checkpoint_of, counting, long_run, resumable

if TYPE_CHECKING:
    import xarray as xr

    from ..models import Robot
    from ..workspace import Condition
    from ..workspace.boundary_mesh import Mesh


# Each has a file of its own; to load them takes longer than help may.
_FILES = (Path(__file__).parent.parent / "workspace" / "conditions").glob("[a-z]*.py")
CONDITIONS = ", ".join(sorted(["all", "any", *(file.stem.replace("_", "-") for file in _FILES)]))
METRICS = (
    "margin, natural_frequency, translational_stiffness, rotational_stiffness, condition_number, dexterity, "
    "tension_factor, payload, acceleration, cable_distance"
)


@parameters(f"""
    --condition KIND|JSON: Condition: its kind, or JSON with the kind and its keys, such as '{{"kind": "margin",
        "above": 5}}'. Kinds: {CONDITIONS}. Repeat the option to combine; all must hold. Default: static-equilibrium.
    --define FILE.py: Python file with conditions of your own.
    --metric NAME: Metric to compute at the samples that are kept (see --keep), and to draw with --figure: {METRICS}.
        May be repeated. Default: none.
    --robust SHARE: The tension conditions hold at all accepted poses simultaneously for this fraction, such as 0.95, of
        all robots within the uncertainty of the robot file. Default: the nominal robot only.
    --box: Box of positions [m]: 'xmin ymin zmin; xmax ymax zmax'. Default: a box around home and the anchors, above the
        floor and inside the workspace_box of the robot file.
    --attitude: One attitude 'roll pitch yaw', or a range 'min min min; max max max' [rad]. Default: the attitude at
        home.
    --carriers: Positions of the carriers: home, or reach (mobile carriers anywhere in their reach boxes).
    --lengths: For robots with three cables, instead of --box: range 'min max' of their lengths [m]; the positions
        follow from them.
    --samples: Number of samples, such as 60000 or 1e8.
    --method: Sampling method: random, sobol, grid or adaptive.
    --seed: Seed of the random numbers.
    --size: With the method adaptive: smallest edge of a cell [m]. Default: as small as the number of samples permits.
{long_run()}
    --keep: Samples to keep in the file, at most a million: accepted, all or none.
    --out: NetCDF file to write (an existing one is overwritten), or new .zarr folder. Default: ROBOT-workspace.nc in
        this folder, from the robot's `name`.
    --figure: File for a picture of the accepted positions: .png, .pdf or .svg.
    --mesh: STL file for the boundary of the workspace at one attitude, with carriers at home (extra mesh).
""")
def workspace(
    robot: RobotArgument,
    condition: list[str] | None = None,
    define: list[Path] | None = None,
    metric: list[str] | None = None,
    robust: float | None = None,
    box: str | None = None,
    attitude: str | None = None,
    carriers: str = "home",
    lengths: str | None = None,
    samples: float = 60_000,
    method: str = "random",
    seed: int = 0,
    size: float | None = None,
    workers: int = 1,
    scheduler: str | None = None,
    checkpoint: Path | None = None,
    resume: Path | None = None,
    keep: str = "accepted",
    out: Path | None = None,
    figure: Path | None = None,
    mesh: Path | None = None,
    as_json: JsonOption = False,
) -> None:
    """Sample the poses at which a condition holds; the exit code is 1 if there are none."""
    from ..base.execution import Execution
    from ..figures import style
    from ..models import load
    from ..workspace import draw, sample, save
    from ..workspace.condition import for_robots

    for file in define or []:
        _import(file)
    loaded = load(robot)
    required = for_robots(_condition(condition), robust)
    region = _region(box, attitude, carriers, lengths)
    target = out or Path(f"{loaded.name}-workspace.nc")
    stored = checkpoint_of(checkpoint, resume)
    if not float(samples).is_integer() or samples > 1e15:
        raise InputError(f"--samples must be a whole number from 1, got {samples:g}")
    _check_files(target, figure, mesh, stored, define or [])
    if mesh is not None and ((attitude is not None and ";" in attitude) or carriers != "home" or lengths is not None):
        raise InputError(f"--mesh requires a region in which only positions vary, got {mesh} of another")
    # Before the samples, so that an error in it is reported before hours of work.
    surface = None if mesh is None else _boundary(loaded, required, region)
    with counting(f"sampling {loaded.name}", "accepted", quiet=as_json) as show:
        where = Execution(workers, scheduler, stored, resume is not None, resumable(show, stored, "samples"))
        kept = {"size": size, "keep": keep, "metrics": metric or ()}
        result = sample(loaded, required, region, int(samples), method, seed, execution=where, **kept)
    add_to_message("")
    written = [save(result, target)]
    if figure is not None:
        written.append(style.save(draw(result, loaded), figure))
    if mesh is not None and surface is not None:
        written.append(surface.save(mesh))
    summary = _summary(result, metric or [])
    reason = None if summary["accepted"] else required.why_nowhere(loaded)
    about_lengths = f"the condition allows any cable lengths, but they are constant; see `towline robots {robot}`"
    note = about_lengths if loaded.fixed_lengths is not None and required.takes_every_row else None
    if as_json:
        print_json({**summary, "reason": reason, "note": note, "file": target, "figure": figure, "mesh": mesh})
    else:
        _show(result, summary, size, {"why": reason, "note": note})
        print_written(written)
    if not summary["accepted"]:
        raise typer.Exit(1)


def _check_files(
    target: Path, figure: Path | None, mesh: Path | None, checkpoint: Path | None, read: list[Path]
) -> None:
    """Check that all files can be written, of the kinds that there are, and none is read."""
    from ..figures import style

    check_ending("--out", target, ".nc", ".zarr")
    if mesh is not None:
        check_ending("--mesh", mesh, ".stl")
    if target.suffix == ".zarr" and target.exists():
        raise InputError(f"--out must be a new .zarr folder or a NetCDF file, got {target}, which exists")
    outputs = {"the checkpoint": checkpoint, "--out": target, "--figure": figure, "--mesh": mesh}
    check_outputs(outputs, {f"--define {file}": file for file in read})
    if figure is not None:
        style.check_picture(figure)


def _boundary(robot: Robot, condition: Condition, data: dict[str, Any]) -> Mesh:
    from ..workspace import Region, boundary
    from ..workspace.domain import Domain

    domain = Domain.of(robot, Region.model_validate(data))
    return boundary(robot, condition, *domain.box, attitude=domain.low[3:6])


def _import(file: Path) -> None:
    """Import a Python file by its name, from its folder, as worker processes will do too."""
    import sys
    from importlib import import_module

    from ..base.inputs import check_ending, printable

    check_ending("--define", file, ".py")
    try:
        sys.path.insert(0, str(file.resolve().parent))
        if Path(import_module(file.stem).__file__ or "").resolve() == file.resolve():
            return
        reason = "there is another module of that name"
    except BaseException as error:  # anything that a file of the user's may raise: a script may end the process
        if requested():  # Ctrl-C
            raise
        try:
            reason = f"{type(error).__name__}: {error}"
        except Exception:  # of a class of its own
            reason = type(error).__name__
        reason = printable(reason.splitlines()[0].removesuffix(": "))
    raise InputError(f"--define must be a Python file that can be imported, got {printable(str(file))} ({reason})")


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
                    f'--condition must be a kind or JSON such as {{"kind": "margin", "above": 5}}, got {text!r} '
                    f"({error.msg}, character {error.pos + 1})"
                ) from None
        conditions.append(condition_from(data))
    return AllOf(conditions=tuple(conditions)) if len(conditions) > 1 else (conditions or [StaticEquilibrium()])[0]


def _region(box: str | None, attitude: str | None, carriers: str, lengths: str | None) -> dict[str, Any]:
    region: dict[str, Any] = {"carriers": carriers}
    if box is not None:
        region["position"] = _ends("--box", box, "x y z")
    if attitude is not None:
        one = None if ";" in attitude else numbers("--attitude", attitude, 3).tolist()
        region["attitude"] = one or _ends("--attitude", attitude, "roll pitch yaw")
    if lengths is not None:
        region["lengths"] = dict(zip(("min", "max"), numbers("--lengths", lengths, 2).tolist(), strict=True))
    return region


def _ends(option: str, text: str, names: str) -> dict[str, list[float]]:
    parts = text.split(";")
    if len(parts) != 2:
        raise InputError(f"{option} must be '{names}; {names}', got {text!r}")
    return {
        end: numbers(f"each half of {option}", part.strip(), 3).tolist()
        for end, part in zip(("min", "max"), parts, strict=True)
    }


def _summary(result: xr.Dataset, metrics: list[str]) -> dict[str, Any]:
    low, high = result["bounds"].values.tolist()
    return {
        **{name: result.attrs[name] for name in ("robot", "samples", "accepted")},
        "volume": float(result["volume"]),
        "volume_interval": result["volume_interval"].values.tolist(),
        "volume_unit": result["volume"].attrs["units"],
        "bounds": {name: [low[i], high[i]] for i, name in enumerate("xyz")},
        **({"metrics": {name: _range(result[name]) for name in metrics}} if metrics else {}),
        **{name: result.attrs[name] for name in ("seconds", "poses_per_s", "method", "seed", "condition", "region")},
    }


def _range(values: xr.DataArray) -> dict[str, Any]:
    """Return the smallest, the median and the largest value, None where there is none, and the unit."""
    import numpy as np

    some = values.values[~np.isnan(values.values)]
    low, middle, high = np.quantile(some, (0, 0.5, 1), method="nearest").tolist() if some.size else (None,) * 3
    return {"min": low, "median": middle, "max": high, "unit": values.attrs["units"]}


def _show(result: xr.Dataset, summary: dict[str, Any], size: float | None, remarks: dict[str, str | None]) -> None:
    import math

    from ..base.text import quantity, quantity_range

    accepted, samples = summary["accepted"], summary["samples"]
    share = f"{100 * accepted / samples:.2f} %"
    typer.echo(f"{summary['robot']}: {quantity(accepted)} of {quantity(samples)} samples accepted ({share})")
    typer.echo("".join(f"  {name}: {text}\n" for name, text in remarks.items() if text is not None), nl=False)
    low, high = summary["volume_interval"]
    unit = summary["volume_unit"].replace("1", "")
    between = f", from {quantity_range((low, high), unit, digits=6)}"
    about = "" if math.isnan(low) else f"{between} ({result['volume_interval'].long_name})"
    size_of = {"m^2": "area", "m": "length"}.get(unit, "volume")
    typer.echo(f"  {size_of} {quantity(summary['volume'], unit, digits=6)}{about}")
    if "cell_edges" in result:
        longest = float(result["cell_edges"].max())
        more = f", not {size:g} m, which takes more samples" if size and longest > size * (1 + 1e-9) else ""
        typer.echo(f"  edges of the smallest cells up to {quantity(longest, 'm', digits=3)}{more}")
    if accepted:
        for name, ends in summary["bounds"].items():
            typer.echo(f"  {name} {quantity_range(ends, 'm')}")
    for name, of in summary.get("metrics", {}).items():
        unit = of["unit"].replace("1", "")
        text = "no value" if of["min"] is None else quantity_range((of["min"], of["max"]), unit, digits=4)
        middle = "" if of["min"] is None else f", median {quantity(of['median'], unit, digits=4)}"
        typer.echo(f"  {name.replace('_', ' ')} {text}{middle}")
    typer.echo(f"  {quantity(summary['seconds'], 's', digits=3)} in total, start-up included")
