"""The command line through its entry point: what it prints, what it writes, its exit codes, and no traceback."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from PIL import Image

from towline.models import available, load
from towline.models.library import FOLDER

from .warm import TOWLINE, towline as run


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    folder = tmp_path_factory.mktemp("demo")
    return folder, run("demo", cwd=folder)


def test_demo_shows_both_halves(demo):
    folder, done = demo
    hovering, free = done.stdout.split("The same circle with a quadrotor that may move")
    assert "INFEASIBLE, 7.627 N short" in hovering
    assert "at t = " in hovering
    assert "t_min of cables 2, 3" in hovering
    assert "FEASIBLE" in free
    assert "INFEASIBLE" not in free
    names = sorted(path.name for path in (folder / "towline-demo").iterdir())
    files = ["circle-free.nc", "circle-hovering.nc", "circle-simulation.nc"]
    assert names == sorted(["base.png", "path.png", "simulation.png", "tensions.png", *files])
    assert all(f"towline-demo/{name}" in done.stdout for name in names)
    assert "wang-flying, simulation of 10 s: PASSED" in free
    flight = xr.load_dataset(folder / "towline-demo" / "circle-simulation.nc")
    assert np.linalg.norm(flight["pose"].values[:, :2] - 50, axis=1) == pytest.approx(
        1, abs=0.05
    )  # the circle, in wind
    for name in names:
        if name.endswith(".png"):
            assert (folder / "towline-demo" / name).read_bytes().startswith(b"\x89PNG")
    free_plan = xr.load_dataset(folder / "towline-demo" / "circle-free.nc")
    assert free_plan["tensions"].min() > 0.5
    assert xr.load_dataset(folder / "towline-demo" / "circle-hovering.nc").attrs["status"] == "infeasible"


def test_robots_lists_and_diagnoses():
    listed = run("robots")
    for name in available():
        assert name in listed.stdout
    printed = run("robots", "wang-flying-printed")
    assert "rank 3 of 6 at home (all cable lines meet in one point" in printed.stdout
    assert "; highest rank near home: 3 if the platform is level, 5 if it is tilted\n    cross the " in printed.stdout
    assert "cross the cables" not in run("robots", "wang-ctmrts").stdout  # three cables are too few either way
    found = json.loads(run("robots", "wang-flying-printed", "--json").stdout)
    assert (found["rank"], found["rank_level"]) == (3, 3)
    assert json.loads(run("robots", "--schema").stdout)["title"] == "Robot"


def test_robots_draws_and_tells_whether_it_can_rest(tmp_path):
    resting = run("robots", "wang-flying", "--figure", tmp_path / "robot.png")
    assert "at rest at home: tensions 2.194 N" in resting.stdout
    assert (tmp_path / "robot.png").read_bytes().startswith(b"\x89PNG")
    falling = run("robots", "wang-ctmrts")
    assert "cannot rest at home (singular)" in falling.stdout
    assert "short by" in falling.stdout
    assert (
        "can rest, in its home attitude and with its carriers at home, in the box\n    x -0.146 to 0.146 m"
        in resting.stdout
    )
    assert "at any of the sampled positions" in falling.stdout
    box = json.loads(run("robots", "multi-quadrotor-3", "--json").stdout)["resting_box"]
    assert (box["min"], box["about"], box["samples"]) == ([None] * 3, [0, 0, 0], 0)
    assert (
        "can rest, in its home attitude, at any position\n    (the carriers move with it"
        in run("robots", "multi-quadrotor-3").stdout
    )


def test_export_writes_models_for_others(tmp_path):
    for option, file in (("--mjcf", "wang-flying.xml"), ("--c", "wang-flying.c")):
        done = run("export", "wang-flying", option, cwd=tmp_path)
        assert done.stdout == f"  Written\n    {file}\n"
        assert (tmp_path / file).stat().st_size > 1000
    done = run("export", "wang-flying", code=2)
    assert "export requires exactly one of --mjcf, --c, --step and --fmu" in done.stderr


def test_tension_prints_the_promised_keys():
    done = run("tension", "wang-flying", "--pose", "0 0 -1 0 0 0", "--json")
    answer = json.loads(done.stdout)
    # Six equal cables carry the weight: each m g l / (6 (z_A - z_B)).
    robot = load("wang-flying")
    height = -0.07 + 1 - 0.03
    length = np.linalg.norm(robot.anchors[0] - robot.attachments[0] - np.array([0, 0, -1]))
    np.testing.assert_allclose(answer["tensions"], robot.weight * length / height / 6, rtol=1e-9)
    assert (answer["status"], answer["feasible"], answer["certificate"]) == ("optimal", True, None)
    assert answer["residual"] < 1e-9
    assert set(answer["methods"]) >= {"active-set", "qp", "min-norm"}
    table = run("tension", "wang-flying").stdout
    assert "active-set" in table
    assert "min-norm" in table


def test_tension_asks_whether_a_pose_is_in_degrees():
    assert "--pose: 45 rad is too large" in run("tension", "cogiro", "--pose", "0 0 2 0 45 0").stdout
    assert "too large" not in run("tension", "cogiro", "--pose", "0 0 2 0 0.45 0").stdout
    assert "--wind: 90 m/s is too large" in run("tension", "wang-flying", "--wind", "90 0 0", code=1).stdout


@pytest.mark.parametrize(
    ("robot", "pose", "status"),
    [
        ("wang-flying", "0.6,0,-1,0,0,0", "infeasible"),
        ("wang-flying-printed", "0.3,0,-1,0,0,0", "singular"),
        ("wang-ctmrts", "1.261 0.961 0.4 0 0 0", "singular"),
    ],
)
def test_tension_without_an_answer_exits_1_with_the_certificate(robot, pose, status):
    done = run("tension", robot, "--pose", pose, "--json", code=1)
    answer = json.loads(done.stdout)
    assert (answer["status"], answer["tensions"]) == (status, None)
    certificate = answer["certificate"]
    assert certificate["shortfall"] > 0
    assert len(certificate["direction"]) == 6
    assert isinstance(certificate["binding"], list)
    told = run("tension", robot, "--pose", pose, code=1)
    assert "short by" in told.stdout


def test_tension_takes_a_motion():
    still = json.loads(run("tension", "wang-flying", "--json").stdout)
    up = json.loads(run("tension", "wang-flying", "--acceleration", "0 0 9.81 0 0 0", "--json").stdout)
    np.testing.assert_allclose(up["tensions"], 2 * np.array(still["tensions"]), rtol=1e-9)
    higher = run("tension", "wang-flying", "--pose", "0 0 9 0 0 0", "--carrier-pose", "0 0 10 0 0 0", "--json")
    np.testing.assert_allclose(json.loads(higher.stdout)["tensions"], still["tensions"], rtol=1e-9)
    windy = json.loads(run("tension", "wang-flying", "--wind", "1,0,0", "--json").stdout)
    assert windy["wrench"][0] == pytest.approx(-0.5 * 1.29 * 0.45 * 0.16)


TASK = """\
name: line
duration: 2
path: {kind: line, start: [0, 0, -1], end: [0.05, 0, -1.2]}
steps: 20
"""


def test_a_folder_for_figures_that_is_a_file_is_told_before_planning(tmp_path):
    (tmp_path / "line.yaml").write_text("path: {kind: rest, pose: [0, 0, -1]}\nduration: 1\n")
    done = run("plan", "wang-flying", "line.yaml", "--figures", "line.yaml", cwd=tmp_path, code=2)
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.glob("*.nc"))


def test_plan_writes_a_file_and_figures(tmp_path):
    (tmp_path / "line.yaml").write_text(TASK)
    done = run("plan", "wang-flying", "line.yaml", "--figures", "pictures", "--format", "pdf", "--json", cwd=tmp_path)
    report = json.loads(done.stdout)
    keys = {"feasible", "tension_min", "tension_max", "margin", "tracking_error_max", "build_s", "solve_s"}
    assert keys | {"audit", "certificate", "file"} <= set(report)
    assert {"rate_hz", "worst_violation", "at_s"} <= set(report["audit"])
    assert report["audit"]["rate_hz"] == 1000
    assert report["audit"]["worst_violation"] < 1e-6
    saved = xr.load_dataset(tmp_path / report["file"])
    assert saved["tensions"].shape[1] == 6
    drawn = sorted(path.name for path in (tmp_path / "pictures").iterdir())
    assert drawn == ["base.pdf", "path.pdf", "tensions.pdf", "views.pdf"]
    assert all((tmp_path / "pictures" / name).read_bytes().startswith(b"%PDF") for name in drawn)


@pytest.mark.parametrize(
    "command", ["plan wang-flying line.yaml", "simulate wang-flying line.nc", "reproduce flying", "demo"]
)
def test_another_format_of_figures_is_refused_before_any_work(command, tmp_path):
    done = run(*command.split(), "--format", "jpg", cwd=tmp_path, code=2)
    assert done.stdout == ""
    assert done.stderr == "towline: --format must be one of png, pdf, svg, got 'jpg'\n"
    assert not list(tmp_path.iterdir())


FREE_TASK = """\
name: circle
path: {kind: circle, centre: [0, 0, -1], radius: 0.5, rate: 3}
base: {kind: free, acceleration_max: 3, ends: periodic}
steps: 24
"""


def test_plan_writes_a_report_and_a_film(tmp_path):
    (tmp_path / "circle.yaml").write_text(FREE_TASK)
    files = ("--report", "out/plan.html", "--animate", "out/plan.gif", "--speed", "0.5", "--fps", "4")
    done = run("plan", "wang-flying", "circle.yaml", *files, "--figures", "out", "--json", cwd=tmp_path)
    assert done.stderr == ""
    answer = json.loads(done.stdout)
    assert (answer["report"], answer["animation"]) == ("out/plan.html", "out/plan.gif")
    page = (tmp_path / "out" / "plan.html").read_text()
    assert page.startswith("<!DOCTYPE html>")
    assert f"{answer['tension_min']:.4g}\u00a0N in cable" in page  # on one line
    assert "Convergence of the solver" in page
    assert "convergence.png" in [Path(picture).name for picture in answer["figures"]]
    with Image.open(tmp_path / "out" / "plan.gif") as film:
        seconds = 2 * 2 * np.pi / 3
        assert film.n_frames == int(4 * seconds) + 1
    (tmp_path / "rest.yaml").write_text("name: rest\npath: {kind: rest, pose: [0, 0, -1]}\nduration: 1\n")
    told = run("plan", "wang-flying", "rest.yaml", "--report", "plan.html", cwd=tmp_path)
    assert told.stderr == ""  # nobody watches
    assert told.stdout.startswith("wang-flying, rest: FEASIBLE")
    assert told.stdout.endswith("\n  Written\n    wang-flying-rest.nc\n    plan.html\n")


def test_plan_refuses_a_wrong_film_before_it_plans(tmp_path):
    (tmp_path / "circle.yaml").write_text(FREE_TASK)
    for options, message in (
        (["--animate", "film.avi"], "must end in .gif or .mp4"),
        (["--animate", "film.gif", "--fps", "0"], "fps must be a number"),
        (["--animate", "film.gif", "--speed", "-1"], "speed must be a number"),
        (["--report", "/proc/nowhere/plan.html"], "cannot be written"),
    ):
        done = run("plan", "wang-flying", "circle.yaml", *options, cwd=tmp_path, code=2)
        assert len(done.stderr.strip().splitlines()) == 1
        assert message in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["circle.yaml"]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pseudo-terminals")
def test_plan_shows_progress_on_a_terminal_and_only_there(tmp_path):
    import pty

    def watched(*options):
        """What a person sees who watches standard error."""
        ours, theirs = pty.openpty()
        environment = {**os.environ, "TERM": "xterm", "COLUMNS": "80"}
        environment.pop("NO_COLOR", None)
        command = [str(TOWLINE), "plan", "wang-flying", str(tmp_path / "circle.yaml"), *options]
        with subprocess.Popen(command, stderr=theirs, stdout=subprocess.DEVNULL, cwd=tmp_path, env=environment) as run:
            os.close(theirs)
            seen = b""
            try:
                while piece := os.read(ours, 65536):
                    seen += piece
            except OSError:
                pass  # how Linux tells that the other end is closed
        os.close(ours)
        assert run.returncode == 0
        return seen.decode()

    (tmp_path / "circle.yaml").write_text(FREE_TASK)
    seen = watched()
    for part in ("planning circle", "attempt 1", "iteration", "objective", "infeasibility"):
        assert part in seen
    assert watched("--json") == ""


def test_plan_that_is_infeasible_exits_1(tmp_path):
    (tmp_path / "far.yaml").write_text(TASK.replace("0.05", "0.8"))
    done = run("plan", "wang-flying", "far.yaml", "--out", "far.nc", "--json", cwd=tmp_path, code=1)
    report = json.loads(done.stdout)
    assert report["certificate"]["shortfall"] > 0
    assert 0 <= report["certificate"]["time"] <= 2
    assert (tmp_path / "far.nc").exists()


def test_a_task_whose_name_has_spaces_is_written_to_a_file_without(tmp_path):
    (tmp_path / "task.yaml").write_text(re.sub("name: .*", "name: round the hall", TASK))
    run("plan", "wang-flying", "task.yaml", cwd=tmp_path)
    assert (
        xr.load_dataset(tmp_path / "wang-flying-round-the-hall.nc")
        .attrs["title"]
        .startswith("wang-flying, round the hall:")
    )
    for name in (" hall", "hall ", "hall/"):
        (tmp_path / "task.yaml").write_text(re.sub("name: .*", f"name: '{name}'", TASK))
        done = run("plan", "wang-flying", "task.yaml", cwd=tmp_path, code=2)
        assert '"_", "-" and spaces inside, and begin with a letter' in done.stderr
        assert f"got '{name}'" in done.stderr


WRONG_FILES = {
    "missing mass": (lambda text: text.replace("  mass: 1.2\n", "", 1), "platform.mass"),
    "negative inertia": (lambda text: text.replace("0.81, 0.81", "-0.81, 0.81"), "platform.inertia"),
    "limits crossed": (lambda text: text.replace("t_min: 0.5", "t_min: 70", 1), "cables[0]"),
    "unknown carrier": (
        lambda text: text.replace("carrier: quad", "carrier: drone", 1),
        "cables[0].carrier must be one of quad, got 'drone'",
    ),
    "NaN": (lambda text: text.replace("[0.52, 0,", "[.nan, 0,"), "cables[0].anchor[0]"),
    "zero length": (
        lambda text: text.replace("anchor: [0.52, 0, -0.07]", "anchor: [0.125, 0.216506350946, -0.97]"),
        "cables[0]",
    ),
    "not YAML": (lambda text: text.replace("name:", "name: [", 1), "is not YAML"),
    "50 MB": (lambda text: text + "#" * 50_000_000, "50.0 MB"),
}


@pytest.mark.parametrize("case", WRONG_FILES)
def test_wrong_robot_file_is_one_line_and_exit_code_2(case, tmp_path):
    change, named = WRONG_FILES[case]
    text = (FOLDER / "wang-flying.yaml").read_text()
    file = tmp_path / "mine.yaml"
    changed = change(text)
    assert changed != text
    file.write_text(changed)
    done = run("robots", file, code=2)
    assert done.stdout == ""
    assert len(done.stderr.strip().splitlines()) == 1
    assert str(file) in done.stderr
    assert named in done.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["tension", "wang-flyng"], "did you mean 'wang-flying'"),
        (["tension", "wang-flying", "--pose", "1 2 3"], "--pose must be 6 finite numbers, got '1 2 3'"),
        (["tension", "wang-flying", "--pose", "a b c d e f"], "--pose must be 6 finite numbers, got 'a b c d e f'"),
        (["tension", "wang-flying", "--pose", "0 0 nan 0 0 0"], "--pose must be 6 finite numbers, got '0 0 nan 0 0 0'"),
        (["tension", "wang-ctmrts", "--carrier-pose", "0 0 1 0 0 0"], "for each of 3 carriers"),
        (["tension", "wang-flying", "--method", "magic"], "active-set"),
        (["tension", "ipanema-1", "--wind", "1 0 0"], "has no platform.aero"),
        (["plan", "wang-flying", "none.yaml"], "none.yaml: no such file"),
        (["demo", "--out", "/proc/nowhere"], "cannot be written"),
        (["robots", "wang-flying", "\x1b[2J"], "extra argument(s) (\\x1b[2J)"),
        (["robots", *["x" * 4000] * 30], "extra argument(s) (xxx"),
    ],
)
def test_wrong_arguments_are_one_line_and_exit_code_2(arguments, message):
    done = run(*arguments, code=2)
    (line,) = done.stderr.splitlines()
    assert message in line
    assert line.isprintable()
    assert len(line) < 1100


def test_version_and_help():
    """The version by a process of its own, as users start it."""
    version = subprocess.run([TOWLINE, "--version"], capture_output=True, text=True, check=True).stdout
    assert version.strip() == "towline 0.3.0"
    for command in ("demo", "robots", "tension", "plan", "simulate", "export"):
        run(command, "--help")
    # Units are in brackets, which a mark-up may take for its own.
    for command, unit in (("workspace", "[rad]"), ("tension", "[m/s]"), ("simulate", "[m/s]")):
        assert unit in run(command, "--help").stdout


def test_shells_complete_commands_and_robots(monkeypatch):
    """Bash asks with the line so far in the environment."""
    monkeypatch.setenv("_TOWLINE_COMPLETE", "complete_bash")
    for line, completed in (
        ("towline ten", {"tension"}),
        ("towline tension wang-f", {name for name in available() if name.startswith("wang-f")}),
    ):
        monkeypatch.setenv("COMP_WORDS", line)
        monkeypatch.setenv("COMP_CWORD", str(line.count(" ")))
        assert set(run().stdout.split()) == completed


def test_what_was_meant_is_told():
    for words, meant in ((("tensio", "wang-flying"), "tension"), (("tension", "wang-fliing"), "wang-flying")):
        done = run(*words, code=2)
        assert re.search(f"did you mean '{meant}'", done.stderr, re.IGNORECASE)


def test_help_starts_at_once():
    """Nothing heavy is imported for it: 0.3 s on a free core."""
    code = "import sys; import towline.cli.main; print(*sys.modules)"
    loaded = set(
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    )
    assert not loaded & {"casadi", "xarray", "matplotlib", "scipy", "qpsolvers", "osqp", "viser", "pandas"}


def test_a_warning_is_one_line_without_the_code_that_gave_it(tmp_path):
    """Two of three quadrotors with one cable each cannot hold a rigid load: for each that may be lost, one line."""
    task = tmp_path / "rest.yaml"
    task.write_text("{name: rest, path: {kind: rest, pose: [0, 0, 0]}, duration: 1, base: {kind: hold}}")
    assert run("plan", "multi-quadrotor-3", task, cwd=tmp_path).returncode == 0
    controller = ("--controller", "fault-tolerant", "--duration", "0.01")
    done = run("simulate", "multi-quadrotor-3", "multi-quadrotor-3-rest.nc", *controller, cwd=tmp_path)
    assert done.returncode == 0
    lines = done.stderr.splitlines()
    starts = [f"towline: warning: multi-quadrotor-3 cannot rest without quad{k}: a force of" for k in (1, 2, 3)]
    assert [line.startswith(start) for line, start in zip(lines, starts, strict=True)] == [True] * 3
