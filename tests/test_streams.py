"""Standard output and standard error that are closed, full, or read no further: exit codes stay those documented."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

TOWLINE = Path(sys.executable).with_name("towline")
GONE = "trap '' PIPE; while echo; do :; done 2>/dev/null"  # until nobody reads what is written
TASK = "name: rest\npath: {kind: rest, pose: [0, 0, -1]}\nduration: 0.3\n"

pytestmark = pytest.mark.skipif(os.name == "nt", reason="there are other shells there")


def shell(command, folder):
    """Run a command of the shell, of which towline is the first word."""
    line = command.replace("towline", f"'{TOWLINE}'", 1)
    return subprocess.run(["bash", "-c", line], cwd=folder, capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.parametrize("closed", ["2>&-", "<&- >&- 2>&-"])
def test_closed_streams_are_those_of_nobody(closed, tmp_path):
    (tmp_path / "rest.yaml").write_text(TASK)
    done = shell(f"towline plan wang-flying rest.yaml --out plan.nc {closed}", tmp_path)
    assert done.returncode == 0, done.stderr
    assert ("FEASIBLE" in done.stdout) == (closed == "2>&-")
    assert done.stderr == ""
    assert (tmp_path / "plan.nc").read_bytes().startswith(b"\x89HDF")
    assert shell(f"towline robots nothing {closed}", tmp_path).returncode == 2


@pytest.mark.parametrize(
    ("command", "code"),
    [
        ("towline robots | true", 141),
        ("towline robots | cat", 0),
        ("towline robots nothing | true", 2),
        ("towline tension wang-flying --pose '0.6 0 -1 0 0 0' | true", 141),
    ],
)
def test_a_pipe_that_is_closed_is_no_no(command, code, tmp_path):
    """The code is that of common tools: 128 and the number of SIGPIPE."""
    writer, reader = command.rsplit(" | ", 1)
    waiting = f"{GONE}; " if reader == "true" else ""
    done = shell(f"set -o pipefail; {{ {waiting}{writer}; }} | {reader}", tmp_path)
    assert done.returncode == code, done.stderr
    assert done.stderr.count("\n") == ("nothing |" in command)  # with its reason


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no /dev/full")
@pytest.mark.parametrize(
    ("command", "code"),
    [
        ("towline robots nothing 2>/dev/full", 2),
        ("towline robots >/dev/full", 2),
        ("towline robots >/dev/full 2>&1", 2),
        ("towline robots 2>/dev/full", 0),
        ("towline --help >/dev/full", 2),
        ("towline tension wang-flying --pose '0.6 0 -1 0 0 0' 2>/dev/full", 1),
    ],
)
def test_a_full_device_changes_no_exit_code(command, code, tmp_path):
    done = shell(command, tmp_path)
    assert done.returncode == code
    assert done.stderr.count("\n") == (">/dev/full" in command.replace("2>/dev/full", "") and "2>&1" not in command)
