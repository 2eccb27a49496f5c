"""The benchmarks run, say what they promise, and their references and our answers are right."""

import importlib.util
import json
import os
from pathlib import Path

import numpy as np
import pytest

from towline import Dynamics, TensionProblem
from towline.base.errors import InputError
from towline.benchmarks import design, planning, tension
from towline.benchmarks.qp_solver import multipliers, register, solve_problem
from towline.benchmarks.tension_contenders import REFERENCE, Contender, contenders
from towline.benchmarks.tension_tasks import KINDS, make_task
from towline.cli.bench import results_alone
from towline.solvers import capacity_margin, certify

from . import warm
from .references import optimum_by_enumeration

FOLDER = Path(__file__).parent.parent / "benchmarks" / "cdpr_qpbenchmark"


def module(path):
    """A file that is in no package, as a module."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


@pytest.fixture(scope="module")
def test_set():
    return module(FOLDER / "cdpr_qpbenchmark.py").CdprQpbenchmark()


def test_the_class_is_as_qpbenchmark_wants_it(test_set):
    names = [problem.name for problem in test_set]
    assert names == sorted(names)
    assert {name.rstrip("0123456789") for name in names} == {"STATIC", "TRAJ", "SINGULAR", "DEGEN", "SOFT"}
    assert "towline" in test_set.solvers
    assert test_set.tolerances["high_accuracy"].primal == 1e-9
    assert {tolerance.runtime for tolerance in test_set.tolerances.values()} == {0.01}
    for problem in test_set:
        limits = np.abs(np.r_[problem.lb, problem.ub])
        assert limits[np.isfinite(limits)].max() == 1.0, problem.name
    assert (FOLDER / "data" / "cdpr.parquet").stat().st_size < 150_000


@pytest.mark.parametrize("accuracy", [1e-9, 1e-6])
def test_towline_solves_every_problem_at_its_accuracy(test_set, accuracy):
    """By qpsolvers' own residuals, on all of them: the near-singular ones are there to be failed."""
    missed = [p.name for p in test_set if not solve_problem(p, eps_abs=accuracy).is_optimal(accuracy)]
    assert missed == []


def test_qpbenchmark_runs_it_from_its_own_command_line(tmp_path):
    """A subset, from a copy, so that no result of the repository is touched."""
    copy = tmp_path / "set"
    (copy / "data").mkdir(parents=True)
    (copy / "results").mkdir()
    (copy / "cdpr_qpbenchmark.py").write_bytes((FOLDER / "cdpr_qpbenchmark.py").read_bytes())
    (copy / "data" / "cdpr.parquet").write_bytes((FOLDER / "data" / "cdpr.parquet").read_bytes())
    options = ("--author", "test", "--problem", "STATIC000", "--solver")
    done = warm.run(copy / "cdpr_qpbenchmark.py", "run", *options, "towline", cwd=copy)
    assert done.returncode == 0, done.stderr
    report = (copy / "results" / "cdpr_qpbenchmark.md").read_text()
    assert "## Results by settings" in report
    rows = (copy / "results" / "qpbenchmark_results.csv").read_text().splitlines()
    assert sum(row.startswith("STATIC000,towline,") and ",True," in row for row in rows) == 4


def test_the_data_are_what_the_generator_makes(tmp_path, test_set):
    done = warm.run(FOLDER / "generate" / "generate.py", tmp_path)
    assert done.returncode == 0, done.stderr
    made = module(FOLDER / "cdpr_qpbenchmark.py").CdprQpbenchmark
    for name in ("cdpr.parquet", "cdpr_infeasible.parquet"):
        made.data = FOLDER / "data" / name
        kept = list(made())
        made.data = tmp_path / name
        again = list(made())
        assert [p.name for p in again] == [p.name for p in kept]
        for one, other in zip(kept, again, strict=True):
            for key in ("P", "q", "A", "b", "lb", "ub"):
                np.testing.assert_allclose(getattr(one, key), getattr(other, key), rtol=1e-9, atol=1e-12)


def test_no_infeasible_problem_is_solved():
    made = module(FOLDER / "cdpr_qpbenchmark.py").CdprQpbenchmark
    made.data = FOLDER / "data" / "cdpr_infeasible.parquet"
    for problem in made():
        answer = solve_problem(problem)
        assert not answer.found, problem.name
        assert answer.extras["status"] == "infeasible", problem.name


def test_multipliers_at_a_vertex():
    """Every variable at a limit: nobody is between to determine y, and least squares alone has the signs wrong."""
    rng = np.random.default_rng(3)
    for _ in range(50):
        A = rng.normal(size=(3, 6))
        y = rng.normal(size=3)
        x = np.where(A.T @ y > 0, 0.0, 1.0)
        gradient = x
        z = -(gradient + A.T @ y)  # negative at 0 and positive at 1, or x would not be optimal
        if ((x == 0) & (z > 0) | (x == 1) & (z < 0)).any():
            continue
        y, z = multipliers(gradient, A, A @ x, x, np.zeros(6), np.ones(6))
        assert np.abs(gradient + A.T @ y + z).max() < 1e-9
        assert (z[x == 0] <= 0).all()
        assert (z[x == 1] >= 0).all()


def test_only_what_is_a_tension_problem_is_accepted():
    import qpsolvers

    one = np.ones((1, 2))
    full = np.array([[2.0, 1.0], [1.0, 2.0]])
    with pytest.raises(InputError, match="diagonal P"):
        solve_problem(qpsolvers.Problem(full, np.zeros(2), A=one, b=np.ones(1)))
    register()
    register()
    assert qpsolvers.available_solvers.count("towline") == 1


@pytest.mark.parametrize("kind", KINDS)
def test_tasks_are_what_they_are_called(kind):
    task = make_task(kind, 7, 6)
    ranks = {np.linalg.matrix_rank(p.A, tol=1e-9) for p in task.problems}
    assert ranks == {5 if kind == "rank-deficient" else 6}
    if task.optima is None:
        assert all(certify(p) is not None for p in task.problems)
    elif kind != "soft":
        for p, optimum in zip(task.problems, task.optima, strict=True):
            expected = optimum_by_enumeration(p.A, p.w, p.t_min, p.t_max)
            np.testing.assert_allclose(optimum, expected, atol=1e-8)


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bench")
    options = ["--count", "3", "--repeats", "1", "--m", "8", "--json", "--out", folder]
    done = warm.towline("bench", "tension", *options)
    assert done.returncode == 0, done.stderr
    return folder, json.loads(done.stdout)


def test_what_libraries_print_is_not_among_the_results(capfd):
    with results_alone():
        os.write(1, b"who I am\n")
    print("{}", flush=True)
    assert capfd.readouterr() == ("{}\n", "who I am\n")


def test_bench_prints_what_the_design_says(bench):
    folder, printed = bench
    assert {row["task"] for row in printed["rows"]} == {f"{kind}, m = 8" for kind in KINDS}
    for row in printed["rows"]:
        assert {"task", "contender", "median_us", "p99_us", "ratio", "max_error", "failures"} <= set(row)
        assert row["tolerance"]
        assert 0 < row["median_us"] <= row["p99_us"]
        if row["contender"] == REFERENCE:
            assert row["ratio"] == 1.0
            assert row["failures"] == 0
    assert [Path(name).name for name in printed["files"]] == ["tension.md", "tension.png"]
    assert (folder / "tension.png").read_bytes().startswith(b"\x89PNG")
    assert "| daqp.solve | " in (folder / "tension.md").read_text()


def test_towline_is_right_in_the_bench(bench):
    """Those that promise the optimum of the QP; a closed form may find none where there is one."""
    exact = {f"towline {name}" for name in ("active-set", "qp", "min-norm", "solve_batch")}
    for row in bench[1]["rows"]:
        if row["contender"] in exact:
            assert row["failures"] == 0, row
            assert not row["detail"], row


def test_who_hangs_or_breaks_is_out_and_the_others_go_on():
    import time

    def slow(task):
        return lambda i: time.sleep(0.05)

    def broken(task):
        raise RuntimeError("no licence")

    def wrong(task):
        return lambda i: task.optima[i] + 1e-3

    task = make_task("feasible", 8, 4)
    reference = contenders()[0]
    who = [reference, Contender("slow", "", slow), Contender("broken", "", broken), Contender("wrong", "", wrong)]
    rows = {row.contender: row for row in tension.measure(task, who, repeats=2, limit=0.08)}
    assert rows["slow"].detail.startswith("out after")
    assert rows["slow"].problems == 2
    assert rows["broken"].detail == "RuntimeError: no licence"
    assert rows["wrong"].failures == 4
    assert rows["wrong"].max_error == pytest.approx(1e-3)
    assert rows[REFERENCE].failures == 0
    page = tension.markdown(tension.Report(list(rows.values()), "here", 4, 2))
    assert "| broken (RuntimeError: no licence) | - | - | - | - | 0 of 0 |" in page


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--count", "0"], "count must be a whole number from 1 to 100 000, got 0"),
        (["--repeats", "1000000"], "repeats must be a whole number from 1 to 100 000, got 1000000"),
        (["--m", "8,x"], "--m must be numbers of cables from 1 to 16, separated by commas, got '8,x'"),
        (["--m", "99"], "m must be numbers of cables from 1 to 16, got [99]"),
    ],
)
def test_bench_refuses_in_one_line(arguments, told):
    assert told in warm.towline("bench", "tension", *arguments, code=2).stderr


def test_all_plan_the_same_circle():
    """Everyone's plan passes the audit, and the two by inverse dynamics have the same optimum."""
    runs = planning.measure(8, 1)
    assert list(runs) == ["towline", "CasADi, mapped", "rockit"]
    for name, (run,) in runs.items():
        assert run.first > 0 < run.again, name
        assert all(audit.passed and audit.violation.max() < 1e-9 for audit in run.audits), name
        moved = np.abs(run.audits[0].carriers.pose - run.audits[1].carriers.pose).max()
        assert moved < 1e-5, name
    ours = runs["towline"][0].audits[0]
    theirs = runs["CasADi, mapped"][0].audits[0]
    np.testing.assert_allclose(theirs.carriers.pose, ours.carriers.pose, atol=1e-5)
    np.testing.assert_allclose(theirs.tensions, ours.tensions, atol=1e-4)
    lines = planning.table(runs)
    assert len(lines) == 2 + len(runs)
    assert lines[2].startswith("| towline | ")
    assert lines[2].count(" s | 1.00 | ") == 2
    assert "| passed, " in lines[2]


def test_all_search_the_same_layouts(monkeypatch):
    """The score of the published layout is its smallest capacity margin, and every contender finds a layout in time."""
    monkeypatch.setattr(design, "DRAWS", 200)
    monkeypatch.setattr(design, "AUDITED", 2_000)
    task = design.Task("ipanema-2", 0.2, seed=1)
    robot, variables = task.variables.robot, task.variables
    share = (variables.of_robot() - variables.low) / (variables.high - variables.low)
    places = task.requirements.require[0].places()
    w = Dynamics(robot).required_wrench(robot.home, np.zeros(6), np.zeros(6))
    A = Dynamics(robot).wrench_matrix(places)
    problems = (TensionProblem(each, w, robot.t_min, robot.t_max, length=robot.length) for each in A)
    least = min(capacity_margin(problem).value for problem in problems)
    assert task.score(share) == pytest.approx(least, abs=1e-9)
    assert task.judged(variables.of_robot()) <= least
    assert task.score(task.draws()[0]) >= task.score(task.draws()[-1])
    pytest.importorskip("pymoo")
    pytest.importorskip("cma")
    found = design.measure("ipanema-2", 0.1, 1)
    assert list(found) == ["towline", "pymoo GA", "cma", "cma, drawn"]
    assert all(np.isfinite(each).all() for each in found.values())
    lines = design.table({"ipanema-2": found})
    assert len(lines) == 2 + len(found)
    assert lines[2].endswith("| 1.00 |")
