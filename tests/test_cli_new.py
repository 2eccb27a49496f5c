"""`towline new`: what it writes can be read, rests, and is feasible as it stands; its comments are true."""

import json
import re

import numpy as np
import pytest
import xarray as xr

from towline import Robot, Task, load
from towline.cli.new import KINDS, TEMPLATES
from towline.models.parsing import parse_yaml

from .warm import towline as run

COMMENTED = re.compile(r"^#(?=\w|  )", re.MULTILINE)  # before a line of YAML; prose has one blank after its #


def keys(schema, known=None):
    """Return all keys in a schema with what their descriptions say."""
    known = {} if known is None else known
    for part in (schema, *schema.get("$defs", {}).values()):
        for key, field in part.get("properties", {}).items():
            known.setdefault(key, []).append(field.get("description", ""))
    return known


@pytest.mark.parametrize("kind", KINDS)
def test_a_new_robot_rests_and_its_task_is_feasible(kind, tmp_path):
    done = run("new", "mine", "--kind", kind, cwd=tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine-task.yaml", "mine.yaml"]
    commands = re.findall(r"^    towline (.*)$", done.stdout, re.MULTILINE)
    assert commands == ["robots mine.yaml", "plan mine.yaml mine-task.yaml"]
    diagnosis = run(*commands[0].split(), cwd=tmp_path)
    assert "at rest at home: tensions" in diagnosis.stdout
    assert "warning" not in diagnosis.stdout
    planned = run(*commands[1].split(), cwd=tmp_path)
    assert "mine, first: FEASIBLE" in planned.stdout
    assert "warning" not in planned.stdout.lower()
    robot, task = load(tmp_path / "mine.yaml"), parse_yaml((tmp_path / "mine-task.yaml").read_text(), Task, "task")
    tensions = xr.load_dataset(tmp_path / "mine-first.nc")["tensions"].values
    margin = np.minimum(tensions - robot.t_min, robot.t_max - tensions).min()
    assert margin >= task.margin - 1e-6


@pytest.mark.parametrize("kind", KINDS)
def test_the_path_lies_in_the_box_that_robots_prints(kind, tmp_path):
    run("new", "mine", "--kind", kind, cwd=tmp_path)
    box = json.loads(run("robots", "mine.yaml", "--json", cwd=tmp_path).stdout)["resting_box"]
    low = [-np.inf if end is None else end for end in box["min"]]
    high = [np.inf if end is None else end for end in box["max"]]
    path = parse_yaml((tmp_path / "mine-task.yaml").read_text(), Task, "task").path
    for point in getattr(path, "points", None) or (path.start, path.end):
        assert (np.array(low) <= point[:3]).all()
        assert (np.array(high) >= point[:3]).all()


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_commented_out_can_be_used(kind, tmp_path):
    """Without its #, each such line is a key of the file, and the whole is planned."""
    run("new", "mine", "--kind", kind, cwd=tmp_path)
    for name, model in (("mine", Robot), ("mine-task", Task)):
        file = tmp_path / f"{name}.yaml"
        text = file.read_text()
        full = COMMENTED.sub("", text)
        assert name == "mine" or full != text
        file.write_text(full)
        parse_yaml(full, model, name)
    run("plan", "mine.yaml", "mine-task.yaml", cwd=tmp_path)


@pytest.mark.parametrize("file", sorted(path.name for path in TEMPLATES.glob("*.yaml")))
def test_units_in_comments_are_those_of_the_schema(file):
    """A comment behind `key: value` or `key: [...]` names the unit that the schema has for the key."""
    known = keys((Task if "-task" in file else Robot).model_json_schema())
    found = 0
    for line in (TEMPLATES / file).read_text().splitlines():
        match = re.match(r"[# ]*([\w-]+): (?:\[[^\]]*\]|[^{}\[\]#]*?) +# .*?\[([^\[\]]+)\]", line)
        if match and match[1] in known:
            assert any(f"[{match[2]}]" in text for text in known[match[1]]), (match[1], match[2], known[match[1]])
            found += 1
    assert found


def test_an_infeasible_variant_comes_with_advice(tmp_path):
    """Ten times as fast is infeasible; the duration that the report names is feasible."""
    run("new", "mine", cwd=tmp_path)
    task = tmp_path / "mine-task.yaml"
    text = task.read_text()
    quick = text.replace("duration: 6 ", "duration: 0.6 ")
    assert quick != text
    task.write_text(quick)
    refused = run("plan", "mine.yaml", "mine-task.yaml", cwd=tmp_path, code=1)
    assert "INFEASIBLE" in refused.stdout
    assert [path.name for path in tmp_path.glob("*.nc")] == ["mine-first-infeasible.nc"]  # it replaces no good plan
    advised = re.search(r"feasible duration +([\d.]+) s", refused.stdout)[1]
    task.write_text(text.replace("duration: 6 ", f"duration: {float(advised) + 0.001} "))
    run("plan", "mine.yaml", "mine-task.yaml", cwd=tmp_path)


def test_files_that_exist_are_kept(tmp_path):
    (tmp_path / "mine-task.yaml").write_text("mine")
    done = run("new", "mine", cwd=tmp_path, code=2)
    assert done.stderr == "towline: mine-task.yaml must be a new file, got one that exists\n"
    assert [path.name for path in tmp_path.iterdir()] == ["mine-task.yaml"]
    assert (tmp_path / "mine-task.yaml").read_text() == "mine"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["mine", "--kind", "drone"], "--kind must be one of frame, planar, drones, towing, got 'drone'"),
        (["../mine"], "NAME must be at most 64 letters"),
        (["mine.yaml"], "NAME must be without an ending, got 'mine.yaml'"),
    ],
)
def test_wrong_arguments_write_nothing(arguments, message, tmp_path):
    done = run("new", *arguments, cwd=tmp_path, code=2)
    assert message in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["null", "1", "1e3", "on"])
def test_a_name_stays_a_text(name, tmp_path):
    """YAML reads some words as something else."""
    answer = json.loads(run("new", name, "--json", cwd=tmp_path).stdout)
    assert load(tmp_path / answer["robot"]).name == name
