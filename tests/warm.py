"""Run scripts in forks of one Python that has imported what towline imports, late things too; only that is shared.

Most of what a command of a second does is importing. Tests of imports, of signals and of the start do not use it.
"""

import atexit
import gc
import importlib
import json
import os
import pkgutil
import runpy
import signal
import subprocess
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import towline as package

TOWLINE = Path(sys.executable).with_name("towline")
LATE = ["dask.array", "h5netcdf", "matplotlib.backends.backend_agg", "matplotlib.pyplot", "mpl_toolkits.mplot3d"]
LONGEST = 600  # [s]: what hangs is ended, what is slow is not

_codes = []  # of the process that a fork has become, once it has ended


def towline(*arguments, cwd=None, code=0):
    """Run the installed command; it must end with `code`, and nothing that it does may show a traceback."""
    done = run(TOWLINE, *arguments, cwd=cwd, env={**os.environ, "COLUMNS": "120", "NO_COLOR": "1"})
    assert "Traceback" not in done.stderr + done.stdout
    assert done.returncode == code, done.stderr + done.stdout
    return done


def run(script, *arguments, cwd=None, env=None):
    """Run a script of Python as `subprocess.run` does, without waiting for imports."""
    command = [str(script), *map(str, arguments)]
    if not hasattr(os, "fork"):
        command = command if script == TOWLINE else [sys.executable, *command]
        return subprocess.run(command, capture_output=True, text=True, cwd=cwd, env=env, timeout=LONGEST, check=False)
    with TemporaryDirectory() as folder:
        streams = [os.path.join(folder, name) for name in ("stdout", "stderr")]
        environment = dict(os.environ if env is None else env)
        server = _server()
        server.stdin.write(json.dumps([command, str(cwd or Path.cwd()), environment, streams]) + "\n")
        server.stdin.flush()
        code = int(server.stdout.readline())
        return subprocess.CompletedProcess(command, code, *[Path(stream).read_text() for stream in streams])


@cache
def _server():
    """Start the process that forks. It ends when its standard input does, at the latest with this process."""
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    server = subprocess.Popen([sys.executable, __file__], process_group=0, **pipes)
    atexit.register(server.communicate)
    return server


def _import_all():
    gc.disable()
    for module in pkgutil.walk_packages(package.__path__, "towline."):
        with suppress(ImportError):  # of what is not installed
            importlib.import_module(module.name)
    for name in LATE:
        importlib.import_module(name)
    gc.enable()
    gc.freeze()  # what is never touched again is not copied for a fork


def _serve():
    """Fork for each request, and return the request in the fork; return None when there are no more."""
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            return json.loads(line)
        signal.signal(signal.SIGALRM, lambda *_, child=child: os.kill(child, signal.SIGKILL))
        signal.alarm(LONGEST)
        _, status = os.waitpid(child, 0)
        signal.alarm(0)
        print(os.waitstatus_to_exitcode(status), flush=True)
    return None


def _become(command, folder, environment, streams):
    """Be the process of a command, from its first line on."""
    for number, name in enumerate([os.devnull, *streams]):
        opened = os.open(name, os.O_RDWR | os.O_CREAT)
        os.dup2(opened, number)
        os.close(opened)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = command
    sys.path[0] = str(Path(command[0]).parent)
    try:
        runpy.run_path(command[0], run_name="__main__")
        _codes.append(0)
    except SystemExit as left:
        _codes.append(left.code if isinstance(left.code, int) else int(left.code is not None))
        raise


def _end():
    """End without deleting thousands of modules one by one, which takes longer than many a command."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(_codes[0] if _codes else 1)


if __name__ == "__main__":
    atexit.register(_end)  # before any other, which makes it the last
    _import_all()
    request = _serve()
    if request is not None:
        _become(*request)
