"""One import: every public name loads from `towline` when it is first used, and is the one that its package has."""

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

import towline

ROOT = Path(__file__).parent.parent


@pytest.mark.parametrize("name", towline.__all__)
def test_every_public_name_is_that_of_its_package(name):
    home = importlib.import_module(f"towline.{towline._HOME[name]}")
    assert getattr(towline, name) is getattr(home, name)


def test_names_are_listed_before_they_load():
    code = "import towline; print(' '.join(dir(towline)))"
    listed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert set(listed) == {*towline.__all__, *towline._PACKAGES, "__version__"}


def test_type_checkers_see_what_loads():
    """The imports under TYPE_CHECKING, the table of homes and `__all__` hold the same names."""
    tree = ast.parse((ROOT / "__init__.py").read_text())
    block = next(node for node in tree.body if isinstance(node, ast.If))
    typed = {
        alias.name: node.module for node in ast.walk(block) if isinstance(node, ast.ImportFrom) for alias in node.names
    }
    assert typed == towline._HOME
    assert set(towline.__all__) == set(typed)


def test_importing_towline_loads_no_package():
    ours = "[m for m in sys.modules if m.split('.')[0] in ('towline', 'numpy', 'casadi')]"
    code = f"import sys; import towline; print(*{ours})"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert set(loaded) == {"towline", "towline.base", "towline.base.former_names", "towline.base.version"}


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'plna'"):
        towline.plna  # noqa: B018
