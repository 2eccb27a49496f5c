"""`towline pose`: the pose of the platform from the lengths of its cables."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from ..base.inputs import InputError, check_ending
from . import options
from .calibrate import by_name
from .log import FieldsOption, FixOption
from .outputs import Outputs, check_outputs

if TYPE_CHECKING:
    from ..estimation import PoseEstimate
    from ..models import Robot

SIX = "x y z roll pitch yaw"
FEWEST_FIT = 0.95  # of the samples of a log


@options.parameters(f"""
    --lengths 'one number for each cable': Measured lengths of the cables [m].
    --log LOG: Log of readings of the winches, instead of --lengths: CSV, NetCDF, MCAP or a ROS bag. The encoders of the
        robot file convert them to lengths. May be repeated, for several logs of one motion.
    --out FILE.csv: With --log: file of poses and covariances; default: LOG-poses.csv in this folder.
    --figures FOLDER: With --log: folder for a figure of the residuals over time.
    --start '{SIX}': Pose at which the search starts [m, rad]; default: none is needed.
    --sigma S: Standard deviation of the lengths [m]: one number, or one per cable; with --log also by
        name: lengths=0.001,rotation=0.01.
""")
def pose(
    robot: options.RobotArgument,
    lengths: str | None = None,
    log: list[Path] | None = None,
    fields: FieldsOption = None,
    fix: FixOption = False,
    out: Path | None = None,
    figures: Path | None = None,
    form: options.FormatOption = "png",
    start: str | None = None,
    carrier_pose: options.CarrierPoseOption = None,
    sigma: str = "0.001",
    as_json: options.JsonOption = False,
) -> None:
    """Estimate the pose of the platform from its cable lengths, and list other poses that fit them.

    If the lengths do not determine the pose, the result is the equilibrium pose. The exit code is 1 if no pose fits the
    lengths. With --log, the poses of all samples are written, and samples that no pose fits are listed; the exit code
    is 1 if these are more than 5 % of all samples, or if the log probably has an input error.
    """
    from ..estimation import branches, pose_from_lengths
    from ..models import load

    loaded = load(robot)
    if (lengths is None) == (log is None):
        raise InputError("one of --lengths and --log must be given, got " + ("none" if log is None else "both"))
    if log is None:
        options.left_out({"--out": out, "--figures": figures, "--fields": fields, "--fix": fix}, "with --lengths")
    else:
        options.left_out({"--start": start, "--carrier-pose": carrier_pose}, "with --log")
        target, outputs = out or Path(f"{log[0].stem}-poses.csv"), Outputs(as_json, figures, form)
        _of_log(loaded, log, fields, sigma, target, outputs, fix)
        return
    assert lengths is not None
    measured = options.numbers("--lengths", lengths, loaded.m)
    near = None if start is None else options.numbers("--start", start, 6)
    carriers = (
        None if carrier_pose is None else options.numbers("--carrier-pose", carrier_pose, 6, rows=len(loaded.carriers))
    )
    deviations = options.numbers("--sigma", sigma, loaded.m if len(sigma.replace(",", " ").split()) > 1 else 1)
    deviations = deviations[0] if len(deviations) == 1 else deviations
    estimate = pose_from_lengths(loaded, measured, near, carriers, deviations)
    others = [other for other in branches(loaded, measured, carriers, deviations) if not _same(loaded, other, estimate)]
    if as_json:
        poses = [other.pose.tolist() for other in others]
        options.print_json({"robot": loaded.name, **estimate.to_dict(), "others": poses})
    else:
        _show(loaded, estimate, others)
    if not estimate.consistent:
        raise typer.Exit(1)


def _of_log(
    robot: Robot, logs: list[Path], fields: Path | None, sigma: str, out: Path, outputs: Outputs, fix: bool
) -> None:
    """Write the poses of a log, without its input errors if `fix` is true."""
    import numpy as np

    from ..base.text import quantity
    from ..estimation.calibration.correction import corrected_log
    from ..estimation.logs import Sigma, read_log
    from ..estimation.pose.from_lengths import SIGMA
    from ..estimation.pose.from_log import poses_from_log
    from ..figures import calibration, style

    check_ending("--out", out, ".csv")
    picture = outputs.picture("consistency")
    check_outputs({"--out": out, "--figures": picture}, {f"the log {log}": log for log in logs})
    stated = by_name("--sigma", sigma, Sigma._fields) if "=" in sigma else {}
    sigma = str(stated.get("lengths", SIGMA)) if stated else sigma
    deviations = options.numbers("--sigma", sigma, robot.m if len(sigma.replace(",", " ").split()) > 1 else 1)
    read = read_log(logs, stated or None, None, robot, fields)
    if fix:
        read, correction = corrected_log(robot, read)
        robot = correction.robot
    found = poses_from_log(robot, read.measurements, deviations if len(deviations) > 1 else deviations[0], read.begin)
    files = [found.save(out)]
    if picture is not None:
        drawn = calibration.consistency(found.estimate.residuals, found.cost, found.largest, found.times)
        files.append(style.save(drawn, picture))
    data: dict[str, Any] = {"robot": robot.name, **found.to_dict(), "notes": read.notes, "files": files}
    if outputs.as_json:
        options.print_json(data)
    else:
        sigmas = np.sqrt(np.diagonal(found.estimate.covariance, axis1=-2, axis2=-1))
        size = quantity(1e3 * data["residual"], "mm", 3)
        typer.echo(f"{robot.name}: {quantity(data['samples'])} poses, residuals {size} rms")
        for i, name in enumerate(SIX.split()):
            middle = 1e3 * float(np.median(sigmas[:, i]))
            size = quantity(middle, "mm" if i < 3 else "mrad", 3) if np.isfinite(middle) else "undetermined"
            size = size if robot.dof_mask[i] else "none, because it is fixed (not in `platform.dof`)"
            typer.echo(f"  median sigma of {name}: {size}")
        if not np.isfinite(sigmas).all():
            typer.echo("  a motion of the platform changes none of the readings: poses are undetermined along it")
        for line in (_included(found.estimate), *read.notes, *found.lines()):
            typer.echo(f"  {line}")
        options.print_written(files)
    if data["consistent"] < FEWEST_FIT or data["doubt"]:
        raise typer.Exit(1)


def _same(robot: Robot, one: PoseEstimate, other: PoseEstimate) -> bool:
    import numpy as np

    from ..models.points import shortest_way

    off = np.abs(shortest_way(one.pose - other.pose))
    return bool(off[:3].max() < 0.01 * robot.length and off[3:].max() < 0.01)


def _included(estimate: PoseEstimate) -> str:
    """Return the errors that the sigmas of an estimate include."""
    import numpy as np

    known = estimate.robot.uncertainty is not None
    file = "and the robot file's uncertainty" if known else "only, because the robot file has no uncertainty"
    weight = " They do not include errors of the CoM." if np.any(estimate.by_gravity) else ""
    return f"The sigmas include noise of the measurements {file}.{weight}"


def _show(robot: Robot, estimate: PoseEstimate, others: list[PoseEstimate]) -> None:
    import numpy as np

    from ..base.text import any_of, column, quantity, quantity_row
    from ..estimation.pose.wrong_lengths import can_explain, wrong_cables

    verdict = "a pose fits the lengths" if estimate.consistent else "NO POSE FITS THE LENGTHS; the closest one is shown"
    if estimate.by_gravity and not estimate.converged:
        verdict = "NO EQUILIBRIUM WITH THESE LENGTHS; the closest pose is shown"
    typer.echo(f"{robot.name}: {verdict} (residuals {quantity(1e3 * estimate.residual, 'mm', 3)} rms)")
    rows = []
    values = [*column(estimate.pose[:3].round(9), 7), *(f"{angle + 0.0:.6f}" for angle in estimate.pose[3:].round(6))]
    for i, name in enumerate(SIX.split()):
        unit, deviation = "m" if i < 3 else "rad", 1e3 * estimate.sigmas[i]
        spread = quantity(deviation, f"m{unit}", 3) if np.isfinite(deviation) else "undetermined"
        rows.append((name, f"{values[i]} {unit}", spread if robot.dof_mask[i] else "fixed"))
    options.print_table(["", "estimate", "sigma"], rows, "lrr")
    if robot.dof_mask[3:].any():
        typer.echo("The sigmas of the angles refer to small rotations about the axes of {G}.")
    typer.echo(_included(estimate))
    if estimate.by_gravity and estimate.converged:
        typer.echo("The lengths do not determine the pose. This is the equilibrium pose.")
    if estimate.consistent and not estimate.determined:
        typer.echo("Undetermined: at least one motion changes none of these lengths.")
    elif estimate.consistent and not estimate.conditioned:
        typer.echo(
            "Nearly singular: the lengths are not linear within the sigmas, so the sigmas are only a rough measure."
        )
    if not estimate.consistent and can_explain(estimate):
        cables = wrong_cables(estimate)
        named = any_of(f"cables[{k}]" for k in cables) if len(cables) < robot.m else "any one cable"
        typer.echo(f"A wrong length of {named} explains this." if named else "No single wrong length explains this.")
    for other in others:
        held = "" if other.taut else ", at which the cables cannot hold the platform at rest"
        typer.echo(f"Also fits: ({quantity_row(np.round(other.pose, 6))}) [m, rad]{held}")
