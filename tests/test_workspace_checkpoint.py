"""Checkpoints: a run that was killed goes on and ends with the identical result; no foreign file is touched."""

import contextlib
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from towline.base import checkpoint
from towline.base.checkpoint import Kind, open_checkpoint
from towline.base.errors import InputError
from towline.cli.main import app
from towline.models import load
from towline.workspace import Condition, StaticEquilibrium, sample, save
from towline.workspace.run import KIND
from towline.workspace.sampling import CHUNK

TOWLINE = Path(sys.executable).with_name("towline")
SAMPLES = 3 * CHUNK + 1000
PAGE = 16_384 + 24  # bytes in the log of SQLite for each chunk, at least


FOREIGN = "which is not a checkpoint of towline's workspace"


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


def test_killed_and_resumed_is_the_identical_file(tmp_path, monkeypatch):
    """A real process with two workers, killed as soon as some chunks are there; nobody of it lives on."""
    command = [str(TOWLINE), "workspace", "wang-flying", "--samples", "1e6", "--json", "--resume"]
    options = {"cwd": tmp_path, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    first = subprocess.Popen([*command, "killed", "--workers", "2"], **options)
    deadline = time.monotonic() + 100
    while not (tmp_path / "killed-wal").exists() or (tmp_path / "killed-wal").stat().st_size < 10 * PAGE:
        assert first.poll() is None, first.stderr.read()
        assert time.monotonic() < deadline
        time.sleep(0.002)
    children = [int(child) for child in Path(f"/proc/{first.pid}/task/{first.pid}/children").read_text().split()]
    first.send_signal(signal.SIGKILL)
    first.wait()
    (tmp_path / "copy").mkdir()
    for left in ("killed", "killed-wal"):  # reading takes the log in
        shutil.copy(tmp_path / left, tmp_path / "copy")
    chunks = stored(tmp_path / "copy" / "killed")
    assert 5 < len(chunks) < 62, "it was done before it was killed"
    while any(alive(child) for child in children):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    monkeypatch.chdir(tmp_path)
    second = CliRunner().invoke(app, [*command[1:], "killed", "--out", "killed.nc"])
    assert second.exit_code == 0, second.output
    save(sample(load("wang-flying"), StaticEquilibrium(), samples=1_000_000), tmp_path / "other.nc")
    resumed = stored(tmp_path / "killed")
    assert {number: resumed[number] for number in chunks} == chunks
    assert sorted(os.listdir(tmp_path)) == ["copy", "killed", "killed.nc", "other.nc"]
    assert (tmp_path / "killed.nc").read_bytes() == (tmp_path / "other.nc").read_bytes()


def stored(file):
    with contextlib.closing(sqlite3.connect(file)) as database:
        return dict(database.execute("SELECT number, content FROM record"))


def alive(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.parametrize("lost", [0, 1, 7000, 30_000, 10**9])
@pytest.mark.parametrize("zeros", [False, True], ids=["cut", "zeros"])
def test_what_a_power_cut_leaves_is_resumed(tmp_path, whole, monkeypatch, lost, zeros):
    """Wherever the log ends, down to nothing, or with zeros where nothing was written yet."""
    monkeypatch.setattr(checkpoint, "SAFE_EVERY", float("inf"))  # all chunks stay in the log
    left = {}

    def look(done, total, accepted):
        if done == total:  # before the file is closed
            left.update({name: (tmp_path / name).read_bytes() for name in os.listdir(tmp_path)})

    run(tmp_path / "run.checkpoint", False, progress=look)
    assert os.listdir(tmp_path) == ["run.checkpoint"]
    assert sorted(left) == ["run.checkpoint", "run.checkpoint-wal"]
    log = left["run.checkpoint-wal"]
    size = max(0, len(log) - lost)
    (tmp_path / "run.checkpoint").write_bytes(left["run.checkpoint"])
    (tmp_path / "run.checkpoint-wal").write_bytes(log[:size] + bytes(len(log) - size if zeros else 0))
    counts.clear()
    found = run(tmp_path / "run.checkpoint", True, Counting())
    assert counts[0] == 1
    assert (sum(counts) == 1) == (lost == 0)
    assert save(found, tmp_path / "result.nc").read_bytes() == whole[1]
    assert sorted(os.listdir(tmp_path)) == ["result.nc", "run.checkpoint"]


def lose(file, more=""):
    """Remove the last chunk from a checkpoint, or those that `more` selects."""
    with contextlib.closing(sqlite3.connect(file)) as database, database:
        database.execute(f"DELETE FROM record WHERE number {more or '= (SELECT max(number) FROM record)'}")


def test_what_is_there_is_not_asked_again(tmp_path):
    """The condition is evaluated at one place, to check whether it applies, and in the chunks that are missing."""
    file = tmp_path / "run.checkpoint"
    counts.clear()
    first = run(file, False, Counting())
    assert sum(counts) == 1 + SAMPLES
    counts.clear()
    assert run(file, True, Counting()).drop_attrs().identical(first.drop_attrs())
    assert sum(counts) == 1
    lose(file)
    counts.clear()
    run(file, True, Counting())
    assert sum(counts) == 1 + 1000
    lose(file, "= 1")  # also in the middle
    counts.clear()
    assert run(file, True, Counting()).drop_attrs().identical(first.drop_attrs())
    assert sum(counts) == 1 + CHUNK


def test_refinement_goes_on_too(tmp_path):
    options = {"method": "adaptive", "samples": 60_000}
    file = tmp_path / "run.checkpoint"
    first = save(run(file, False, **options), tmp_path / "first.nc").read_bytes()
    lose(file, ">= 2")
    assert save(run(file, True, **options), tmp_path / "second.nc").read_bytes() == first


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
        (lambda content: b"robot: mine\n" * 100, FOREIGN),
        (lambda content: b"towline workspace checkpoint 2\n" + bytes(5000), FOREIGN),  # of older versions
        (lambda content: content[:68] + b"mine" + content[72:], FOREIGN),  # the database of another program
        (lambda content: content[: len(content) // 2], "which is damaged"),
        (lambda content: content.replace(b'"robot"', b'"rabot"'), "which is damaged"),
        (lambda content: content[:-2000] + b"?" + content[-1999:], "which is damaged"),
        (lambda content: content[:16_384] + b"?" * 8 + content[16_392:], "which is damaged"),  # a page of its table
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


def test_an_empty_file_is_a_new_one(tmp_path, whole):
    """As a run leaves it that is killed before it has begun."""
    file = tmp_path / "run.checkpoint"
    file.touch()
    assert save(run(file, True), tmp_path / "result.nc").read_bytes() == whole[1]


def test_a_checkpoint_of_another_command_is_refused(tmp_path, whole):
    file = tmp_path / "run.checkpoint"
    file.write_bytes(whole[0])
    with pytest.raises(InputError, match="which is not a checkpoint of towline's sweep"):
        open_checkpoint(file, Kind("sweep", "plan"), {}, True).__enter__()
    assert file.read_bytes() == whole[0]


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
    """Neither resumes, and both have seen that it is not there yet."""
    file = tmp_path / "run.checkpoint"
    with open_checkpoint(file, KIND, {"a": 1}, False) as first:
        with pytest.raises(InputError, match="must be a new file unless it is resumed"):
            open_checkpoint(file, KIND, {"a": 1}, False).__enter__()
        first.put(0, b"mine")
    with open_checkpoint(file, KIND, {"a": 1}, True) as again:
        assert list(again.items()) == [(0, b"mine")]
    assert os.listdir(tmp_path) == ["run.checkpoint"]


def test_a_full_disk_is_told_and_what_is_there_is_gone_on_with(tmp_path, whole):
    """A limit on the size of files stands for the disk."""
    resource = pytest.importorskip("resource")
    file = tmp_path / "run.checkpoint"
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (3 * PAGE, before[1]))
        with pytest.raises(
            InputError, match=r"run.checkpoint cannot be written after chunk [12] \(disk I/O error\); it can be resumed"
        ):
            run(file, False)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    found = run(file, True)
    assert save(found, tmp_path / "whole.nc").read_bytes() == whole[1]
    (tmp_path / "whole.nc").unlink()
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
        with pytest.raises(InputError, match=r"result.nc: cannot be written \(File too large\)"):
            save(found, tmp_path / "result.nc")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert os.listdir(tmp_path) == ["run.checkpoint"]


def test_one_run_at_a_time(tmp_path):
    file = tmp_path / "run.checkpoint"
    with (
        open_checkpoint(file, KIND, {"a": 1}, False),
        pytest.raises(InputError, match="to which another run is writing"),
    ):
        open_checkpoint(file, KIND, {"a": 1}, True).__enter__()
    with open_checkpoint(file, KIND, {"a": 1}, True) as again:
        assert again.stored == 0
