"""A start that does not wait: what a command loads, by name and not by the clock."""

import subprocess
import sys

import pytest

from towline.ocp.timing.toppra_law import imported_late

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


def test_a_module_that_is_imported_late_is_the_real_one_wherever_it_is_used(tmp_path, monkeypatch):
    """Its names are also needed at once, as a second thread may, and a module of the package beside it."""
    package = tmp_path / "heavy_package"
    package.mkdir()
    for name in ("__init__", "rare", "other"):
        (package / f"{name}.py").write_text(f"NAME = {name!r}\n")
    monkeypatch.syspath_prepend(tmp_path)
    with imported_late("heavy_package", "rare"):
        import heavy_package.rare as late
    assert "heavy_package" not in sys.modules
    with imported_late("heavy_package", "rare"):
        import heavy_package.rare as now
        from heavy_package.other import NAME
    assert (NAME, now.NAME, late.NAME, sys.modules["heavy_package"].NAME) == ("other", "rare", "rare", "__init__")
    with imported_late("another_package", "rare"):
        import another_package.rare
    with pytest.raises(ImportError):
        another_package.rare.draw()
    assert not {"another_package", "another_package.rare"} & set(sys.modules)
