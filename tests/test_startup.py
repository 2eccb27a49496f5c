"""A start that does not wait: what a command loads, by name and not by the clock."""

import subprocess
import sys

import pytest

TASK = """\
name: circle
path: {kind: circle, centre: [0, 0, -1], radius: 0.5, rate: 0.6}
base: {kind: free, acceleration_max: 3, ends: periodic}
"""
HEAVY = {"xarray", "pandas", "dask", "distributed", "matplotlib.pyplot", "scipy", "rich", "viser", "osqp"}
NOT_LOADED = {
    "towline --help": HEAVY | {"numpy", "casadi", "pydantic", "ruamel"},
    "towline robots": HEAVY | {"numpy", "casadi", "ruamel"},  # Typer reads arguments with pydantic
    "towline plan wang-flying circle.yaml": HEAVY,
}


@pytest.mark.parametrize("command", NOT_LOADED)
def test_a_command_loads_only_what_it_uses(command, tmp_path):
    (tmp_path / "circle.yaml").write_text(TASK)
    code = "import sys; from towline.cli.main import main\ntry: main()\nfinally: print(*sys.modules, file=sys.stderr)"
    arguments = command.split()[1:]
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, cwd=tmp_path, check=True
    )
    assert not NOT_LOADED[command] & set(done.stderr.split())
