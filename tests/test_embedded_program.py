"""The command `towline export --step`, and the example program that it writes, here and on other processors."""

import subprocess

import numpy as np
import pytest

import towline
from towline import TensionProblem, load, solve, tensions
from towline.base.errors import InputError
from towline.models import Dynamics
from towline.solvers import limit_rate

from .soak.step_code import FLAGS
from .soak.step_states import random_states
from .steps import line, required
from .warm import towline as run


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """Return a function that exports a robot by the command line, makes the example and runs it on some lines."""
    required("cc", "make")
    folder, made = tmp_path_factory.mktemp("programs"), {}

    def runs(name, text, *options, real="double"):
        if (name, real) not in made:
            place = folder / f"{name}-{real}"
            done = run("export", name, "--step", place, *(["--float"] if real == "float" else []))
            assert done.stdout.splitlines() == ["  Written", *(f"    {file}" for file in sorted(place.iterdir()))]
            # One as users make it; without optimisation the others have the same bits, in half of the time.
            plain = [] if (name, real) == ("cogiro", "double") else ["CPPFLAGS=-O0"]
            subprocess.run(["make", "CC=cc", *plain, "-s", "-C", place], check=True)
            made[name, real] = place / "main"
        return subprocess.run([made[name, real], *options], input=text, capture_output=True, text=True)

    return runs


@pytest.mark.parametrize("name", ["wang-flying", "wang-ctmrts-6", "cogiro"])
def test_the_program_prints_what_tensions_computes(program, name):
    """With all groups of a line, and with as few as there can be."""
    robot = load(name)
    states = random_states(robot, 36, seed=8)
    lines = [line(row) for row in states.rows(robot)]
    done = program(name, "".join(lines), "--certificate")
    assert done.returncode == 0, done.stderr
    words = [text.split() for text in done.stdout.splitlines()]
    assert len(words) == 36
    A, w = states.problems(Dynamics(robot))
    for row, (status, *rest) in enumerate(words):
        numbers = np.array(rest, float)
        assert numbers.size == robot.m + 7
        if status in ("invalid", "inaccurate"):
            continue
        solution = solve(TensionProblem(A[row], w[row], robot.t_min, robot.t_max, length=robot.length))
        assert status == solution.status
        if status == "optimal":
            np.testing.assert_allclose(numbers[: robot.m], solution.tensions, rtol=0, atol=1e-10 * robot.t_max.max())
            assert not numbers[robot.m :].any()
        else:
            # The certificate of `solve` is the sharpest: moments count as forces at the length.
            scaled = numbers[robot.m + 1 :] * np.repeat([1.0, robot.length], 3)
            assert np.linalg.norm(scaled) == pytest.approx(1.0)
            if status == "infeasible":
                assert 0.0 < numbers[robot.m] <= solution.certificate.shortfall * (1.0 + 1e-6)
    rest = program(name, line(robot.home, np.zeros(12))).stdout.split()
    wind = np.zeros(3) if robot.platform.aero else None
    solution = tensions(robot, robot.home, wind=wind)
    assert rest[0] == solution.status
    if solution.feasible:
        np.testing.assert_allclose(np.array(rest[1:], float), solution.tensions, rtol=1e-10)


def test_in_float_the_program_answers_nearly_the_same(program):
    robot = load("cogiro")
    text = line(robot.home, np.zeros(12))
    double, single = (program("cogiro", text, real=real).stdout.split() for real in ("double", "float"))
    assert double[0] == single[0] == "optimal"
    assert double[1:] != single[1:]
    np.testing.assert_allclose(np.array(single[1:], float), np.array(double[1:], float), atol=1e-4 * robot.t_max.max())


def test_what_is_no_state_holds_the_last_command(program):
    good = line(load("cogiro").home, np.zeros(12))
    words = [text.split() for text in program("cogiro", "nan" + good[1:] + good + "inf" + good[1:]).stdout.splitlines()]
    assert [status for status, *_ in words] == ["invalid", "optimal", "invalid"]
    assert np.array_equal(np.array(words[0][1:], float), load("cogiro").t_min)
    assert words[2][1:] == words[1][1:]


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ("1 2 3", "line 2: must have 18 or 24 numbers, got 3"),
        ("", "line 2: must have 18 or 24 numbers, got 0"),
        ("1 " * 30, "line 2: must have 18 or 24 numbers, got more than 24"),
        ("1,2,3", "line 2: must have only numbers, separated by spaces"),
        ("0x", "line 2: must have only numbers, separated by spaces"),
        ("1 2 three", "line 2: must have only numbers, separated by spaces"),
        ("1 " * 5000, "line 2: must have at most 4096 characters"),
    ],
)
def test_a_malformed_line_ends_the_program_in_one_line(program, bad, message):
    good = line(load("cogiro").home, np.zeros(12))
    done = program("cogiro", f"{good}{bad}\n{good}")
    assert done.returncode == 1
    assert done.stderr == message + "\n"
    assert len(done.stdout.splitlines()) == 1  # what was before is answered


@pytest.mark.parametrize(("name", "counts"), [("wang-flying", (18, 24, 27, 33)), ("wang-ctmrts-6", (18, 54, 60))])
def test_a_line_may_end_before_what_is_as_usual(program, name, counts):
    """Left out, carriers are at home, the air is still and there is no disturbance; the message lists the counts."""
    robot = load(name)
    whole = np.r_[robot.home + 0.01, np.full(6, 0.1), np.full(6, 0.2)]
    usual = np.r_[robot.carrier_home.ravel(), np.zeros(counts[-1] - 18 - robot.carrier_home.size)]
    lines = [line(np.r_[whole, usual][:count]) for count in counts]
    answers = program(name, "".join(lines)).stdout.splitlines()
    assert len(answers) == len(counts)
    assert len(set(answers)) == 1
    listed = f"{', '.join(map(str, counts[:-1]))} or {counts[-1]}"
    for count in set(range(counts[-1] + 2)) - set(counts):
        done = program(name, "1 " * count + "\n")
        assert done.returncode == 1
        assert f"line 1: must have {listed} numbers, got " in done.stderr


def test_the_program_explains_its_options(program):
    for options in (["--rate"], ["--rate", "-1"], ["--rate", "x"], ["--nonsense"]):
        done = program("cogiro", "", *options)
        assert done.returncode == 2
        assert "--certificate" in done.stderr
    assert program("cogiro", "").stdout == ""


def test_rate_limits_are_those_of_limit_rate(program):
    """Each step is the problem whose limits `limit_rate` narrows around the command before, exact or soft."""
    robot, rate = load("cogiro"), 40.0
    rng = np.random.default_rng(9)
    pose = robot.home + np.cumsum(rng.normal(size=(60, 6)) * [0.3, 0.3, 0.3, 0.02, 0.02, 0.02], axis=0)
    zero = np.zeros_like(pose)
    done = program("cogiro", "".join(line(row) for row in np.hstack([pose, zero, zero])), "--rate", str(rate))
    words = [text.split() for text in done.stdout.splitlines()]
    command = np.array([row[1:] for row in words], float)
    assert np.abs(np.diff(command, axis=0)).max() <= rate * (1.0 + 1e-12)
    dynamics, statuses = Dynamics(robot), set()
    for row in range(1, 60):
        A, w = dynamics.wrench_matrix(pose[row]), dynamics.required_wrench(pose[row], zero[row], zero[row])
        problem = TensionProblem(A, w, robot.t_min, robot.t_max, length=robot.length)
        solution = solve(limit_rate(problem, command[row - 1], rate))
        statuses.add(words[row][0])
        assert words[row][0] == solution.status
        if solution.feasible:
            np.testing.assert_allclose(command[row], solution.tensions, rtol=0, atol=1e-9 * robot.t_max.max())
    assert statuses == {"optimal", "infeasible"}


def test_computed_torque_is_its_formula(tmp_path):
    """A closed loop with these accelerations is that of the gains; here the formula, coordinate by coordinate."""
    required("cc")
    folder = towline.export_step("planar-4", tmp_path / "step")
    (folder / "try.c").write_text(
        """
        #include <stdio.h>
        #include "towline_step.h"
        int main(void) {
            const towline_gains gains = {{4, 4, 4, 9, 9, 9}, {2, 2, 2, 3, 3, 3}};
            const towline_reference reference = {{1, 2, 3, 0.1, 0.2, 0.3}, {4, 5, 6, 1, 2, 3}, {7, 8, 9, 4, 5, 6}};
            towline_input input = {{0.5, 1, 2, 0, 0.1, 0.1}, {1, 1, 1, 0, 1, 2}, {0}, {0}, {0}};
            towline_computed_torque(&gains, &reference, &input);
            for (int i = 0; i < 6; i++) printf("%.17g ", input.acceleration[i]);
            return 0;
        }
        """
    )
    subprocess.run(["cc", "try.c", "towline_step.c", "-lm", "-o", "try"], cwd=folder, check=True)
    printed = np.array(subprocess.check_output([folder / "try"], text=True).split(), float)
    Kp, Kd = np.repeat([4.0, 9.0], 3), np.repeat([2.0, 3.0], 3)
    error = np.array([0.5, 1, 1, 0.1, 0.1, 0.2])
    expected = np.array([7, 8, 9, 4, 5, 6]) + Kd * np.array([3, 4, 5, 1, 1, 1]) + Kp * error
    np.testing.assert_allclose(printed, expected, rtol=1e-12)


def test_a_broken_state_of_the_caller_has_a_defined_answer(tmp_path):
    """Whatever is in the state, the command is inside the limits, and the next step is as usual."""
    required("cc")
    folder = towline.export_step("planar-4", tmp_path / "step")
    (folder / "try.c").write_text(
        """
        #include <math.h>
        #include <stdio.h>
        #include "towline_step.h"
        static void show(const towline_input *input, towline_state *state) {
            towline_answer answer;
            printf("%s", towline_status_name(towline_step(input, state, &answer)));
            for (int c = 0; c < TOWLINE_CABLES; c++) printf(" %.17g", answer.tensions[c]);
            printf("\\n");
        }
        int main(void) {
            const towline_input input = {.pose = HOME};
            towline_state state;
            towline_start(&state);
            show(&input, &state);
            state.tensions[1] = NAN;
            show(&input, &state);
            show(&input, &state);
            state.tensions[2] = INFINITY;
            state.rate_max[2] = 1;
            show(&input, &state);
            state.rate_max[2] = NAN;
            show(&input, &state);
            state.rate_max[2] = -1;
            show(&input, &state);
            towline_start(&state);
            show(&input, &state);
            return 0;
        }
        """.replace("HOME", "{" + ", ".join(map(repr, load("planar-4").home.tolist())) + "}")
    )
    subprocess.run(["cc", *FLAGS, "try.c", "towline_step.c", "-lm", "-o", "try"], cwd=folder, check=True)
    printed = [row.split() for row in subprocess.check_output([folder / "try"], text=True).splitlines()]
    statuses, commands = [row[0] for row in printed], np.array([row[1:] for row in printed], float)
    assert statuses == ["optimal", "invalid", "optimal", "invalid", "invalid", "invalid", "optimal"]
    robot = load("planar-4")
    assert ((commands >= robot.t_min) & (commands <= robot.t_max)).all()
    np.testing.assert_array_equal(commands[[2, 6]], commands[[0, 0]])
    assert commands[1, 1] == robot.t_min[1]
    np.testing.assert_array_equal(np.delete(commands[1], 1), np.delete(commands[0], 1))


def test_nothing_is_overwritten_and_nothing_half_written(tmp_path):
    (tmp_path / "here").mkdir()
    for arguments, message in (
        (["--step", tmp_path / "here"], "must be a new path, got one that exists"),
        (["--step", tmp_path / "new", "--c"], "export requires exactly one of --mjcf, --c, --step and --fmu"),
        (["--step", tmp_path / "new", "--out", "x.c"], "--out must be left out with --step"),
        (["--c", "--float"], "--float must be left out without --step"),
    ):
        done = run("export", "cogiro", *arguments, code=2)
        assert message in done.stderr
        assert "Traceback" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["here"]
    with pytest.raises(InputError, match="precision must be one of"):
        towline.export_step("cogiro", tmp_path / "new", "half")
    assert not (tmp_path / "new").exists()


def test_other_processors_compute_the_same_bits(tmp_path):
    required("gcc", "aarch64-linux-gnu-gcc", "qemu-aarch64")
    robot = load("wang-flying")
    text = "".join(line(row) for row in random_states(robot, 2000, seed=10).rows(robot))
    folder = towline.export_step(robot, tmp_path / "step")
    printed = []
    for compiler, emulator in (("gcc", []), ("aarch64-linux-gnu-gcc", ["qemu-aarch64"])):
        command = [compiler, *FLAGS, "-O2", "-static", "main.c", "towline_step.c", "-lm", "-o", compiler]
        subprocess.run(command, cwd=folder, check=True)
        printed.append(
            subprocess.run([*emulator, f"./{compiler}"], cwd=folder, input=text, capture_output=True, text=True).stdout
        )
    assert printed[0].count("\n") == 2000
    assert printed[0] == printed[1]


def test_sanitizers_are_silent(tmp_path):
    required("gcc")
    robot = load("wang-ctmrts-6")
    folder = towline.export_step(robot, tmp_path / "step")
    flags = [*FLAGS, "-O0", "-g1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    linked = subprocess.run(["gcc", *flags, "main.c", "towline_step.c", "-lm", "-o", "main"], cwd=folder, check=False)
    if linked.returncode:
        pytest.skip("gcc has no sanitizers here")
    text = "".join(line(row) for row in random_states(robot, 2000, seed=11).rows(robot))
    done = subprocess.run([folder / "main", "--rate", "5"], input=text, capture_output=True, text=True)
    assert done.returncode == 0
    assert done.stderr == ""
