"""Check that a process starts without machine code, and that its answers do not depend on what it solved before."""

import subprocess
import sys
from importlib import import_module

import numpy as np
import pytest

from towline.core import CABLES
from towline.solvers import TensionProblem, compiled, solve, solve_batch

from .problems import ZOO
from .soak.exactness import awkward_problem

KEYS = ("A", "w", "t_min", "t_max", "t_ref", "weights", "length")


@pytest.fixture
def patient(monkeypatch):
    """Let this process lose no time: plain Python stays plain."""
    monkeypatch.setattr(compiled, "_lose", lambda *_, **__: None)


@pytest.fixture
def without_extension(monkeypatch):
    for module in ("solve", "batch"):
        monkeypatch.setattr(import_module(f"towline.solvers.{module}"), "CABLES", 0)


def other_process(code):
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()


def test_a_process_that_solves_little_loads_no_numba():
    code = (
        "import sys; from towline.solvers import TensionProblem, solve;"
        "solution = solve(TensionProblem([[1, -1]], [3], 1, 60));"
        "print(solution.tensions, solution.backend, 'numba' in sys.modules)"
    )
    assert other_process(code) == ["[4.", "1.]", "c" if CABLES else "daqp", "False"]


def test_ten_thousand_rows_are_solved_without_machine_code():
    code = (
        "import sys; import numpy as np; from towline.solvers import solve_batch;"
        "A = np.random.default_rng(0).normal(size=(10_001, 6, 6));"
        "batch = solve_batch(A, A.sum(axis=2), 0.5, 60);"
        "print(batch.feasible.all(), batch.backend, 'numba' in sys.modules)"
    )
    assert other_process(code) == ["True", "interpreted", "False"]


def same_bits(first, second):
    for name in ("tensions", "code", "residual", "direction", "shortfall", "support"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name), err_msg=name)


@pytest.mark.parametrize("rho", [None, 1e3])
def test_plain_python_and_machine_code_give_the_same_bits(rho, monkeypatch, patient):
    machine_code = compiled.load()
    shapes = {}
    for seed in range(4_000_000, 4_000_600):
        problem = awkward_problem(seed)
        shapes.setdefault(problem[0].shape, []).append(problem)
    for members in shapes.values():
        arrays = [np.array(column) for column in zip(*members, strict=True)]
        answers = []
        for kernels in (compiled.PLAIN, machine_code):
            monkeypatch.setattr(compiled, "_kernels", kernels)
            answers.append(solve_batch(*arrays, rho=rho, backend="lanes"))
            assert answers[-1].backend == kernels.backend
        same_bits(*answers)


@pytest.mark.parametrize("m", [6, 7, 8, 12])
def test_a_row_does_not_depend_on_its_company(m, monkeypatch, patient):
    monkeypatch.setattr(compiled, "_kernels", compiled.PLAIN)
    rng = np.random.default_rng(m)
    A = rng.normal(size=(60, 6, m))
    w = np.einsum("rij,rj->ri", A, rng.uniform(-0.3, 1.3, (60, m)))
    together = solve_batch(A, w, 0.0, 1.0, backend="lanes")
    assert 0 < together.feasible.sum() < 60
    for rows in (slice(0, 1), slice(7, 30), slice(31, 60, 5)):
        apart = solve_batch(A[rows], w[rows], 0.0, 1.0, backend="lanes")
        np.testing.assert_array_equal(apart.tensions, together.tensions[rows])
        np.testing.assert_array_equal(apart.direction, together.direction[rows])


def test_without_the_extension_the_zoo_is_answered(without_extension):
    for name, (problem, status) in ZOO.items():
        solution = solve(problem)
        assert solution.status == status, name
        assert solution.backend == "daqp"
        assert solve_batch(**{key: [getattr(problem, key)] for key in KEYS}).status[0] == status, name


def test_without_the_extension_a_batch_has_the_same_answers(without_extension, monkeypatch):
    rows = [awkward_problem(seed, 3, 6) for seed in range(60)]
    arrays = [np.array(column) for column in zip(*rows, strict=True)]
    arrays[1][7] = np.nan
    without = solve_batch(*arrays)
    monkeypatch.undo()
    batch = solve_batch(*arrays)
    np.testing.assert_array_equal(without.status, batch.status)
    assert batch.status[7] == "invalid"
    assert 10 < batch.feasible.sum() < 50
    t = batch.tensions[batch.feasible]
    error = np.abs(without.tensions[batch.feasible] - t).max(axis=1)
    assert (error <= 1e-8 * np.abs(t).max(axis=1)).all()


@pytest.mark.parametrize(("on_disk", "seconds"), [(True, 1.0), (False, 15.0)])
def test_machine_code_is_loaded_once_that_would_have_been_quicker(on_disk, seconds, monkeypatch):
    loads = []
    monkeypatch.setattr(compiled, "load", lambda: loads.append(1))
    monkeypatch.setattr(compiled, "_on_disk", lambda: on_disk)
    monkeypatch.setattr(compiled, "_forget_old_code", lambda: None)
    monkeypatch.setattr(compiled, "_lost", 0.0)
    monkeypatch.setattr(compiled, "_patience", 1.0)
    compiled._lose(0.9 * seconds)
    assert not loads
    compiled._lose(0.2 * seconds)
    assert loads


def test_machine_code_that_another_process_compiles_meanwhile_is_loaded(monkeypatch):
    loads = []
    monkeypatch.setattr(compiled, "load", lambda: loads.append(1))
    monkeypatch.setattr(compiled, "_forget_old_code", lambda: None)
    for name, value in (("_lost", 0.0), ("_patience", 1.0)):
        monkeypatch.setattr(compiled, name, value)
    monkeypatch.setattr(compiled, "_on_disk", lambda: False)
    compiled._lose(4.0)
    assert not loads
    monkeypatch.setattr(compiled, "_on_disk", lambda: True)
    compiled._lose(4.5)  # not 15 s
    assert loads


def test_a_solution_reports_the_code_that_answered():
    problem = TensionProblem([[1.0, -1.0]], [3.0], 1, 60)
    assert solve(problem).backend == ("c" if CABLES else "daqp")
    assert solve(problem, "daqp").backend is None
    assert solve(problem, "qp").backend == "clarabel"
    # Directions that only rounding separates from none are left to the robust path.
    doubtful = TensionProblem([[1.0, 1.0], [1.0, 1.0 + 3e-10]], [2.0, 2.0], 0.0, 60.0)
    assert solve(doubtful).backend == "daqp"
