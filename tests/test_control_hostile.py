"""Controllers are stepped with what is no state, by two threads at once, and are interrupted: one line, or nothing."""

import copy
import pickle
import signal
import sys
import threading

import numpy as np
import pytest

from towline import InputError, load
from towline.control import ComputedTorque, LengthControl, OpenLoop, Predictive, Reference, State


class Raising:
    def __array__(self, *_, **__):
        raise ZeroDivisionError("of an array that is elsewhere")


def endless():
    items = []
    items.append(items)
    return items


WRONG = {
    "one number": 1e308,
    "none": object(),
    "large": [10**400] * 6,
    "without end": endless(),
    "raising": Raising(),
    "text": ["1"] * 6,
    "complex": np.ones(6, complex),
    "dates": np.zeros(6, "datetime64[s]"),
    "objects": np.array([object()] * 6),
    "class": np.ndarray,
    "rows of rows": np.zeros((2, 3, 6)),
    "of many": np.broadcast_to(0.0, (10**9, 5)),
}


def at_home(robot):
    still = np.zeros((len(robot.carriers), 6))
    state = State(robot.home, np.zeros(6), robot.carrier_home, still)
    return state, Reference(robot.home, *np.zeros((2, 6)), robot.carrier_home, still, still)


@pytest.mark.parametrize("kind", [ComputedTorque, Predictive, OpenLoop, LengthControl])
@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_array_is_refused_in_one_line_that_names_it(case, kind):
    robot = load("wang-flying")
    controller, (state, reference) = kind(robot), at_home(robot)
    given = [(state, name, {"reference": reference}) for name in state._fields]
    given += [(reference, name, {"state": state}) for name in reference._fields]
    for whole, name, other in given:
        if kind is OpenLoop and whole is state and name != "pose":
            continue
        changed = whole._replace(**{name: WRONG[case]})
        controller.reset()
        with pytest.raises(InputError, match=f"{type(whole).__name__.lower()}.{name} must be") as error:
            controller.step(0.0, **{type(whole).__name__.lower(): changed}, **other)
        assert str(error.value).isprintable()
        if kind is Predictive and whole is reference:
            with pytest.raises(InputError, match=f"reference.{name} must be"):
                controller.follow([reference, changed], 0.01)


def test_a_predictive_controller_takes_references_of_one_robot():
    robot = load("wang-ctmrts")
    controller, (state, reference) = Predictive(robot), at_home(robot)
    with pytest.raises(InputError, match=r"reference.carrier_pose must be of shape \(3, 6\), got shape \(1, 3, 6\)"):
        controller.step(0.0, state, reference._replace(carrier_pose=reference.carrier_pose[None]))


@pytest.mark.parametrize("kind", [ComputedTorque, Predictive, OpenLoop])
def test_lists_and_other_floats_command_the_same(kind):
    robot = load("wang-flying")
    state, reference = at_home(robot)
    state = state._replace(tensions=np.ones(6))
    expected = kind(robot).step(0.0, state, reference)
    for change in (np.ndarray.tolist, lambda x: x.astype(">f8"), lambda x: x.astype(object), lambda x: x[::-1][::-1]):
        changed = [
            type(each)(*(change(x) if isinstance(x, np.ndarray) else x for x in each)) for each in (state, reference)
        ]
        for one, two in zip(expected, kind(robot).step(0.0, *changed), strict=True):
            if one is not None:
                np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("kind", [ComputedTorque, Predictive])
def test_a_second_thread_is_refused_and_breaks_nothing(kind):
    """Two threads that stepped one controller met arrays of two sizes: a ValueError of NumPy, or of the core."""
    robot = load("wang-flying")
    controller, (state, reference) = kind(robot), at_home(robot)
    expected, times, wrong = controller.step(0.0, state, reference).tensions, iter(range(1, 10**9)), []
    one_of_two = State(*(None if part is None else np.stack([part] * 2) for part in state))

    def work(rows):
        for _ in range(300):
            try:
                controller.step(next(times), rows, reference)
            except InputError:
                pass
            except Exception as error:  # of any kind
                wrong.append(error)

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        threads = [threading.Thread(target=work, args=(rows,)) for rows in (state, one_of_two) * 2]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        sys.setswitchinterval(interval)
    assert not wrong
    controller.reset()
    np.testing.assert_array_equal(controller.step(0.0, state, reference).tensions, expected)


def test_a_controller_in_use_is_refused_and_its_copies_are_free():
    robot = load("wang-flying")
    controller, (state, reference) = ComputedTorque(robot), at_home(robot)
    refused = []

    def other():
        for call in (controller.reset, lambda: controller.step(0.0, state, reference)):
            with pytest.raises(InputError, match="controller must be used by one thread at a time"):
                call()
            refused.append(call)

    with controller._alone:
        thread = threading.Thread(target=other)
        thread.start()
        thread.join()
        for copied in (copy.deepcopy(controller), pickle.loads(pickle.dumps(controller))):
            thread = threading.Thread(target=lambda own=copied: refused.append(own.step(0.0, state, reference)))
            thread.start()
            thread.join()
    assert len(refused) == 4


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timers")
@pytest.mark.parametrize("kind", [ComputedTorque, Predictive])
def test_an_interrupt_in_a_step_leaves_a_controller_that_can_be_reset(kind):
    robot = load("wang-flying")
    controller, (state, reference) = kind(robot), at_home(robot)
    expected, draw, stopped = controller.step(0.0, state, reference).tensions, np.random.default_rng(0), 0

    def stop(*_):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, stop)
    try:
        for _ in range(40):
            try:
                signal.setitimer(signal.ITIMER_REAL, draw.uniform(1e-5, 5e-3))
                for time in range(1, 10_000):
                    controller.step(time, state, reference)
            except KeyboardInterrupt:
                stopped += 1
            controller.reset()
            np.testing.assert_array_equal(controller.step(0.0, state, reference).tensions, expected)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert stopped == 40
