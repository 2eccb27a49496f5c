"""`towline export`: a robot for other programs."""

from pathlib import Path

from ..base.inputs import check_ending
from .options import JsonOption, RobotArgument, left_out, parameters, print_result
from .outputs import check_outputs


@parameters("""
    --mjcf: Write a MuJoCo model.
    --c: Write the functions of the dynamics as C code without dependencies.
    --step DIR: Write a control step as C, from state to tensions, into this new folder.
    --float: With --step: compute in single precision instead of double.
    --fmu FILE.fmu: Write an FMU for co-simulation (FMI 3.0), for example in Simulink.
    --fmu-of PART: With --fmu: plant, controller, or both in a loop.
    --drive DRIVE: With --fmu: type of the plant's cable commands (lengths, rates, forces or tensions); default:
        tensions, or lengths for robots whose cables have constant lengths.
    --reference PLAN.nc|'x y z roll pitch yaw': With --fmu: pose in {G} [m, rad], or plan, at which a simulation starts;
        default: home.
    --out FILE: File to write; default: ROBOT.xml or ROBOT.c in this folder, from the robot's `name`.
""")
def export(
    robot: RobotArgument,
    mjcf: bool = False,
    c_code: bool = False,
    step: Path | None = None,
    single: bool = False,
    fmu: Path | None = None,
    part: str = "plant",
    drive: str | None = None,
    reference: str | None = None,
    out: Path | None = None,
    as_json: JsonOption = False,
) -> None:
    """Export a robot: MuJoCo model, dynamics as C code, control step as C code, or functional mock-up unit (FMU)."""
    from ..base.errors import InputError
    from ..base.writing import whole_file
    from ..models import load

    if mjcf + c_code + (step is not None) + (fmu is not None) != 1:
        raise InputError("export requires exactly one of --mjcf, --c, --step and --fmu")
    if step is None:
        left_out({"--float": single}, "without --step", got=False)
    if fmu is None:
        left_out({"--fmu-of": part != "plant", "--drive": drive, "--reference": reference}, "without --fmu", got=False)
    if out is not None and (step is not None or fmu is not None):
        raise InputError(f"--out must be left out with {'--step, which names the folder' if step else '--fmu'}")
    loaded = load(robot)
    if step is not None:
        from ..export.step import export_step

        folder = export_step(loaded, step, "float" if single else "double")
        files = sorted(folder.iterdir())
        print_result(as_json, {"robot": loaded.name, "folder": folder, "files": files}, None, files)
        return
    if fmu is not None:
        from ..export.fmu import export_fmu
        from .options import numbers

        check_outputs({"--fmu": check_ending("--fmu", fmu, ".fmu")})
        start = reference if reference is None or reference.endswith(".nc") else numbers("--reference", reference, 6)
        platform = export_fmu(loaded, fmu, part, drive, start)
        report = None if platform else lambda: "There is no C compiler (cc, or CC), so the FMU has sources only."
        print_result(as_json, {"robot": loaded.name, "file": fmu, "binary": platform}, report, [fmu])
        return
    ending = ".xml" if mjcf else ".c"
    path = out if out is not None else Path(f"{loaded.name}{ending}")
    check_outputs({"--out": check_ending("--out", path, ending)})
    if mjcf:
        from ..export.mjcf import to_mjcf

        text = to_mjcf(loaded)
    else:
        from ..models.c_code import to_c

        text = to_c(loaded)
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    print_result(as_json, {"robot": loaded.name, "file": path}, None, [path])
