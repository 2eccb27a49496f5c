"""Wrong values that once passed in silence: endings of files, numbers as text, poses that are none, options by name."""

import warnings

import numpy as np
import pytest
from typer.testing import CliRunner

from towline import InputError, load, plan, read_task, tensions
from towline.cli.main import app

REST = {"name": "rest", "path": {"kind": "rest", "pose": [0, 0, -1]}, "duration": 0.3}
FILE = "name: rest\npath: {kind: rest, pose: [0, 0, -1]}\nduration: 0.3\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rest.yaml").write_text(FILE)
    return tmp_path


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("plan wang-flying rest.yaml --out x.txt", "--out must end in .nc or .mcap, got 'x.txt'"),
        ("plan wang-flying rest.yaml --out x", "--out must end in .nc or .mcap, got 'x'"),
        ("plan wang-flying rest.yaml --report x.txt", "--report must end in .html or .htm, got 'x.txt'"),
        ("plan wang-flying rest.yaml --vary margin=0:1:1 --out x.txt", "--out must end in .nc, got 'x.txt'"),
        ("simulate wang-flying rest.yaml --out x.txt", "--out must end in .nc or .mcap, got 'x.txt'"),
        ("time wang-flying rest.yaml --out x.txt", "--out must end in .yaml or .yml, got 'x.txt'"),
        ("workspace wang-flying --out x.txt", "--out must end in .nc or .zarr, got 'x.txt'"),
        ("workspace wang-flying --mesh x.txt", "--mesh must end in .stl, got 'x.txt'"),
        ("view wang-flying --html x.txt", "--html must end in .html or .htm, got 'x.txt'"),
    ],
)
def test_a_file_is_what_its_name_ends_in(folder, command, message):
    done = CliRunner().invoke(app, command.split())
    assert isinstance(done.exception, InputError)
    assert str(done.exception) == message
    assert [path.name for path in folder.iterdir()] == ["rest.yaml"]


def test_results_are_saved_under_names_that_end_in_nc_or_mcap(folder):
    result = plan("wang-flying", REST)
    with pytest.raises(InputError, match=r"^file must end in \.nc or \.mcap, got 'x\.txt'$"):
        result.save("x.txt")
    assert result.save("x.NC").exists()


@pytest.mark.parametrize("steps", ["10", True, 10.5, [10], np.array([10, 20])])
def test_steps_are_a_whole_number_and_no_text(steps):
    with pytest.raises(InputError, match="steps") as error:
        read_task(REST | {"steps": steps})
    assert str(error.value).isprintable()


@pytest.mark.parametrize(
    ("file", "message"),
    [
        ("checkpoint.ckpt", "--define must end in .py, got 'checkpoint.ckpt'"),
        ("x" * 5000 + ".py", "--define must be a Py"),
    ],
)
def test_a_file_of_definitions_is_a_python_file(file, message):
    """A module named `checkpoint` would be imported in its place."""
    done = CliRunner().invoke(app, ["workspace", "wang-flying", "--define", file])
    assert isinstance(done.exception, InputError)
    assert str(done.exception).startswith(message)
    assert len(str(done.exception)) < 600


@pytest.mark.parametrize("given", [3, None])
def test_a_path_of_the_users_own_class_must_be_a_text(given):
    """`os.fspath` raises TypeError for what is a path by its class only."""
    path = type("Own", (), {"__fspath__": lambda _: given})()
    with pytest.raises(InputError, match=r"^robot must be a name of the library or the path of a YAML file, got "):
        load(path)


def test_half_floats_are_numbers_as_others_are():
    pose = np.array([0, 0, -1, 0, 0, 0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = tensions("wang-flying", pose, acceleration=np.full(6, 0.5, dtype=np.float16)).tensions
    np.testing.assert_array_equal(found, tensions("wang-flying", pose, acceleration=np.full(6, 0.5)).tensions)


@pytest.mark.parametrize("fault", ["cut 9 at 0.1", "cut 1", "cut 1 at 7"])
def test_a_wrong_fault_is_named_as_the_option_with_its_text(folder, fault):
    plan("wang-flying", REST).save("rest.nc")
    done = CliRunner().invoke(app, ["simulate", "wang-flying", "rest.nc", "--fault", "cut 2 at 0.1", "--fault", fault])
    assert isinstance(done.exception, InputError)
    assert str(done.exception).startswith(f"--event {fault!r} must ")


@pytest.mark.parametrize(
    "command",
    [
        "calibrate wang-flying none.csv --figures new",
        "calibrate wang-flying rest.yaml --figures new/deep --out other/robot.yaml",
        "import caspr nothing --out new/robot.yaml",
        "plan wang-flying rest.yaml --figures new --robust 2",
        "plan wang-flying rest.yaml --vary margin=0:1:1 --keep new --workers 0",
        "simulate wang-flying rest.yaml --figures new",
        "workspace wang-flying --out new/x.nc --samples 0",
        "bench tension --m 99 --out new",
        "view nothing --html new/page.html",
        "time wang-flying rest.yaml --out new/task.yaml",
    ],
)
def test_a_refused_command_leaves_no_folder(folder, command):
    done = CliRunner().invoke(app, command.split())
    assert isinstance(done.exception, InputError)
    assert [path.name for path in folder.iterdir()] == ["rest.yaml"]
