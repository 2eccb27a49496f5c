"""Ctrl-C and SIGTERM as they are sent: real signals from outside to Python's `plan` and to the command.

How soon a command ends is measured in processor time, which does not depend on what else the machine is doing.
"""

import contextlib
import math
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import casadi as ca
import pytest

from towline.ocp.nlp.waiting import heeding, wait_for

TOWLINE = Path(sys.executable).with_name("towline")
PROMPT = 1.0  # [s] of processor time from the signal to the end
SOON = 20.0  # [s] from the signal to the end, of which most is the work of others
LONGEST = 60.0  # [s] of anything else
TASK = """\
name: fast
path: {kind: line, start: [0, 0, 0], end: [2, 0, 0]}
duration: {min: 1.5, max: 8}
base: {kind: free}
tube: {position: free, attitude: free}
objective: {time: 1}
"""
HALF_WRITTEN = """\
import pathlib, sys, time
from towline.base.writing import whole_file
from towline.cli import stopping

stopping.listen()
with whole_file(pathlib.Path(sys.argv[1])) as temporary:
    temporary.write_text("half")
    while True:
        try:
            print("ready", flush=True)
            time.sleep(60)
        except KeyboardInterrupt:
            pass
"""
SCRIPT = """\
from towline.models import load
from towline.ocp import plan

robot = load("multi-quadrotor-3")
print("ready", flush=True)
try:
    plan(robot, "fast.yaml", lambda iteration, *_: print("iteration", iteration, flush=True))
except KeyboardInterrupt:
    print("interrupted", flush=True)
print("went on", flush=True)
"""

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals are sent otherwise there")


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "fast.yaml").write_text(TASK)
    (tmp_path / "slow.yaml").write_text(TASK + "steps: 800\n")
    (tmp_path / "script.py").write_text(SCRIPT)
    return tmp_path


def heed_interrupts():
    """Undo that a shell's background job, and so whatever it starts, ignores SIGINT."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


def start(command, folder, **pipes):
    pipes |= {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(command, cwd=folder, preexec_fn=heed_interrupts, **pipes)


def processor_time(process):
    """Return what a process has used [s]; where the system has no /proc, so much that nothing is measured."""
    file = Path(f"/proc/{process.pid}/stat")
    if not file.exists():
        return math.inf
    fields = file.read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def stop(process, number=signal.SIGINT, send=os.kill):
    """Send a signal; return output, errors and the processor time from then to the end [s]."""
    before = os.times()
    used = processor_time(process)
    send(process.pid, number)
    out, err = process.communicate(timeout=SOON)
    after = os.times()
    lived = after.children_user + after.children_system - before.children_user - before.children_system
    return out, err, lived - used


def wait_until_heeded(process):
    """Wait until SIGTERM has a handler: until then it is Python that starts, and ends with a traceback or nothing."""
    status = Path(f"/proc/{process.pid}/status")
    while status.exists() and not int(status.read_text().partition("SigCgt:")[2].split()[0], 16) >> 14 & 1:
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.01)


@pytest.mark.parametrize("moment", ["ready", "iteration 3"])
def test_an_interrupt_from_outside_ends_plan(folder, moment):
    """Before the first iteration the solver is made, then it solves: in neither may it go on."""
    process = start([sys.executable, "script.py"], folder)
    lines = iter(process.stdout.readline, "")
    assert any(line.strip() == moment for line in lines)
    time.sleep(0.4)  # into the next step
    process.send_signal(signal.SIGINT)
    assert any(line == "interrupted\n" for line in lines), process.stderr.read()
    assert list(lines) == ["went on\n"]
    # What still computed ends. If the interrupt hit the making of a dataclass, Python still dies of it in the end.
    assert process.wait(LONGEST) in (0, -signal.SIGINT)
    assert process.stderr.read() == ""


class Operand:
    """An operand of CasADi during whose conversion Ctrl-C is pressed."""

    @property
    def shape(self):
        signal.raise_signal(signal.SIGINT)
        return ()


def multiplied():
    """Multiply it; CasADi takes the interrupt as a wrong type, whatever other kind of number it then tries."""
    with contextlib.suppress(NotImplementedError, TypeError):
        _ = ca.SX(1) * Operand()


def interrupted(then):
    """Multiply with attention to interrupts, and go on."""
    with heeding():
        multiplied()
        if then == "a wait":
            wait_for(lambda: pytest.fail("it went on"))
        if then == "another error":
            raise ImportError("initialization failed")
        if then == "an exit":
            raise SystemExit


@pytest.mark.parametrize("then", ["the end", "a wait", "another error"])
def test_an_interrupt_that_casadi_swallows_is_raised_again(then, request):
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job ignores it
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, before))
    multiplied()  # no KeyboardInterrupt: if this fails, CasADi no longer swallows it, and `heeding` can go
    with pytest.raises(KeyboardInterrupt):
        interrupted(then)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    with heeding():
        wait_for(lambda: None)  # the interrupt is over


def test_a_swallowed_interrupt_is_raised_in_the_main_thread_only_and_never_after_its_end(request):
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, before))
    waited = []

    def beside():
        """Plan in another thread: its waits are no business of Ctrl-C."""
        wait_for(lambda: waited.append(True))

    def swallowed_beside():
        with heeding():
            multiplied()
            thread = threading.Thread(target=beside)
            thread.start()
            thread.join()

    with pytest.raises(KeyboardInterrupt):
        swallowed_beside()
    assert waited
    with pytest.raises(SystemExit):
        interrupted("an exit")
    wait_for(lambda: None)  # the interrupt is over


@pytest.mark.parametrize("seconds", [1.0, 2.5])  # imports, iterations
def test_an_interrupt_ends_the_command_with_one_line(folder, seconds):
    before = set(os.listdir(folder))
    process = start([TOWLINE, "plan", "multi-quadrotor-3", "slow.yaml"], folder)
    wait_until_heeded(process)
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(seconds)
    out, err, took = stop(process)
    assert took < PROMPT
    assert (process.returncode, out, err) == (130, "", "towline: stopped\n")
    assert set(os.listdir(folder)) == before


def test_an_interrupt_that_a_library_swallows_ends_the_command_all_the_same(tmp_path):
    """The thread that listens does not depend on what the main thread is doing, and leaves nothing half written."""
    process = start([sys.executable, "-c", HALF_WRITTEN, "half"], tmp_path)
    assert process.stdout.readline() == "ready\n"
    assert len(os.listdir(tmp_path)) == 1
    _, err, took = stop(process)
    assert (process.returncode, err) == (130, "towline: stopped\n")
    assert took < PROMPT
    assert not os.listdir(tmp_path)


def test_an_interrupt_before_anything_listens_is_one_line(tmp_path):
    code = (
        "import os, signal, sys\n"
        "class Interrupts:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'towline.cli.stopping':\n"
        "            os.kill(os.getpid(), signal.SIGINT)\n"
        "from towline.cli.entry import main\n"
        "sys.meta_path.insert(0, Interrupts())\n"
        "main()\n"
    )
    process = start([sys.executable, "-c", code], tmp_path)
    out, err = process.communicate(timeout=LONGEST)
    assert (process.returncode, out, err) == (130, "", "towline: stopped\n")


def test_an_interrupt_after_the_end_of_a_command_is_ignored(tmp_path):
    """When all is written, neither Python's own end nor the thread that listens may be cut short by Ctrl-C."""
    code = (
        "import os, signal, time\n"
        "from towline.cli import stopping\n"
        "stopping.listen()\n"
        "stopping.ignore()\n"
        "os.kill(os.getpid(), signal.SIGINT)\n"
        "time.sleep(2 * stopping.GRACE)\n"
        "print(stopping.requested())\n"
    )
    process = start([sys.executable, "-c", code], tmp_path)
    out, err = process.communicate(timeout=LONGEST)
    assert (process.returncode, out, err) == (0, "False\n", "")


STOP = {signal.SIGINT: 130, signal.SIGTERM: 143}
SWEEP = ["plan", "wang-flying", "circle.yaml", "--vary", "robot.platform.mass=0.5:3:0.01", "--workers", "2"]
SAMPLES = ["workspace", "wang-flying", "--samples", "2e7", "--workers", "2"]
CIRCLE = """\
name: circle
path: {kind: circle, centre: [0, 0, -1], radius: 0.5, rate: 3}
base: {kind: free, acceleration_max: 3, ends: periodic}
"""


def processes_of(session):
    """Return the ids of the living processes of a session, where the system has /proc."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            fields = entry.read_text().rpartition(")")[2].split()
            if int(fields[3]) == session and fields[0] != "Z":
                found.append(int(entry.parent.name))
    return found


@pytest.mark.parametrize(("number", "to_all", "work"), [(signal.SIGINT, True, SWEEP), (signal.SIGTERM, False, SAMPLES)])
def test_a_signal_ends_a_command_and_its_workers(number, to_all, work, tmp_path):
    """A terminal, Slurm and systemd send it to the workers too, a container to the command alone."""
    (tmp_path / "circle.yaml").write_text(CIRCLE)
    command = [TOWLINE, *work, "--checkpoint", "c"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(command, cwd=tmp_path, preexec_fn=heed_interrupts, start_new_session=True, **pipes)
    sizes = set()
    while len(sizes) < 2:  # until the first part of the work is stored
        time.sleep(0.05)
        assert process.poll() is None, process.stderr.read()
        sizes |= {(tmp_path / "c-wal").stat().st_size} if (tmp_path / "c-wal").exists() else set()
    out, err, _ = stop(process, number, os.killpg if to_all else os.kill)  # the time is also that of its workers
    assert (process.returncode, out) == (STOP[number], "")
    # What is stored is counted a moment later.
    counted = r"towline: stopped( after \d+ of (251 plans|20000000 samples))?; to continue, repeat the command with "
    assert re.fullmatch(counted + "--resume c\n", err), err
    # A thread ends the process where it does not end in time: then the log of the checkpoint is left beside it.
    assert {"c", "circle.yaml"} <= set(os.listdir(tmp_path)) <= {"c", "c-wal", "circle.yaml"}
    if Path("/proc/self").exists():
        deadline = time.perf_counter() + LONGEST
        while processes_of(process.pid):
            assert time.perf_counter() < deadline
            time.sleep(0.05)


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="the moment is found in /proc")
@pytest.mark.parametrize("running", [2, 6])
def test_a_signal_while_workers_start_is_one_line(running, tmp_path):
    """A worker that has no work yet must not end in a traceback of its own, nor go on: a container tells it nothing."""
    command = [TOWLINE, "workspace", "wang-flying", "--samples", "2e7", "--workers", "6", "--checkpoint", "c"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(command, cwd=tmp_path, start_new_session=True, **pipes)
    while len(processes_of(process.pid)) < running:
        assert process.poll() is None, process.stderr.read()
    process.terminate()
    out, err = process.communicate(timeout=LONGEST)
    assert (process.returncode, out, err.count("\n")) == (143, "", 1), err
    resumed = r"towline: stopped( after \d+ of \d+ samples)?; to continue, repeat the command with --resume c\n"
    assert re.fullmatch(resumed, err) or running == 2, err


def test_sigterm_leaves_nothing_half_written(tmp_path):
    process = start([sys.executable, "-c", HALF_WRITTEN, "new/half"], tmp_path)
    assert process.stdout.readline() == "ready\n"
    _, err, _ = stop(process, signal.SIGTERM)
    assert (process.returncode, err) == (143, "towline: stopped\n")
    assert not os.listdir(tmp_path)


def test_signals_that_whoever_started_the_command_ignores_are_ignored(tmp_path):
    """As a script's `&` does with SIGINT: the Ctrl-C is meant for the command in the foreground."""

    def ignore():
        for number in STOP:
            signal.signal(number, signal.SIG_IGN)

    (tmp_path / "rest.yaml").write_text("name: rest\npath: {kind: rest, pose: [0, 0, -1]}\nduration: 0.3\n")
    command = [TOWLINE, "plan", "wang-flying", "rest.yaml"]
    process = subprocess.Popen(command, cwd=tmp_path, preexec_fn=ignore)
    while process.poll() is None:
        for number in STOP:
            process.send_signal(number)
        time.sleep(0.02)
    assert process.returncode == 0
    assert (tmp_path / "wang-flying-rest.nc").exists()


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 0), (signal.SIGTERM, 143)])
def test_a_signal_ends_the_viewer(number, code, tmp_path):
    """Ctrl-C is how a user ends it, so that the answer is yes."""
    process = start([TOWLINE, "view", "wang-flying", "--port", "0"], tmp_path)
    assert any("http://" in line for line in iter(process.stdout.readline, ""))
    process.send_signal(number)
    _, err = process.communicate(timeout=LONGEST)
    assert (process.returncode, err) == (code, "\n" if code == 0 else "towline: stopped\n")


KEPT = """\
import sys

from towline.models import load
from towline.ocp import Planner

planner = Planner(load("multi-quadrotor-3"), "kept.yaml")
met = 0

def follow(iteration, objective, infeasibility):
    global met
    met += infeasibility < 1e-9
    if met == 3:
        print("met", flush=True)
        sys.stdin.readline()  # the search waits for the signal

try:
    planner.plan(follow)
except KeyboardInterrupt:
    best = planner.interrupted
    print(best.reason or best.status.value, best.audit.times[-1], flush=True)
    print(planner.plan().status.value, flush=True)
"""


def test_the_best_motion_so_far_is_kept_and_the_planner_can_be_used_again(folder):
    """Once iterates meet all constraints, an interrupt leaves an audited motion of a duration that the task allows."""
    (folder / "kept.py").write_text(KEPT)
    (folder / "kept.yaml").write_text(TASK + "steps: 16\n")
    process = start([sys.executable, "kept.py"], folder, stdin=subprocess.PIPE)
    assert any(line.strip() == "met" for line in iter(process.stdout.readline, ""))
    process.send_signal(signal.SIGINT)
    out, err = process.communicate("\n", timeout=120)
    assert process.returncode == 0, err
    reason, again = [line for line in out.splitlines() if line != "met"]
    status, _, duration = reason.rpartition(" ")
    assert status in ("feasible", "the search was interrupted")
    assert 1.5 <= float(duration) <= 8
    assert again == "feasible"
