"""The house keeps its shape: imports point down, packages are listed, importing is cheap."""

import ast
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parent.parent

# From the ground up: a file may import files of its own room and of rooms on lower floors.
FLOORS = [
    {"base", "core"},
    {"models", "solvers", "figures"},
    {"statics", "plant"},
    {"workspace", "estimation", "control", "ocp"},
    {"simulation", "export", "layout"},
    {"studies"},
    {"benchmarks", "viewer"},
    {"cli"},
]
FLOOR = {room: level for level, floor in enumerate(FLOORS) for room in floor}
CONFIGURATION = tomllib.loads((ROOT / "pyproject.toml").read_text())


def rooms():
    """Folders at the top that are packages."""
    return {path.parent.name for path in ROOT.glob("*/__init__.py")}


def modules(root, tops):
    """The files of the package by their names without `towline.`; the package itself is the empty name."""
    files = {root / "__init__.py", *(file for top in tops for file in (root / top).rglob("*.py"))}
    names = {file: ".".join(file.relative_to(root).with_suffix("").parts) for file in files}
    return {name.removesuffix("__init__").removesuffix("."): file for file, name in names.items()}


@cache
def tree(file):
    return ast.parse(file.read_text())


def imports(name, file, known):
    """The modules that a file imports anywhere: also inside functions, and under TYPE_CHECKING."""
    package = name.split(".") if file.name == "__init__.py" else name.split(".")[:-1]
    package = [part for part in package if part]
    found = set()
    for node in ast.walk(tree(file)):
        if isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else []
            parts = [*above, *(node.module.split(".") if node.module else [])]
            if not node.level and parts[0] != "towline":
                continue
            origin = ".".join(parts if node.level else parts[1:])
            for alias in node.names:
                member = f"{origin}.{alias.name}".lstrip(".")
                found.add(member if member in known else origin)
        elif isinstance(node, ast.Import):
            found |= {alias.name[8:] for alias in node.names if alias.name.startswith("towline.")}
    return (found & known) - {name}


def graph(root=ROOT, tops=None):
    """The modules that each module imports."""
    files = modules(root, rooms() if tops is None else tops)
    return {name: imports(name, file, set(files)) for name, file in files.items()}


def circles(arrows):
    """Modules that are on a circle: what can be reached from it reaches it."""
    left = {name: set(others) for name, others in arrows.items()}
    while ends := {name for name, others in left.items() if not others}:
        left = {name: others - ends for name, others in left.items() if name not in ends}
    return set(left)


def test_no_import_goes_up_or_round():
    arrows = graph()
    assert rooms() == set(FLOOR), "a new room needs its floor in this test"
    for name, others in arrows.items():
        room = name.split(".")[0]
        for other in others if room else ():
            target = other.split(".")[0]
            assert target == room or FLOOR.get(target, len(FLOORS)) < FLOOR[room], f"{name} imports {other}"
    assert not circles(arrows)


def test_the_root_holds_folders():
    """Beside metadata there are two files at the top: the package's own, and that of its build."""
    assert {path.name for path in ROOT.glob("*.py")} == {"__init__.py", "setup.py"}


def test_the_import_test_can_see(tmp_path):
    """It sees late imports, those for types only, and circles of three files."""
    assert "solvers.solve" in graph(tops=["solvers"])["solvers"]
    lines = {
        "one": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from .two import b",
        "two": "def f():\n    from . import three",
        "three": "import towline.room.one",
    }
    (tmp_path / "room").mkdir()
    for name, text in {"__init__": "", **lines}.items():
        (tmp_path / "room" / f"{name}.py").write_text(text)
    (tmp_path / "__init__.py").write_text("from .room.one import a")
    arrows = graph(tmp_path, ["room"])
    assert arrows == {
        "": {"room.one"},
        "room": set(),
        "room.one": {"room.two"},
        "room.two": {"room.three"},
        "room.three": {"room.one"},
    }
    assert {"room.one", "room.two", "room.three"} <= circles(arrows)


def test_former_names_can_be_imported():
    """The public packages that moved, with a warning, and without one where the short name stays."""
    import importlib
    import warnings

    import pytest

    from towline.base import former_names

    for old, new in former_names.NOW.items():
        sys.modules.pop(f"towline.{old}", None)
        if old in former_names.SHORT:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                module = importlib.import_module(f"towline.{old}")
        else:
            with pytest.warns(DeprecationWarning, match=f"towline.{old} is called towline.{new} now"):
                module = importlib.import_module(f"towline.{old}")
        assert module is importlib.import_module(f"towline.{new}")
        assert module.__spec__.name == f"towline.{new}"
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("towline.embedding")
    import towline

    assert importlib.import_module("towline.calibration.solving") is towline.estimation.calibration.solving
    (ROOT / "calibration").mkdir()  # as `git pull` leaves one with the compiled modules of before
    try:
        for name in [name for name in sys.modules if name.startswith("towline.calibration")]:
            del sys.modules[name]
        assert importlib.import_module("towline.calibration") is towline.estimation.calibration
    finally:
        (ROOT / "calibration").rmdir()
    for package in (towline, towline.ocp):
        with pytest.warns(DeprecationWarning, match="Timing is called Plan now"):
            assert package.Timing is towline.Plan
    assert towline.models.pose_from_lengths is towline.estimation.pose_from_lengths


def test_only_carriers_know_their_kinds():
    """No other file imports a class of one kind, or compares a kind, alone or in a collection, with a value."""
    from towline.models.carriers import _KINDS

    classes = {kind.__name__ for kind in _KINDS.values()}
    words = classes | {f'"{kind}"' for kind in _KINDS}  # files without any of them need not be parsed
    for file in {path for room in rooms() for path in (ROOT / room).rglob("*.py")} - {ROOT / "models" / "carriers.py"}:
        text = file.read_text()
        for node in ast.walk(tree(file)) if any(word in text for word in words) else ():
            named = {getattr(node, "id", None), getattr(node, "attr", None), getattr(node, "name", None)}
            assert not named & classes, f"{file.relative_to(ROOT)} names {named & classes}"
            parts = ast.walk(node) if isinstance(node, ast.Compare | ast.Match) else ()
            kinds = {part.value for part in parts if isinstance(part, ast.Constant)} & set(_KINDS)
            assert not kinds, f"{file.relative_to(ROOT)} compares with {kinds}"


def test_every_package_is_listed():
    listed = set(CONFIGURATION["tool"]["setuptools"]["packages"])
    found = {"towline"} | {
        "towline." + ".".join(path.parent.relative_to(ROOT).parts)
        for room in rooms()
        for path in (ROOT / room).rglob("__init__.py")
    }
    assert listed == found


def test_pins_are_plain():
    """Every requirement is pinned, as name==version and nothing else."""
    lines = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if not line.startswith("#")]
    pinned = {line.split("==")[0].lower().replace("_", "-") for line in lines if line.count("==") == 1}
    assert len(pinned) == len(lines)
    project = CONFIGURATION["project"]
    for requirements in (project["dependencies"], *project["optional-dependencies"].values()):
        for requirement in requirements:
            assert requirement.split(">=")[0].lower() in pinned


def imported_by(statement):
    code = f"import sys; {statement}; print(' '.join(sys.modules))"
    return set(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split())


def test_importing_is_cheap():
    """What costs 0.3 s and more alone is imported where it is used."""
    heavy = {"xarray", "qpsolvers", "osqp", "matplotlib.pyplot", "scipy.optimize"}
    assert not heavy & imported_by("import towline, towline.models, towline.solvers")
    assert not (heavy | {"casadi"}) & imported_by("import towline.cli.main, towline; towline.load('wang-flying')")


def test_no_name_hides_a_module():
    """`towline.ocp.timing` is the package of that name, not something that `towline.ocp` happens to export."""
    import importlib
    import types

    for package in CONFIGURATION["tool"]["setuptools"]["packages"]:
        module = importlib.import_module(package)
        folder = ROOT.joinpath(*package.split(".")[1:])
        names = {path.stem for path in folder.glob("*.py")} | {
            path.parent.name for path in folder.glob("*/__init__.py")
        }
        # These are what their packages are called for; their modules are imported by their full path.
        called_for = {
            "towline.ocp": {"plan"},
            "towline.solvers": {"solve", "methods"},
            "towline.simulation": {"simulate"},
        }
        for name in names - {"__init__"} - called_for.get(package, set()):
            assert isinstance(getattr(module, name, module), types.ModuleType), f"{package}.{name} hides the module"


def test_no_constant_of_a_module_replaces_another():
    """Where two modules became one, 20001 places in each cell of a corner replaced 8."""
    for file in set(modules(ROOT, rooms()).values()):
        found = set()
        for node in tree(file).body:
            targets = [name for target in getattr(node, "targets", []) for name in ast.walk(target)]
            names = [name.id for name in targets if isinstance(name, ast.Name) and isinstance(name.ctx, ast.Store)]
            assert not found & set(names), f"{file.relative_to(ROOT)} assigns {names} twice"
            found |= set(names)
