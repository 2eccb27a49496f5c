"""Signals at random moments of every long command: one line, 130 or 143, within a second, and nothing left.

    python -m tests.soak signals [--start 0] [--count 100] [--only plan,...]

Each command is ended `count` times, by SIGINT or SIGTERM, sent to it alone or to its workers too, at a moment between
its first reading of signals and its usual end. A command that ends before is counted, and must have ended well.

The commands named "... on dask" send their work to a scheduler with a worker of its own, see `cluster`. Both outlive
the commands, and must drop the work of each that is ended.
"""

from __future__ import annotations

import contextlib
import os
import random
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from towline import Dynamics, load, plan

from .cluster import Cluster, cluster

PROMPT = 1.0  # [s] from the signal to the end
LONGEST = 60.0  # [s]
STOP = {signal.SIGINT: 130, signal.SIGTERM: 143}
LINE = re.compile(r"towline: stopped[^\n]*\n")

CIRCLE = """\
name: circle
path: {kind: circle, centre: [0, 0, -1], radius: 0.5, rate: 3}
base: {kind: free, acceleration_max: 3, ends: periodic}
"""
SLOW = """\
name: slow
path: {kind: line, start: [0, 0, 0], end: [2, 0, 0]}
duration: {min: 1.5, max: 8}
base: {kind: free}
tube: {position: free, attitude: free}
objective: {time: 1}
steps: 800
"""
TRACK = "name: track\npath: {kind: circle, centre: [0, 0, 2], radius: 2, rate: 0.6}\n"


class Case(NamedTuple):
    """A command, how long it takes at least [s], what it may leave (files and folders), and whether it uses Dask."""

    arguments: str
    seconds: float
    leaves: tuple[str, ...] = ()
    on_dask: bool = False


CHECKPOINT = ("c", "c-wal", "c-shm")
CASES = {
    "plan": Case("plan multi-quadrotor-3 slow.yaml --out p.nc", 8.0, ("p.nc",)),
    "sweep": Case(
        "plan wang-flying circle.yaml --vary robot.platform.mass=0.5:3:0.01 --workers 2 --checkpoint c",
        12.0,
        CHECKPOINT,
    ),
    "time": Case("time cogiro track.yaml --grid 6400 --out t.yaml", 4.0, ("t.yaml",)),
    "simulate": Case("simulate wang-flying plan.nc --controller predictive --duration 20 --out s.nc", 8.0, ("s.nc",)),
    "runs": Case(
        "simulate wang-flying plan.nc --runs 20000 --wind '3 2 0.5' --gusts 1 --workers 2 --checkpoint c --out s.nc",
        12.0,
        (*CHECKPOINT, "s.nc"),
    ),
    "workspace": Case(
        "workspace wang-flying --samples 2e7 --workers 2 --checkpoint c --out w.nc", 12.0, (*CHECKPOINT, "w.nc")
    ),
    "calibrate": Case("calibrate cogiro log.csv --out r.yaml", 6.0, ("r.yaml",)),
    "reproduce": Case("reproduce flying --out paper", 15.0, ("paper",)),
    "bench": Case("bench tension --count 2000 --out bench", 10.0, ("bench",)),
    "demo": Case("demo", 8.0, ("towline-demo",)),
    "export": Case("export wang-flying --step step", 2.0, ("step",)),
}
CASES |= {
    f"{name} on dask": case._replace(arguments=case.arguments.replace("--workers 2", "--scheduler"), on_dask=True)
    for name, case in CASES.items()
    if "--workers 2" in case.arguments
}


def prepare(folder: Path) -> None:
    """Write what the commands read."""
    for name, text in (("circle", CIRCLE), ("slow", SLOW), ("track", TRACK)):
        (folder / f"{name}.yaml").write_text(text)
    line = {"kind": "line", "start": [0, 0, -1], "end": [0.1, 0, -1.2]}
    plan("wang-flying", {"path": line, "duration": 1}).save(folder / "plan.nc")
    robot, rng = load("cogiro"), np.random.default_rng(0)
    poses = robot.home + np.c_[rng.uniform(-1, 1, (400, 3)), rng.uniform(-0.1, 0.1, (400, 3))]
    lengths = Dynamics(robot).cable_lengths(poses) + 1e-3 * rng.normal(size=(400, robot.m))
    head = ",".join(f"l{k} [m]" for k in range(robot.m))
    np.savetxt(folder / "log.csv", lengths, delimiter=",", header=head, comments="")


def processes_of(session: int) -> list[int]:
    """Return the ids of the living processes of a session."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            fields = entry.read_text().rpartition(")")[2].split()
            if int(fields[3]) == session and fields[0] != "Z":
                found.append(int(entry.parent.name))
    return found


def _heed() -> None:
    """Undo that a shell's background job, and so whatever it starts, ignores SIGINT."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


def _listens(process: subprocess.Popen[str]) -> None:
    """Wait until SIGTERM has a handler: until then it is Python that starts, and ends with a traceback or nothing."""
    status = Path(f"/proc/{process.pid}/status")
    while process.poll() is None and not int(status.read_text().partition("SigCgt:")[2].split()[0], 16) >> 14 & 1:
        time.sleep(0.01)


def attempt(case: Case, given: Path, seed: int, beside: Cluster | None = None) -> str:
    """End a command once; return "stopped", "ended", or what is wrong with it or in the cluster that it uses."""
    result = _end(case, given, seed, beside)
    return result if beside is None or not case.on_dask else beside.left() or result


def _end(case: Case, given: Path, seed: int, beside: Cluster | None) -> str:
    draw = random.Random(seed)
    number, to_all = draw.choice(list(STOP)), draw.random() < 0.5
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place, "here")
        shutil.copytree(given, folder)
        before = set(os.listdir(folder))
        arguments = case.arguments
        if case.on_dask:
            assert beside is not None
            arguments = arguments.replace("--scheduler", f"--scheduler {beside.address}")
        command = [Path(sys.executable).with_name("towline"), *shlex.split(arguments)]
        pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        process = subprocess.Popen(command, cwd=folder, preexec_fn=_heed, start_new_session=True, **pipes)
        _listens(process)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(draw.uniform(0.0, case.seconds))
        if process.poll() is not None:
            _, err = process.communicate()
            return "ended" if process.returncode in (0, 1) else f"ended by itself with {process.returncode}: {err}"
        (os.killpg if to_all else os.kill)(process.pid, number)
        sent = time.perf_counter()
        try:
            out, err = process.communicate(timeout=LONGEST)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            return f"no end within {LONGEST:g} s"
        took = time.perf_counter() - sent
        if process.returncode in (0, 1) and took < PROMPT:
            return "ended"  # at the same moment
        if process.returncode != STOP[number]:
            return f"code {process.returncode} for {number.name}: {err}"
        if not LINE.fullmatch(err):
            return f"not one line: {err!r}"
        if took > PROMPT:
            return f"took {took:.2f} s"
        if left := set(os.listdir(folder)) - before - set(case.leaves):
            return f"left {sorted(left)}, with output {out[:80]!r}"
        deadline = time.perf_counter() + PROMPT
        while there := processes_of(process.pid):
            if time.perf_counter() > deadline:
                os.killpg(process.pid, signal.SIGKILL)
                return f"{len(there)} processes left"
            time.sleep(0.02)
    return "stopped"


def soak(start: int, count: int, names: Sequence[str]) -> bool:
    """End each command `count` times, print what is wrong, and return whether nothing is."""
    wrong = 0
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        prepare(Path(folder))
        beside = stack.enter_context(cluster()) if any(CASES[name].on_dask for name in names) else None
        for name in names:
            counts: Counter[str] = Counter()
            for seed in range(start, start + count):
                result = attempt(CASES[name], Path(folder), seed, beside)
                counts[result if result in ("stopped", "ended") else "wrong"] += 1
                if result not in ("stopped", "ended"):
                    print(f"{name}, seed {seed}: {result}", flush=True)
            wrong += counts["wrong"]
            stopped, ended = counts["stopped"], counts["ended"]
            print(f"{name}: {stopped} stopped, {ended} ended before, {counts['wrong']} wrong", flush=True)
    return not wrong
