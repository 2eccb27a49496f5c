"""Every result has one report: its text, its page and its data say the same."""

import html
import json
import re

import numpy as np
import pytest

from towline import calibration, load, plan, simulate, sweep, time_along
from towline.base.errors import InputError
from towline.figures import style
from towline.figures.style import typeset

from .warm import towline as command

LIFT = {"path": {"kind": "line", "start": [0, 0, -1], "end": [0.2, 0, -1]}, "duration": 1.5}
TOO_HEAVY = {"path": {"kind": "line", "start": [0, 0, -1], "end": [9, 0, -1]}, "duration": 1.5}


def calibrated():
    robot, rng = load("ipanema-1"), np.random.default_rng(2)
    poses = robot.home + np.c_[rng.uniform(-0.4, 0.4, (30, 3)), rng.uniform(-0.2, 0.2, (30, 3))]
    lengths = calibration_lengths(robot, poses) + 1e-3 * rng.normal(size=(30, robot.m)) + 0.02
    return calibration.calibrate(robot, calibration.Measurements(lengths, poses=poses, sigma=1e-3), free=("offsets",))


def calibration_lengths(robot, poses):
    from towline import Dynamics

    return Dynamics(robot).cable_lengths(poses)


RESULTS = {
    "plan": lambda: plan("wang-flying", LIFT),
    "infeasible plan": lambda: plan("wang-flying", TOO_HEAVY),
    "simulation": lambda: simulate("wang-flying", load("wang-flying").home, duration=0.1),
    "failed simulation": lambda: simulate(
        "wang-flying", load("wang-flying").home, duration=0.5, events=["cut 1 at 0.1"]
    ),
    "timing": lambda: time_along("wang-flying", LIFT),
    "sweep": lambda: sweep("wang-flying", LIFT, {"duration": [1.0, 1.5]}),
    "calibration": calibrated,
}


@pytest.fixture(scope="module", params=RESULTS)
def result(request):
    return RESULTS[request.param]()


def texts(data):
    """All that a report as data says, piece by piece."""
    yield data["about"]
    yield data["summary"]
    for part in data["parts"]:
        if isinstance(part, str):
            yield part
            continue
        yield from (cell for row in (*part.get("facts", ()), *part.get("rows", ())) for cell in row)
        yield from (part["title"], *part.get("columns", ()))


def test_text_page_and_data_say_the_same(result, tmp_path, monkeypatch):
    monkeypatch.setattr(style, "svg", lambda figure: "<svg/>")  # `test_commands_write_the_page` has drawn pages
    text, page, data = (result.save_report(tmp_path / f"report.{kind}").read_text() for kind in ("txt", "html", "json"))
    assert text == result.report() + "\n"
    shown = html.unescape(re.sub(r"<[^>]*>", "", page))
    said = [piece for piece in texts(json.loads(data)) if piece]
    assert len(said) > 5
    for piece in said:
        assert piece in text
        without_marks = piece.replace("`", "")  # code has a font instead
        assert html.unescape(re.sub(r"<[^>]*>", "", typeset(html.escape(without_marks)))) in shown
    assert "<script" not in page
    assert "data:image/svg+xml" in page or "shortest duration" in text  # of a time law alone there is no figure
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report.html", "report.json", "report.txt"]


def test_the_first_line_is_the_result(result):
    first = result.report().splitlines()[0]
    status = json.loads(json.dumps(result._report().to_dict()))["status"]
    assert status.upper() in first
    assert first.startswith(result._headline())


def test_a_report_that_cannot_be_written_leaves_nothing(result, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot be written"):
        result.save_report(tmp_path / "file" / "report.html")


LIFT_FILE = "name: lift\npath: {kind: line, start: [0, 0, 1], end: [0.3, 0.2, 1.3]}\nduration: 3\n"


def test_commands_write_the_page(tmp_path):
    """The same facts as on the terminal; nothing if the file cannot be a page."""
    (tmp_path / "lift.yaml").write_text(LIFT_FILE)
    commands = [
        ("plan", "cogiro", "lift.yaml", "--out", "lift.nc"),
        ("time", "cogiro", "lift.yaml"),
        ("simulate", "cogiro", "lift.nc"),
    ]
    for name, *arguments in commands:
        done = command(name, *arguments, "--report", f"{name}.html", cwd=tmp_path)
        assert f"    {name}.html" in done.stdout
        page = html.unescape((tmp_path / f"{name}.html").read_text())
        assert typeset(done.stdout.partition(": ")[2].partition("\n")[0].partition(", ")[2]) in page
    for name, *arguments in [*commands, ("calibrate", "cogiro", "log.csv"), ("design", "cogiro", "lift.yaml")]:
        refused = command(name, *arguments, "--report", "page.txt", cwd=tmp_path, code=2)
        assert not (tmp_path / "page.txt").exists()
        if name in ("plan", "time", "simulate"):
            assert refused.stderr == "towline: --report must end in .html or .htm, got 'page.txt'\n"
