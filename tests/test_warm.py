"""A script run in a fork of a process that has imported everything is run as in a process of its own."""

import os
import subprocess
import sys

import pytest

from .warm import TOWLINE, run

SCRIPT = """\
import atexit, os, sys
from beside import word
atexit.register(print, "at exit")
print(__name__, __file__, sys.argv, os.getcwd(), os.environ["WORD"], word, sys.stdin.read(), sys.stdout.isatty())
print("problem", file=sys.stderr)
"""


@pytest.mark.parametrize(
    "end", ["", "sys.exit()", "sys.exit(0)", "sys.exit(3)", "sys.exit('told')", "1 / 0", "os.abort()"]
)
def test_a_script_cannot_tell(end, tmp_path):
    (tmp_path / "beside.py").write_text("word = 'beside'\n")
    script = tmp_path / "script.py"
    script.write_text(SCRIPT + end)
    place = {"cwd": tmp_path, "env": {**os.environ, "WORD": "mine"}}
    warm = run(script, "one", 2, **place)
    options = {"capture_output": True, "text": True, "check": False, "stdin": subprocess.DEVNULL}
    cold = subprocess.run([sys.executable, script, "one", "2"], **options, **place)
    assert (warm.returncode, warm.stdout) == (cold.returncode, cold.stdout)
    assert warm.stderr.splitlines()[-1:] == cold.stderr.splitlines()[-1:]


@pytest.mark.parametrize("arguments", [["robots", "wang-flying"], ["tension", "wang-flying", "--pose", "1 2 3"]])
def test_the_command_cannot_tell(arguments):
    warm = run(TOWLINE, *arguments)
    cold = subprocess.run([TOWLINE, *arguments], capture_output=True, text=True, check=False)
    assert (warm.returncode, warm.stdout, warm.stderr) == (cold.returncode, cold.stdout, cold.stderr)
