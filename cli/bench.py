"""`towline bench`: towline against other solvers, measured on this machine."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import typer

from .options import PLAIN, Command, JsonOption, parameters, print_json, print_result
from .watching import progress_bar

app = typer.Typer(**PLAIN)


@app.callback()
def _bench() -> None:
    """Measure towline against other solvers on this machine."""


@contextmanager
def results_alone() -> Iterator[None]:
    """Redirect what libraries print in the block to standard error: HiGHS, from 1.16 on, prints its version.

    C code prints this, not Python, so the file descriptor itself changes.
    """
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


@app.command("tension", cls=Command)
@parameters("""
    --count: Random problems per task.
    --repeats: Runs of each solver on each task.
    --m: Numbers of cables of the problems, separated by commas.
    --limit: Longest time for one solver on one task [s].
    --out: Folder for tension.md and tension.png.
""")
def tension(
    count: int = 100,
    repeats: int = 5,
    m: str = "6,7,8,12",
    limit: float = 5.0,
    out: Path | None = None,
    as_json: JsonOption = False,
) -> None:
    """Measure speed, accuracy and failures of every installed solver."""
    from ..base.errors import InputError
    from ..base.writing import check_writable
    from ..benchmarks import tension as benchmark

    try:
        cables = [int(word) for word in m.replace(",", " ").split()]
    except ValueError:
        raise InputError(f"--m must be numbers of cables from 1 to 16, separated by commas, got {m!r}") from None
    if out is not None:
        check_writable(out / "tension.md")
    with results_alone(), progress_bar("tension distribution", quiet=as_json) as progress:
        report = benchmark.run(count, repeats, cables, limit, progress)
    written = benchmark.write(report, out) if out is not None else []
    if as_json:
        print_json({**report.to_dict(), "files": written})
    else:
        typer.echo(benchmark.markdown(report), nl=False)
        for name in written:
            typer.echo(name)


@app.command("control", cls=Command)
@parameters("""
    --steps: Control steps per run, one per millisecond.
    --seeds: Runs of each controller, each with different gusts.
""")
def control(steps: int = 500, seeds: int = 3, as_json: JsonOption = False) -> None:
    """Compare control steps and solvers for predictive control."""
    from ..benchmarks import control as benchmark

    with results_alone(), progress_bar("control", quiet=as_json) as progress:
        report = benchmark.run(steps, seeds, progress=progress)
    print_result(as_json, report.to_dict(), lambda: benchmark.markdown(report).removesuffix("\n"))
