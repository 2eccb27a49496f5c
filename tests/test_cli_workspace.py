"""`towline workspace` through the entry point."""

import json
import os

import numpy as np
import pytest
import xarray as xr

from towline import methods
from towline.cli.tension import METHODS
from towline.cli.workspace import CONDITIONS, _show
from towline.workspace import Condition

from .warm import towline

ROBOT = """\
name: hanging-mass
source: a test, a point mass on three cables from a triangle of 2 m x 3 m
platform: {mass: 1, dof: [x, y, z], home: [0, 1, 1, 0, 0, 0]}
carriers: [{name: frame, kind: ground}]
cables:
  - {carrier: frame, anchor: [-1, 0, 4], attachment: [0, 0, 0], t_min: 0, t_max: 1000}
  - {carrier: frame, anchor: [1, 0, 4], attachment: [0, 0, 0], t_min: 0, t_max: 1000}
  - {carrier: frame, anchor: [0, 3, 4], attachment: [0, 0, 0], t_min: 0, t_max: 1000}
"""
BOX = "-1 0 0; 1 3 2"


def run(*arguments, **given):
    return towline("workspace", *arguments, **given)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "mass.yaml").write_text(ROBOT)
    return tmp_path


def test_json_tells_the_prism(folder):
    done = run("mass.yaml", "--box", BOX, "--method", "sobol", "--samples", "2e4", "--json", cwd=folder)
    told = json.loads(done.stdout)
    assert told["samples"] == 20_000
    assert told["volume"] == pytest.approx(3 * 2, rel=0.01)  # half of 2 m x 3 m, 2 m high
    low, high = told["volume_interval"]
    assert low < 6 < high
    assert told["volume_unit"] == "m^3"
    for name, ends in {"x": (-1, 1), "y": (0, 3), "z": (0, 2)}.items():
        np.testing.assert_allclose(told["bounds"][name], ends, atol=0.1)
    assert told["poses_per_s"] > 0
    found = xr.load_dataset(folder / told["file"])
    assert told["file"] == "hanging-mass-workspace.nc"
    assert found.sizes["point"] == told["accepted"] == found.attrs["accepted"]
    assert found["position"].units == "m"


def test_text_figure_and_conditions_that_all_have_to_hold(folder):
    both = ("--condition", "static-equilibrium", "--condition", '{"kind": "static-equilibrium"}')
    done = run("mass.yaml", "--box", BOX, *both, "--figure", "f.png", "--out", "w.nc", "--keep", "none", cwd=folder)
    assert "hanging-mass: " in done.stdout
    assert "of 60 000 samples accepted" in done.stdout
    assert "(95 % confidence interval of Clopper and Pearson)" in done.stdout
    assert (folder / "f.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads(xr.load_dataset(folder / "w.nc").attrs["condition"])["kind"] == "all"


def test_the_boundary_and_a_zarr_folder(folder):
    pytest.importorskip("skimage")
    pytest.importorskip("zarr")
    files = ("--mesh", "prism.stl", "--out", "w.zarr")
    done = run("mass.yaml", "--box", "-1.2 -0.2 0.1; 1.2 3.2 2", "--samples", "5000", *files, "--json", cwd=folder)
    assert json.loads(done.stdout)["mesh"] == "prism.stl"
    corners = np.frombuffer((folder / "prism.stl").read_bytes()[84:], np.uint8).reshape(-1, 50)[:, 12:48]
    a, b, c = np.moveaxis(corners.copy().view("<f4").reshape(-1, 3, 3).astype(float), 1, 0)
    assert np.einsum("ni,ni->", a, np.cross(b, c)) / 6 == pytest.approx(3 * 1.9, rel=0.03)
    assert xr.open_zarr(folder / "w.zarr").sizes["point"] == json.loads(done.stdout)["accepted"]
    again = run("mass.yaml", "--out", "w.zarr", cwd=folder, code=2)
    assert again.stderr == "towline: --out must be a new .zarr folder or a NetCDF file, got w.zarr, which exists\n"


def test_help_lists_every_condition_and_method():
    """The names are written out, so that help need not load what they name."""
    ours = [kind for kind, one in Condition.kinds.items() if one.__module__.startswith("towline.")]
    assert CONDITIONS.split(", ") == sorted(ours)
    assert METHODS.split(", ") == list(methods())


def test_nowhere_is_exit_code_1(folder):
    done = run("mass.yaml", "--box", "5 5 0; 6 6 1", "--samples", "1000", "--json", cwd=folder, code=1)
    told = json.loads(done.stdout)
    assert (told["accepted"], told["volume"]) == (0, 0)
    assert told["bounds"]["x"] == [None, None]


def test_checkpoint_then_resume(folder):
    arguments = ("mass.yaml", "--box", BOX, "--json", "--samples", "40000")
    run(*arguments, "--checkpoint", "c", cwd=folder)
    before = (folder / "hanging-mass-workspace.nc").read_bytes()
    again = run(*arguments, "--checkpoint", "c", cwd=folder, code=2)
    assert again.stdout == ""
    assert "checkpoint must be a new file unless it is resumed, got c, which exists" in again.stderr
    run(*arguments, "--resume", "c", "--out", "again.nc", cwd=folder)
    assert (folder / "again.nc").read_bytes() == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--samples", "0"), "samples must be a whole number from 1"),
        (("--samples", "1.5"), "--samples must be a whole number from 1"),
        (("--box", "0 0 0"), "--box must be 'x y z; x y z', got '0 0 0'"),
        (("--box", "0 0 0; 0 0 0"), "region.position must have min below max"),
        (("--box", "0 0 x; 0 0 0"), "--box must be 3 finite numbers, got '0 0 x'"),
        (("--condition", "levitation"), "condition.kind must be one of"),
        (("--condition", "{kind"), "--condition must be a kind or JSON"),
        (("--scheduler", "tcp://127.0.0.1:9"), "scheduler must be the address"),
        (("--checkpoint", "mass.yaml"), "the checkpoint must be a file other than mass.yaml, which is read"),
        (("--resume", "/proc/version"), "/proc/version: cannot be written"),
        (("--resume", "a", "--checkpoint", "b"), "--checkpoint must not be given with --resume"),
        (("--resume", "a.nc", "--out", "a.nc"), "--out must be a file other than the checkpoint"),
        (("--out", "a.nc", "--figure", "a.nc"), "--figure must be a file other than --out"),
        (("--samples", "1e300"), "got 1e+300"),
        (("--condition", '{"kind": ["margin"]}'), "got ['margin']"),
        (("--mesh", "m.stl", "--box", "0 0 0; 1 1 0"), "low must be below high"),
        (("--mesh", "m.stl", "--attitude", "0 0 0; 0 0 1"), "--mesh requires a region in which only positions vary"),
        (("--resume", "/proc/a"), "/proc/a: cannot be written (No such file or directory)"),
    ],
)
def test_wrong_input_is_one_line_and_exit_code_2(folder, arguments, message):
    done = run("mass.yaml", *arguments, cwd=folder, code=2)
    assert message in done.stderr
    assert done.stderr.count("\n") == 1
    assert os.listdir(folder) == ["mass.yaml"]
    assert (folder / "mass.yaml").read_text() == ROBOT


def test_too_few_cables_report_why_and_what_to_request(tmp_path):
    done = run("wang-ctmrts", "--samples", "50", cwd=tmp_path, code=1)
    why = done.stdout.splitlines()[1]
    assert why.startswith("  why: 3 cables cannot balance 6 components of force and moment")
    for condition in ("equilibrium-posture", "force-balance"):
        assert condition in why
        other = run("wang-ctmrts", "--samples", "50", "--condition", condition, "--json", cwd=tmp_path)
        assert json.loads(other.stdout)["accepted"] > 5


def test_cables_of_constant_length_do_not_let_the_platform_go(tmp_path):
    """With its quadrotors at home, flycrane can be only where its cables have their lengths: at home."""
    done = run("flycrane", "--samples", "50", cwd=tmp_path)
    assert "  note: the condition allows any cable lengths, but they are constant; see " in done.stdout
    told = json.loads(run("wang-flying", "--samples", "50", "--json", cwd=tmp_path).stdout)
    assert told["note"] is None


def test_a_picture_of_another_format_is_refused_before_any_work(folder):
    done = run("mass.yaml", "--figure", "f.jpg", cwd=folder, code=2)
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert ".png, .pdf, .svg, got f.jpg" in done.stderr


def test_both_ends_of_a_range_have_one_unit(capsys):
    """A robot of a millimetre has bounds in millimetres at both ends of a range, not in metres at one of them."""
    summary = {"robot": "micro", "accepted": 9, "samples": 10, "volume": 2e-6, "volume_unit": "m^2", "seconds": 1.0}
    summary |= {"volume_interval": [np.nan, np.nan], "bounds": {"x": [-7.754e-4, 7.831e-4], "y": [0.0, 0.0]}}
    _show(xr.Dataset(), summary, None, {})
    printed = capsys.readouterr().out.splitlines()
    assert printed[2:4] == ["  x -0.78 to 0.78 mm", "  y 0 m"]
