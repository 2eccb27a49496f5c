"""Checkpoints: a run that was killed goes on and ends with the identical file; no foreign file is touched."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from towline.base.checkpoint import begin, open_checkpoint
from towline.base.errors import InputError
from towline.models import load
from towline.solvers import compiled
from towline.workspace import Condition, StaticEquilibrium, sample, save
from towline.workspace.checkpoint import KIND
from towline.workspace.sampling import CHUNK

TOWLINE = Path(sys.executable).with_name("towline")
SAMPLES = 3 * CHUNK + 1000
RECORD = 16 + CHUNK // 8 + 4  # bytes


class Counting(StaticEquilibrium):
    """Rest; counts how many places it was evaluated at."""

    def evaluate(self, robot, places):
        counts.append(len(places.pose))
        return super().evaluate(robot, places)


counts: list[int] = []


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A run that nothing interrupted: checkpoint and result."""
    folder = tmp_path_factory.mktemp("whole")
    found = run(folder / "run.checkpoint", False)
    return (folder / "run.checkpoint").read_bytes(), save(found, folder / "result.nc").read_bytes()


def run(checkpoint, resume, condition: Condition | None = None, **changed):
    arguments = {"samples": SAMPLES, "seed": 4, "keep": "all", **changed}
    return sample(
        load("wang-flying"), condition or StaticEquilibrium(), checkpoint=checkpoint, resume=resume, **arguments
    )


def test_killed_and_resumed_is_the_identical_file(tmp_path):
    """A real process with two workers, killed as soon as some chunks are there; nobody of it lives on."""
    compiled.keep()  # or the run would spend its first minute with that
    command = [str(TOWLINE), "workspace", "wang-flying", "--samples", "1e6", "--json", "--resume"]
    options = {"cwd": tmp_path, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    first = subprocess.Popen([*command, "killed", "--workers", "2"], **options)
    deadline = time.monotonic() + 100
    while not (tmp_path / "killed").exists() or (tmp_path / "killed").stat().st_size < 10 * RECORD:
        assert first.poll() is None, first.stderr.read()
        assert time.monotonic() < deadline
        time.sleep(0.002)
    children = [int(child) for child in Path(f"/proc/{first.pid}/task/{first.pid}/children").read_text().split()]
    first.send_signal(signal.SIGKILL)
    first.wait()
    size = (tmp_path / "killed").stat().st_size
    assert size < 62 * RECORD, "it was done before it was killed"
    while any(alive(child) for child in children):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    second = subprocess.run([*command, "killed", "--out", "killed.nc"], check=False, timeout=120, **options)
    assert second.returncode == 0, second.stderr
    subprocess.run([*command, "other", "--out", "other.nc"], check=True, timeout=120, **options)
    assert (tmp_path / "killed").read_bytes() == (tmp_path / "other").read_bytes()
    assert (tmp_path / "killed.nc").read_bytes() == (tmp_path / "other.nc").read_bytes()


def alive(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.parametrize("lost", [1, RECORD - 1, RECORD, 2 * RECORD + 7, 10**6])
def test_a_torn_end_is_dropped(tmp_path, whole, lost):
    """Wherever the file ends, down to its bare header."""
    content, result = whole
    header = len(content) - 3 * RECORD - (16 + 1000 // 8 + 4)
    file = tmp_path / "run.checkpoint"
    file.write_bytes(content[: max(header, len(content) - lost)])
    found = run(file, True)
    assert file.read_bytes() == content
    assert save(found, tmp_path / "result.nc").read_bytes() == result


def test_garbage_at_the_end_is_dropped(tmp_path, whole):
    """As a power cut can leave: the length is there, the content is not."""
    content, result = whole
    file = tmp_path / "run.checkpoint"
    for lost, zeros in ((100, 100), (RECORD + 5, 3 * RECORD)):
        file.write_bytes(content[:-lost] + bytes(zeros))
        assert save(run(file, True), tmp_path / "result.nc").read_bytes() == result
        assert file.read_bytes() == content


def test_what_is_there_is_not_asked_again(tmp_path):
    """The condition is evaluated at one place, to check whether it applies, and in the chunks that are missing."""
    file = tmp_path / "run.checkpoint"
    counts.clear()
    first = run(file, False, Counting())
    assert sum(counts) == 1 + SAMPLES
    counts.clear()
    assert run(file, True, Counting()).drop_attrs().identical(first.drop_attrs())
    assert sum(counts) == 1
    with file.open("r+b") as stream:
        stream.truncate(file.stat().st_size - 1)
    counts.clear()
    run(file, True, Counting())
    assert sum(counts) == 1 + 1000


def test_refinement_goes_on_too(tmp_path):
    options = {"method": "adaptive", "samples": 60_000}
    file = tmp_path / "run.checkpoint"
    first = save(run(file, False, **options), tmp_path / "first.nc").read_bytes()
    content = file.read_bytes()
    file.write_bytes(content[: len(content) * 2 // 3])
    assert save(run(file, True, **options), tmp_path / "second.nc").read_bytes() == first
    assert file.read_bytes() == content


@pytest.mark.parametrize(
    ("changed", "name"),
    [
        ({"seed": 5}, "seed 4, not 5"),
        ({"samples": SAMPLES + 1}, "with samples 5"),
        ({"method": "sobol"}, 'method "random", not "sobol"'),
        ({"region": {"attitude": [0, 0, 0.1]}}, "with region "),
    ],
)
def test_a_checkpoint_of_another_run_is_refused(tmp_path, whole, changed, name):
    file = tmp_path / "run.checkpoint"
    file.write_bytes(whole[0])
    with pytest.raises(InputError, match=name):
        run(file, True, **changed)
    assert file.read_bytes() == whole[0]


def test_a_checkpoint_of_another_robot_is_refused(tmp_path, whole):
    file = tmp_path / "run.checkpoint"
    file.write_bytes(whole[0])
    robot = load("wang-flying")
    heavier = robot.model_copy(update={"platform": robot.platform.model_copy(update={"mass": 2.0})})
    with pytest.raises(InputError, match="of another run, with robot "):
        sample(heavier, StaticEquilibrium(), samples=SAMPLES, seed=4, checkpoint=file, resume=True)
    assert file.read_bytes() == whole[0]


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda content: b"", "which is no checkpoint of towline's workspace"),
        (lambda content: b"robot: mine\n" * 100, "which is no checkpoint of towline's workspace"),
        (lambda content: content[: len(KIND.magic) + 2], "with a damaged header"),
        (lambda content: content[:60] + b"?" + content[61:], "with a damaged header"),
        (lambda content: content[: -2 * RECORD] + b"?" + content[-2 * RECORD + 1 :], "is damaged after chunk"),
        (lambda content: content + content, "is damaged after chunk 4"),
    ],
)
def test_a_damaged_or_foreign_file_is_left_as_it_is(tmp_path, whole, damage, message):
    file = tmp_path / "run.checkpoint"
    file.write_bytes(damage(whole[0]))
    before = file.read_bytes()
    with pytest.raises(InputError, match=message) as caught:
        run(file, True)
    assert "\n" not in str(caught.value)
    assert file.read_bytes() == before


def test_nothing_is_overwritten(tmp_path):
    file = tmp_path / "notes.txt"
    file.write_text("mine")
    with pytest.raises(InputError, match="checkpoint must be a new file unless it is resumed"):
        run(file, False)
    assert file.read_text() == "mine"
    with pytest.raises(InputError, match="must be the path of a file, got a folder"):
        run(tmp_path, True)
    with pytest.raises(InputError, match="cannot be written"):
        run(file / "below", True)
    assert os.listdir(tmp_path) == ["notes.txt"]


def test_of_two_runs_that_begin_at_once_one_has_the_file(tmp_path):
    """Both have seen that it is not there yet."""
    file = tmp_path / "run.checkpoint"
    assert begin(file, b"first")
    assert not begin(file, b"second")
    assert file.read_bytes() == b"first"
    assert os.listdir(tmp_path) == ["run.checkpoint"]


def test_a_full_disk_is_told_and_what_is_there_is_gone_on_with(tmp_path, whole):
    """A limit on the size of files stands for the disk."""
    resource = pytest.importorskip("resource")
    file = tmp_path / "run.checkpoint"
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (len(whole[0]) - RECORD, before[1]))
        with pytest.raises(
            InputError, match=r"run.checkpoint cannot be written after chunk 2 \(File too large\); it can be resumed"
        ):
            run(file, False)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    found = run(file, True)
    assert file.read_bytes() == whole[0]
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
        with pytest.raises(InputError, match=r"result.nc: cannot be written \(File too large\)"):
            save(found, tmp_path / "result.nc")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert os.listdir(tmp_path) == ["run.checkpoint"]


def test_one_run_at_a_time(tmp_path):
    pytest.importorskip("fcntl")
    file = tmp_path / "run.checkpoint"
    with (
        open_checkpoint(file, KIND, {"a": 1}, False),
        pytest.raises(InputError, match="to which another run is writing"),
    ):
        open_checkpoint(file, KIND, {"a": 1}, True).__enter__()
    with open_checkpoint(file, KIND, {"a": 1}, True) as again:
        assert again.stored == 0
