"""A start that does not wait: what a command loads, by name and not by the clock."""

import subprocess
import sys

import pytest

from towline.benchmarks.startup import TARGETS, TASK

HEAVY = {"xarray", "pandas", "dask", "distributed", "numba", "matplotlib.pyplot", "scipy", "rich", "viser", "osqp"}
NOT_LOADED = {
    "towline --help": HEAVY | {"numpy", "casadi", "pydantic", "ruamel"},
    "towline robots": HEAVY | {"numpy", "casadi", "ruamel"},  # Typer reads arguments with pydantic
    "towline plan wang-flying circle.yaml": HEAVY,
}


@pytest.mark.parametrize("label", TARGETS)
def test_a_command_loads_only_what_it_uses(label, tmp_path):
    (tmp_path / "circle.yaml").write_text(TASK)
    code = "import sys; from towline.cli.main import main\ntry: main()\nfinally: print(*sys.modules, file=sys.stderr)"
    command = [sys.executable, "-c", code, *TARGETS[label][0]]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=True)
    assert not NOT_LOADED[label] & set(done.stderr.split())
