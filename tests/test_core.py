"""The C core answers as Python does, proves what it answers, and in float never calls an infeasible problem optimal."""

import ctypes
import re
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from towline import Dynamics, core as extension, load
from towline.base import tolerances
from towline.solvers import TensionProblem, certify, solve
from towline.solvers.solution import STATUSES, UNSURE

from .references import linear_program_status, optimality_error, support_value
from .soak.exactness import awkward_problem

CORE = Path(__file__).parent.parent / "core" / "distribution"
SOURCES = sorted(CORE.glob("*.c"))
FLAGS = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-Wdouble-promotion", "-O0"]
OPTIMAL, INFEASIBLE, SINGULAR, INACCURATE, INVALID = range(5)
SHAPES = [(1, 3), (2, 4), (3, 3), (3, 7), (6, 3), (6, 6), (6, 7), (6, 8), (6, 10), (6, 12), (6, 16)]


def rows_solver(library, real):
    """Return a function that solves rows: arrays with the rows in front, to a namespace of arrays."""
    solve_rows = ctypes.CDLL(str(library)).solve_rows
    solve_rows.restype = None
    number = ctypes.c_float if real is np.float32 else ctypes.c_double

    def run(A, w, t_min, t_max, t_ref, weights, length, rho=0.0):
        given = [np.ascontiguousarray(array, real) for array in (A, w, t_min, t_max, t_ref, weights, length)]
        count, n, m = given[0].shape
        counts = [np.empty(count, np.intc) for _ in range(3)]
        answers = [np.full((count, size), np.nan, real) for size in (m, n, 3)]
        pointers = [ctypes.c_void_p(array.ctypes.data) for array in (*given, *counts, *answers)]
        solve_rows(count, n, m, *pointers[:7], number(rho), *pointers[7:])
        names = ("status", "steps", "inner", "t", "direction", "numbers")
        return SimpleNamespace(**dict(zip(names, (*counts, *answers), strict=True)))

    return run


@pytest.fixture(scope="module")
def core(tmp_path_factory):
    """Return the core in double and in float."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("there is no C compiler: no command cc")
    folder = tmp_path_factory.mktemp("core")
    sources = [*map(str, SOURCES), str(Path(__file__).parent / "core_rows.c")]
    solvers = {}
    for real, precision in ((np.float64, []), (np.float32, ["-DTOWLINE_FLOAT"])):
        library = folder / f"{real.__name__}.so"
        command = [compiler, *FLAGS, *precision, f"-I{CORE}", "-fPIC", "-shared", *sources, "-lm", "-o", str(library)]
        subprocess.run(command, check=True)
        solvers[real] = rows_solver(library, real)
    return solvers


def problems_of(arrays):
    return [TensionProblem(*row[:-1], length=float(row[-1])) for row in zip(*arrays, strict=True)]


def awkward(n, m, count=60):
    rows = [awkward_problem(seed, m, n) for seed in range(count)]
    return [*(np.array(column) for column in zip(*rows, strict=True)), np.ones(count)]


def states(name, count, seed=0):
    """Return random states of a robot: wrench matrices, and wrenches of tensions inside, at or beyond the limits."""
    rng = np.random.default_rng(seed)
    robot = load(name)
    dynamics, m, mask = Dynamics(robot), len(robot.cables), robot.dof_mask
    anchors = np.array([cable.anchor for cable in robot.cables])
    pose = np.zeros((count, 6))
    pose[:, :3] = anchors.mean(axis=0) + rng.uniform(-0.3, 0.3, (count, 3)) * np.ptp(anchors, axis=0).max()
    pose[:, 2] -= 0.4 * np.ptp(anchors, axis=0).max()
    pose[:, 3:] = rng.normal(size=(count, 3)) * 0.2
    A = np.asarray(dynamics.wrench_matrix(pose)) * mask[:, None]
    low, high = (np.tile(limit, (count, 1)) for limit in (robot.t_min, robot.t_max))
    high = np.minimum(high, 1e3)
    t = np.clip(rng.uniform(low - 0.2 * high, 1.2 * high), low, high)
    w = np.einsum("rij,rj->ri", A, t) * rng.choice([0.5, 1.0, 1.0, 1.5], (count, 1))
    w = np.where(rng.random((count, 1)) < 0.2, w + rng.normal(size=(count, 6)) * mask, w)
    return [A, w, low, high, np.zeros((count, m)), np.ones((count, m)), np.full(count, robot.length)]


def check_certificate(problem, direction, support, shortfall):
    """Check a certificate from the definition: along the direction no tensions inside the limits reach w."""
    reach = support_value(problem.A, direction, problem.t_min, problem.t_max)
    size = 1e-9 * (np.linalg.norm(problem.scaled_w) + abs(reach))
    assert direction @ problem.w > reach
    assert support == pytest.approx(reach, abs=size)
    assert shortfall == pytest.approx(direction @ problem.w - reach, abs=size)


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("precision", [[], ["-DTOWLINE_FLOAT"]])
def test_no_compiler_has_a_warning(compiler, precision):
    if shutil.which(compiler) is None:
        pytest.skip(f"there is no {compiler}")
    subprocess.run([compiler, *FLAGS, *precision, f"-I{CORE}", "-fsyntax-only", *map(str, SOURCES)], check=True)


def test_it_needs_nothing_but_roots_and_has_no_state(tmp_path):
    """Its symbols show it: no allocation among what it calls, no variables among what it has."""
    compiler, nm = shutil.which("cc"), shutil.which("nm")
    if compiler is None or nm is None:
        pytest.skip("there is no cc or no nm")
    subprocess.run([compiler, "-std=c99", f"-I{CORE}", "-c", *map(str, SOURCES)], check=True, cwd=tmp_path)
    objects = [str(path) for path in tmp_path.glob("*.o")]
    lines = subprocess.check_output([nm, *objects], text=True).splitlines()
    symbols = [line.split()[-2:] for line in lines if " " in line]
    own = {name for kind, name in symbols if kind in "Tt"}
    called = {name for kind, name in symbols if kind == "U"}
    assert called - own <= {"sqrt", "memcpy", "memset", "memmove", "_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail"}
    assert not {name for kind, name in symbols if kind in "DdBbCc"}


def test_both_languages_judge_by_the_same_numbers():
    source = (CORE / "tolerances.h").read_text().split("#else")[0]
    numbers = {name: float(value) for name, value in re.findall(r"#define (\w+) ([\d.e-]+)", source)}
    shared = [name for name in numbers if hasattr(tolerances, name)]
    assert len(shared) >= 9
    for name in shared:
        assert numbers[name] == getattr(tolerances, name), name


@pytest.mark.parametrize(("n", "m"), SHAPES)
def test_awkward_problems(core, n, m):
    """Statuses are Python's, tensions satisfy the optimality conditions, certificates hold by their definition."""
    arrays = awkward(n, m)
    answer = core[np.float64](*arrays)
    assert np.mean(answer.status == INACCURATE) < 0.1
    for row, problem in enumerate(problems_of(arrays)):
        status = answer.status[row]
        if status == INACCURATE:
            continue
        assert STATUSES[status] == solve(problem).status
        if status == OPTIMAL:
            assert optimality_error(problem, answer.t[row]) < 1e-7
        else:
            check_certificate(problem, answer.direction[row], *answer.numbers[row, 1:])
            assert linear_program_status(problem.A, problem.w, problem.t_min, problem.t_max) != "optimal"


@pytest.mark.parametrize("name", ["cogiro", "wang-flying", "ipanema-2", "wang-ctmrts-6", "planar-4"])
def test_states_of_robots(core, name):
    arrays = states(name, 60)
    answer = core[np.float64](*arrays)
    assert (answer.status == OPTIMAL).any()
    assert (answer.status == INFEASIBLE).any()
    for row, problem in enumerate(problems_of(arrays)):
        solution = solve(problem)
        assert STATUSES[answer.status[row]] == solution.status or answer.status[row] == INACCURATE
        if answer.status[row] == OPTIMAL:
            # The worst is a singular value of 1e-12, which both leave out in ways of their own.
            assert np.abs(answer.t[row] - solution.tensions).max() < 1e-10 * problem.t_max.max()
            assert answer.numbers[row, 0] <= problem.tolerance(answer.t[row])
        elif answer.status[row] != INACCURATE:
            check_certificate(problem, answer.direction[row], *answer.numbers[row, 1:])


def test_iterations_are_bounded(core):
    for n, m in SHAPES:
        answer = core[np.float64](*awkward(n, m))
        if m - n <= 2:  # the rank may be less, and the dual active-set method then answers
            full = np.linalg.matrix_rank(awkward(n, m)[0]) == min(n, m)
            assert answer.steps[full].max() <= m
            assert answer.inner[full].max() <= m * (m - 1) // 2
        assert answer.steps.max() <= 10 * m + 20
        assert (answer.inner <= np.maximum(2 * answer.steps, m * (m - 1) // 2)).all()


@pytest.mark.parametrize(("real", "rho", "accuracy"), [(np.float64, 1e6, 1e-10), (np.float32, 1e4, 1e-5)])
def test_a_soft_answer_is_always_there_and_optimal(core, real, rho, accuracy):
    """Its cost is that of scipy's bounded least squares, and the status and the proof of the problem stay."""
    for name in ("cogiro", "wang-flying", "wang-ctmrts-6"):
        arrays = [array.astype(real).astype(float) for array in states(name, 40, seed=1)]
        answer, plain = core[real](*arrays, rho=rho), core[real](*arrays)
        assert np.array_equal(answer.status, plain.status)
        for row in np.flatnonzero(answer.status != OPTIMAL):
            A, w, low, high, *_, length = (array[row] for array in arrays)
            scale = np.repeat([1.0, 1.0 / length], 3)
            t = answer.t[row].astype(float)
            assert ((t >= low) & (t <= high)).all()
            assert answer.numbers[row, 0] == pytest.approx(
                np.linalg.norm(scale * (A @ t - w)), rel=1e-3, abs=accuracy * np.linalg.norm(scale * w)
            )
            rows = np.vstack([np.sqrt(rho) * scale[:, None] * A, np.eye(t.size)])
            right = np.r_[np.sqrt(rho) * scale * w, np.zeros(t.size)]
            best = lsq_linear(rows, right, (low, high), method="bvls", tol=1e-14)
            assert np.sum((rows @ t - right) ** 2) <= 2.0 * best.cost * (1.0 + accuracy)
            if answer.status[row] != INACCURATE:
                assert np.array_equal(answer.direction[row], plain.direction[row])


@pytest.mark.parametrize("name", ["cogiro", "wang-flying", "planar-4", "wang-ctmrts"])
def test_float_calls_nothing_optimal_that_is_infeasible(core, name):
    """Wrenches a part of 1e-8 to 1e-2 inside and outside the boundary; the truth is that of the rounded numbers."""
    rng = np.random.default_rng(3)
    A, _, low, high, *rest = states(name, 200)
    pull = np.einsum("ri,rij->rj", rng.normal(size=(200, 6)), A)
    t = np.where(pull > 0.0, high, low)
    t += (t - 0.5 * (low + high)) * 10.0 ** rng.uniform(-8, -2, (200, 1)) * rng.choice([-1, 1], (200, 1))
    arrays = [x.astype(np.float32).astype(float) for x in (A, np.einsum("rij,rj->ri", A, t), low, high, *rest)]
    answer = core[np.float32](*arrays)
    problems = problems_of(arrays)
    for row in np.flatnonzero(answer.status == OPTIMAL):
        assert certify(problems[row]) is None
    for row in np.flatnonzero((answer.status == INFEASIBLE) | (answer.status == SINGULAR)):
        assert certify(problems[row]) is not None


def test_float_answers_most_states_to_four_digits(core):
    for name in ("cogiro", "wang-flying", "ipanema-2"):
        A, _, low, high, *rest = states(name, 100)
        inside = np.random.default_rng(4).uniform(low + 0.1 * high, 0.9 * high)
        arrays = [A, np.einsum("rij,rj->ri", A, inside), low, high, *rest]
        single, double = core[np.float32](*arrays), core[np.float64](*arrays)
        assert np.mean(single.status == OPTIMAL) > 0.9
        both = (single.status == OPTIMAL) & (double.status == OPTIMAL)
        assert np.abs(single.t - double.t)[both].max() < 1e-4 * high.max()


def test_what_is_no_problem_is_invalid(core):
    A, w, low, high, ref, weights, length = states("cogiro", 1)
    good = [A, w, low, high, ref, weights, length]
    broken = {0: A * np.nan, 1: w + np.inf, 2: high + 1.0, 4: ref * np.nan, 5: -weights, 6: 0.0 * length}
    for position, array in broken.items():
        for real in (np.float64, np.float32):
            answer = core[real](*good[:position], array, *good[position + 1 :], rho=1e3)
            assert answer.status[0] == INVALID
    assert core[np.float64](*good, rho=1e30).status[0] == INVALID


@pytest.mark.parametrize(("n", "m"), SHAPES)
def test_the_extension_is_the_core(core, n, m):
    """Its status, tensions and direction are those of the core, though its arrays have other sizes."""
    arrays = awkward(n, m)
    answer = core[np.float64](*arrays)
    for row, problem in enumerate(problems_of(arrays)):
        tensions, direction = np.zeros(m), np.zeros(n)
        assert extension.solve_packed(problem.packed, tensions, direction) == answer.status[row]
        if answer.status[row] == OPTIMAL:
            assert np.abs(tensions - answer.t[row]).max() <= 1e-9 * np.abs(tensions).max()
            assert solve(problem).backend == "c"
            np.testing.assert_array_equal(solve(problem).tensions, tensions)
        elif answer.status[row] in (INFEASIBLE, SINGULAR):
            np.testing.assert_allclose(direction, answer.direction[row], rtol=0, atol=1e-6 * np.abs(direction).max())


def test_the_extension_refuses_memory_that_is_no_problem():
    packed = TensionProblem([[1.0, -1.0]], [3.0], 1.0, 60.0).packed
    assert extension.solve_packed(packed, np.empty(2)) == OPTIMAL
    for arguments, error in (
        ((packed,), TypeError),
        ((packed, None), TypeError),
        ((packed, np.empty(3)), ValueError),
        ((packed, np.empty(0)), ValueError),
        ((packed[:-1], np.empty(2)), ValueError),
        ((packed, np.empty(2), np.empty(2)), ValueError),
        ((packed[::2], np.empty(2)), ValueError),
        ((packed, packed), ValueError),
    ):
        with pytest.raises(error):
            extension.solve_packed(*arguments)


def test_problems_that_the_extension_has_no_space_for_are_solved_all_the_same():
    A = np.random.default_rng(0).normal(size=(3, 40))
    solution = solve(TensionProblem(A, A.sum(axis=1), 0.0, 2.0))
    assert solution.feasible
    assert solution.backend != "c"


def test_the_example_of_the_docs(tmp_path):
    """It compiles and prints what `solve` computes for the same numbers."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("there is no C compiler: no command cc")
    page = (CORE.parents[1] / "docs" / "howto" / "c-code.md").read_text()
    (tmp_path / "distribute.c").write_text(page.split('```c title="distribute.c"\n')[1].split("```")[0])
    command = [compiler, "-O0", f"-I{CORE}", "distribute.c", *map(str, SOURCES), "-lm", "-o", "distribute"]
    subprocess.run(command, check=True, cwd=tmp_path)
    printed = subprocess.run([tmp_path / "distribute"], check=True, capture_output=True, text=True).stdout
    status, tensions = printed.splitlines()
    solution = solve(TensionProblem([[-0.6, 0.6, 0.0], [0.8, 0.8, -1.0]], [5.0, 30.0], 2.0, 60.0))
    assert status == solution.status
    assert tensions == "tensions {:.6f} {:.6f} {:.6f} N".format(*solution.tensions)


def rows_of_the_extension(arrays, rho, in_lanes):
    """Solve all rows by the extension alone: codes, tensions, directions and residuals."""
    count, n, m = arrays[0].shape
    per = np.array([array[0].size for array in arrays], float)
    sizes = (m, n, 2, 1, 1)
    answers = [np.full(count * size, value) for size, value in zip(sizes, [0.0] * 4 + [float(UNSURE)], strict=True)]
    extension.solve_rows(n, m, rho, in_lanes, *(np.ascontiguousarray(array).ravel() for array in arrays), per, *answers)
    t, d, info, residual, status = answers
    return SimpleNamespace(
        code=status, t=t.reshape(count, m), d=d.reshape(count, n), shortfall=info[1::2], residual=residual
    )


@pytest.mark.parametrize(("n", "m"), SHAPES)
@pytest.mark.parametrize("rho", [0.0, 1e3])
@pytest.mark.parametrize("in_lanes", [False, True])
def test_rows_of_a_batch(n, m, rho, in_lanes):
    """Each row is what the core answers; with rho, what the method soft-wrench minimises."""
    arrays = awkward(n, m, 30)
    arrays[1][3] = np.nan
    answer = rows_of_the_extension(arrays, rho, in_lanes)
    assert answer.code[3] == INVALID
    for row in np.flatnonzero((answer.code != UNSURE) & (answer.code != INVALID)):
        problem = TensionProblem(*(array[row] for array in arrays[:-1]))
        t = answer.t[row]
        if rho == 0.0:
            assert STATUSES[int(answer.code[row])] == solve(problem).status
        else:
            root = np.sqrt(problem.weights / problem.weights.max())
            rows = np.vstack([np.sqrt(rho) * problem.A, np.diag(root)])
            right = np.r_[np.sqrt(rho) * problem.w, root * problem.t_ref]
            best = solve(problem, "soft-wrench", rho=rho).tensions
            assert np.linalg.norm(rows @ t - right) <= np.linalg.norm(rows @ best - right) * (1.0 + 1e-9)
            assert ((t >= problem.t_min) & (t <= problem.t_max)).all()
        if not np.isnan(answer.shortfall[row]):
            d = answer.d[row]
            reach = support_value(problem.A, d, problem.t_min, problem.t_max)
            assert 0.0 < answer.shortfall[row] <= (d @ problem.w - reach) * (1.0 + 1e-6)


def test_rows_of_no_batch_are_refused():
    arrays = [np.ascontiguousarray(array) for array in awkward(3, 4, 5)]
    per = np.array([array[0].size for array in arrays], float)
    answers = [np.full(5 * size, float(UNSURE)) for size in (4, 3, 2, 1, 1)]
    extension.solve_rows(3, 4, 0.0, True, *arrays, per, *answers)
    for position in range(13):
        wrong = [*arrays, per, *answers]
        wrong[position] = wrong[position].ravel()[:-1].copy() if position != 12 else np.full(6, 6.0)
        with pytest.raises(ValueError, match="one batch"):
            extension.solve_rows(3, 4, 0.0, True, *wrong)
    with pytest.raises(ValueError, match="one batch"):
        extension.solve_rows(7, 4, 0.0, True, *arrays, per, *answers)
    with pytest.raises(TypeError):
        extension.solve_rows(3, 4, 0.0, True, *arrays)
    with pytest.raises(TypeError):
        extension.solve_rows(3, 4, None, True, *arrays, per, *answers)
