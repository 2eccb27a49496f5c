"""The house keeps its shape: imports point down, packages are listed, importing is cheap."""

import ast
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parent.parent

# From the ground up: a room may import the rooms below its floor, and itself. Rooms of one floor stand apart.
FLOORS = [
    {"models", "solvers", "figures"},
    {"distribution", "robust"},
    {"calibration", "control", "workspace", "ocp", "embedded"},
    {"simulation"},
    {"studies"},
    {"benchmarks"},
    {"viewer"},
    {"cli"},
]
COMMON = {
    *(
        "checkpoint",
        "declared",
        "display",
        "errors",
        "execution",
        "inputs",
        "kernel",
        "netcdf",
        "processors",
        "quiet",
        "reading",
        "simd",
        "simd_llvm",
        "text",
        "tolerances",
        "writing",
    )
}
CONFIGURATION = tomllib.loads((ROOT / "pyproject.toml").read_text())


def rooms():
    """Folders at the top that are packages, and the modules there that join models and solvers."""
    return {path.parent.name for path in ROOT.glob("*/__init__.py")} | {"distribution", "robust"}


def files_of(room):
    return [*(ROOT / room).rglob("*.py")] or [ROOT / f"{room}.py"]


def imported_rooms(file):
    """Top-level parts of towline that a file imports, relative or absolute."""
    depth = len(file.relative_to(ROOT).parts) - 1
    found = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and node.level == depth + 1:
            found |= {node.module.split(".")[0]} if node.module else {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and (node.module or "").startswith("towline."):
            found.add(node.module.split(".")[1])
        elif isinstance(node, ast.Import):
            found |= {alias.name.split(".")[1] for alias in node.names if alias.name.startswith("towline.")}
    return found - COMMON - {"__version__"}


def test_imports_only_point_down():
    floor_of = {room: level for level, floor in enumerate(FLOORS) for room in floor}
    assert rooms() == set(floor_of), "a new room needs its floor in this test"
    for file in [path for room in rooms() for path in files_of(room)]:
        room = file.relative_to(ROOT).parts[0].removesuffix(".py")
        for other in imported_rooms(file) - {room}:
            assert floor_of[other] < floor_of[room], f"{file.relative_to(ROOT)} imports {other}"


def test_the_import_test_can_see():
    """It would notice: planning does import models and solvers."""
    seen = {other for path in (ROOT / "ocp").rglob("*.py") for other in imported_rooms(path)}
    assert {"models", "solvers"} <= seen


def test_only_carriers_know_their_kinds():
    """No other file imports a class of one kind, or compares a kind, alone or in a collection, with a value."""
    from towline.models.carriers import _KINDS

    classes = {kind.__name__ for kind in _KINDS.values()}
    for file in {path for room in rooms() for path in files_of(room)} - {ROOT / "models" / "carriers.py"}:
        for node in ast.walk(ast.parse(file.read_text())):
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
    heavy = {"xarray", "qpsolvers", "osqp", "matplotlib.pyplot", "scipy.optimize", "numba"}
    for statement in ("import towline", "import towline.models", "import towline.solvers", "import towline.cli.main"):
        assert not heavy & imported_by(statement), statement
    assert "casadi" not in imported_by("import towline.cli.main")


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
        called_for = {"towline.solvers": {"solve", "methods"}, "towline.simulation": {"simulate"}}
        for name in names - {"__init__"} - called_for.get(package, set()):
            assert isinstance(getattr(module, name, module), types.ModuleType), f"{package}.{name} hides the module"
