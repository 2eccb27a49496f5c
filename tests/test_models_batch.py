"""Batches of a CasADi Function: whichever way they are evaluated, they are what the single call says."""

import threading

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.extra.numpy import mutually_broadcastable_shapes

from towline.base.errors import InputError, SolverError
from towline.models import Dynamics, batch, load

RELATIVE = 1e-14


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
    """Map and single call agree, and the single call is what CasADi's own call says."""
    rng = np.random.default_rng(2)
    for function in functions_of(load(name)):
        arguments = ordinary_arguments(function, 100, rng)
        mapped = batch.call(function, arguments)
        for k in (0, 70, 99):
            row = {argument: values[k] for argument, values in arguments.items()}
            single = batch.call(function, row)
            direct = function(**row)
            for output in function.name_out():
                want = direct[output].full().reshape(single[output].shape)
                np.testing.assert_array_equal(single[output], want)
                assert difference(mapped[output][k : k + 1], want[None]) <= RELATIVE


def wrench_matrix(name="wang-flying"):
    return Dynamics(load(name)).functions["wrench_matrix"]


def matrices():
    """A small Function that tells rows from columns, and its value by hand."""
    a, B = ca.SX.sym("a", 2), ca.SX.sym("B", 2, 3)
    return ca.Function("small", [a, B], [a[0] * B + a[1], B.T @ a], ["a", "B"], ["C", "d"])


def by_hand(a, B):
    a, B = np.asarray(a, dtype=float), np.asarray(B, dtype=float)
    return a[..., 0, None, None] * B + a[..., 1, None, None], np.einsum("...ij,...i->...j", B, a)


@pytest.fixture(scope="module")
def small():
    return matrices()


@settings(max_examples=60, deadline=None)
@given(mutually_broadcastable_shapes(num_shapes=2, max_dims=3, min_side=0, max_side=4))
def test_shapes_broadcast_as_in_numpy(small, shapes):
    rng = np.random.default_rng(0)
    leading_a, leading_B = shapes.input_shapes
    a, B = rng.normal(size=(*leading_a, 2)), rng.normal(size=(*leading_B, 2, 3))
    got = batch.call(small, {"a": a, "B": B})
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


def test_large_numbers_are_finite(small):
    """Their squares are not."""
    assert batch.call(small, {"a": [1.0, 0.0], "B": np.full((2, 3), 1e200)})["C"][0, 0] == 1e200


def test_symbols_pass_through(small):
    a = ca.MX.sym("a", 2)
    C = batch.call(small, {"a": a, "B": np.ones((2, 3))})["C"]
    assert isinstance(C, ca.MX)
    np.testing.assert_array_equal(ca.Function("f", [a], [C])([2.0, 1.0]).full(), np.full((2, 3), 3.0))


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


def test_places_without_elements():
    """Sparse inputs and outputs, and empty ones, have their shape in NumPy; what has no element is 0."""
    S = ca.SX.sym("S", ca.Sparsity.lower(3))
    empty = ca.SX.sym("empty", 0, 3)
    function = ca.Function("sparse", [S, empty], [2 * S, ca.SX(0, 2), ca.SX(2, 2)], ["S", "none"], ["T", "no", "zero"])
    values = np.arange(1.0, 9 * 70 + 1).reshape(70, 3, 3)
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
