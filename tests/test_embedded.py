"""The exported control step compiles everywhere, answers as Python does, and answers whatever it gets."""

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

import towline
from towline import Robot, available, load, solve_batch
from towline.export.step.export import costs, mechanics, moving_carriers, step_files
from towline.models import Dynamics
from towline.models.tape_c import operations
from towline.solvers.solution import STATUSES

from .soak import step as benchmark
from .soak.step import robot_named
from .soak.step_code import FLAGS, States, StepCode
from .soak.step_states import random_states
from .steps import deepest, line, measure_size, required, target

OPTIMAL, INFEASIBLE, SINGULAR, INACCURATE, INVALID = range(5)
ROBOTS = ["wang-flying", "cogiro", "ipanema-2", "wang-ctmrts-6", "planar-4", "caroca-pulleys", "twelve"]
ARM = ("-mcpu=cortex-m7", "-mthumb", "-mfpu=fpv5-d16", "-mfloat-abi=hard")


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """Return the folders of the steps of all robots."""
    folder = tmp_path_factory.mktemp("steps")
    return [towline.export_step(name, folder / name) for name in available()]


@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize("compiler", ["gcc", "clang", "aarch64-linux-gnu-gcc", "arm-none-eabi-gcc"])
def test_no_compiler_has_a_warning(exported, compiler, real):
    """The first has all robots once; they differ in numbers, and the others have some of them."""
    required(compiler)
    folders = exported[:: 1 if (compiler, real) == ("gcc", "double") else 4 if compiler in ("gcc", "clang") else 8]
    sources = [folder / "towline_step.c" for folder in folders] + [exported[-1] / "main.c"]
    extra = [*(ARM if compiler.startswith("arm") else ()), *(["-DTOWLINE_FLOAT"] if real == "float" else [])]
    subprocess.run([compiler, *FLAGS, "-Wdouble-promotion", *extra, "-fsyntax-only", *sources], check=True)


def test_a_robot_with_any_source_compiles(tmp_path):
    """Its text cannot end the comment in which it stands."""
    required("cc")
    robot = load("planar-4").model_copy(
        update={
            "source": "*/ int x; /* ??/ \\\n \\ \N{GREEK SMALL LETTER ALPHA} @name@ \u202e\u2066 \x1b[31m \x00 \u200b"
        }
    )
    folder = towline.export_step(robot, tmp_path / "step")
    texts = [(folder / name).read_text(encoding="utf-8") for name in ("towline_step.c", "towline_step.h", "README.md")]
    assert all(char.isprintable() or char in "\n\t" for text in texts for char in text)
    assert any("U+202EU+2066 U+001B[31m U+0000" in " ".join(text.split()) for text in texts)
    subprocess.run(["cc", *FLAGS, "-fsyntax-only", folder / "towline_step.c"], check=True)


@pytest.mark.parametrize("real", ["double", "float"])
def test_it_needs_only_sines_and_roots_and_has_no_state(exported, real, tmp_path):
    """The optimised build has no warnings either: compilers give some only then."""
    required("cc", "nm")
    suffix, options = ("f", ["-DTOWLINE_FLOAT"]) if real == "float" else ("", [])
    folder = next(path for path in exported if path.name == "wang-flying")
    command = ["cc", *FLAGS, "-O2", *options, "-c", folder / "towline_step.c", "-o", tmp_path / "step.o"]
    subprocess.run(command, check=True)
    lines = subprocess.check_output(["nm", tmp_path / "step.o"], text=True).splitlines()
    symbols = [line.split()[-2:] for line in lines]
    called = {name for kind, name in symbols if kind == "U"}
    functions = {f"{name}{suffix}" for name in ("sin", "cos", "sincos", "sqrt")}
    assert called <= {*functions, "memcpy", "memset", "memmove", "_GLOBAL_OFFSET_TABLE_"}
    assert not [name for kind, name in symbols if kind in "DdBbCc"]
    assert {name for kind, name in symbols if kind == "T"} == {
        *("towline_start", "towline_carriers_home", "towline_computed_torque", "towline_step", "towline_status_name")
    }


@pytest.fixture(scope="module")
def code(tmp_path_factory):
    """Return a function from the name of a robot and a precision to its compiled step.

    Without optimisation the bits are the same, in less than half of the time; `test_embedded_program` has what a user
    builds.
    """
    required("cc")
    kept = {}

    def compiled(name, real="double"):
        if (name, real) not in kept:
            kept[name, real] = StepCode(robot_named(name), real, tmp_path_factory.mktemp("code"), flags=("-O0",))
        return kept[name, real]

    return compiled


def check_certificates(robot, A, w, steps):
    """Check each certificate from its definition: no tensions inside the limits reach w along the direction."""
    rows = np.isin(steps.status, (INFEASIBLE, SINGULAR))
    pull = np.einsum("ni,nij->nj", steps.direction[rows], A[rows])
    reach = np.maximum(pull * robot.t_min, pull * robot.t_max).sum(axis=1)
    demand = np.einsum("ni,ni->n", steps.direction[rows], w[rows])
    assert (demand > reach).all()
    assert (steps.direction[~rows] == 0.0).all()
    assert (steps.numbers[~rows, 1:] == 0.0).all()
    return demand - reach, rows


@pytest.mark.parametrize("name", ROBOTS)
def test_steps_are_those_of_python(code, name):
    robot = robot_named(name)
    states = random_states(robot, 900, seed=5)
    steps = code(name).run(states.rows(robot))
    A, w = states.problems(Dynamics(robot))
    batch = solve_batch(A, w, robot.t_min, robot.t_max, length=robot.length)
    sure = steps.status != INACCURATE
    assert np.mean(sure) > 0.995
    assert np.array_equal(steps.status[sure], batch.code[sure])
    assert {OPTIMAL, INVALID} <= set(steps.status.tolist())
    both = sure & (batch.code == OPTIMAL)
    error = np.abs(steps.tensions - batch.tensions)[both].max(axis=1) / robot.t_max.max()
    assert np.median(error) < 1e-14
    assert error.max() < 1e-10  # singular values down to 1e-5 are in some of the states
    shortfall, rows = check_certificates(robot, A, w, steps)
    np.testing.assert_allclose(steps.numbers[rows, 2], shortfall, rtol=1e-6, atol=1e-9 * robot.t_max.max())
    assert ((steps.tensions >= robot.t_min) & (steps.tensions <= robot.t_max)).all()
    assert (steps.counts[:, 0] <= 10 * (2 * robot.m + 6) + 40).all()


@pytest.mark.parametrize("name", ["wang-flying", "cogiro", "wang-ctmrts-6", "twelve"])
def test_float_calls_nothing_optimal_that_is_infeasible(code, name):
    robot = robot_named(name)
    states = random_states(robot, 1800, seed=6, single=True)
    steps = code(name, "float").run(states.rows(robot))
    A, w = states.problems(Dynamics(robot))
    batch = solve_batch(A, w, robot.t_min, robot.t_max, length=robot.length)
    optimal = steps.status == OPTIMAL
    assert optimal.sum() > 100
    assert (batch.code[optimal] == OPTIMAL).all()
    assert np.abs(steps.tensions - batch.tensions)[optimal].max() < 1e-4 * robot.t_max.max()
    check_certificates(robot, A, w, steps)
    assert np.isfinite(steps.tensions).all()


def test_in_free_fall_float_proves_only_what_holds(code):
    """Only rounding of weight and inertia is left of the required wrench there, and its direction has no meaning."""
    robot = load("wang-ctmrts-6")
    dynamics = Dynamics(robot)
    states = random_states(robot, 4500, seed=14, single=True)
    near = states.select(np.arange(4500) % 9 < 4)  # KINDS[:4]: near home
    slack = np.zeros((2000, robot.m))
    falling = dynamics.acceleration(near.pose, near.velocity, slack, near.carrier_pose)
    falling = np.asarray(falling).astype(np.float32).astype(float)
    states = near._replace(acceleration=falling, disturbance=np.zeros((2000, 6)))
    steps = code("wang-ctmrts-6", "float").run(states.rows(robot))
    A, w = states.problems(dynamics)
    assert np.median(np.linalg.norm(w, axis=1)) < 1e-4
    check_certificates(robot, A, w, steps)
    assert not (steps.status == INVALID).any()


def test_the_soft_answer_misses_the_wrench_by_least(code):
    """No tensions inside the limits come nearer, by bounded least squares of scipy."""
    from scipy.optimize import lsq_linear

    robot = load("cogiro")
    states = random_states(robot, 180, seed=7)
    steps = code("cogiro").run(states.rows(robot))
    A, w = states.problems(Dynamics(robot))
    S = robot.wrench_scale
    for row in np.flatnonzero(steps.status == INFEASIBLE)[:20]:
        best = lsq_linear(S[:, None] * A[row], S * w[row], (robot.t_min, robot.t_max), method="bvls", tol=1e-14)
        least = np.linalg.norm(S * (A[row] @ best.x - w[row]))
        assert steps.numbers[row, 0] == pytest.approx(least, rel=1e-5)


@pytest.mark.parametrize("name", ["wang-flying", "caroca-pulleys"])
def test_operations_are_those_of_the_code(name):
    """Counted in the C text itself: one operation a line, of known spelling."""
    robot = load(name)
    text = step_files(robot)["towline_step.c"]
    body = text[text.index("static void mechanics(") : text.index("/* ---- The step. ---- */")]
    counts = operations(mechanics(robot))
    assert body.count("MATH(sin)") == counts["SIN"]
    assert body.count("MATH(sqrt)") == counts["SQRT"]
    lines = [text.split(" = ")[1] for text in body.splitlines() if " = v" in text or " = 2 * v" in text]
    assert sum(" * " in text for text in lines) == counts["MUL"] + counts["SQ"] + counts["TWICE"]
    assert sum(bool(re.search(r" [+-] ", text)) for text in lines) == counts["ADD"] + counts["SUB"]
    header = step_files(robot)["towline_step.h"]
    total = counts.total() - counts["SIN"] - counts["COS"]
    assert re.search(rf"mechanics +{total}, and {counts['SIN'] + counts['COS']} sines and cosines", header)


@pytest.mark.parametrize("name", ["wang-flying", "twelve"])
def test_no_step_has_more_operations_than_the_bounds(tmp_path, name):
    """Each operation is counted, by the step compiled as C++ with numbers that count."""
    required("g++")
    robot = robot_named(name)
    for file, text in step_files(robot).items():
        (tmp_path / file).write_text(text.replace("typedef double towline_real;", ""))
    source = Path(__file__).parent / "counted_step.cpp"
    subprocess.run(["g++", "-std=c++17", "-O0", f"-I{tmp_path}", source, "-o", tmp_path / "counted"], check=True)
    text = "".join(line(row) for row in random_states(robot, 900, seed=13).rows(robot))
    printed = subprocess.run([tmp_path / "counted"], input=text, capture_output=True, text=True, check=True).stdout
    status, steps, inner, counts = np.array([row.split() for row in printed.splitlines()], int).T
    assert status.size == 900
    counted = operations(mechanics(robot))
    sines = counted["SIN"] + counted["COS"]
    bounds = costs(robot.m, len(robot.platform.dof), counted.total() - sines, sines)
    optimal = status == OPTIMAL
    assert (counts[optimal & (steps == 0)] <= bounds.free).all()
    most = bounds.free + steps * bounds.outer + inner * bounds.inner
    assert (counts[optimal] <= most[optimal]).all()
    assert (counts[optimal] > bounds.free / 2).all()  # the bound is not far from what there is
    soft = ~optimal & (status != INVALID)
    most = bounds.soft_free + steps * bounds.soft_outer + inner * bounds.soft_inner
    assert (counts[soft] <= most[soft]).all()
    assert counts.max() <= bounds.most


def test_mechanics_take_only_carriers_that_move():
    assert moving_carriers(load("cogiro")) == []
    assert moving_carriers(load("wang-ctmrts-6")) == list(range(6))
    robot = Robot.model_validate(
        load("multi-quadrotor-3").model_dump()
        | {"carriers": [*load("multi-quadrotor-3").model_dump()["carriers"][:2], {"name": "pole", "kind": "ground"}]}
        | {
            "cables": [
                *load("multi-quadrotor-3").model_dump()["cables"][:2],
                load("multi-quadrotor-3").model_dump()["cables"][2] | {"carrier": "pole", "anchor": [2.0, 1.0, 3.0]},
            ]
        }
    )
    assert moving_carriers(robot) == [0, 1]
    state = States(*(np.zeros((1, 6)) for _ in range(3)), robot.carrier_home[None], None, np.zeros((1, 6)))
    A, w = mechanics(robot)(state.pose[0], state.velocity[0], np.ones(6), robot.carrier_home[:2], np.zeros(6))
    np.testing.assert_allclose(A, Dynamics(robot).wrench_matrix(np.zeros(6)), atol=1e-15)
    np.testing.assert_allclose(
        np.array(w).ravel(), Dynamics(robot).required_wrench(np.zeros(6), np.zeros(6), np.ones(6))
    )


def test_the_benchmark_reports_what_is_wrong(code):
    """Steps are altered one by one, and each alteration is counted in its place."""
    robot = load("cogiro")
    states = random_states(robot, 180, seed=12)
    A, w = states.problems(Dynamics(robot))
    steps = code("cogiro").run(states.rows(robot))
    row = benchmark.compare(robot, A, w, steps)
    assert row.passed
    assert row.steps == 180
    assert row.certificates == np.isin(steps.status, (INFEASIBLE, SINGULAR)).sum()
    one = np.flatnonzero(steps.status == INFEASIBLE)[0]
    other = np.flatnonzero(steps.status == OPTIMAL)[0]
    cases = (("status", one, OPTIMAL, "wrongly_optimal"), ("status", one, SINGULAR, "others"))
    cases += (("status", other, INACCURATE, "unsure"), ("direction", one, 0.0, "unproven"))
    cases += (("tensions", other, np.nan, "outside"), ("tensions", other, robot.t_max, "above"))
    for field, index, value, count in cases:
        altered = steps._replace(**{field: getattr(steps, field).copy()})
        getattr(altered, field)[index] = value
        assert getattr(benchmark.compare(robot, A, w, altered), count) == 1, count
    single = steps._replace(status=np.where(steps.status == INFEASIBLE, SINGULAR, steps.status))
    assert benchmark.compare(robot, A, w, single, single=True).others == 0


def test_the_deepest_stack_is_that_of_the_longest_calls():
    graph = """
    node: { title: "a.c:top" label: "top\\na.c:1:1\\n100 bytes (static)" }
    node: { title: "a.c:wide" label: "wide\\na.c:2:1\\n50 bytes (static)" }
    node: { title: "a.c:long" label: "long\\na.c:3:1\\n20 bytes (static)" }
    node: { title: "a.c:leaf" label: "leaf\\na.c:4:1\\n40 bytes (static)" }
    node: { title: "sqrt" label: "sqrt\\nmath.h:1:1" shape : ellipse }
    edge: { sourcename: "a.c:top" targetname: "a.c:wide" label: "a.c:5:5" }
    edge: { sourcename: "a.c:top" targetname: "a.c:long" label: "a.c:6:5" }
    edge: { sourcename: "a.c:long" targetname: "a.c:leaf" label: "a.c:7:5" }
    edge: { sourcename: "a.c:leaf" targetname: "sqrt" }
    """
    assert deepest(graph, "top") == 160


def test_code_and_stack_are_small(tmp_path):
    """On a Cortex-M7 where there is its compiler: 25 kB of code, and 6 kB of stack for twelve cables."""
    required("gcc")
    if "Free Software Foundation" not in subprocess.check_output(["gcc", "--version"], text=True):
        pytest.skip("gcc is another compiler here, which does not report the stack")
    size = measure_size(robot_named("twelve"), "double", tmp_path, target())
    assert size.text < 25_000
    assert 2_000 < size.stack <= 6 * 1024


def test_statuses_have_the_words_of_python(exported):
    text = (exported[0] / "towline_step.c").read_text()
    words = re.findall(r'return "(\w+)";', text)
    assert words == [STATUSES[code].value for code in range(5)]


def test_the_example_of_the_docs_compiles(exported, tmp_path):
    required("cc")
    page = (Path(__file__).parent.parent / "docs" / "howto" / "control-step.md").read_text()
    (tmp_path / "control.c").write_text(page.split('```c title="control.c"\n')[1].split("```")[0])
    for folder in exported:
        subprocess.run(["cc", *FLAGS[:5], f"-I{folder}", "-fsyntax-only", tmp_path / "control.c"], check=True)
