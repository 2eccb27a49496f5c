"""What a cell or a terminal shows of a result: at most five lines, or a table with a picture, for whatever it holds."""

import ast
import re
from dataclasses import FrozenInstanceError
from importlib import import_module
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import towline
from towline import Dynamics, Planner, TensionProblem, load, plan, simulate, solve, solve_batch, tensions
from towline.base import display
from towline.base.display import picture
from towline.models import pose_from_lengths

from .robots_as_built import as_built

ROOT = Path(__file__).parent.parent
ROOMS = ("models", "solvers", "workspace", "calibration", "control", "simulation", "ocp", "viewer")
SVG = "{http://www.w3.org/2000/svg}"
LIFT = {"name": "lift", "path": {"kind": "line", "start": [0, 0, 1], "end": [0.6, 0.4, 1.6]}, "duration": 3}


@pytest.fixture(scope="module")
def results():
    """Return one result of each kind, by name: large ones, infeasible ones, and some that hold nan."""
    robot = load("ipanema-1")
    found, blocked = plan(robot, LIFT), plan(robot, LIFT | {"duration": 0.2})
    lengths = Dynamics(robot).cable_lengths(robot.home)
    away = tensions(robot, robot.home + np.eye(6)[0] * 9)
    many = [np.repeat(part[None], 5000, axis=0) for part in (away.problem.A, away.problem.w)]
    short, quick = simulate(robot, found, duration=0.2), towline.time_along(robot, LIFT)
    broken = simulate(robot, found, duration=0.2)
    broken.record.tensions[3:] = broken.record.motions[3:] = np.nan
    measurements = as_built(40, 0).measurements()
    unlimited = solve(TensionProblem(np.eye(3), np.ones(3), -np.inf, np.inf))
    return {
        "Robot": robot,
        "planar Robot": load("cogiro"),
        "Dynamics": Dynamics(robot),
        "Planner": Planner(robot, LIFT),
        "Task": found.scenario.task,
        "Plan": found,
        "infeasible Plan": blocked,
        "Simulation": short,
        "Simulation with nan": broken,
        "Plan of time_along": quick,
        "blocked time_along": towline.time_along(robot, LIFT | {"path": LIFT["path"] | {"end": [9, 0, 0]}}),
        "Sweep": towline.sweep(robot, LIFT, {"duration": [0.2, 3]}),
        "TensionSolution": tensions(robot, robot.home),
        "infeasible TensionSolution": away,
        "unlimited TensionSolution": unlimited,
        "TensionProblem": away.problem,
        "Certificate": away.certificate,
        "BatchSolution": solve_batch(*many, away.problem.t_min, away.problem.t_max),
        "PoseEstimate": pose_from_lengths(robot, lengths),
        "PoseEstimates": pose_from_lengths(robot, np.repeat(lengths[None], 50, axis=0)),
        "Measurements": measurements,
        "Calibration": towline.calibrate("cogiro", measurements),
        "reference": short.references[0],
    }


def held(value, depth=3):
    """Yield an object of towline and those that its public attributes hold, some levels down."""
    yield value
    names = [name for name in dir(value) if not name.startswith("_")] if depth else []
    for name in names:
        if name in ("held_out", "refused", "relaxations", "relaxed", "robot", "parametrised", "warnings"):
            continue  # which are computed for seconds, or are among the results
        try:
            part = getattr(value, name, None)
        except towline.TowlineError:
            continue
        if type(part).__module__.startswith("towline") and not callable(part):
            yield from held(part, depth - 1)


def test_every_record_has_a_short_form():
    """A dataclass of a package is `Displayed`; a public named tuple of arrays is a `record`."""
    texts = [path.read_text() for room in ROOMS for path in (*(ROOT / room).rglob("*.py"), *ROOT.glob(f"{room}.py"))]
    trees = [ast.parse(text) for text in texts if "@dataclass" in text]
    parsed = [node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    bases = {node.name: {ast.unparse(base) for base in node.bases} for node in parsed}
    records = [node for node in parsed if "dataclass" in " ".join(map(ast.unparse, node.decorator_list))]
    assert len(records) > 50
    for node in records:
        above = bases[node.name].union(*(bases.get(base, ()) for base in bases[node.name]))
        assert node.name.startswith("_") or "Displayed" in above, node.name
    rooms = [import_module(f"towline.{room}") for room in ROOMS]
    for kind in [getattr(room, name) for room in rooms for name in getattr(room, "__all__", ())]:
        if hasattr(kind, "_fields") and re.search("Array|ndarray", str(kind.__annotations__)):
            assert kind.__repr__ is display.record, kind


def test_at_most_five_lines(results):
    for name, result in results.items():
        for part in held(result):
            text = repr(part)
            assert len(text.splitlines()) <= 5, (name, type(part), text)
            assert max(map(len, text.splitlines())) <= display.WIDTH, (name, type(part), text)


def test_a_table_of_at_most_20_rows_with_one_picture(results):
    """It is well-formed, and has the facts of the text."""
    for name, result in results.items():
        if name == "reference":
            continue
        page = ElementTree.fromstring(f"<div>{result._repr_html_()}</div>")
        rows = {row[0].text: row[1].text for row in page.iter("tr")}
        assert 1 <= len(rows) <= 20, name
        pictures = list(page.iter(f"{SVG}svg"))
        drawn = name.endswith(("Robot", "Plan", "time_along", "Simulation", "nan", "TensionSolution", "Calibration"))
        assert len(pictures) == drawn, name
        assert page.find("p/strong").text.startswith(repr(result).splitlines()[0][:100]), name
        first = re.match(r"  (.+?): ", repr(result).splitlines()[1])
        assert first is not None, name
        assert first[1] in rows, name


def test_headlines_state_the_result(results):
    """With numbers from a second source."""
    of = {name: repr(result).splitlines()[0] for name, result in results.items()}
    assert "FEASIBLE" in of["Plan"]
    certificate = results["infeasible Plan"].certificate
    assert f"INFEASIBLE, {certificate.shortfall:.0f} N short of the required wrench" in of["infeasible Plan"]
    assert "PASSED" in of["Simulation"]
    assert "FAILED" in of["Simulation with nan"]
    assert of["BatchSolution"] == "5000 problems: 5000 infeasible"
    problem, proof = results["TensionProblem"], results["Certificate"]
    reach = sum(max(d * low, d * high) for d, low, high in zip(
        proof.direction @ problem.A, problem.t_min, problem.t_max, strict=True))  # fmt: skip
    assert f"short by {proof.direction @ problem.w - reach:.4g} N" in of["infeasible TensionSolution"]
    assert of["Sweep"] == "ipanema-1, lift: 1 of 2 plans feasible, 1 infeasible"


def test_results_cannot_be_changed(results):
    """Neither what was computed, nor a name that is not there."""
    for name in ("Plan", "Simulation", "Calibration", "TensionSolution"):
        for attribute in ("report", "robot", "warnings", "typo"):
            with pytest.raises((FrozenInstanceError, AttributeError, TypeError)):
                setattr(results[name], attribute, 1)


def test_a_half_made_result_is_displayed():
    """As a debugger meets it: nothing in it can be computed."""
    for kind in (towline.Plan, towline.Simulation, towline.TensionSolution, towline.Calibration):
        empty = object.__new__(kind)
        assert repr(empty) == kind.__name__
        assert empty._repr_html_() == f"<p><strong>{kind.__name__}</strong></p><table></table>"


def test_names_are_escaped():
    robot = load("cogiro").model_copy(update={"source": "<script>alert(1)</script>"})
    assert "<script>" not in robot._repr_html_()


def paths(svg):
    """Return the points of each curve, (n, 2) [px] with y downwards, and its colour."""
    drawn = ElementTree.fromstring(svg).iter(f"{SVG}path")
    return [(np.array(re.findall(r"[\d.]+", path.get("d")), dtype=float), path.get("stroke")) for path in drawn]


def test_a_picture_has_the_shape_of_its_numbers():
    """Its points are an affine map of the numbers, upwards, with one scale where that is asked for."""
    x, y = np.array([0.0, 1.0, 4.0]), np.array([0.0, 3.0, 1.0])
    for equal in (False, True):
        ((points, colour),) = paths(picture([(x, y, display.BLUE)], equal=equal))
        points = points.reshape(-1, 2)
        across, up = np.polyfit(x, points[:, 0], 1), np.polyfit(y, points[:, 1], 1)
        assert np.allclose(np.polyval(across, x), points[:, 0], atol=0.06)
        assert np.allclose(np.polyval(up, y), points[:, 1], atol=0.06)
        assert across[0] > 0 > up[0]
        assert colour == display.BLUE
        assert np.isclose(across[0], -up[0], rtol=0.01) == equal


def test_a_long_curve_keeps_its_peak_and_its_gaps():
    x = np.linspace(0, 1, 100_000)
    y = np.zeros(100_000)
    y[54_321], y[70_000:80_000] = 7.0, np.nan
    svg = picture([(x, y, display.BLUE)])
    ((points, _),) = paths(svg)
    assert len(points) < 1000
    assert len(set(points[1::2])) == 2  # the line and its peak
    assert svg.count("M", svg.index("<path")) == 2
    assert picture([(x, np.full_like(x, np.nan), display.BLUE)]) == ""
