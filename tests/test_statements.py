"""Statements of the documentation about the program that were wrong once, each checked against the program."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from towline import load, plan, solve, tensions
from towline.cli.main import app
from towline.models import Dynamics
from towline.solvers import methods
from towline.statics.distribution import pose_problem

ROOT = Path(__file__).parents[1]
LINE = {"kind": "line", "start": [0, 0, -1], "end": [0.1, 0, -1]}
INSIDE = {"kind": "sphere", "centre": LINE["end"], "radius": 0.3}
CIRCLE = {"kind": "circle", "centre": [0, 0, -1], "radius": 0.5, "rate": 0.6}  # of the README
FREE = {"tube": {"position": "free"}, "base": {"kind": "free"}}


def page(name):
    return " ".join((ROOT / name).read_text(encoding="utf-8").split())


@pytest.fixture(scope="module")
def crane(tmp_path_factory):
    """Return the robot file of the how-to."""
    text = (ROOT / "docs/howto/robot-file.md").read_text(encoding="utf-8")
    file = tmp_path_factory.mktemp("crane") / "my-crane.yaml"
    file.write_text(re.search(r'```yaml title="my-crane.yaml"\n(.*?)```', text, re.DOTALL)[1], encoding="utf-8")
    return file


@pytest.mark.parametrize(
    ("task", "status", "dense"),
    [
        ({"path": LINE, "duration": 2, "base": FREE["base"]}, "feasible", True),
        ({"path": LINE, "duration": 0.05}, "infeasible", True),
        ({"path": LINE, "duration": 2, **FREE, "limits": {"keep_out": [INSIDE]}}, "infeasible", False),
    ],
    ids=["planned", "fixed", "blocked"],
)
def test_planned_motions_are_audited_every_millisecond_and_blocked_tasks_shown_at_the_output_rate(task, status, dense):
    found = plan("wang-flying", task)
    assert found.status == status
    steps = np.diff(found.audit.times)
    if dense:
        assert steps.max() < 1.001e-3
        assert len(steps) >= 200
    else:
        assert steps == pytest.approx(1 / 100)


def test_infeasible_plans_have_a_certificate_or_a_limit_that_is_exceeded():
    """A free tube does not make a task "not-found" where its goal is inside an obstacle, and that has no direction."""
    fixed = plan("wang-flying", {"path": CIRCLE})
    assert fixed.status == "infeasible"
    assert fixed.certificate is not None
    limits = {"keep_out": [INSIDE]}
    blocked = plan("wang-flying", {"path": LINE, "duration": {"min": 1, "max": 4}, **FREE, "limits": limits})
    assert blocked.status == "infeasible"
    assert blocked.certificate is None
    assert blocked.audit.excess[0].about == "platform outside obstacle"


def test_six_cables_leave_no_choice_and_with_more_the_default_has_the_smallest_norm():
    robot = load("wang-flying")
    problem = pose_problem(Dynamics(robot), [0, 0, -1, 0, 0, 0])
    assert np.linalg.matrix_rank(problem.A) == robot.m == 6
    crane = load("cogiro")
    problem = pose_problem(Dynamics(crane), crane.home)
    norms = {name: np.linalg.norm(solve(problem, method=name).tensions) for name in methods()}
    assert norms["active-set"] <= min(norms.values()) * (1 + 1e-6)
    assert max(norms.values()) > 1.1 * norms["active-set"]


def test_the_circle_of_the_readme_is_feasible_below_a_quadrotor_with_mass_and_thrust_limits_too():
    task = {"path": CIRCLE, "base": {"kind": "free", "acceleration_max": 3.0, "ends": "periodic"}}
    (carrier,) = load("wang-flying-quadrotor").carriers
    assert (carrier.kind, carrier.mass > 0, np.isfinite(carrier.thrust_max)) == ("quadrotor", True, True)
    assert load("wang-flying").carriers[0].kind == "prescribed"
    assert plan("wang-flying-quadrotor", task).feasible


def test_certificates_number_cables_from_1_in_text_and_from_0_as_data():
    certificate = tensions(load("wang-flying"), [0.5, 0, -1, 0, 0, 0]).certificate
    assert certificate.to_dict()["at_min"]
    cables = ", ".join(str(cable + 1) for cable in certificate.to_dict()["at_min"])
    assert f"t_min of cables {cables}" in certificate.describe()


def test_the_exit_code_of_tension_is_that_of_its_method(crane):
    command = ["tension", str(crane), "--pose", "-0.519 0.5811 1.5663 0 0 0"]
    for method, code in (("active-set", 0), ("closed-form", 1)):
        done = CliRunner().invoke(app, [*command, "--method", method, "--json"])
        assert (done.exit_code, json.loads(done.stdout)["certificate"]) == (code, None)
    times = re.findall(r" (\S+) us$", CliRunner().invoke(app, command).stdout, re.MULTILINE)
    assert len(times) == len(methods())
    assert min(map(float, times)) > 0  # the default method took "0.00 ms"


def test_the_page_has_the_ratios_of_the_benchmark():
    text = (ROOT / "docs/benchmarks.md").read_text(encoding="utf-8")
    table = text.split("| | computed torque | bandwidth 40, observer 60 | predictive |")[1].split("\n\n")[0]
    ratios = [[float(cell.split(", ")[1]) for cell in row.split("|")[3:5]] for row in table.splitlines()[2:]]
    gusts, team = np.array(ratios[:-1]), ratios[-1]
    stated = re.search(r"`Predictive` has (\d+) to (\d+) % of the error", page("docs/simulation.md"))
    assert [float(end) / 100 for end in stated.groups()] == [gusts[:, 1].min(), gusts[:, 1].max()]
    assert (gusts[:, 0] < gusts[:, 1]).all()
    assert team[1] < 1 < team[0]


def test_an_installed_towline_takes_extras_by_its_name():
    """As messages advise: `pip install 'towline[timing]'` needs no index for towline itself."""
    command = [sys.executable, "-m", "pip", "install", "--dry-run", "--no-index", "--no-deps", "towline[timing]"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if "No module named pip" in done.stderr:
        pytest.skip("there is no pip here")
    assert (done.returncode, "already satisfied: towline[timing]" in done.stdout) == (0, True), done.stderr


def test_lists_of_pages_and_notebooks_are_complete():
    navigation = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    pages = {path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*.md")}
    assert {name for name in pages if f": {name}\n" not in navigation} == set()
    last = json.loads((ROOT / "notebooks/01_quickstart.ipynb").read_text(encoding="utf-8"))["cells"][-1]
    numbers = {path.name[:2] for path in (ROOT / "notebooks").glob("*.ipynb")}
    assert numbers - {"01"} == set(re.findall(r"\((\d\d)\)", "".join(last["source"])))
