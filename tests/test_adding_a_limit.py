"""The page on adding a limit: its example runs, and the limit is in program, audit, report and figure."""

import re
from pathlib import Path

import numpy as np
import pytest

from towline import Task
from towline.base.errors import InputError
from towline.models import load
from towline.models.parsing import parse_yaml, to_yaml
from towline.ocp.audits.audit import audit
from towline.ocp.reports.trajectory import limited
from towline.ocp.tasks.lay_out import lay_out
from towline.ocp.tasks.task import read_task
from towline.viewer.replay import Replay

PAGE = (Path(__file__).parent.parent / "docs" / "adding-a-limit.md").read_text()
BOUND = 0.1


def from_line(poses):
    """Distance of the CoM, which is the platform's origin, from the line along x at height 1."""
    return np.hypot(poses[:, 1], poses[:, 2] - 1)


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    names = {}
    picture = tmp_path_factory.mktemp("page") / "limits.png"
    exec(code.replace("limits.png", str(picture)), names)
    assert picture.stat().st_size > 1000
    return names


def test_the_example_is_short():
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert len([line for line in code.splitlines() if line.strip()]) <= 30


def test_the_limit_binds_in_the_plan(example):
    assert load("ipanema-1").platform.com == (0.0, 0.0, 0.0)
    free, kept, soft = example["planned"](), example["result"], example["soft"]
    assert all(result.feasible for result in (free, kept, soft))
    far, near, between = (from_line(result.audit.motion.pose).max() for result in (free, kept, soft))
    assert 0.99 * BOUND < near <= BOUND * (1 + 1e-6)
    assert BOUND + 0.01 < between < far - 0.01
    assert [excess.limit for excess in soft.audit.soft_excess] == ["com_from_line"]


def test_the_limit_is_audited(example):
    task = {"path": {"kind": "line", "start": [0, 0, 1], "end": [0, 0.3, 1]}, "duration": 2}
    scenario = lay_out(load("ipanema-1"), read_task(task | {"limits": {"own": [example["line"]]}}))
    (excess,) = audit(scenario, None).excess
    assert (excess.limit, excess.about, excess.unit) == ("com_from_line", "platform", "m")
    assert (excess.value, excess.bound) == pytest.approx((0.3, BOUND))


def test_the_limit_is_in_report_and_figure(example):
    result = example["result"]
    assert "com_from_line" in result.report()
    (curve,) = [each for each in limited(result, np.arange(10)) if each.name == "com_from_line"]
    assert (curve.unit, curve.high, curve.labels) == ("m", BOUND, ["platform"])
    np.testing.assert_allclose(curve.values[:, 0], from_line(result.audit.motion.pose[:10]), atol=1e-12)
    names = [text.get_text() for text in result.figures()["limits"].legends[0].get_texts()]
    assert any(name.startswith("com from line (at most ") for name in names)


def test_a_plan_with_the_limit_is_saved_and_its_page_written(example, tmp_path):
    page = example["result"].save_report(tmp_path / "page.html").read_text()
    assert "com_from_line" in page
    example["soft"].save(tmp_path / "plan.nc")
    Replay(example["soft"].trajectory, "plan.nc")
    kept = parse_yaml(example["soft"].trajectory.attrs["task"], Task, "task")
    assert (kept.limits.own, kept.limits.soft) == ((), {})


def test_a_task_with_the_limit_is_no_file(example):
    task = example["result"].scenario.task
    with pytest.raises(InputError, match=r"limits.own must be empty to be saved, .*'com_from_line'"):
        to_yaml(task)
    assert "own" not in Task.model_json_schema()["$defs"]["TaskLimits"]["properties"]


@pytest.mark.parametrize("wrong", ["com_from_line", 3])
def test_what_is_no_limit_is_refused(wrong):
    rest = {"path": {"kind": "rest", "pose": [0, 0, 1]}, "duration": 1}
    with pytest.raises(InputError, match=r"limits.own"):
        Task.model_validate(rest | {"limits": {"own": [wrong]}})
