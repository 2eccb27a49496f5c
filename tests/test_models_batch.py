"""Batches of a CasADi Function: whichever way they are evaluated, they are what the single call says."""

import math
import os
import subprocess
import sys
import threading

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import mutually_broadcastable_shapes

from towline.base.errors import InputError, SolverError
from towline.base.machine_code import kernel
from towline.models import Dynamics, available, batch, load, tape

from . import warm

RELATIVE = 1e-14
UNARY = [
    "sqrt",
    "exp",
    "expm1",
    "log",
    "log1p",
    "sin",
    "cos",
    "tan",
    "asin",
    "acos",
    "atan",
    "sinh",
    "cosh",
    "tanh",
    "asinh",
    "acosh",
    "atanh",
    "erf",
    "fabs",
    "sign",
    "floor",
    "ceil",
]
BINARY = [
    "fmod",
    "copysign",
    "fmin",
    "fmax",
    "atan2",
    "power",
    "hypot",
    "lt",
    "le",
    "eq",
    "ne",
    "logic_and",
    "logic_or",
]


@pytest.fixture(scope="module", autouse=True)
def own_cache(tmp_path_factory):
    """Kernels of these tests stay out of the user's cache."""
    patch = pytest.MonkeyPatch()
    patch.setenv("TOWLINE_CACHE", str(tmp_path_factory.mktemp("cache")))
    yield
    patch.undo()


def every_operation():
    """Every operation of SX that a kernel has, on two numbers."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    results = {name: getattr(ca, name)(x) for name in UNARY}
    results |= {name: getattr(ca, name)(x, y) for name in BINARY}
    results |= {"add": x + y, "sub": x - y, "mul": x * y, "div": x / y, "neg": -x, "inv": 1 / x, "sq": x**2}
    results |= {
        "twice": 2 * x,
        "not": ca.logic_not(x),
        "constpow": x**1.7,
        "if_else_zero": ca.if_else(x, y, 0),
    }
    results |= {"constants": ca.vertcat(x * 0.1, x - 1e300, x * np.inf, x + np.nan, x * -np.inf)}
    return ca.Function("operations", [x, y], list(results.values()), ["x", "y"], list(results))


def test_every_operation():
    function = every_operation()
    used = {tape._NAMES[function.instruction_id(k)] for k in range(function.n_instructions())}
    assert used - {"INPUT", "OUTPUT", "CONST"} == set(tape._OPERATIONS)
    special = [0.0, -0.0, 1.0, -1.0, 0.5, 2.0, -2.5, 1e-9, 30.0, -700.0, 1e200]
    rng = np.random.default_rng(0)
    values = np.concatenate([special, rng.normal(size=40), rng.uniform(-10, 10, 40)])
    x, y = (grid.ravel() for grid in np.meshgrid(values, values))
    run = batch.compiled(function)
    outputs = [np.empty((len(x), *function.size_out(i))) for i in range(function.n_out())]
    run(0, len(x), x.reshape(-1, 1, 1), y.reshape(-1, 1, 1), *outputs)
    expected = function.map(len(x))(x=x[None], y=y[None])
    for name, got in zip(function.name_out(), outputs, strict=True):
        want = expected[name].full().T.reshape(got.shape)
        np.testing.assert_allclose(got, want, rtol=RELATIVE, atol=0, equal_nan=True, err_msg=name)


def functions_of(robot):
    dynamics = Dynamics(robot)
    yield from dynamics.functions.values()
    if len(robot.carriers) == 1:
        yield from dynamics.relative.functions.values()


def ordinary_arguments(function, count, rng):
    """Poses about which nothing is special; every input of a robot's Functions has meaning at such values."""
    return {name: rng.uniform(-1.0, 1.0, (count, *batch._core(function.size_in(name)))) for name in function.name_in()}


def difference(got, want):
    """Of each row, relative to the row's norm: an element may be the difference of two that are large."""
    axes = tuple(range(1, want.ndim))
    return (np.sqrt(np.sum((got - want) ** 2, axes)) / np.sqrt(np.sum(want**2, axes))).max()


@pytest.mark.parametrize("name", ["wang-flying", "wang-ctmrts"])
def test_functions_of_robots(name):
    """Kernel, map and single call agree, and the single call is what CasADi's own call says."""
    rng = np.random.default_rng(2)
    for function in functions_of(load(name)):
        arguments = ordinary_arguments(function, 100, rng)
        mapped = batch.call(function, arguments)
        batch.compiled(function)
        kernels = batch.call(function, arguments)
        for k in (0, 70, 99):
            row = {argument: values[k] for argument, values in arguments.items()}
            single = batch.call(function, row)
            direct = function(**row)
            for output in function.name_out():
                want = direct[output].full().reshape(single[output].shape)
                np.testing.assert_array_equal(single[output], want)
                assert difference(mapped[output][k : k + 1], want[None]) <= RELATIVE
                assert difference(kernels[output][k : k + 1], want[None]) <= RELATIVE


def test_every_robot_gets_a_kernel():
    """As Python runs it: to compile all would take minutes."""
    rng = np.random.default_rng(7)
    for name in available():
        for function in functions_of(load(name)):
            space = {"math": math, "np": np}
            exec(tape.translate(tape.dense(function)), space)
            inputs = [rng.uniform(-1.0, 1.0, (2, *function.size_in(i))) for i in range(function.n_in())]
            outputs = [np.full((2, *function.size_out(i)), np.nan) for i in range(function.n_out())]
            space["kernel"](0, 2, *inputs, *outputs)
            wanted = function.call([ca.DM(values[1]) for values in inputs])
            for got, want in zip(outputs, wanted, strict=True):
                assert difference(got[1:], want.full()[None]) <= RELATIVE, (name, function.name())


def wrench_matrix(name="wang-flying"):
    return Dynamics(load(name)).functions["wrench_matrix"]


def matrices():
    """A small Function that tells rows from columns, and its value by hand."""
    a, B = ca.SX.sym("a", 2), ca.SX.sym("B", 2, 3)
    return ca.Function("small", [a, B], [a[0] * B + a[1], B.T @ a], ["a", "B"], ["C", "d"])


def by_hand(a, B):
    a, B = np.asarray(a, dtype=float), np.asarray(B, dtype=float)
    return a[..., 0, None, None] * B + a[..., 1, None, None], np.einsum("...ij,...i->...j", B, a)


@pytest.fixture(scope="module", params=["map", "kernel"])
def small(request):
    """The small Function, before and after it has its kernel."""
    function = matrices()
    if request.param == "kernel":
        batch.compiled(function)
    return function


@settings(max_examples=60, deadline=None)
@given(mutually_broadcastable_shapes(num_shapes=2, max_dims=3, min_side=0, max_side=4), st.integers(1, 3))
def test_shapes_broadcast_as_in_numpy(small, shapes, threads):
    rng = np.random.default_rng(0)
    leading_a, leading_B = shapes.input_shapes
    a, B = rng.normal(size=(*leading_a, 2)), rng.normal(size=(*leading_B, 2, 3))
    got = batch.call(small, {"a": a, "B": B}, threads=threads)
    C, d = by_hand(np.broadcast_to(a, (*shapes.result_shape, 2)), np.broadcast_to(B, (*shapes.result_shape, 2, 3)))
    assert got["C"].shape == (*shapes.result_shape, 2, 3)
    assert got["d"].shape == (*shapes.result_shape, 3)
    np.testing.assert_allclose(got["C"], C, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(got["d"], d, rtol=1e-13, atol=1e-13)


def test_arrays_of_any_layout(small):
    rng = np.random.default_rng(3)
    a, B = rng.normal(size=(200, 2)), rng.normal(size=(200, 2, 3))
    record = np.zeros(200, dtype=np.dtype([("odd", "i1"), ("a", "f8", 2)]))
    record["a"] = a  # not aligned
    layouts = {
        "strided": (np.repeat(a, 3, axis=0)[::3], np.flip(np.flip(B, 0).copy(), 0)),
        "other order": (np.asfortranarray(a), np.asfortranarray(B)),
        "one row for all": (a, np.broadcast_to(B[0], B.shape)),
        "not aligned": (record["a"], B),
        "big-endian": (a.astype(">f8"), B),
        "float32": (a.astype(np.float32), B.astype(np.float32)),
        "integers": (np.arange(400).reshape(200, 2), np.arange(1200).reshape(200, 2, 3)),
        "lists": (a.tolist(), B.tolist()),
    }
    for told, (given_a, given_B) in layouts.items():
        C, d = by_hand(given_a, given_B)
        got = batch.call(small, {"a": given_a, "B": given_B})
        np.testing.assert_allclose(got["C"], C, rtol=1e-13, atol=1e-13, err_msg=told)
        np.testing.assert_allclose(got["d"], d, rtol=1e-13, atol=1e-13, err_msg=told)


def test_what_does_not_fit_is_named(small):
    good = {"a": np.zeros((5, 2)), "B": np.zeros((2, 3))}
    wrong = {
        "a": [np.zeros((5, 3)), np.zeros(()), "no number", [[1, 2], [3]]],
        "B": [np.zeros((3, 2)), np.full((5, 2, 3), np.nan), np.full((2, 3), -np.inf), np.zeros((4, 2, 3))],
    }
    for name, values in wrong.items():
        for value in values:
            with pytest.raises(InputError, match=rf"\b{name}\b.*(must be|must have).*got") as told:
                batch.call(small, good | {name: value})
            assert "\n" not in str(told.value)
    with pytest.raises(InputError, match="other must be an input of small, which has a, B"):
        batch.call(small, good | {"other": 1.0})
    with pytest.raises(InputError, match="threads must be a whole number from 1, or None, got 0"):
        batch.call(small, good, threads=0)


def test_large_numbers_are_finite(small):
    """Their squares are not."""
    assert batch.call(small, {"a": [1.0, 0.0], "B": np.full((2, 3), 1e200)})["C"][0, 0] == 1e200


def test_symbols_pass_through(small):
    a = ca.MX.sym("a", 2)
    C = batch.call(small, {"a": a, "B": np.ones((2, 3))})["C"]
    assert isinstance(C, ca.MX)
    np.testing.assert_array_equal(ca.Function("f", [a], [C])([2.0, 1.0]).full(), np.full((2, 3), 3.0))


def test_results_do_not_depend_on_threads():
    function = wrench_matrix()
    batch.compiled(function)
    poses = np.random.default_rng(4).uniform(-1, 1, (10_001, 6))
    arguments = {"pose": poses, "carrier_pose": np.zeros((1, 6))}
    one = batch.call(function, arguments, threads=1)["A"]
    for threads in (2, 7, None):
        np.testing.assert_array_equal(batch.call(function, arguments, threads=threads)["A"], one)


def test_callers_in_threads_do_not_meet():
    """A buffer that two threads shared would mix their poses."""
    function = wrench_matrix()
    poses = np.random.default_rng(5).uniform(-1, 1, (4, 6))
    expected = [function(pose, np.zeros((1, 6))).full() for pose in poses]
    wrong = []

    def work(k):
        for _ in range(500):
            got = batch.call(function, {"pose": poses[k], "carrier_pose": np.zeros((1, 6))})["A"]
            if not np.array_equal(got, expected[k]):
                wrong.append(k)

    workers = [threading.Thread(target=work, args=(k,)) for k in range(len(poses))]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert not wrong


def test_many_rows_get_a_kernel(monkeypatch):
    """Few rows never compile; many do, also in several calls; one that has no kernel goes on without."""
    monkeypatch.setattr(batch, "ROWS_WORTH_A_KERNEL", 1000)
    made = []
    compile_kernel = batch.compile_kernel
    monkeypatch.setattr(batch, "compile_kernel", lambda *given: made.append(given) or compile_kernel(*given))
    function = matrices()
    arguments = {"a": np.ones((400, 2)), "B": np.ones((2, 3))}
    for expected in (0, 0, 1, 1):
        assert batch.call(function, arguments)["C"].sum() == 400 * 6 * 2.0
        assert len(made) == expected


def without_a_kernel():
    """Functions that have none: an operation unknown to it, a solver inside, far too long."""
    x = ca.SX.sym("x", 2)
    yield (
        ca.Function("remainder", [x], [ca.remainder(x, 1.5)], ["x"], ["y"]),
        lambda x: np.vectorize(math.remainder)(x, 1.5),
    )
    z = ca.MX.sym("z", 2)
    root = ca.rootfinder("root", "newton", {"x": x, "p": (p := ca.SX.sym("p", 2)), "g": x**3 + x - p})
    yield (
        ca.Function("root", [z], [root(x0=[0, 0], p=z)["x"]], ["x"], ["y"]),
        lambda p: np.vectorize(lambda q: next(r.real for r in np.roots([1, 0, 1, -q]) if abs(r.imag) < 1e-9))(p),
    )
    total = x
    for k in range(tape.LONGEST // 2):
        total = ca.sin(total) if k % 2 else total + k
    yield ca.Function("long", [x], [total], ["x"], ["y"]), None


@pytest.mark.parametrize(("function", "by_hand"), list(without_a_kernel()), ids=["unknown operation", "solver", "long"])
def test_what_has_no_kernel_is_mapped(monkeypatch, function, by_hand):
    monkeypatch.setattr(batch, "ROWS_WORTH_A_KERNEL", 10)
    with pytest.raises(InputError, match=rf"{function.name()} must have .*, got"):
        batch.compiled(function)
    x = np.random.default_rng(6).uniform(-2, 2, (130, 2))
    got = batch.call(function, {"x": x})["y"]
    if by_hand is not None:
        np.testing.assert_allclose(got, by_hand(x), rtol=1e-9)
    np.testing.assert_array_equal(got[100], function(x[100]).full().ravel())


def test_places_without_elements():
    """Sparse inputs and outputs, and empty ones, have their shape in NumPy; what has no element is 0."""
    S = ca.SX.sym("S", ca.Sparsity.lower(3))
    empty = ca.SX.sym("empty", 0, 3)
    function = ca.Function("sparse", [S, empty], [2 * S, ca.SX(0, 2), ca.SX(2, 2)], ["S", "none"], ["T", "no", "zero"])
    values = np.arange(1.0, 9 * 70 + 1).reshape(70, 3, 3)
    for prepare in (lambda f: None, batch.compiled):
        prepare(function)
        for S_given, leading in ((values, (70,)), (values[3], ())):
            got = batch.call(function, {"S": S_given, "none": np.zeros((0, 3))})
            np.testing.assert_array_equal(got["T"], 2 * np.tril(S_given))
            assert got["no"].shape == (*leading, 0, 2)
            np.testing.assert_array_equal(got["zero"], np.zeros((*leading, 2, 2)))


def test_an_input_left_out_has_its_default():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    function = ca.Function("f", [x, y], [x + y], ["x", "y"], ["z"], {"default_in": [0, 5]})
    assert batch.call(function, {"x": [1.0]})["z"] == 6
    np.testing.assert_array_equal(batch.call(function, {"x": np.ones((3, 1))})["z"], np.full((3, 1), 6.0))


def test_failing_functions_say_so():
    x = ca.MX.sym("x")
    failing = ca.rootfinder("root", "newton", {"x": x, "g": x**2 + 1}, {"error_on_fail": True, "max_iter": 3})
    function = ca.Function("wrapped", [z := ca.MX.sym("z")], [failing(x0=z)["x"]], ["x"], ["y"])
    for x in ([0.3], np.full((70, 1), 0.3)):
        with pytest.raises(SolverError, match=r"wrapped.*: CasADi could not evaluate it"):
            batch.call(function, {"x": x})


# The cache on the disk. Each test has its own Function, so that no kernel is in memory yet.

_OTHER_PROCESS = """
import sys, time, casadi as ca, numpy as np
from numba.core import event
from towline.models import batch
x = ca.SX.sym("x", 2)
function = ca.Function("f", [x], [ca.sin(x) * {number}], ["x"], ["y"])
with event.install_recorder("numba:compile") as recorder:
    batch.compiled(function)
y = batch.call(function, {{"x": np.array([[1.0, 2.0]] * 5)}})["y"]
assert np.array_equal(y, np.sin([[1.0, 2.0]] * 5) * {number}), y
print("compiled" if recorder.buffer else "loaded")
"""


@pytest.fixture
def other_process(tmp_path_factory):
    """Return a function that lets a process evaluate sin(x) times a number, and returns what it did for that."""
    script = tmp_path_factory.mktemp("script") / "script.py"

    def evaluate(number, folder):
        script.write_text(_OTHER_PROCESS.format(number=number))
        done = warm.run(script, env=os.environ | {"TOWLINE_CACHE": str(folder)})
        assert (done.returncode, done.stderr) == (0, ""), done.stderr
        return done.stdout.strip()

    return evaluate


def test_the_next_process_loads(tmp_path, other_process):
    assert other_process(3.0, tmp_path) == "compiled"
    assert other_process(3.0, tmp_path) == "loaded"


def test_three_processes_at_once(tmp_path, other_process):
    command = [sys.executable, "-c", _OTHER_PROCESS.format(number=4.0)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    environment = os.environ | {"TOWLINE_CACHE": str(tmp_path)}
    for process in [subprocess.Popen(command, env=environment, **pipes) for _ in range(3)]:
        out, err = process.communicate(timeout=120)
        assert (process.returncode, err) == (0, ""), err
        assert out.strip() in ("compiled", "loaded")
    assert other_process(4.0, tmp_path) == "loaded"


def spoil(file, how):
    content = bytearray(file.read_bytes())
    if how == "cut":
        content = content[: len(content) // 2]
    elif how == "emptied":
        content = b""
    else:
        for k in range(0, len(content), 97):
            content[k] ^= 0x55
    file.write_bytes(content)


@pytest.mark.parametrize("how", ["cut", "emptied", "flipped"])
def test_a_spoiled_cache_is_made_anew(tmp_path, how, other_process):
    """Any of its files: nothing breaks, and the process after next loads again."""
    assert other_process(5.0, tmp_path) == "compiled"
    files = [file for file in tmp_path.rglob("*") if file.is_file()]
    assert len(files) == 4  # source, Numba's index and machine code, seal
    for file in files:
        spoil(file, how)
    assert other_process(5.0, tmp_path) == "compiled"
    assert other_process(5.0, tmp_path) == "loaded"


def test_each_file_spoiled_alone(tmp_path):
    function = ca.Function("f", [x := ca.SX.sym("x")], [x * 6.5], ["x"], ["y"])
    source = tape.translate(function)
    how = source, "kernel", kernel._signature(1, 1)
    folder = tmp_path / kernel._key(source)
    y = np.empty((1, 1, 1))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TOWLINE_CACHE", str(tmp_path))
        kernel._from_disk(*how)
        for file in [file for file in folder.rglob("*") if file.is_file()]:
            spoil(file, "flipped")
            kernel._from_disk(*how)(0, 1, np.full((1, 1, 1), 2.0), y)
            assert y.item() == 13.0
            assert kernel._is_intact(folder, source)


def test_no_place_to_write(tmp_path, other_process):
    (tmp_path / "file").touch()
    assert other_process(7.0, tmp_path / "file") == "compiled"
    assert other_process(7.0, "/proc/none") == "compiled"


def test_where_the_cache_is(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("TOWLINE_CACHE", str(tmp_path / "mine"))
    assert kernel.cache_folder() == tmp_path / "mine"
    monkeypatch.delenv("TOWLINE_CACHE")
    assert kernel.cache_folder() == tmp_path / "towline"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert kernel.cache_folder() == tmp_path / ".cache" / "towline"
