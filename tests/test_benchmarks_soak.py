"""The runner of random checks, and what all benchmarks share: turns, ratios and tables."""

import gc
from collections import Counter

import numpy as np
import pytest

from towline.benchmarks.harness import alternating, ratio, table

from .soak import __main__ as soak, exactness


def run(monkeypatch, *arguments):
    """Return the exit code of the command."""
    monkeypatch.setattr("sys.argv", ["soak", *map(str, arguments)])
    with pytest.raises(SystemExit) as caught:
        soak.main()
    return caught.value.code


@pytest.mark.parametrize(
    ("name", "count", "only", "printed"),
    [
        ("exactness", 1, "random", "random: 1 problems, 0 wrong answers"),
        ("continuity", 2, "active-set", "active-set: tensions: 2 motions"),
        ("control", 80, "cogiro", "| cogiro | "),
        ("predictive", 60, "cogiro", "| cogiro | "),
        ("silence", 1, "cogiro", "0 of 1 runs were handed over"),
        ("signals", 1, "export", "export: "),
        ("files", 1, "task,xml", "1 files, 0 wrong"),
        ("tasks", 1, "ordinary", "all       1 feasible"),
    ],
)
def test_a_check_runs_by_its_name(monkeypatch, capsys, name, count, only, printed):
    assert run(monkeypatch, name, "--start", 3, "--count", count, "--only", only) == 0
    assert printed in capsys.readouterr().out


def test_a_wrong_case_is_printed_and_is_the_exit_code(monkeypatch, capsys):
    wrong = exactness.Wrong(17, "solve", "optimal: the limits permit no w")
    report = exactness.Report(Counter({("solve", "optimal"): 1}), [wrong], 0.0)
    monkeypatch.setattr(exactness, "check", lambda seeds, family, step: report)
    assert run(monkeypatch, "exactness", "--count", 1) == 1
    assert "seed=17" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nothing"], "invalid choice: 'nothing'"),
        (["tasks", "--count", 0], "--count must be 1 or more and --start 0 or more, got 0 and 0"),
        (["tasks", "--start", -1], "got 200 and -1"),
        (["tasks", "--only", "rack,forest"], "--only must be among ordinary, lift"),
    ],
)
def test_wrong_arguments_are_refused(monkeypatch, capsys, arguments, message):
    assert run(monkeypatch, *arguments) == 2
    assert message in capsys.readouterr().err


def test_contenders_alternate_and_garbage_waits():
    seen, collected = [], []
    for turn, contender in alternating("abc", 4):
        seen.append((turn, contender))
        collected.append(gc.isenabled())
    assert [turn for turn, _ in seen] == [0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3]
    assert "".join(contender for _, contender in seen) == "abcbcacababc"
    assert not any(collected)
    assert gc.isenabled()


def test_a_ratio_is_of_the_same_turn():
    """A machine that is ten times slower in the second turn slows down both."""
    assert ratio({0: [2.0, 2.0, 9.0], 1: [20.0]}, {0: [1.0], 1: [10.0]}) == 2.0
    assert ratio({0: [6.0]}, {1: [1.0, 3.0]}) == 3.0  # without that turn, to the median of all
    assert np.isnan(ratio({}, {0: [1.0]}))


def test_a_table_has_text_on_the_left_and_numbers_on_the_right():
    assert table("who | how | us", [("a", "b", 1)], 2) == ["| who | how | us |", "|---|---|---:|", "| a | b | 1 |"]
