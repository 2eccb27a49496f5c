"""A command never writes over what it reads, by whatever name: its task, its robot, or a file that these name."""

import os
import sys

import pytest
from typer.testing import CliRunner

from towline import InputError, load, plan
from towline.cli.main import app

from .caspr_xml import write

TASK = "name: line\npath: {kind: line, start: [0, 0, -1], end: [0.1, 0, -1]}\n"
POINTS = "name: points\npath: {kind: waypoints, points: points.csv}\nduration: 3\n"
CSV = "x [m], y [m], z [m]\n0, 0, -1\n0.1, 0, -1\n0.1, 0.1, -1\n"
LOG = "l0 [m]\n1\n"
REST = {"name": "rest", "path": {"kind": "rest", "pose": [0, 0, -1]}, "duration": 0.3}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in (("task.yaml", TASK), ("points.yaml", POINTS), ("points.csv", CSV), ("log.csv", LOG)):
        (tmp_path / name).write_text(text)
    load("wang-flying").save("robot.yaml")
    plan("wang-flying", REST).save("plan.nc")
    (tmp_path / "caspr").mkdir()
    write(tmp_path / "caspr")
    (tmp_path / "own.py").write_text("")
    for link, file in (
        ("link.nc", "task.yaml"),
        ("link.yaml", "log.csv"),
        ("link.xml", "robot.yaml"),
        ("link.png", "robot.yaml"),
        ("link.html", "plan.nc"),
        ("page.html", "robot.yaml"),
        ("film.gif", "plan.nc"),
        ("own.nc", "own.py"),
        ("caspr.yaml", next(tmp_path.glob("caspr/*_bodies.xml"))),
    ):
        (tmp_path / link).symlink_to(file)
    os.link("task.yaml", "same.yaml")
    return tmp_path


@pytest.mark.parametrize(
    "command",
    [
        "time wang-flying task.yaml --out task.yaml",
        "time robot.yaml task.yaml --out robot.yaml",
        "time wang-flying task.yaml --out ./caspr/../task.yaml",
        "time wang-flying task.yaml --out same.yaml",
        "plan wang-flying task.yaml --out link.nc",
        "plan robot.yaml task.yaml --report page.html",
        "plan wang-flying points.yaml --vary margin=0,1 --out points.nc",
        "simulate wang-flying plan.nc --out plan.nc",
        "simulate wang-flying plan.nc --animate film.gif",
        "simulate wang-flying plan.nc --runs 2 --checkpoint plan.nc",
        "calibrate robot.yaml log.csv --out robot.yaml",
        "calibrate wang-flying log.csv --out link.yaml",
        "workspace robot.yaml --figure link.png",
        "workspace robot.yaml --define own.py --out own.nc",
        "export robot.yaml --mjcf --out link.xml",
        "import caspr caspr --out caspr.yaml",
        "robots robot.yaml --figure link.png",
        "view plan.nc --html link.html",
    ],
)
def test_no_output_is_an_input(command, folder, monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # of the condition in own.py
    before = {file: file.read_bytes() for file in folder.rglob("*") if file.is_file()}
    done = CliRunner().invoke(app, command.split())
    assert isinstance(done.exception, InputError), done.exception
    assert "must be a file other than" in str(done.exception)
    assert {file: file.read_bytes() for file in folder.rglob("*") if file.is_file()} == before
