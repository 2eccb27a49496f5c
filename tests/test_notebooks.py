"""Each notebook runs from top to bottom, is stored with its outputs, and says today what it said when it was stored."""

import re
import tomllib
from pathlib import Path
from tempfile import TemporaryDirectory

import nbformat
import pytest
from jupyter_client.manager import KernelManager
from nbclient import NotebookClient
from traitlets.config import Config

ROOT = Path(__file__).parent.parent
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
MOST_BYTES, MOST_SECONDS = 600_000, 60
VERDICT = re.compile(r"\b(FEASIBLE|INFEASIBLE|NOT-FOUND|optimal|infeasible|accepted)\b")
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def code(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def verdicts(notebook):
    """Printed lines that hold a verdict: their words, and their numbers. No such line has a timing."""
    text = "".join(out.text for cell in code(notebook) for out in cell.outputs if out.output_type == "stream")
    lines = [line for line in text.splitlines() if VERDICT.search(line)]
    return [NUMBER.sub("#", " ".join(line.split())) for line in lines], [
        float(number) for line in lines for number in NUMBER.findall(line)
    ]


def test_they_are_all_there():
    names = ["quickstart", "flying_cdpr", "ctmrts", "tension_distribution", "trajectory_planning", "qp_benchmark"]
    names += ["multi_quadrotor", "closed_loop", "robot_as_built", "design"]
    wanted = [f"{index:02d}_{name}" for index, name in enumerate(names, start=1)]
    assert [path.stem for path in NOTEBOOKS] == wanted


@pytest.fixture(scope="module")
def kernel():
    """Start one process for all notebooks, since each would spend seconds on the same imports."""
    with TemporaryDirectory() as folder:  # sockets instead of ports; their paths have to be short
        sockets = Config({"KernelManager": {"transport": "ipc", "ip": str(Path(folder) / "kernel")}})
        manager = KernelManager(kernel_name="python3", config=sockets)
        manager.start_kernel()
        yield manager
        manager.shutdown_kernel(now=True)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_says_the_same(path, kernel, tmp_path):
    assert path.stat().st_size < MOST_BYTES
    stored, fresh = (nbformat.read(path, as_version=4) for _ in range(2))
    assert 8 <= len(stored.cells) <= 20
    assert [cell.execution_count for cell in code(stored)] == list(range(1, len(code(stored)) + 1))
    shown = [out for cell in code(stored) for out in cell.outputs]
    assert {out.output_type for out in shown} <= {"stream", "display_data", "execute_result"}
    assert any("image/png" in out.get("data", {}) for out in shown)
    # It begins without the names of the notebook before, in a folder of its own. Figures are drawn once, not a second
    # time for their margins, and of few pixels.
    once = "%matplotlib inline\n%config InlineBackend.print_figure_kwargs = {'bbox_inches': None, 'dpi': 20}"
    fresh.cells.insert(0, nbformat.v4.new_code_cell(f"%reset -f\n%cd -q {tmp_path}\n{once}"))
    NotebookClient(fresh, km=kernel, timeout=MOST_SECONDS).execute()
    words, numbers = verdicts(stored)
    assert words
    assert verdicts(fresh)[0] == words
    assert verdicts(fresh)[1] == pytest.approx(numbers, rel=0.01, abs=0.02)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_uses_the_public_interface(path):
    """Notebooks import the front door, and modules of the API reference; they store nothing of this machine."""
    packages = ("control", "estimation", "models", "solvers", "statics.equilibria", "workspace")
    of_models = ("models.air", "models.cables.driving_force")
    allowed = {"towline", *(f"towline.{package}" for package in (*packages, *of_models))}
    text = path.read_text()
    assert set(re.findall(r"from (towline[\w.]*) import", text)) <= allowed
    assert not re.search(r"/home/|/tmp/|site-packages|Traceback", text)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_opens_where_notebooks_are_hosted(path):
    """The first cell has one link that runs the notebook and one that shows it, at the project's public address."""
    repository = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["urls"]["Repository"]
    project, file = repository.removeprefix("https://github.com/"), f"notebooks/{path.name}"
    first = nbformat.read(path, as_version=4).cells[0].source
    assert f"(https://mybinder.org/v2/gh/{project}/main?labpath={file})" in first
    assert f"(https://nbviewer.org/github/{project}/blob/main/{file})" in first
